"""Case files that run in a moment, for tests of what is around a run."""

#: A species at rest on a periodic line, for 1 s with three frames.
DIFFUSING_LINE = """
[domain]
lower = [0]
upper = ["10 um"]
periodic = "x"
depth = "1 um"
[materials.w]
density = 1000
viscosity = 1e-3
[[phases]]
type = "fluid"
material = "w"
spacing = "1 um"
[scheme]
type = "Static"
[[species]]
name = "A"
diffusivity = "1 um^2/s"
[[initial]]
species = "A"
concentration = 1
[run]
until = 1
every = 0.5
"""
