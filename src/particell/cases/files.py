"""Cases from TOML files, and other values for their parameters."""

from __future__ import annotations

import copy
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from particell import cases
from particell.cases.base import Case
from particell.errors import InputError, unknown_name
from particell.output.files import reason

#: A case file is written by hand, or by a script in a few loops.
MOST_BYTES = 10_000_000


def read_case_file(path: str | Path) -> tuple[type[Case], dict[str, Any]]:
    """Class and parameters from a TOML file.

    It either has ``case = "name"`` and a table ``[parameters]``, or it describes a whole simulation
    (:mod:`particell.casefile`).

    Raises
    ------
    InputError
        Where the file cannot be read, is not TOML, or has other keys.
    """
    try:
        with open(path, "rb") as handle:
            text = handle.read(MOST_BYTES + 1)
        if len(text) > MOST_BYTES:
            raise InputError("case file", str(path), f"a file of at most {MOST_BYTES} bytes")
        content = tomllib.loads(text.decode("utf-8-sig"))  # editors mark UTF-8
    except OSError as error:
        raise InputError("case file", str(path), f"a readable file ({reason(error)})") from None
    except RecursionError:
        raise InputError("case file", str(path), "nested less deeply") from None
    except InputError:
        raise
    except ValueError as error:  # of TOML, of the text's encoding, of numbers too long
        raise InputError("case file", str(path), f"valid TOML ({reason(error)})") from None
    if not {"case", "parameters"} & set(content):
        from particell.casefile.case import FileCase
        from particell.casefile.networks import located

        return FileCase, {"name": _name_of(path), **located(content, Path(path).parent)}
    for key in content:
        if key not in ("case", "parameters"):
            raise unknown_name("key", key, ("case", "parameters"))
    name, parameters = content.get("case"), content.get("parameters", {})
    if not isinstance(name, str):
        raise InputError("case", name, "the name of a case")
    if not isinstance(parameters, Mapping):
        raise InputError("parameters", parameters, "a table")
    return cases.load(name), dict(parameters)


def _name_of(path: str | Path) -> str:
    """A file's name as one of a case."""
    return re.sub(r"[^A-Za-z0-9_.-]", "-", Path(path).stem).lstrip("_.-") or "case"


def with_settings(parameters: Mapping[str, Any], settings: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters with others in their place; ``table.key`` and ``list.1.key`` (from 1) go deeper.

    Raises
    ------
    InputError
        Where there is no such table or item.
    """
    result: dict[str, Any] = copy.deepcopy(dict(parameters))
    for path, value in settings.items():
        *tables, last = path.split(".")
        place: Any = result
        for part in tables:
            key = _key_in(place, part, path)
            place = place.setdefault(key, {}) if isinstance(place, dict) else place[key]
        place[_key_in(place, last, path)] = value
    return result


def _key_in(place: Any, part: str, path: str) -> Any:
    """The key of a table, or the index in a list, that a part of a path means."""
    if isinstance(place, dict):
        return part
    if isinstance(place, list) and part.isdecimal() and 1 <= int(part) <= len(place):
        return int(part) - 1
    raise InputError("--set", path, "the path of a key, such as run.until or species.1.name")
