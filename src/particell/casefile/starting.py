"""The file that ``particell new`` writes."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from particell.errors import InputError
from particell.output.files import reason


def starting_text() -> str:
    """The commented file."""
    return (files("particell.casefile") / "starting.toml").read_text(encoding="utf-8")


def write_starting_file(path: Path) -> None:
    """Write it to a new file.

    Raises
    ------
    InputError
        Where the file exists, cannot be written, or would not be found as a case file.
    """
    if path.suffix != ".toml":
        raise InputError("out", str(path), "a name that ends in .toml")
    try:
        with open(path, "x", encoding="utf-8") as handle:
            handle.write(starting_text())
    except OSError as error:
        raise InputError("out", str(path), f"a new file ({reason(error)})") from None
