"""A periodic box of water at rest, 160 nm wide: thermal noise and friction hold each other.

python examples/thermal_box.py [particles along an edge] [time in ns]
"""

import sys

import particell as pc
from particell.materials import BOLTZMANN

edge = int(sys.argv[1]) if len(sys.argv) > 1 else 16
until = float(sys.argv[2]) * 1e-9 if len(sys.argv) > 2 else 100e-9
spacing, temperature = 10e-9, 300.0  # m and K

box = pc.Domain((0, 0), (edge * spacing, edge * spacing), periodic="xy", depth=spacing)
water = pc.Fluid(density=1000, viscosity=1e-3, temperature=temperature)
simulation = pc.Simulation(
    box,
    pc.fluid(box, water, spacing),
    pc.SDPD(density="summation", fluctuations=True),
    seed=1,
)
run = simulation.run(until, every=until / 400)

# D (N − 1) degrees of freedom, since the total momentum is conserved; the first frames warm up
energy = run.observable("kinetic_energy")[40:]
ratio = energy.mean() / (edge**2 - 1) / (BOLTZMANN * temperature)
momentum = simulation.conservation()["momentum"]
print(f"kinetic temperature {ratio * temperature:.1f} K, where it should be {temperature:.1f} K")
print(f"momentum has drifted by {momentum:.0e} of the sum of m|v|")
