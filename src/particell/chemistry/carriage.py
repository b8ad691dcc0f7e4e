"""The flux of concentrations by a shift, in time: when which loop runs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from particell.compute.reduce import Reduction
from particell.errors import InputError
from particell.kernels import kernel_code, normalisation
from particell.laws.species_flux import carry, deviations, species_parts

if TYPE_CHECKING:
    from particell.simulation import Simulation


class Carriage:
    """Moves amounts between particles by :mod:`particell.laws.species_flux`.

    Raises
    ------
    InputError
        For species that are molecules.
    """

    def __init__(self, simulation: Simulation):
        self.simulation = simulation
        chemistry, device = simulation.chemistry, simulation.device
        assert chemistry is not None
        for name, species in chemistry.species.items():
            if species.molecules:
                raise InputError(
                    "species_flux",
                    True,
                    f"False with molecules ('{name}'): the flux may take more than a particle has, "
                    "so that whole molecules cannot be drawn without bias",
                )
        particles = simulation.particles
        fluid = np.array([g.kind == "fluid" for g in particles.groups])
        carries = chemistry.deterministic.present & fluid[:, None]
        n, self.columns = len(particles), carries.shape[1]
        self._reduction = Reduction(device)
        self._fields: dict[str, Any] = {
            "carries": device.array(carries.astype(np.float64)),
            "part": device.zeros((n, 2 * self.columns), np.float64),
            "mean": device.zeros(self.columns, np.float64),
            "deviation": device.zeros((n, self.columns), np.float64),
            "alpha": normalisation(kernel_code(simulation.scheme.kernel), simulation.domain.dim),
        }
        self._half = device.zeros((n, self.columns), np.float64)
        self._rows: Any = None

    def _bind(self) -> None:
        """Look up arrays again where those of the neighbour list are new."""
        s = self.simulation
        listed = s.neighbours.fields["neighbours"]
        if self._rows is listed:
            return
        self._rows = listed
        fields = {**s.neighbours.fields, **s.particles.fields, **self._fields}
        half, bind, columns = self._half, s.device.bind, {"COLUMNS": self.columns}
        pairs = {**columns, "DIM": s.domain.dim, "KERNEL": kernel_code(s.scheme.kernel)}
        self._parts = bind(species_parts, fields, **columns)
        self._deviations = [
            bind(deviations, {**fields, "amount": amount}, **columns)
            for amount in (fields["amount"], half)
        ]
        self._carry = bind(carry, {**fields, "carried": half}, **pairs)

    def apply(self, dt: float) -> None:
        """Amounts after dt, by the midpoint rule (Euler's would let fronts grow)."""
        self._bind()
        s = self.simulation
        n = len(s.particles)
        self._parts(n)
        sums = self._reduction.sum(self._fields["part"])
        mass = sums[self.columns :]
        mean = np.where(mass > 0, sums[: self.columns] / np.where(mass > 0, mass, 1.0), 0.0)
        s.device.write(self._fields["mean"], mean)
        self._deviations[0](n)
        self._carry(n, 0.5 * dt)
        self._deviations[1](n)
        self._carry(n, dt)
        s.device.copy(self._half, s.particles["amount"])
