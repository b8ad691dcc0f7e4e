"""What reactions turn out to be wrong about while they run: one line for each law."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from particell.chemistry.massaction import NEGATIVE, NOT_FINITE, TAKES_TOO_MUCH
from particell.chemistry.network import Tables
from particell.compute.device import Device
from particell.errors import LawWarning


class Remarks:
    """Lines about laws that take what is not there, or are negative; each is said once.

    Parameters
    ----------
    device
        Where loops run.
    tables
        Those of concentrations and those of molecules.
    fields
        The loops' arrays of each kind, of which ``found`` holds what the loops noted.

    Attributes
    ----------
    lines
        What was said so far.
    """

    def __init__(
        self, device: Device, tables: tuple[Tables, Tables], fields: tuple[dict[str, Any], ...]
    ):
        self.device, self.tables = device, tables
        self._found = [each["found"] for each in fields]
        self.lines: list[str] = []

    def look(self) -> None:
        """Say what the loops have noted and was not said before."""
        for molecules, found in enumerate(self._found):
            table = self.tables[molecules]
            if not table.laws:  # mass action vanishes by itself
                continue
            noted = self.device.to_host(found)
            for r in np.flatnonzero(noted):
                for line in _lines(table, int(r), int(noted[r]), bool(molecules)):
                    if line not in self.lines:
                        self.lines.append(line)
                        warnings.warn(line, LawWarning, stacklevel=2)

    def not_finite(self) -> str:
        """The end of a message about rates: which reactions' are not finite."""
        names = []
        for table, found in zip(self.tables, self._found, strict=True):
            noted = self.device.to_host(found)
            names += [f"'{table.labels[r]}'" for r in np.flatnonzero(noted & NOT_FINITE)]
        return f" ({', '.join(names)})" if names else ""


def _lines(table: Tables, r: int, noted: int, molecules: bool) -> list[str]:
    """What there is to say about reaction r of a table."""
    law = f"the {'propensity' if molecules else 'rate_law'} of reaction '{table.labels[r]}'"
    lines = []
    if noted & TAKES_TOO_MUCH:
        change = table.net[r] if (table.net[r] < 0).any() else -table.net[r]
        what = " or ".join(s for s, c in zip(table.names, change, strict=True) if c < 0)
        lines.append(f"{law} does not vanish where {what} runs out: no more is taken than there is")
    if noted & NEGATIVE:
        lines.append(f"{law} was negative: it counts as zero there")
    return lines
