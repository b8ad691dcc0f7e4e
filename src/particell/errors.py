"""What can go wrong, by whose fault: wrong input (exit status 2) or a run that broke (3)."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

#: Longest text of a value in a message.
LONGEST_VALUE = 200


class ParticellError(Exception):
    """Base class of all errors that Particell raises on purpose."""


class InputError(ParticellError, ValueError):
    """The input is wrong: what, where, and what is allowed, in one line.

    Parameters
    ----------
    key
        Name of the parameter.
    value
        The value that was refused.
    allowed
        What is allowed instead, as a phrase.
    """

    def __init__(self, key: str, value: object, allowed: str):
        self.key, self.value, self.allowed = key, value, allowed
        super().__init__(f"{key} = {shown(value)} is not allowed: it must be {allowed}")


class MissingExtra(InputError):  # noqa: N818 - an installation, not an error
    """Something was asked for that needs a part which was not installed.

    Parameters
    ----------
    what
        What was asked for.
    package
        What it needs.
    extra
        The extra of this package that brings it.
    """

    def __init__(self, what: str, package: str, extra: str):
        super().__init__(what, package, f"installed: extra '{extra}'")
        self.args = (
            f"{what} needs {package}, which is not installed: pip install 'particell[{extra}]'",
        )


def shown(value: object) -> str:
    """A value as Python writes it, in one line that is not too long, numbers without round-off."""
    try:
        text = " ".join(repr(_without_round_off(value)).split())
    except Exception:  # whatever it is, it is shown in a message about something else
        text = f"<{type(value).__name__}>"
    return text if len(text) <= LONGEST_VALUE else f"{text[: LONGEST_VALUE - 1]}…"


def _without_round_off(value: object) -> object:
    """Floats, alone or in lists, as short as 12 digits allow: 2.5e-06 for 2.4999999999999998e-06.

    Numbers of NumPy's are Python's.
    """
    if type(value) is list or type(value) is tuple:
        return type(value)([_without_round_off(one) for one in value])
    if type(value).__module__ == "numpy" and getattr(value, "ndim", 1) == 0:
        value = value.item()  # type: ignore[attr-defined]
    return float(f"{value:.12g}") if type(value) is float else value


def unknown_name(what: str, name: str, known: Iterable[str]) -> InputError:
    """The error for a name that does not exist, with the nearest right one."""
    names = sorted(set(known))
    near = difflib.get_close_matches(name, names, n=1)
    hint = f"did you mean '{near[0]}'? " if near else ""
    return InputError(
        what, name, f"one of {', '.join(names)}" + (f" ({hint.strip()})" if near else "")
    )


class RunError(ParticellError, RuntimeError):
    """The run broke: names step, time, particle and field.

    Parameters
    ----------
    message
        What happened.
    step, time
        When.
    field
        The field concerned.
    particle
        The persistent id of the first particle concerned.
    """

    def __init__(self, message: str, *, step: int, time: float, field: str, particle: int):
        self.step, self.time, self.field, self.particle = step, time, field, particle
        super().__init__(
            f"{message}: field '{field}' of particle {particle} at step {step}, t = {time:.6g} s"
        )


class LawWarning(UserWarning):
    """A law of the input is wrong in a way that a run can live with: said in one line, once."""


class CacheWarning(UserWarning):
    """Compiled code cannot be kept, or what was kept is damaged: it is compiled anew."""


class HealthWarning(UserWarning):
    """A run is beyond a limit of :mod:`particell.health`: look before you trust it."""


class Interrupted(ParticellError):  # noqa: N818 - the user's wish, not an error
    """The user stopped the run (Ctrl-C); its state is in the checkpoint.

    Parameters
    ----------
    directory
        The run's directory, or None where nothing was written.
    step, time
        Where it stopped.
    """

    def __init__(self, directory: str | None, *, step: int, time: float):
        self.directory, self.step, self.time = directory, step, time
        where = f"; go on with: particell resume {directory}" if directory else ""
        super().__init__(f"stopped at step {step}, t = {time:.6g} s{where}")
