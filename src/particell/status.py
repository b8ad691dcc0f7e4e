"""``status.json``: how far a run is, and whether it still runs."""

from __future__ import annotations

import contextlib
import os
import socket
import time
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from particell import snapshot
from particell.errors import Interrupted
from particell.health import beyond
from particell.output.files import OutputError, read_json, write_json
from particell.output.ownership import UNKNOWN, owner
from particell.output.run import STATUS
from particell.plans import Plan
from particell.simulated import Runnable

RUNNING, ENDED, STOPPED = "running", "ended", "stopped"
INTERRUPTED, FAILED, KILLED = "interrupted", "failed", "killed"
#: Where it says that it runs, and it cannot be told whether it does.
UNCERTAIN = "unknown"
#: Seconds between two, at least.
EVERY = 5.0


class Status:
    """Keeps the ``status.json`` of a run.

    Parameters
    ----------
    simulation, directory
        What runs, and where its frames go; without a directory nothing is written.

    Attributes
    ----------
    identity
        Which run it is, and how many frames it has.
    """

    def __init__(self, simulation: Runnable, directory: Path | None):
        self.simulation = simulation
        self.identity: Mapping[str, Any] = {"id": simulation.run_id, "frames": 0}
        self._path = directory / STATUS if directory else None
        self._started, self._written = _now(), -EVERY
        self._checkpoint: dict[str, Any] | None = None
        self._health: list[str] = []

    def saved(self) -> None:
        """A checkpoint has been written: it is noted, and how healthy the run is."""
        if self._path is not None:
            s = self.simulation
            self._checkpoint = {"step": s.step, "time": s.time, "written": _now()}
            self._health = [finding.line for finding in beyond(s.watch.findings())]

    def tell(self, plan: Plan, state: str = RUNNING, error: str = "") -> None:
        """Write how far it is, if it is time to or the state is another one."""
        if self._path is None:
            return
        now = time.monotonic()
        if state == RUNNING and now - self._written < EVERY:
            return
        self._written = now
        with contextlib.suppress(OutputError):  # frames and checkpoints say it where it matters
            write_json(self._path, self._content(plan, state, error))

    @contextlib.contextmanager
    def failures(self, plan: Plan) -> Iterator[None]:
        """Tell how a run ends that does not come to its end."""
        try:
            yield
        except BaseException as error:
            wish = isinstance(error, Interrupted | KeyboardInterrupt)
            words = "" if wish else " ".join(f"{type(error).__name__}: {error}".split())
            self.tell(plan, INTERRUPTED if wish else FAILED, words[:1000])
            raise

    def _content(self, plan: Plan, state: str, error: str) -> dict[str, Any]:
        s = self.simulation
        performance = snapshot.performance_of(s, s.account)
        rate = performance["particle_steps_per_second"] if s.step else 0.0
        left = (plan.last - s.step) * len(s.particles) / rate if rate else None
        return {
            "state": state,
            "error": error or None,
            "run": self.identity["id"],
            "process": os.getpid(),
            "host": socket.gethostname(),
            "started": self._started,
            "updated": _now(),
            "step": s.step,
            "last_step": plan.last,
            "time": s.time,
            "until": plan.until,
            "progress": 1.0 if state in (ENDED, STOPPED) else s.step / max(plan.last, 1),
            "frames": self.identity["frames"],
            "particle_steps_per_second": rate,
            "seconds_left": left if state == RUNNING else None,
            "health": self._health,
            "checkpoint": self._checkpoint,
        }


def read_status(directory: str | Path) -> dict[str, Any]:
    """What ``status.json`` says, with the state ``"killed"`` where nobody runs who says so.

    It is ``"unknown"`` where that cannot be told: the lock may not be read, or there are none.

    Raises
    ------
    InputError
        Where there is none that can be read.
    """
    found = read_json(Path(directory) / STATUS, "directory")
    if not isinstance(found, dict):
        return {}
    if found.get("state") == RUNNING:
        whose = owner(directory)
        found["state"] = {None: KILLED, UNKNOWN: UNCERTAIN}.get(whose, RUNNING)
    return found


def status_lines(directory: str | Path) -> list[str]:
    """The status of a run's directory, for people."""
    s = read_status(directory)

    def given(key: str, form: str = "") -> str:
        value = s.get(key)
        if value is None:
            return "-"
        return format(value, form) if isinstance(value, int | float) else str(value)

    lines = [f"{directory}: {given('state')}" + (f" ({s['error']})" if s.get("error") else "")]
    lines.append(
        f"step {given('step')} of {given('last_step')}, t = {given('time', '.6g')} of "
        f"{given('until', '.6g')} s ({given('progress', '.1%')}), {given('frames')} frames"
    )
    lines.append(f"{given('particle_steps_per_second', '.3g')} particle-steps/s")
    if s.get("seconds_left") is not None:
        lines[-1] += f", {given('seconds_left', '.0f')} s left"
    checkpoint = s.get("checkpoint")
    if isinstance(checkpoint, dict):
        lines.append(f"checkpoint of step {checkpoint.get('step')}, {checkpoint.get('written')}")
    health = s.get("health")
    lines += [f"health: {line}" for line in health] if isinstance(health, list) else []
    if given("state") in (INTERRUPTED, KILLED):
        lines.append(f"go on with: particell resume {directory}")
    return lines


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
