"""An enzyme's reactions from an SBML file, on particles, against the rate equations.

python examples/sbml_model.py        (needs the extra 'sbml')
"""

from pathlib import Path

from scipy.integrate import solve_ivp

import particell as pc

model = pc.read_sbml(Path(__file__).with_name("enzyme.xml"), diffusivity="100 um^2/s")
for reaction in model.reactions:
    print(f"{reaction.label:14}  forward {reaction.forward:g}  backward {reaction.backward}  (SI)")

line = pc.Domain(lower=(0,), upper=(10e-6,), periodic="x", depth=1e-6)
simulation = pc.Simulation(
    line,
    pc.fluid(line, pc.Fluid(density=1000, viscosity=1e-3), 1e-6),
    pc.Static(),
    model.species,
    model.reactions,
)
model.set_initial(simulation.chemistry)
run = simulation.run(until=5.0, progress=False)

on, off, kcat = 30e3 / 60, 60 / 60, 60 / 60  # m³/mol/s, 1/s, 1/s: l/µmol/min and 1/min of the file


def rates(t, c):
    binding, made = on * c[0] * c[1] - off * c[2], kcat * c[2]
    return -binding, made - binding, binding - made, made


exact = solve_ivp(rates, (0, 5), [10e-3, 1e-3, 0, 0], rtol=1e-10, atol=1e-16).y[3, -1]
product = run.field("concentration/P")[-1].mean()
error = abs(product / exact - 1)
print(f"product {1e3 * product:.4f} µmol/l, rate equations {1e3 * exact:.4f}: {error:.1e} off")
