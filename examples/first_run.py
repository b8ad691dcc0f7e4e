"""Water between two plates, driven by a body force, against the exact parabola.

python examples/first_run.py [particles across the gap]
"""

import sys

import numpy as np

import particell as pc

height, speed = 100e-6, 1e-3  # m and m/s
water = pc.Fluid(density=1000, viscosity=1e-3)
push = 8 * water.viscosity / water.density * speed / height**2  # m/s²: gives that speed midway

box = pc.Domain(lower=(0, 0), upper=(height, height), periodic="x")
across = 20
if len(sys.argv) > 1:
    across = int(sys.argv[1])
spacing = height / across
simulation = pc.Simulation(
    box,
    [pc.fluid(box, water, spacing), *pc.channel_walls(box, water, spacing, axis=1)],
    pc.TransportVelocity(gravity=(push, 0)),
)
run = simulation.run(until=0.01, every=0.001, out="out/first_run", overwrite=True)

y = np.linspace(0, height, 11)
velocity = run.on_line("velocity", (0, 0), (0, height), points=11)[:, 0]
error = np.abs(velocity - 4 * speed * y * (height - y) / height**2).max() / speed
print(f"largest error: {100 * error:.2f} % of the velocity midway")
run.plot("velocity", path="out/first_run/velocity.png")
