"""A ⇌ B while both diffuse: as concentrations, as molecules, and exactly.

python examples/reaction_diffusion.py [number of particles]
"""

import sys

import numpy as np

import particell as pc

number = int(sys.argv[1]) if len(sys.argv) > 1 else 50
length, diffusivity, forward, backward = 10e-6, 1e-12, 2.0, 1.0  # m, m²/s, 1/s, 1/s
mean, until, wave = 1e-3, 1.0, 2 * np.pi / length  # mol/m³, s, 1/m

line = pc.Domain(lower=(0,), upper=(length,), periodic="x", depth=1e-6)  # 1 µm² across
kinds = {"concentrations": "", "molecules": "_molecules"}
simulation = pc.Simulation(
    line,
    pc.fluid(line, pc.Fluid(density=1000, viscosity=1e-3), length / number),
    pc.Static(),
    [pc.Species(s + k, diffusivity, molecules=bool(k)) for k in kinds.values() for s in "AB"],
    [pc.Reaction(f"A{k} <-> B{k}", forward, backward) for k in kinds.values()],
    normalise_diffusion=True,
)
for k in kinds.values():
    simulation.chemistry.set_concentration(f"A{k}", lambda x: mean * (1 + np.cos(wave * x[:, 0])))
run = simulation.run(until)

x = run.field("position")[-1][:, 0]
# A + B spreads as if nothing reacted; the part of it that is A relaxes to k₋/(k + k₋)
total = mean * (1 + np.cos(wave * x) * np.exp(-diffusivity * wave**2 * until))
both = forward + backward
exact = total * (backward + forward * np.exp(-both * until)) / both
errors = {name: run.field(f"concentration/A{k}")[-1] - exact for name, k in kinds.items()}
for name, error in errors.items():
    print(f"{name:14}  root mean square error {error.std() / mean:.1e} of the mean concentration")
per_particle = run.field("count/A_molecules")[-1].mean()
print(f"Poisson noise   {exact.mean() / mean / per_particle**0.5:.1e} of it")
