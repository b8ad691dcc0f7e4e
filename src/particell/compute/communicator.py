"""Who else takes part in a run: today nobody.

Every number that is of all particles comes through here, so that particles can be shared among
processes: whole numbers (the bins of exact sums) are added up, maxima are compared, whatever the
number of processes and whoever holds which particle.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np


class Communicator(Protocol):
    """The processes that share the particles of a run."""

    @property
    def rank(self) -> int:
        """Which of them this one is."""
        ...

    @property
    def size(self) -> int:
        """How many there are."""
        ...

    def sum(self, numbers: np.ndarray) -> np.ndarray:
        """Whole numbers (int64), added over all processes."""
        ...

    def maximum(self, number: float) -> float:
        """The largest over all processes; NaN where one is NaN."""
        ...


class Alone:
    """The only process of a run."""

    rank, size = 0, 1

    def sum(self, numbers: np.ndarray) -> np.ndarray:
        """The numbers themselves."""
        return numbers

    def maximum(self, number: float) -> float:
        """The number itself."""
        return number
