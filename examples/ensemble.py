"""Molecules that turn around, A ⇌ B: many realisations against the exact mean and scatter.

python examples/ensemble.py [number of realisations] [processes]
"""

import sys

import numpy as np

import particell as pc

runs = int(sys.argv[1]) if len(sys.argv) > 1 else 100
processes = int(sys.argv[2]) if len(sys.argv) > 2 else None
forward, backward, start, number, until = 2.0, 1.0, 50, 20, 1.0


def build(seed):
    line = pc.Domain(lower=(0,), upper=(10e-6,), periodic="x", depth=1e-6)
    simulation = pc.Simulation(
        line,
        pc.fluid(line, pc.Fluid(density=1000, viscosity=1e-3), 10e-6 / number),
        pc.Static(),
        [pc.Species(name, 1e-12, molecules=True) for name in "AB"],
        [pc.Reaction("A <-> B", forward, backward)],
        seed=seed,
    )
    simulation.chemistry.set_count("A", start)
    return simulation


result = pc.Ensemble(build, runs, seed=1, until=until).run("out/ensemble", processes)

# of all molecules each is an A with this probability, independently of the others
both, total = forward + backward, start * number
share = (backward + forward * np.exp(-both * until)) / both
mean, deviation = result.mean("amount_A"), result.deviation("amount_A")
print(f"molecules of A: {mean:.1f} ± {deviation:.1f}")
print(f"exact:          {total * share:.1f} ± {np.sqrt(total * share * (1 - share)):.1f}")
result.plot("amount_A", "amount_B", path="out/ensemble/amounts.png")
