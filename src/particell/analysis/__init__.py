"""What the particles tell: fields on lines and grids, errors, moments, temperatures, rates."""

from particell.analysis.arrangement import Evenness, evenness
from particell.analysis.fields import grid, interpolate, line
from particell.analysis.statistics import (
    ChiSquare,
    Decay,
    Moments,
    block_average,
    decay_rate,
    epsilon_error,
    kinetic_temperature,
    maxwellian_test,
    moments,
    relative_l2,
)

__all__ = [
    "ChiSquare",
    "Decay",
    "Evenness",
    "Moments",
    "block_average",
    "decay_rate",
    "epsilon_error",
    "evenness",
    "grid",
    "interpolate",
    "kinetic_temperature",
    "line",
    "maxwellian_test",
    "moments",
    "relative_l2",
]
