"""Cases and their settings, as a command line gives them."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from particell.errors import InputError

if TYPE_CHECKING:
    from particell.cases.base import Case


def described_case(case: str, settings: Sequence[str]) -> Case:
    """The case of a name or a TOML file, with the settings of the command line."""
    from particell import cases
    from particell.cases.files import read_case_file, with_settings

    if case.endswith(".toml"):
        kind, parameters = read_case_file(case)
    else:
        kind, parameters = cases.load(case), {}
    return kind(**with_settings(parameters, parse_settings(settings)))


def parse_settings(settings: Sequence[str]) -> dict[str, Any]:
    """``key=value`` texts as a dictionary; a value is TOML where it can be, and else text."""
    found: dict[str, Any] = {}
    for setting in settings:
        key, equals, value = setting.partition("=")
        key, value = key.strip(), value.strip()
        if not equals or not key:
            raise InputError("--set", setting, "of the form KEY=VALUE")
        try:
            found[key] = tomllib.loads(f"value = {value}")["value"]
        except tomllib.TOMLDecodeError:
            found[key] = value
    return found
