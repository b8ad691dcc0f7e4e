"""What the tests of case files share: a small file, changed here and there, as TOML."""

from __future__ import annotations

import json
import math
import re
import tomllib
from typing import Any

from particell.casefile.case import FileCase
from particell.casefile.starting import starting_text
from particell.cases.files import with_settings


def small() -> dict[str, Any]:
    """The starting file with few particles and one frame."""
    content = tomllib.loads(starting_text())
    content["constants"]["spacing"] = "= height / 8"
    content["run"] = {"until": "0.1 ms", "every": "0.1 ms"}
    return content


def changed(**settings: Any) -> dict[str, Any]:
    """The small file with other values, by paths with ``__`` for a dot."""
    return with_settings(small(), {k.replace("__", "."): v for k, v in settings.items()})


def case(**settings: Any) -> FileCase:
    """The case of :func:`changed`."""
    return FileCase(**changed(**settings))


def toml(value: Any) -> str:
    """A value as TOML, in one line."""
    if isinstance(value, dict):
        parts = (f"{_key(k)} = {toml(v)}" for k, v in value.items())
        return "{" + ", ".join(parts) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(toml, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    return repr(value)


def document(content: dict[str, Any]) -> str:
    """A whole file."""
    return "\n".join(f"{_key(k)} = {toml(v)}" for k, v in content.items()) + "\n"


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name)
