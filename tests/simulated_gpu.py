"""Scripts that are run by Numba's CUDA simulator, in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

#: The simulator's threads wait for each other busily: they are to take turns quickly. It gives the
#: functions that kernels call a ``cuda`` of its own for each call, and takes it away while other
#: threads are in them: here it stays until the kernel is done.
RUN = """\
import runpy, sys, threading
from contextlib import contextmanager
from numba import cuda
from numba.cuda.simulator import kernel

known = {}

@contextmanager
def swapped(function, fake):
    scope = function.__globals__
    names = [name for name, value in list(scope.items()) if value is cuda]
    known.setdefault(id(scope), (scope, names))
    for name in known[id(scope)][1]:
        scope[name] = fake
    try:
        yield
    finally:
        if threading.current_thread() is threading.main_thread():
            for scope, names in list(known.values()):
                scope.update(dict.fromkeys(names, cuda))

assert hasattr(kernel, "swapped_cuda_module")
kernel.swapped_cuda_module = swapped
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
