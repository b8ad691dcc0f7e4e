"""Where compiled code is kept: one directory per state of the sources it is made from.

Numba keys a cached function on its own file only and does not see an edit of a helper in another
file. The directory of a function therefore carries a hash of its module and of every module of
the package that this one imports, directly or not.

What is kept is code that will be run: the directory has to be the user's own, and nobody else's to
write to, or nothing is kept (Numba alone would keep it beside the sources then, where an edit of
another file goes unseen). Every file has a digest, so that what is damaged, cut off or of another
kind is compiled anew.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import pickle
import re
import stat
import tempfile
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import FunctionCache, IndexDataCacheFile
from platformdirs import user_cache_path

from particell.errors import CacheWarning

#: Numba sets the attributes of its configuration at run time, unseen by type checkers.
NUMBA_CONFIG: Any = numba.config
#: Bytes of a digest.
DIGEST = 32
PACKAGE = Path(__file__).resolve().parent.parent
IMPORT = re.compile(
    rf"^\s*from ({PACKAGE.name}[\w.]*) import (?:\(([^)]*)\)|([^(\n]*))"
    rf"|^\s*import ({PACKAGE.name}[\w.]*)",
    re.MULTILINE,
)


def _file(module: str) -> Path | None:
    """The source of a module of the package; None where the name is no module."""
    path = PACKAGE.parent.joinpath(*module.split("."))
    candidates = (path.with_suffix(".py"), path / "__init__.py")
    return next((file for file in candidates if file.is_file()), None)


@cache
def _read(file: Path) -> tuple[bytes, tuple[Path, ...]]:
    """The content of a source file, and the sources that it imports."""
    content = file.read_bytes()
    found: list[Path | None] = []
    for module, several, one, plain in IMPORT.findall(content.decode()):
        found.append(_file(module or plain))
        names = re.findall(r"(\w+)(?: as \w+)?", several or one)
        found += [_file(f"{module}.{name}") for name in names]
    return content, tuple(file for file in found if file is not None)


def sources(file: Path) -> list[Path]:
    """``file`` and all sources of the package that it imports, directly or not, sorted."""
    seen: set[Path] = set()
    waiting = [file]
    while waiting:
        source = waiting.pop()
        if source not in seen:
            seen.add(source)
            waiting += _read(source)[1]
    return sorted(seen)


def place() -> Path:
    """Where compiled code is to be kept; ``PARTICELL_CACHE_DIR`` overrides the user's cache."""
    override = os.environ.get("PARTICELL_CACHE_DIR")
    return Path(override) if override else user_cache_path("particell")


@cache
def usable(directory: Path) -> bool:
    """Whether code can be kept in a directory, which is made; where it can't, a line says why."""
    why = _unusable(directory)
    if why:
        tell(f"compiled code is not kept, as its directory {directory} {why}")
    return not why


def _unusable(directory: Path) -> str:
    """Why code cannot be kept in a directory; nothing where it can."""
    try:
        directory.mkdir(mode=0o700, parents=True, exist_ok=True)
        if hasattr(os, "geteuid"):
            found = os.stat(directory)
            if found.st_uid != os.geteuid():
                return "belongs to another user"
            if found.st_mode & stat.S_IWOTH:
                return "can be written to by everybody (chmod 700 makes it yours)"
            if found.st_mode & stat.S_IWGRP:
                os.chmod(directory, 0o700)
                tell(f"a group could write to {directory}, which keeps compiled code: now 0700")
        with tempfile.TemporaryFile(dir=directory) as file:
            file.write(b"0")
    except OSError as error:
        return f"cannot be written to ({os.strerror(error.errno) if error.errno else error})"
    return ""


def tell(line: str) -> None:
    """Say in one line what is wrong with what was kept; each line once."""
    warnings.warn(line, CacheWarning, stacklevel=2)


@cache
def cache_directory(file: Path) -> Path | None:
    """Directory of the compiled functions of a source file, as it and its imports are now.

    None where nothing can be kept.
    """
    root = place()
    if not usable(root):
        return None
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sources(file):
        digest.update(str(source.relative_to(PACKAGE.parent) if source != file else "").encode())
        digest.update(_read(source)[0])
    return root / digest.hexdigest()[:16]


def compiled_before(file: Path) -> bool:
    """Whether a function of a source file, as it is now, has been compiled and kept."""
    directory = cache_directory(file)
    return directory is not None and any(directory.rglob("*.nbi"))


def keep(dispatcher: Any, file: str) -> None:
    """Let a function of a source file, made by Numba's ``njit``, be kept on the disk."""
    directory = cache_directory(Path(file).resolve())
    if directory is None:
        return
    previous, NUMBA_CONFIG.CACHE_DIR = NUMBA_CONFIG.CACHE_DIR, str(directory)
    try:
        kept = KeptCode(dispatcher.py_func)
    except (OSError, RuntimeError) as error:  # it finds no place
        tell(f"compiled code is not kept in {directory} ({error})")
        return
    finally:
        NUMBA_CONFIG.CACHE_DIR = previous
    if Path(kept.cache_path).is_relative_to(directory):  # and not beside the sources
        dispatcher._cache = kept
    else:
        tell(f"compiled code is not kept, as {directory} cannot be written to")


class KeptCode(FunctionCache):
    """Numba's cache of a function, without which things go on where it is damaged or full."""

    def __init__(self, function: Callable[..., Any]):
        super().__init__(function)
        plain = self._cache_file
        self._cache_file = _Files(
            self._cache_path, plain._index_name.removesuffix(".nbi"), plain._source_stamp
        )

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The code for a signature, or None where it has to be compiled."""
        try:
            return super().load_overload(sig, target_context)
        except Exception as error:  # bytes that are anything may raise anything
            line = f"compiled code in {self._cache_path} is damaged and is made anew"
            tell(f"{line} ({' '.join(str(error).split())[:100]})")
            with contextlib.suppress(Exception):
                self._cache_file.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the code for a signature, if there is room."""
        try:
            super().save_overload(sig, data)
        except OSError as error:
            tell(f"compiled code is not kept in {self._cache_path} ({error.strerror or error})")


class _Files(IndexDataCacheFile):
    """Numba's files, with a digest at their beginning, and the signature in their names.

    Numba numbers the files of a function's signatures. Two processes that compile one function for
    different types at the same time choose the same number, and who comes later calls the code for
    one type with arrays of the other.
    """

    def save(self, key: Any, data: Any) -> None:
        """Keep the code for a key: the types that it was compiled for, and the processor."""
        name = self._name_of(key)
        self._save_data(name, data)
        overloads = self._load_index()
        overloads[key] = name
        self._save_index(overloads)

    def _name_of(self, key: Any) -> str:
        digest = hashlib.blake2b(repr(key).encode(), digest_size=8).hexdigest()
        return self._index_name.removesuffix(".nbi") + f".{digest}.nbc"

    def load(self, key: Any) -> Any:
        """The code for a key, or None."""
        name = self._load_index().get(key)
        if name is None:
            return None
        if name != self._name_of(key):
            raise ValueError(f"{name} is of other types")
        try:
            return self._load_data(name)
        except FileNotFoundError:
            return None

    def _load_index(self) -> dict:
        try:
            version, stamp, overloads = pickle.loads(_read_whole(self._index_path))
        except FileNotFoundError:
            return {}
        return overloads if (version, stamp) == (self._version, self._source_stamp) else {}

    def _save_index(self, overloads: dict) -> None:
        self._write_whole(self._index_path, (self._version, self._source_stamp, overloads))

    def _load_data(self, name: str) -> Any:
        return pickle.loads(_read_whole(self._data_path(name)))

    def _save_data(self, name: str, data: Any) -> None:
        self._write_whole(self._data_path(name), data)

    def _write_whole(self, path: str, content: Any) -> None:
        data = self._dump(content)
        with self._open_for_write(path) as file:
            file.write(hashlib.blake2b(data, digest_size=DIGEST).digest() + data)


def _read_whole(path: str) -> bytes:
    """What a file holds behind its digest, which it has to agree with."""
    content = Path(path).read_bytes()
    data = content[DIGEST:]
    if hashlib.blake2b(data, digest_size=DIGEST).digest() != content[:DIGEST]:
        raise ValueError(f"{Path(path).name} is not as it was written")
    return data
