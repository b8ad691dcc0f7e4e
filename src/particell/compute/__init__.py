"""How a loop over particles runs: compiled for CPU threads or CUDA."""

import os

# Threads of GNU OpenMP wait for the next loop by spinning, for milliseconds by default. On a
# machine that does other things too that halves the speed; a short spin costs nothing elsewhere.
os.environ.setdefault("GOMP_SPINCOUNT", "1000")
