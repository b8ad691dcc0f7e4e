"""Where compiled code is kept: one directory per state of the sources.

Numba keys a cached function on its own file only and does not see an edit of a helper in another
file. The cache directory therefore carries a hash of every source of the package.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numba
from platformdirs import user_cache_path

#: Numba sets the attributes of its configuration at run time, unseen by type checkers.
NUMBA_CONFIG: Any = numba.config
PACKAGE = Path(__file__).resolve().parent.parent


@cache
def cache_directory() -> Path:
    """Directory of the compiled code that belongs to the present sources.

    ``PARTICELL_CACHE_DIR`` overrides the user's cache directory.
    """
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(PACKAGE.rglob("*.py")):
        digest.update(source.relative_to(PACKAGE).as_posix().encode())
        digest.update(source.read_bytes())
    override = os.environ.get("PARTICELL_CACHE_DIR")
    root = Path(override) if override else user_cache_path("particell")
    return root / digest.hexdigest()[:16]


@contextmanager
def compiled_here() -> Iterator[None]:
    """Make Numba pick :func:`cache_directory` for functions created inside the block."""
    previous = NUMBA_CONFIG.CACHE_DIR
    NUMBA_CONFIG.CACHE_DIR = str(cache_directory())
    try:
        yield
    finally:
        NUMBA_CONFIG.CACHE_DIR = previous
