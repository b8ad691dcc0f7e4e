"""The CUDA forms of what is one for each thread on a CPU; imported where kernels are made.

``cuda`` has to be a global of the device function: that is where the simulator looks for it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import cuda as _module

cuda: Any = _module  # its stubs know 'atomic' as a class only


@cuda.jit(device=True)
def scatter_add(buffer, column, value):
    """Add ``value`` to ``buffer[0, column]`` atomically; ``buffer`` has shape (1, columns)."""
    cuda.atomic.add(buffer, (0, column), value)


@cuda.jit(device=True)
def batch_row(i):
    """The row of a batch buffer that particle i uses: its own."""
    return np.uint64(i)
