r"""What species ask of the particles: that they resolve patterns, and that amounts are no few.

The root mean square wavenumber of a field C is found from pairs of neighbours,

.. math:: k^2 = D\,\frac{\langle (C_i - C_j)^2/r_{ij}^2\rangle}{\langle (C - \bar C)^2\rangle},

and :math:`2\pi/k\Delta` is how many particles a wave of it has.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from particell.health.finding import Finding
from particell.materials import AVOGADRO
from particell.simulated import Simulated

#: Least number of particles per wave of a concentration: diffusion is then 5 to 11 % slow (support
#: 2 to 3 spacings, Lucy's kernel), at 6 particles 9 to 19 %.
PER_WAVE = 8.0
#: Least number of molecules that a concentration may stand for.
FEWEST = 100.0
#: Smaller deviations from the mean are no pattern.
FLAT = 1e-6
#: Fewer particles have no pattern.
FEW_PARTICLES = 8
#: More particles than are worth looking at.
SAMPLE = 20_000


def of_species(simulation: Simulated) -> Iterator[Finding]:
    """Particles per wave of each concentration that diffuses, and how many molecules it is."""
    chemistry = simulation.chemistry
    if chemistry is None:
        return
    for name, species in chemistry.species.items():
        if species.molecules:
            continue
        total = chemistry.totals()[name][0] * simulation.system.depth_factor * AVOGADRO
        if total > 0:
            yield Finding(
                f"molecules of {name}",
                total,
                FEWEST,
                f"as a concentration {name} has no noise, and so few molecules have much: "
                "molecules=True, or a larger depth of the domain if this is not meant",
                least=True,
            )
        waves = _per_wave(simulation, name)
        if waves is not None:
            yield Finding(
                f"particles per wave of {name}",
                waves,
                PER_WAVE,
                "the pattern is as fine as the particles and not resolved: give a smaller spacing",
                least=True,
            )


def _per_wave(simulation: Simulated, name: str) -> float | None:
    s = simulation
    assert s.chemistry is not None
    table = s.chemistry.deterministic
    diffuses = table.diffusivity[:, table.names.index(name)] > 0
    chosen = diffuses[s.particles.host("group")] & (s.particles.host("is_wall") == 0)
    if chosen.sum() < FEW_PARTICLES:
        return None
    c = np.array(s.chemistry.concentration(name)[chosen], float)
    variance = float(c.var())
    if variance <= (FLAT * max(abs(float(c.mean())), 1e-300)) ** 2:
        return None
    domain, dim = s.domain, s.domain.dim
    tree = domain.tree(s.particles.host("x")[chosen])
    rows = np.arange(tree.n)[:: -(-tree.n // SAMPLE)]
    r, j = tree.query(tree.data[rows], 2 * dim + 1)
    slope = (c[rows, None] - c[j[:, 1:]]) ** 2 / r[:, 1:] ** 2
    wavenumber = np.sqrt(dim * float(slope.mean()) / variance)
    spacing = float(np.median(s.particles.host("support")[chosen])) / s.scheme.support
    return float(2 * np.pi / (wavenumber * spacing)) if wavenumber else None
