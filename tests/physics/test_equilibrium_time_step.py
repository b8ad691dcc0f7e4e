"""Equilibrium does not depend on the time step: temperature and fluctuations of density."""

from __future__ import annotations

import numpy as np

from particell.analysis.statistics import block_average
from particell.cases.base import Context
from particell.cases.equilibrium import Equilibrium2D
from systems import standard_errors


def test_density_fluctuations_do_not_depend_on_the_time_step():
    found, off = [], standard_errors(5, 20)
    for seed, factor in enumerate((1.0, 0.5, 0.25)):
        case = Equilibrium2D(resolution=16, samples=250, dt_factor=factor)
        simulation = case.build(Context(seed=seed + 1))
        run = simulation.run(case.until, case.every, progress=False)
        first = case.first(run)
        variance = block_average(case.density_variances(run)[first:])
        temperature = block_average(case.temperatures(run)[first:])
        assert abs(temperature.mean - 300) < off * temperature.error
        found.append((float(variance.mean), float(variance.error)))
    mean, error = np.array(found).T
    assert np.all(error < 0.03 * mean)
    for k in (1, 2):
        assert abs(mean[k] - mean[0]) < off * np.hypot(error[k], error[0]), found
