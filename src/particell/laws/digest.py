"""What laws and functions are made of, as text that is the same for the same law in any process.

Loops are filed under what they call and checkpoints know the laws of the user's, so both have to
be told apart by what they compute: numbers by value, arrays in full, functions by their code and by
all that this refers to. What is part of an installed package is known by its name.
"""

from __future__ import annotations

import dataclasses
import dis
import functools
import hashlib
import sys
import sysconfig
import types
from collections.abc import Callable, Mapping
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from particell.errors import InputError

#: Characters of a digest.
LENGTH = 16
#: Longest text of values that are shown as they are.
LONGEST = 80
_PLAIN = (bool, int, float, complex, str, bytes, type(None), type(Ellipsis))
_PACKAGE = Path(__file__).resolve().parent.parent
_INSTALLED = (_PACKAGE, *(Path(sysconfig.get_paths()[k]) for k in ("stdlib", "purelib")))


def digest(value: Any, what: str, lenient: bool = False) -> str:
    """A digest of a value; ``what`` names it where it cannot be had.

    ``lenient`` takes of what may change by itself (lists, tables, sets and objects that functions
    refer to) the type alone: what a script collects into is no part of what it describes.

    Raises
    ------
    InputError
        Where a part is neither data nor code.
    """
    return _Digest(what, lenient).of(value)


def is_own(function: Any) -> bool:
    """Whether a function (or a class's) is of the user's: of no installed package."""
    code = getattr(getattr(function, "py_func", function), "__code__", None)
    if code is None:
        return False
    file = Path(code.co_filename)
    return not any(file.is_relative_to(place) for place in _INSTALLED)


def described(law: Any, lenient: bool = False) -> str:
    """A law as text: its class, its values, and the digest of its methods' code.

    ``lenient`` is as for :func:`digest`.

    Raises
    ------
    InputError
        Where a value is of a kind that cannot be compared.
    """
    kind = type(law)
    parts = []
    for name, value in sorted(vars(law).items()):
        if isinstance(value, _PLAIN) or _short(value):
            parts.append(f"{name}={value!r}")
        else:
            shown = f"{type(value).__name__} {digest(value, f'{name} of {kind.__name__}', lenient)}"
            parts.append(f"{name}=<{shown}>")
    methods = {
        f"{number} {name}": function
        for number, base in enumerate(kind.__mro__)
        for name, function in vars(base).items()
        if is_own(function)
    }
    if methods:
        parts.append(f"code {_Digest(kind.__name__, lenient).of(sorted(methods.items()), True)}")
    return f"{kind.__qualname__}({', '.join(parts)})"


def _short(value: Any) -> bool:
    """Whether a value says by itself, in a few words, what it is."""
    whole = isinstance(value, tuple) and all(isinstance(item, _PLAIN) for item in value)
    return whole and len(repr(value)) <= LONGEST


def scheme_text(scheme: Any) -> str:
    """A scheme as text, with the laws of the user's as they :meth:`.Law.described` themselves."""
    more = getattr(scheme, "more", ())
    if not more:
        return repr(scheme)
    laws = ", ".join(law.described() for law in more)
    return f"{dataclasses.replace(scheme, more=())!r} with {laws}"


class _Digest:
    def __init__(self, what: str, lenient: bool = False):
        self.what, self.lenient = what, lenient
        self.hash = hashlib.sha256()
        self.seen: dict[int, Any] = {}

    def of(self, value: Any, whole: bool = False) -> str:
        """The digest; ``whole`` goes into a list that is ours."""
        if whole:
            for item in value:
                self.feed(item)
        else:
            self.feed(value)
        return self.hash.hexdigest()[:LENGTH]

    def _changes(self, value: Any) -> bool:
        """Whether a value is of a kind that collects, or is an object with a life of its own."""
        if isinstance(value, list | set | Mapping):
            return True
        known = tuple | frozenset | functools.partial | types.MethodType | Enum | np.ufunc
        code = type | types.ModuleType | types.BuiltinFunctionType | np.dtype
        return not (
            isinstance(value, known | code)
            or hasattr(value, "__code__")
            or hasattr(value, "py_func")
        )

    def put(self, *texts: object) -> None:
        for text in texts:
            self.hash.update(f"{text}\0".encode())

    def feed(self, value: Any) -> None:
        """Take a value into account."""
        if isinstance(value, _PLAIN):
            self.put(type(value).__name__, repr(value))
        elif isinstance(value, np.ndarray | np.generic) and value.dtype.kind != "O":
            self.put(value.dtype.str, value.shape)
            self.hash.update(np.ascontiguousarray(value).tobytes())
        elif id(value) in self.seen:
            self.put("again")
        else:
            self.seen[id(value)] = value  # kept: identities stay taken
            self._feed_whole(value)

    def _feed_whole(self, value: Any) -> None:
        self.put(type(value).__name__)
        if self.lenient and self._changes(value):
            return
        if isinstance(value, tuple | list):
            self.put(len(value))
            for item in value:
                self.feed(item)
        elif isinstance(value, set | frozenset):
            self.put(*sorted(digest(item, self.what, self.lenient) for item in value))
        elif isinstance(value, Mapping):
            for key in sorted(value, key=repr):
                self.feed(key)
                self.feed(value[key])
        elif isinstance(value, functools.partial):
            self.feed((value.func, value.args, value.keywords))
        elif isinstance(value, types.MethodType):
            self.feed((value.__func__, value.__self__))
        elif isinstance(value, Enum | np.ufunc | np.dtype):
            self.put(repr(value))
        elif isinstance(value, type | types.ModuleType | types.BuiltinFunctionType):
            self.put(getattr(value, "__module__", ""), getattr(value, "__qualname__", repr(value)))
        elif is_own(value):
            self._feed_function(getattr(value, "py_func", value))
        elif hasattr(value, "__code__") or hasattr(value, "py_func"):
            self.put(value.__module__, value.__qualname__)
        elif hasattr(value, "__dict__"):
            self.put(type(value).__module__, type(value).__qualname__)
            self.feed(vars(value))
        else:
            allowed = (
                "a number, a text, an array, a function, or made of these; or the law has a method "
                "described(self), whose text is the same for the same law"
            )
            raise InputError(self.what, value, allowed)

    def _feed_function(self, function: Callable[..., Any]) -> None:
        """The code, what it refers to, and what it was made with."""
        self.put(*sys.version_info[:2])
        self._feed_code(function.__code__, function.__doc__, function.__globals__)
        self.feed((function.__defaults__, function.__kwdefaults__))
        for cell in function.__closure__ or ():
            try:
                self.feed(cell.cell_contents)
            except ValueError:  # not yet given
                self.put("empty")

    def _feed_code(self, code: types.CodeType, doc: str | None, known: Mapping[str, Any]) -> None:
        self.put(code.co_argcount, code.co_kwonlyargcount, code.co_flags, *code.co_names)
        self.put(*code.co_varnames[: code.co_argcount + code.co_kwonlyargcount])
        self.hash.update(code.co_code)
        for constant in code.co_consts:
            if isinstance(constant, types.CodeType):
                self._feed_code(constant, None, known)
            elif doc is None or constant != doc:
                self.feed(constant)
        for instruction in dis.get_instructions(code):
            name = instruction.argval
            if instruction.opname in ("LOAD_GLOBAL", "LOAD_NAME") and name in known:
                self.put(name)
                self.feed(known[name])
