r"""Flow between two plates, driven by a body force.

.. math::

   u(y, t) = 4 U \frac{y}{H}\left(1 - \frac{y}{H}\right)
   - \sum_{k\,\mathrm{odd}} \frac{32\,U}{\pi^3 k^3}\,\sin\frac{k\pi y}{H}\,
   e^{-k^2\pi^2\nu t/H^2}

from rest, with the force :math:`f = 8\nu U/H^2` per mass. The papers run it with Re = 10
(H = 1, ν = 0.1, f = 0.8) and a support of 3 spacings.

References
----------
Jacob, thesis, UCSB 2020, chapter 3 (errors at 20 to 320 particles across); Morris, Fox & Zhu,
J. Comput. Phys. 136 (1997) 214.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np

from particell.cases.base import Context, Metric
from particell.cases.channel import ChannelFlow
from particell.output.run import Run
from particell.simulation import Simulation

#: The papers' errors by kernel and resolution (absolute, with U = 1).
PAPER = {
    "lucy": {20: 3.4e-2, 40: 6.6e-3, 80: 4.6e-3, 160: 1.5e-3, 320: 9.3e-4},
    "cubic-spline": {20: 2.2e-2, 40: 1.7e-2, 80: 9.5e-3, 160: 5.8e-3, 320: 6.6e-4},
    "wendland-c2": {20: 3.2e-2, 40: 2.9e-2, 80: 7.0e-3, 160: 1.4e-2, 320: 1.2e-2},
}
#: Limits of the averaged profile of a running flow with Lucy's kernel: 20, 40, 80 across; beyond
#: these the papers' error.
LIMITS = {20: 6e-3, 40: 2e-3, 80: 2.5e-3}
#: Limit on the resting lattice, of second order from the one at 40 across.
AT_40, ORDER = 1.3e-3, 1.9


class Poiseuille(ChannelFlow):
    """Flow between two plates, driven by a body force."""

    name = "poiseuille"
    title = "Flow between two plates, driven by a body force"
    reference: ClassVar[str] = "exact series"
    full: ClassVar[list[dict[str, Any]]] = [
        *({"resolution": n, "lattice": "resting"} for n in (20, 40, 80)),
        *({"resolution": n} for n in (20, 40, 80, 160, 320)),
        *(
            {"resolution": n, "kernel": kernel, "normalise_viscosity": True}
            for kernel in ("cubic-spline", "wendland-c2")
            for n in (20, 40, 80)
        ),
    ]

    def drive(self) -> tuple[float, float]:
        """The force whose steady flow has the velocity U in the middle."""
        return 8 * self.viscosity * self.scale / self.height**2, 0.0

    def exact(self, y: np.ndarray, time: float) -> np.ndarray:
        """The series above, over U."""
        k = np.arange(1, 200, 2)[:, None]
        decay = 32 / (math.pi * k) ** 3 * np.exp(-((k * math.pi) ** 2) * time)
        return 4 * y * (1 - y) - (decay * np.sin(k * math.pi * y)).sum(axis=0)

    def paper_error(self) -> float | None:
        """The papers' error at the end."""
        return PAPER.get(self.kernel, {}).get(self.resolution)

    def limit(self) -> float | None:
        """On the lattice of the second order; running, see :data:`LIMITS`."""
        if self.kernel != "lucy" or self.scheme != "transport-velocity":
            return None
        if self.lattice == "resting":
            return AT_40 * max((40 / self.resolution) ** 2, 1.0)
        return LIMITS.get(self.resolution, self.paper_error())

    def transient_limit(self) -> float | None:
        """On the lattice that of the steady profile."""
        return self.limit() if self.lattice == "resting" else None

    def analyse(self, run: Run, simulation: Simulation) -> dict[str, Metric]:
        """Also, on the resting lattice, the order of convergence from half the resolution."""
        found = super().analyse(run, simulation)
        if self.lattice == "resting" and self.resolution >= 16:
            half = self.model_copy(update={"resolution": self.resolution // 2})
            coarse = half.build(Context()).run(half.until, half.every, progress=False)
            ratio = half.profile(coarse, half.averaged(coarse)).error
            order = math.log2(ratio / found["profile_error"].value)
            found["order"] = Metric(order)
            limited = self.kernel == "lucy" and self.resolution == 40
            shortfall = max(0.0, ORDER - order)
            found["order_shortfall"] = Metric(shortfall, limit=0.0 if limited else None)
        return found
