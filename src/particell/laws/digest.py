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
from collections import deque
from collections.abc import Callable, Mapping, Set
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
_COLLECTIONS = (list, set, dict, deque)
#: Methods that collect into what they belong to.
_COLLECT = {"append", "appendleft", "extend", "add", "update", "insert", "setdefault"}
_PACKAGE = Path(__file__).resolve().parent.parent
_INSTALLED = (_PACKAGE, *(Path(sysconfig.get_paths()[k]) for k in ("stdlib", "purelib")))


def digest(value: Any, what: str, lenient: bool = False) -> str:
    """A digest of a value; ``what`` names it where it cannot be had.

    ``lenient`` takes the type alone of lists, tables and sets that a function itself appends to
    (what a script collects into is no part of what it describes), and of other packages' objects.

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
    methods = {
        f"{number} {name}": function
        for number, base in enumerate(kind.__mro__)
        for name, function in vars(base).items()
        if is_own(function)
    }
    codes = [getattr(m, "py_func", m).__code__ for m in methods.values()] if lenient else []
    collected = set().union(*map(_collected, codes))
    parts = []
    for name, value in sorted(vars(law).items()):
        if isinstance(value, _PLAIN) or _short(value):
            parts.append(f"{name}={value!r}")
        elif name in collected and isinstance(value, _COLLECTIONS):
            parts.append(f"{name}=<{type(value).__name__}>")
        else:
            shown = f"{type(value).__name__} {digest(value, f'{name} of {kind.__name__}', lenient)}"
            parts.append(f"{name}=<{shown}>")
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
        if isinstance(value, tuple | list | deque):
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
        elif self.lenient and not _describes(value):
            self.put(type(value).__module__, type(value).__qualname__)
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
        code = function.__code__
        skipped = _collected(code) if self.lenient else frozenset()
        for name, cell in zip(code.co_freevars, function.__closure__ or (), strict=True):
            try:
                self._feed_named(name, cell.cell_contents, skipped)
            except ValueError:  # not yet given
                self.put("empty")

    def _feed_named(self, name: str, value: Any, skipped: Set[str]) -> None:
        """What a function has under a name; of what it collects into, the type."""
        if name in skipped and isinstance(value, _COLLECTIONS):
            self.put(type(value).__name__)
        else:
            self.feed(value)

    def _feed_code(self, code: types.CodeType, doc: str | None, known: Mapping[str, Any]) -> None:
        self.put(code.co_argcount, code.co_kwonlyargcount, code.co_flags, *code.co_names)
        self.put(*code.co_varnames[: code.co_argcount + code.co_kwonlyargcount])
        self.hash.update(code.co_code)
        for constant in code.co_consts:
            if isinstance(constant, types.CodeType):
                self._feed_code(constant, None, known)
            elif doc is None or constant != doc:
                self.feed(constant)
        skipped = _collected(code) if self.lenient else frozenset()
        for instruction in dis.get_instructions(code):
            name = instruction.argval
            if instruction.opname in ("LOAD_GLOBAL", "LOAD_NAME") and name in known:
                self.put(name)
                self._feed_named(name, known[name], skipped)


def _collected(code: types.CodeType) -> Set[str]:
    """The names of what code appends to: ``x`` of ``x.append(…)`` and of ``self.x.append(…)``."""
    found: set[str] = set()
    last = None
    for instruction in dis.get_instructions(code):
        if instruction.opname in ("LOAD_ATTR", "LOAD_METHOD") and instruction.argval in _COLLECT:
            # two loads may be one instruction; the second one is nearer
            found.add(last[-1] if isinstance(last, tuple) else str(last))
        last = instruction.argval
    return found.union(*(_collected(c) for c in code.co_consts if isinstance(c, types.CodeType)))


def is_frozen(kind: type) -> bool:
    """Whether it is a class of frozen data."""
    return dataclasses.is_dataclass(kind) and kind.__dataclass_params__.frozen  # type: ignore[attr-defined]


def _describes(value: Any) -> bool:
    """Whether an object is made of its values: of the user's classes, a frozen one, or a shape."""
    kind = type(value)
    if not hasattr(value, "__dict__"):
        return False
    if is_frozen(kind) or kind.__module__.startswith(f"{_PACKAGE.name}.geometry."):
        return True
    file = getattr(sys.modules.get(kind.__module__), "__file__", None)
    if file is None:
        return kind.__module__ == "__main__"
    return not any(Path(file).is_relative_to(place) for place in _INSTALLED)
