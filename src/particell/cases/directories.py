"""Directories of runs: whose case it is, going on with it, and drawing its figures again.

A directory is data: nothing that it names is imported but the program's own cases.
"""

from __future__ import annotations

import os
from pathlib import Path

from particell import cases
from particell.cases import execution
from particell.cases.base import Case, Context
from particell.cases.files import with_settings
from particell.errors import InputError
from particell.output.files import read_json, reason
from particell.output.run import CASE, CHECKPOINT, TRAJECTORY, Run


def resume(
    directory: str | Path,
    progress: bool = True,
    kind: type[Case] | str | None = None,
    before: bool = False,
    until: object = None,
) -> int:
    """Go on from the last checkpoint of a directory; gives the exit status.

    ``kind`` is the class of a case that is not built in, as for :func:`read_case`; ``before`` takes
    the checkpoint before the last one; ``until`` is another end, in s or with a unit.

    Raises
    ------
    InputError, CheckpointError
        Where the directory holds no run, or its checkpoint cannot be read.
    """
    directory = Path(directory)
    case, context = read_case(directory, kind)
    if until is not None:
        case = ending_at(case, until)
    options = {"before": before, "again": until is not None}
    return execution.go_on(case, context, directory, progress, **options)


def ending_at(case: Case, until: object) -> Case:
    """The same case with another end.

    Raises
    ------
    InputError
        Where the case has no such parameter, or that is no time.
    """
    parameters = case.model_dump(mode="json")
    paths = {"until": "until", "run": "run.until"}
    key = next((paths[name] for name in paths if name in type(case).model_fields), None)
    if key is None:
        allowed = f"left out: '{case.name}' says itself when it ends"
        raise InputError("--until", until, allowed)
    return type(case)(**with_settings(parameters, {key: until}))


def replot(directory: str | Path, kind: type[Case] | str | None = None) -> list[Path]:
    """Draw the figures of a directory again; gives the paths of the PNG files.

    Of a run that a script has made, figures of everything are drawn. ``kind`` is the class of a
    case that is not built in, as for :func:`read_case`.
    """
    directory = Path(directory)
    by_script = kind is None and not os.path.exists(directory / CASE)
    if by_script and os.path.isfile(directory / TRAJECTORY):
        return figures_of_any(Run(directory), directory)
    case, _ = read_case(directory, kind)
    return case.figures(Run(directory), directory)


def figures_of_any(run: Run, directory: Path) -> list[Path]:
    """Figures of a run that no case knows: all observables, and the fields of the last frame."""
    found = []
    if run.observable_names:
        found.append(directory / "observables.png")
        run.plot.series(path=found[-1])
    for name in run.field_names:
        if name.partition("/")[0] not in ("position", "image"):
            found.append(directory / f"{name.replace('/', '-')}.png")
            run.plot.scatter(name, path=found[-1])
    return found


def read_case(directory: str | Path, kind: type[Case] | str | None = None) -> tuple[Case, Context]:
    """The case that a directory was made from, and how it was run.

    Parameters
    ----------
    directory
        Of a run. It is data: nothing that it names is imported but the program's own cases.
    kind
        The class of a case that is not built in, or its ``"module:Class"``.

    Raises
    ------
    InputError
        Where it holds no run, or one of a case that is neither built in nor given.
    """
    path = Path(directory) / CASE
    if not os.path.isfile(path):
        allowed = f"one with the output of a run ({CASE})"
        if os.path.isfile(path.with_name(CHECKPOINT)):
            allowed = (
                f"with a case ({CASE}); this run was made by a script: build its simulation there, "
                f"restore(read_checkpoint('{path.with_name(CHECKPOINT)}')[0]), and run again"
            )
        raise InputError("directory", str(directory), allowed)
    found = read_json(path, "case")
    try:
        name, reference = found["case"], found.get("class")
        parameters, context = dict(found["parameters"]), Context(**found["context"])
        described = cases.recorded(str(name), reference, kind)
    except InputError:
        raise
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        allowed = f"a case file of particell ({type(error).__name__}: {reason(error)})"
        raise InputError("case", str(path), allowed) from None
    return described(**parameters), context
