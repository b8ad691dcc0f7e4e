"""A case that takes no time: particles that walk at random in a periodic box.

It has the interface of a real case and a real simulation, for tests of everything around them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from particell import plots
from particell.cases.base import Case, Context, Diffusivity, Length, Metric, Time
from particell.errors import InputError, Interrupted, RunError
from particell.geometry.domain import Domain
from particell.health import Finding
from particell.output.checkpoint import write_checkpoint
from particell.output.run import CHECKPOINT, TRAJECTORY, Run
from particell.output.trajectory import TrajectoryWriter


class WalkSimulation:
    """What :class:`particell.simulation.Simulation` promises, as far as output needs it."""

    def __init__(self, case: Walk, seed: int):
        self.case = case
        self.domain = Domain((0, 0), (case.side, case.side), periodic="xy")
        self.random = np.random.Generator(np.random.Philox(seed))
        self.position = self.random.random((case.particles, 2)) * case.side
        self.step, self.dt = 0, 0.1
        self.settings = {"kernel": "lucy", "support": 3e-6, "dt": self.dt}

    def health(self) -> list[Finding]:
        return []

    @property
    def time(self) -> float:
        return self.step * self.dt

    def frame(self) -> dict[str, np.ndarray]:
        n = len(self.position)
        return {
            "position": self.position % self.case.side,
            "velocity": np.zeros((n, 2)),
            "density": np.full(n, 1000.0),
            "concentration/L": np.arange(n, dtype=float),
        }

    def static_frame(self) -> dict[str, np.ndarray]:
        n = len(self.position)
        return {
            "id": np.arange(n),
            "group": (np.arange(n) % 2).astype(np.int32),
            "mass": np.full(n, 1e-15),
            "support": np.full(n, 3 * self.case.side / np.sqrt(n)),
        }

    def observables(self) -> dict[str, float]:
        return {"spread": float(self.position.var())}

    def state(self) -> dict:
        return {
            "step": self.step,
            "position": self.position,
            "random": self.random.bit_generator.state,
        }

    def restore(self, state: dict) -> None:
        self.step = state["step"]
        self.position = state["position"].copy()
        self.random.bit_generator.state = state["random"]

    def conservation(self) -> dict[str, float]:
        return {"amount_L": 0.0}

    @property
    def performance(self) -> dict:
        return {"particles": len(self.position), "steps": self.step, "wall_seconds": 0.1}

    def run(self, until, every, out, progress=True) -> Run:
        path = out / TRAJECTORY
        if self.step:
            writer = TrajectoryWriter.resume(path, self.step)
        else:
            writer = TrajectoryWriter(path, self.domain, self.static_frame(), ["odd", "even"])
        with writer:
            if not self.step:
                writer.append(0, 0.0, self.frame(), self.observables())
                if self.case.break_at == 0:
                    raise RunError("not finite", step=0, time=0.0, field="v", particle=3)
                write_checkpoint(out / CHECKPOINT, self.state(), {"step": 0})
            while self.time < until - 1e-9:
                kicks = self.random.normal(size=self.position.shape)
                self.position = self.position + np.sqrt(2 * self.case.diffusivity * self.dt) * kicks
                self.step += 1
                writer.append(self.step, self.time, self.frame(), self.observables())
                if self.step == self.case.break_at:
                    raise RunError(
                        "not finite", step=self.step, time=self.time, field="v", particle=3
                    )
                if self.step == self.case.interrupt_at:
                    raise Interrupted(str(out), step=self.step, time=self.time)
                write_checkpoint(out / CHECKPOINT, self.state(), {"step": self.step})
        return Run(out)


class Walk(Case):
    name = "walk"
    title = "Random walkers in a periodic box"
    full: ClassVar = {"particles": 64}

    side: Annotated[Length, Field(gt=0)] = 10e-6
    """Edge of the box."""
    diffusivity: Annotated[Diffusivity, Field(ge=0)] = 1e-12
    """Of the walkers."""
    particles: Annotated[int, Field(ge=4, le=1000)] = 16
    """Number of walkers."""
    limit: float = 1.0
    """What the spread may be at most, relative to the box's."""
    break_at: int = -1
    interrupt_at: int = -1
    until: Time = 1.0
    """End."""

    @property
    def every(self) -> float:
        return 0.1

    def build(self, context: Context) -> WalkSimulation:
        if self.particles == 13:
            raise InputError("particles", 13, "a luckier number")
        return WalkSimulation(self, context.seed)

    def analyse(self, run: Run, simulation: WalkSimulation) -> dict[str, Metric]:
        spread = run.observable("spread")[-1] / self.side**2
        return {
            "spread": Metric(spread, paper=0.5, limit=self.limit),
            "frames": Metric(float(len(run))),
        }

    def figures(self, run: Run, directory: Path) -> list[Path]:
        figure = plots.time_series(
            run.times, {"walk": run.observable("spread")}, ylabel="spread [m²]"
        )
        return [plots.save(figure, directory / "spread.png")]
