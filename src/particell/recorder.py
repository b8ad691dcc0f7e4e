"""Where the frames of a run go: to ``run.h5`` and its checkpoints, or to memory."""

from __future__ import annotations

import json
import uuid
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from particell import snapshot
from particell.averages import RunningAverage
from particell.laws.digest import described
from particell.output.checkpoint import write_checkpoint
from particell.output.files import plain
from particell.output.h5md import AVERAGES
from particell.output.run import CHECKPOINT, TRAJECTORY, Run
from particell.output.sources import GROUPS
from particell.output.trajectory import TrajectoryWriter
from particell.plans import Plan, check_plan
from particell.restored import StateError, whole
from particell.simulated import Runnable


def new_id() -> str:
    """A name for a run that no other has."""
    return uuid.uuid4().hex


def kept_of_run(state: Any) -> dict[str, Any]:
    """What a state has besides that of the simulation: of the run that it was kept by, if any.

    Raises
    ------
    StateError
        Where it is another thing.
    """
    found = state if isinstance(state, Mapping) else {}
    kept: dict[str, Any] = {"averages": {}, "averaged": {}}
    if "plan" in found:
        check_plan(found["plan"])
        kept["plan"] = found["plan"]
    if "run" in found:
        _check_identity(found["run"])
        kept["run"] = found["run"]
    for name in ("averages", "averaged"):
        if name in found:
            if not isinstance(found[name], Mapping):
                raise StateError(name, found[name], "a table")
            kept[name] = found[name]
    return kept


def _check_identity(found: Any) -> None:
    """Refuse what does not say which run, and up to which frame, a checkpoint belongs to."""
    names = {"id", "seed", "frames", "step"}
    if not isinstance(found, Mapping) or set(found) != names or not isinstance(found["id"], str):
        raise StateError("run", found, f"with {', '.join(sorted(names))}")
    whole("seed of the run", found["seed"], 0, 2**64)
    whole("frames of the run", found["frames"], 1)
    whole("step of the last frame", found["step"])


def groups_of(simulation: Runnable) -> list[dict[str, Any]]:
    """The groups: their role, material, the body or wall that they fill, and how that moves."""
    found = []
    for phase, role in zip(simulation.phases, snapshot.roles_of(simulation), strict=True):
        group = next(g for g in simulation.particles.groups if g.name == role.name)
        motion = simulation.walls.motions.get(role.name)
        found.append(
            {
                **role.as_dict(),
                "material": repr(simulation.materials[group.material]),
                "surface": None if phase.surface is None else repr(phase.surface),
                "motion": None if motion is None else repr(motion),
            }
        )
    return found


def _text_of(simulation: Runnable) -> str:
    """What a trajectory says of the run."""
    return json.dumps(plain({**simulation.settings, GROUPS: groups_of(simulation)}))


class Recorder:
    """Takes frames and checkpoints.

    Parameters
    ----------
    simulation
        Of which.
    directory
        Where they go; None for memory.
    going_on
        Whether the trajectory that is there is gone on with.
    averages
        What is averaged in time.
    """

    def __init__(
        self,
        simulation: Runnable,
        directory: Path | None,
        going_on: bool,
        averages: list[RunningAverage],
    ):
        self.simulation, self.directory, self.averages = simulation, directory, averages
        self.points = {a.average.name: a.average.points for a in averages}
        self.frames: list[dict[str, np.ndarray]] = []
        self.observables: list[dict[str, Any]] = []
        self.steps: list[int] = []
        self.times: list[float] = []
        self.writer: TrajectoryWriter | None = None
        self.static = simulation.static_frame()  # normals of walls that turn are those of now
        self.identity: dict[str, Any] = {
            "id": simulation.run_id,
            "seed": int(simulation.seed),
            "frames": 0,
            "step": 0,
        }
        if directory is None:
            return
        if going_on and simulation.resumed_run is not None:
            self.identity = dict(simulation.resumed_run)
            path = directory / TRAJECTORY
            self.writer = TrajectoryWriter.resume(path, simulation.step, self.identity)
        else:
            self.writer = TrajectoryWriter(
                directory / TRAJECTORY,
                simulation.domain,
                self.static,
                simulation.group_names,
                parameters=_text_of(simulation),
                points=self.points,
                units=snapshot.units_of(simulation),
                identity={"run_id": simulation.run_id, "seed": int(simulation.seed)},
            )

    def record(self) -> dict[str, float]:
        """Take a frame; returns the observables."""
        s = self.simulation
        frame, observables = s.frame(), s.observables()
        s.watch.look()
        series: dict[str, Any] = dict(observables)
        for average in self.averages:
            for field, mean in average.take().items():
                series[f"{AVERAGES}/{average.average.name}/{field}"] = mean
        if self.writer is not None:
            self.writer.append(s.step, s.time, frame, series)
        else:
            self.frames.append(frame)
            self.observables.append(series)
            self.steps.append(s.step)
            self.times.append(s.time)
        self.identity["frames"] += 1
        self.identity["step"] = s.step
        return observables

    def checkpoint(self, plan: Plan) -> None:
        """Write a checkpoint that the frames written so far belong to."""
        if self.directory is None:
            return
        self.simulation.check()  # a checkpoint is good, whatever observers did
        if self.writer is not None:
            self.writer.sync()
        state = {**self.simulation.state(), **self.kept(plan)}
        meta = {"step": self.simulation.step, "run": self.identity["id"]}
        write_checkpoint(self.directory / CHECKPOINT, state, meta)

    def kept(self, plan: Plan) -> dict[str, Any]:
        """What goes into a checkpoint besides the state of the simulation."""
        return {
            "plan": plan.saved(),
            "averages": {a.average.name: a.sums for a in self.averages},
            "averaged": {a.average.name: described(a.average) for a in self.averages},
            "run": dict(self.identity),
        }

    def close(self) -> None:
        """Close the file."""
        if self.writer is not None:
            self.writer.close()

    def finish(self) -> Run:
        """Close the file and open the run."""
        s = self.simulation
        self.close()
        if self.directory is not None:
            return Run(self.directory)
        return Run.from_memory(
            s.domain,
            s.group_names,
            self.static,
            self.steps,
            self.times,
            self.frames,
            self.observables,
            points=self.points,
            units=snapshot.units_of(s),
            roles=snapshot.roles_of(s),
        )
