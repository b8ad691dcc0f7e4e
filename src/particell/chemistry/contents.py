"""What particles hold of each species: set, read, add up."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from particell.chemistry import reservoirs
from particell.chemistry.network import Tables
from particell.chemistry.species import Species
from particell.compute.device import Device
from particell.compute.philox import INITIAL, stream_key
from particell.compute.reduce import Reduction
from particell.errors import InputError, unknown_name
from particell.fields import WORK, Field
from particell.geometry.domain import Domain
from particell.materials import AVOGADRO
from particell.particles import Particles

#: Molecules a particle; sums of two still fit in 64 bits.
MOST_MOLECULES = 2.0**62
Values = float | np.ndarray | Callable[[np.ndarray], np.ndarray | float]


class Contents:
    """The species of a set of particles, in the fields ``amount`` (mol) and ``count`` (molecules).

    Parameters
    ----------
    device
        Where loops run.
    domain
        The box, for functions of the place.
    particles
        The particles, with the fields of :meth:`add_fields`.
    species
        What there is.
    tables
        Those of concentrations and those of molecules.
    seed
        Of the random rounding of initial molecules.
    depth
        Extent of the dimensions that are not simulated, in m (2D) or m² (1D).
    """

    def __init__(
        self,
        device: Device,
        domain: Domain,
        particles: Particles,
        species: Sequence[Species],
        tables: tuple[Tables, Tables],
        seed: int,
        depth: float,
    ):
        self.device, self.particles, self.depth = device, particles, depth
        self.domain = domain
        self.species = {s.name: s for s in species}
        self.tables = self.deterministic, self.stochastic = tables
        self._reduction = Reduction(device)
        self._initial_key = tuple(stream_key(seed, INITIAL))
        self._round = device.bind(reservoirs.round_counts, {"id": particles["id"]})

    @staticmethod
    def add_fields(particles: Particles, species: Sequence[Species]) -> None:
        """Add the fields of the species to the particles, where they are missing."""
        molecules = sum(s.molecules for s in species)
        amounts = sum(not s.molecules or s.switches for s in species)
        needed = [
            Field("amount", components=amounts, kind=np.float64),
            Field("amount_booked", components=amounts, kind=np.float64, role=WORK),
            Field("count", components=molecules, kind=np.int64),
            Field("count_booked", components=molecules, kind=np.int64),
        ]
        if any(s.switches for s in species):
            needed.append(Field("continuous", components=molecules, kind=np.uint8))
        for field in needed:
            if field.components and field.name not in particles:
                particles.add(field)

    def set_concentration(
        self, name: str, values: Values, group: str | None = None, by_id: bool = False
    ) -> None:
        """Set a species from concentrations in mol/m³.

        Parameters
        ----------
        name
            The species.
        values
            A number, an array for the particles concerned or for all (of which the others' are left
            aside: what :meth:`concentration` returns can be put back), or a function of positions
            (m, dim).
        group
            The particles concerned; by default all that hold the species.
        by_id
            Whether an array is in the order of the particles' ids, which never changes; by default
            in memory order, which does.

        Notes
        -----
        Molecules: C V depth 𝒩 is rounded at random without bias, by a random number of
        the particle's own (purpose ``INITIAL``, counter id and species). A species that switches
        begins as an amount where it has more than ``switch_above`` molecules.
        """
        chosen, numbers = self._values(name, values, group, by_id)
        if (numbers < 0).any() or not np.isfinite(numbers).all():
            raise InputError(f"concentration of {name}", float(numbers.min()), "finite and >= 0")
        p = self.particles
        amounts = np.zeros(p.n)
        amounts[chosen] = numbers * (p.view("mass") / p.view("density"))[chosen]
        table, column = self._column(name)
        if table is self.deterministic:
            self._overwrite("amount", column, chosen, amounts)
            return
        expected = amounts * self.depth * AVOGADRO
        most = self.species[name].switch_above
        if most is not None:
            above = chosen & (expected > most)
            self._overwrite("amount", table.partner[column], chosen, np.where(above, amounts, 0.0))
            self._overwrite("continuous", column, chosen, above)
            self._overwrite("count", column, above, np.zeros(p.n))
            chosen = chosen & ~above
        if chosen.any() and expected[chosen].max() > MOST_MOLECULES:
            allowed = f"at most {MOST_MOLECULES:g} a particle"
            raise InputError(f"number of molecules of {name}", float(expected.max()), allowed)
        mask = self.device.array(chosen.astype(np.uint8))
        key0, key1 = self._initial_key
        self._round(p.n, self.device.array(expected), column, mask, key0, key1, p["count"])

    def set_count(
        self, name: str, values: Values, group: str | None = None, by_id: bool = False
    ) -> None:
        """Set the numbers of molecules of a species; arguments as in :meth:`set_concentration`."""
        table, column = self._column(name)
        if table is self.deterministic:
            raise InputError("species", name, "one with molecules=True, to have its count set")
        chosen, numbers = self._values(name, values, group, by_id)
        whole = np.rint(numbers)
        if not ((whole == numbers) & (whole >= 0) & (whole <= MOST_MOLECULES)).all():
            allowed = f"whole numbers from 0 to {MOST_MOLECULES:g}"
            raise InputError(f"count of {name}", values, allowed)
        every = np.zeros(self.particles.n)
        every[chosen] = whole
        self._overwrite("count", column, chosen, every)
        if self.species[name].switches:
            self._overwrite("amount", table.partner[column], chosen, 0 * every)
            self._overwrite("continuous", column, chosen, 0 * every)

    def concentration(self, name: str, by_id: bool = False) -> np.ndarray:
        """Concentration of a species of either kind in mol/m³, a new array (n,).

        In memory order, which changes when neighbour lists are built, or with ``by_id`` in the
        order of the particles' ids.
        """
        found = self._concentration(name)
        return self.particles.in_order_of_ids(found) if by_id else found

    def _concentration(self, name: str) -> np.ndarray:
        table, column = self._column(name)
        p = self.particles
        volume = p.view("mass").astype(float) / p.view("density")
        if table is self.deterministic:
            return p.view("amount")[:, column] / volume
        found = p.view("count")[:, column] / (volume * self.depth * AVOGADRO)
        if self.species[name].switches:
            amount = p.view("amount")[:, table.partner[column]]
            found = np.where(p.view("continuous")[:, column] == 1, amount / volume, found)
        return found

    def count(self, name: str, by_id: bool = False) -> np.ndarray:
        """Molecules of a species, a new array int64 (n,); ``by_id`` as in :meth:`concentration`.

        Of a species that is an amount there (see ``switch_above``), the nearest whole number.
        """
        table, column = self._column(name)
        if table is self.deterministic:
            raise InputError("species", name, "one with molecules=True, to have a count")
        count = self.particles.view("count")[:, column]
        if self.species[name].switches:
            amount = self.particles.view("amount")[:, table.partner[column]]
            near = np.rint(amount * self.depth * AVOGADRO).astype(np.int64)
            count = np.where(self.particles.view("continuous")[:, column] == 1, near, count)
        return self.particles.in_order_of_ids(count) if by_id else np.array(count)

    def column(self, name: str) -> int:
        """The species' column in the field ``amount`` or ``count``."""
        return self._column(name)[1]

    def totals(self) -> dict[str, tuple[float | int, float | int]]:
        """For each species its total and what was booked: mol, or molecules.

        The first minus the second is constant: exactly for molecules (whole numbers), to round-off
        for amounts and for species that switch (in molecules, remainders of rounding included).
        """
        result: dict[str, tuple[float | int, float | int]] = {}
        for table, field in ((self.deterministic, "amount"), (self.stochastic, "count")):
            if table.names:
                total = self._reduction.sum(self.particles[field])
                booked = self._reduction.sum(self.particles[f"{field}_booked"])
                for s, name in enumerate(table.names):
                    found = (total[s].item(), booked[s].item())
                    if name in result:  # it switches: its amounts were found before
                        scale = self.depth * AVOGADRO
                        old = result[name]
                        found = (found[0] + old[0] * scale, found[1] + old[1] * scale)
                    result[name] = found
        return result

    def _overwrite(self, field: str, column: int, chosen: np.ndarray, values: np.ndarray) -> None:
        host = self.particles.host(field)
        host[chosen, column] = values[chosen]
        self.particles.set(field, host)

    def _column(self, name: str) -> tuple[Tables, int]:
        """Table and column of a species; of one that switches, those of its molecules."""
        for table in (self.stochastic, self.deterministic):
            if name in table.names:
                return table, table.names.index(name)
        raise unknown_name("species", name, self.species)

    def _values(
        self, name: str, values: Values, group: str | None, by_id: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """Which particles are meant, and one number for each of them, both in memory order."""
        table, column = self._column(name)
        p = self.particles
        holds = table.present[:, column]
        if group is None:
            chosen = holds[p.view("group")]
        else:
            chosen = p.select(group)
            if not holds[[g.name for g in p.groups].index(group)]:
                raise InputError(f"group of {name}", group, "one that holds the species")
        given = values
        if callable(values):
            given = values(self.domain.wrapped(p.view("x")[chosen])[0])
        number = int(chosen.sum())
        try:
            numbers = np.asarray(given, float)
            if numbers.shape == (p.n,) and not callable(values):  # of all particles
                return chosen, numbers[p.view("id") if by_id else slice(None)][chosen]
            numbers = np.broadcast_to(numbers, (number,))
        except (TypeError, ValueError):
            allowed = f"a number, or {number} numbers, or a function that returns them"
            shown = f"of shape {np.shape(given)}" if isinstance(given, np.ndarray) else given
            raise InputError(f"values of {name}", shown, allowed) from None
        if not by_id or callable(values):
            return chosen, numbers
        ids = p.view("id")[chosen]
        return chosen, numbers[np.argsort(np.argsort(ids))]
