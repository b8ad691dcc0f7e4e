"""Where arrays live and loops run: the CPU's threads, or a CUDA GPU.

The CPU's arrays are NumPy's; on a GPU they are device arrays. The rest of the program asks its
:class:`Device` for arrays and for compiled loops and does not know the difference.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from particell.checks import checked
from particell.compute.loop import Loop, particle_loop
from particell.errors import InputError, MissingExtra

#: Bytes that a processor reads at once.
CACHE_LINE = 64


@particle_loop
def gather_rows(i, source, order, target, *, COLUMNS):
    """target[i] = source[order[i]] for arrays of shape (n, COLUMNS)."""
    for c in range(COLUMNS):
        target[i, c] = source[order[i], c]


@particle_loop
def clear(k, numbers):
    """Zeros."""
    numbers[k] = 0


@checked
class Device:
    """The machine that loops run on.

    Parameters
    ----------
    backend
        ``"cpu"`` or ``"cuda"``.
    precision
        ``"float64"`` or ``"float32"``, the type of particle fields.
    form
        The form of sweeps on a CPU, ``"gather"`` or ``"lanes"``, for those that can have it; by a
        rule (:mod:`particell.compute.forms`) where it is left out. With ``"gather"`` rows of
        neighbours are in the order of a GPU's.

    Raises
    ------
    InputError
        Where the backend is unknown or there is no usable GPU.
    """

    def __init__(self, backend: str = "cpu", precision: str = "float64", form: str | None = None):
        if backend not in ("cpu", "cuda"):
            raise InputError("backend", backend, "'cpu' or 'cuda'")
        if precision not in ("float64", "float32"):
            raise InputError("precision", precision, "'float64' or 'float32'")
        if form not in (None, "gather", "lanes"):
            raise InputError("form", form, "'gather' or 'lanes', or left out")
        if backend == "cuda":
            _require_cuda()
        self.backend, self.form = backend, form
        self.real = np.dtype(precision)

    def zeros(self, shape: int | tuple[int, ...], dtype: Any = None):
        """A new array of zeros (of the device's real type by default)."""
        if self.backend == "cpu":
            return aligned_zeros(shape, np.dtype(dtype or self.real))
        from numba import cuda

        made = cuda.device_array(shape, np.dtype(dtype or self.real))
        clear.specialise(self.backend)(made.size, made.reshape(made.size))
        return made

    def array(self, values: np.ndarray):
        """A copy of a NumPy array on this device."""
        if self.backend == "cpu":
            return np.array(values)
        from numba import cuda

        return cuda.to_device(np.ascontiguousarray(values))

    def to_host(self, array) -> np.ndarray:
        """The array as NumPy's (the array itself, not a copy, on the CPU)."""
        return array if isinstance(array, np.ndarray) else array.copy_to_host()

    def write(self, array, values: np.ndarray) -> None:
        """Overwrite a device array with values of the same shape and type."""
        if isinstance(array, np.ndarray):
            array[...] = values
        else:
            array.copy_to_device(np.ascontiguousarray(values, dtype=array.dtype))

    def copy(self, source, target) -> None:
        """Copy one array of this device to another of the same shape and type."""
        if self.backend == "cpu":
            np.copyto(target, source)
        else:
            target.copy_to_device(source)

    def permute(self, rows, order, scratch) -> None:
        """Put ``rows[order[k]]`` in place k of an array (n, columns), in place.

        ``scratch`` has the shape of ``rows``. On the CPU this is NumPy's: a loop of our own would
        have to be compiled for every type and number of columns.
        """
        if self.backend == "cpu":
            np.take(rows, order, axis=0, out=scratch, mode="clip")
        else:
            gather = gather_rows.specialise(self.backend, COLUMNS=rows.shape[1])
            gather(len(rows), rows, order, scratch)
        self.copy(scratch, rows)

    def bind(self, loop: Loop, fields: Mapping[str, Any], **constants: Any) -> Callable[..., None]:
        """Compile a loop and look up its arguments by name once.

        Parameters
        ----------
        loop
            A :func:`~particell.compute.loop.particle_loop`.
        fields
            Arrays and numbers by name. Parameters of the loop that are missing here are given,
            in order, at every call.
        **constants
            The loop's compile-time constants.

        Returns
        -------
        callable
            ``f(n, *missing)``.
        """
        run = loop.specialise(self.backend, **constants)
        missing = [name for name in loop.arguments if name not in fields]
        bound = [fields.get(name) for name in loop.arguments]
        places = [k for k, name in enumerate(loop.arguments) if name not in fields]
        if not missing:
            return lambda n: run(n, *bound)

        def call(n: int, *args: Any) -> None:
            if len(args) != len(missing):
                raise TypeError(f"{loop.__name__} still needs {missing}")
            for place, value in zip(places, args, strict=True):
                bound[place] = value
            run(n, *bound)

        return call


def aligned_zeros(shape: int | tuple[int, ...], dtype: np.dtype) -> np.ndarray:
    """An array that begins with a cache line, so that records and vectors do not lie across two."""
    size = int(np.prod(shape)) * dtype.itemsize
    raw = np.zeros(size + CACHE_LINE, np.uint8)
    begin = -raw.ctypes.data % CACHE_LINE
    return raw[begin : begin + size].view(dtype).reshape(shape)


def _require_cuda() -> None:
    try:
        from numba import cuda
    except ImportError:
        raise MissingExtra("the backend 'cuda'", "numba-cuda", "cuda") from None
    if not cuda.is_available():
        raise InputError("backend", "cuda", "'cpu' (no CUDA GPU was found on this machine)")
    # of every launch of a loop over few particles
    warnings.filterwarnings("ignore", message=".*Grid size .* low occupancy")
