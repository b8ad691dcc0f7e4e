"""One number that tells whether a run can be trusted, and how far it may go."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Finding:
    """What was looked at, what came out, and what it means where it is beyond its limit.

    Attributes
    ----------
    name
        What was looked at.
    value
        What came out.
    limit
        The largest value allowed, or the least where ``least``.
    sentence
        What is wrong beyond it and what to do, in one line.
    least
        Whether the value has to be the limit or more.
    """

    name: str
    value: float
    limit: float
    sentence: str
    least: bool = False

    @property
    def passed(self) -> bool:
        """Whether the value is within its limit; false for a NaN."""
        if math.isnan(self.value):
            return False
        return bool(self.value >= self.limit if self.least else self.value <= self.limit)

    @property
    def line(self) -> str:
        """Name, value, limit and sentence in one line."""
        than = "below" if self.least else "above"
        return f"{self.name} {self.value:.3g}, {than} {self.limit:.3g}: {self.sentence}"

    def as_dict(self) -> dict[str, Any]:
        """The finding as in ``summary.json``; the sentence only where it applies."""
        found = {
            "value": self.value,
            "limit": self.limit,
            "kind": "least" if self.least else "most",
            "passed": self.passed,
        }
        return found if self.passed else {**found, "sentence": self.sentence}


def beyond(findings: Iterable[Finding]) -> list[Finding]:
    """Those beyond their limits."""
    return [f for f in findings if not f.passed]
