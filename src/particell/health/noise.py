"""Whether a fluid with noise is one that was measured, and stiff enough: before a run."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from particell.health.finding import Finding
from particell.schemes.summation import disorder_of, measured_range
from particell.simulated import Simulated

#: Least compression modulus K of the fluid over that of its particles. Below, rows of the table lie
#: so far apart that two ways to interpolate differ by up to 15 % in K; above by 3.5 %.
STIFFNESS = 0.7
#: How many spacings a support may be beyond the table's: K changes by 0.03 at most.
SUPPORT = 0.25
#: How many times θ may be beyond the table's: K changes by 0.04 at most, s by 0.01.
STRENGTH = 3.0


def of_noise(simulation: Simulated) -> Iterator[Finding]:
    """Modulus, support and strength of noise of fluids with summed densities and noise."""
    s, dim = simulation, simulation.domain.dim
    if s.static or dim == 1 or not s.scheme.fluctuations or s.scheme.density != "summation":
        return
    kernel, support = s.scheme.kernel, s.scheme.support
    (least, most), (weak, strong) = measured_range(kernel, dim)
    group, mass = s.particles.host("group"), s.particles.host("mass")
    groups = np.unique(group[s.particles.host("is_wall") == 0])
    if not len(groups):
        return
    stiffness, beyond = [], []
    for g in groups:
        weight = float(mass[group == g].mean()) * s.system.depth_factor
        entry, theta = disorder_of(kernel, support, dim, s.materials[g], weight)
        stiffness.append(entry.stiffness)
        beyond.append(max(theta / strong, weak / theta))
    yield Finding(
        "noise: compression modulus of the fluid over that of its particles",
        min(stiffness),
        STIFFNESS,
        f"{kernel} with a support of {support:g} spacings makes so soft a fluid that its sound "
        "speed is uncertain by 5 % and more: give a larger support, 2.5 to 3 spacings",
        least=True,
    )
    yield Finding(
        "noise: spacings of the support beyond those measured",
        max(0.0, least - support, support - most),
        SUPPORT,
        f"what noise makes of the fluid is known for {kernel} from {least:g} to {most:g} spacings "
        f"in {dim}D, not for {support:g}: pressure, sound and viscosity may be some per cent off",
    )
    yield Finding(
        "noise: times that k_BT/(m c²) is beyond those measured",
        max(beyond),
        STRENGTH,
        f"what noise makes of the fluid is known from {weak:g} to {strong:g} in {dim}D: pressure, "
        "sound and viscosity may be some per cent off; give another sound_speed, or, where noise "
        "is far below the flow, leave it off",
    )
