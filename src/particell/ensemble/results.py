"""What an ensemble left behind: its finished realisations, statistics and pictures."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

from particell.ensemble.realisations import FAILURE, Realisations, member
from particell.output.files import read_json
from particell.output.run import SUMMARY
from particell.representation import block, table

if TYPE_CHECKING:
    from particell.ensemble.figures import EnsemblePlots


class EnsembleRun(Realisations):
    """The finished realisations of an ensemble.

    Statistics are of a field or observable by its name (fields first), or of any function of a
    :class:`~particell.output.run.Run` that gives numbers or arrays of one shape.

    A field is compared particle by particle, by persistent id, where the particles are at the same
    places in all realisations: particles at rest, fixed walls, a flow without randomness. Where
    they are not, the value of "the same particle" in two realisations belongs to two places and
    is refused; give ``grid`` (cells along each axis) or ``points`` (m, D) to compare places.

    Parameters
    ----------
    directory
        The ensemble's directory.

    Raises
    ------
    InputError
        Where there is no ensemble.
    """

    @cached_property
    def failed(self) -> dict[int, str]:
        """Numbers of the failed realisations, and why they failed."""
        found = {}
        for k in range(int(self.settings["runs"])):
            path = member(self.directory, k) / FAILURE
            if path.is_file():
                found[k] = str(read_json(path, "failed realisation")["error"])
        return found

    @property
    def seeds(self) -> list[int]:
        """Seeds of the finished realisations."""
        return [int(run.summary["seed"]) for run in self.runs]

    @property
    def summary(self) -> dict[str, Any]:
        """The contents of the ensemble's ``summary.json``; empty while there is none."""
        path = self.directory / SUMMARY
        return read_json(path, "summary") if path.exists() else {}

    def __repr__(self) -> str:
        failed = f", {len(self.failed)} failed" if self.failed else ""
        return f"EnsembleRun({len(self)} of {self.settings['runs']} realisations{failed})"

    def _repr_html_(self) -> str:
        seed, first = self.settings.get("seed"), self.runs[0] if self.runs else None
        rows: list[tuple[str, object]] = [
            ("finished", f"{len(self)} of {self.settings['runs']} realisations"),
            ("failed", list(self.failed) or None),
            ("master seed", seed),
        ]
        if first is not None:
            rows.append(("frames", len(first)))
            rows.append(("fields", first.field_names))
            rows.append(("observables", first.observable_names))
        return block(f"Ensemble {self.directory}", table(rows))

    @property
    def plot(self) -> EnsemblePlots:
        """Pictures: ``result.plot("amount_A")``, ``result.plot.histogram(...)``, …."""
        from particell.ensemble.figures import EnsemblePlots

        return EnsemblePlots(self)
