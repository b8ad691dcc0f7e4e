"""Scripts that are run by Numba's CUDA simulator, in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

#: The simulator's threads wait for each other busily: they are to take turns quickly.
RUN = """\
import runpy, sys
sys.setswitchinterval(1e-5)
del sys.argv[0]
runpy.run_path(sys.argv[0], run_name="__main__")
"""


def lines_on_simulator(script: str, *arguments: str, timeout: float = 600) -> list[str]:
    """What a script prints, line by line; it must end well."""
    tests = Path(__file__).resolve().parent
    path = os.pathsep.join([str(tests), *filter(None, [os.environ.get("PYTHONPATH")])])
    environment = {**os.environ, "NUMBA_ENABLE_CUDASIM": "1", "PYTHONPATH": path}
    done = subprocess.run(
        [sys.executable, "-c", RUN, script, *arguments],
        capture_output=True, text=True, env=environment, timeout=timeout,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout.splitlines()
