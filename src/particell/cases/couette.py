r"""Flow between two plates of which the upper one moves.

.. math::

   u(y, t) = U\frac{y}{H} + \sum_{n\ge 1} \frac{2U}{n\pi} (-1)^n \sin\frac{n\pi y}{H}\,
   e^{-n^2\pi^2\nu t/H^2}

from rest. The plate's particles move with it, around the periodic channel.

References
----------
Morris, Fox & Zhu, J. Comput. Phys. 136 (1997) 214.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np

from particell.cases.channel import ChannelFlow


class Couette(ChannelFlow):
    """Flow between two plates of which the upper one moves."""

    name = "couette"
    title = "Flow between two plates of which one moves"
    reference: ClassVar[str] = "exact series"
    full: ClassVar[list[dict[str, Any]]] = [{"resolution": n} for n in (20, 40, 80)]

    def drive(self) -> tuple[float, float]:
        """The upper plate moves with U."""
        return 0.0, self.scale

    def exact(self, y: np.ndarray, time: float) -> np.ndarray:
        """The series above, over U."""
        n = np.arange(1, 400)[:, None]
        decay = 2 / (math.pi * n) * (-1.0) ** n * np.exp(-((n * math.pi) ** 2) * time)
        return y + (decay * np.sin(n * math.pi * y)).sum(axis=0)

    def limit(self) -> float | None:
        """A linear profile is exact but for round-off and what is left of the transient."""
        return 1e-3

    def transient_limit(self) -> float | None:
        """As that of Poiseuille flow at 20 particles across."""
        return 6e-3
