"""The command line.

Exit status: 0 done; 1 done, but a metric or the run's health is beyond its limit; 2 the input is
wrong; 3 the run broke; 70 something that nobody foresaw; 130 interrupted.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NoReturn, TextIO

import click

from particell.errors import CacheWarning, InputError, LawWarning, ParticellError
from particell.exits import (
    BROKEN,
    FAILED,
    INTERRUPTED,
    complain,
    guarded,
    one_line,
    unforeseen,
)
from particell.settings import described_case, parse_settings
from particell.streams import Heedless, mend_streams

_run_options = [
    click.option("--seed", type=int, default=1, show_default=True, help="Of the random numbers."),
    click.option("--threads", type=int, help="CPU threads (default: all)."),
    click.option("--backend", type=click.Choice(["cpu", "cuda"]), default="cpu", show_default=True),
    click.option(
        "--precision",
        type=click.Choice(["float64", "float32"]),
        default="float64",
        show_default=True,
    ),
    click.option("--progress/--no-progress", default=True, help="Show a progress bar."),
]


def run_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """The options that commands which run something share."""
    for option in reversed(_run_options):
        command = option(command)
    return command


def _importable(context: click.Context, option: click.Parameter, value: str | None) -> str | None:
    """Let a module that the user names be found where the user is, as ``python -m`` does."""
    if value is not None and "" not in sys.path:
        sys.path.insert(0, "")
    return value


#: Which class a directory's case is of, where the program does not know it.
own_case = click.option(
    "--case",
    "kind",
    metavar="MODULE:CLASS",
    callback=_importable,
    help="The class of a case of your own (imported from here or from where Python looks).",
)


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="particell", message="%(prog)s %(version)s")
def cli() -> None:
    """Particle-based multiphysics at the scale of cells."""


@cli.command("list")
@click.argument("case", required=False)
def list_cases(case: str | None) -> int:
    """List the built-in cases, or the parameters of one CASE."""
    from particell import cases

    if case is None:
        width = max((len(name) for name in cases.names()), default=0)
        for name in cases.names():
            click.echo(f"{name:{width}}  {cases.title(name)}")
        return 0
    kind = cases.load(case)
    click.echo(f"{kind.name}: {kind.title}")
    rows = kind.describe()
    width = max((len(row[0]) for row in rows), default=0)
    for name, default, unit, description in rows:
        words = " ".join(description.split())
        click.echo(f"  {name:{width}}  {f'{default} {unit}'.strip():20}  {words}".rstrip())
    return 0


@cli.command()
@click.argument("case", metavar="CASE|FILE.toml")
@click.option("--set", "settings", multiple=True, metavar="KEY=VALUE", help="Set a parameter.")
@click.option("--out", type=click.Path(path_type=Path), help="Directory (default: out/CASE).")
@click.option("--overwrite", is_flag=True, help="Replace an earlier run in that directory.")
@run_options
def run(
    case: str, settings: tuple[str, ...], out: Path | None, overwrite: bool, **options: Any
) -> int:
    """Run a case, by its name or as a TOML file describes it."""
    from particell.cases.execution import execute

    instance = described_case(case, settings)
    directory = out or Path("out") / instance.name
    return guarded(directory, lambda: execute(instance, directory, overwrite=overwrite, **options))


@cli.command()
@click.argument("file", type=click.Path(path_type=Path), default="case.toml")
def new(file: Path) -> int:
    """Write a commented case file to start from (default: case.toml)."""
    from particell.casefile.starting import write_starting_file

    write_starting_file(file)
    click.echo(f"{file}: look at it, then: particell check {file}; particell run {file}")
    return 0


@cli.command()
@click.argument("case", metavar="CASE|FILE.toml")
@click.option("--set", "settings", multiple=True, metavar="KEY=VALUE", help="Set a parameter.")
@click.option("--timing/--no-timing", default=True, help="Time a few steps (they may compile).")
@click.option("--threads", type=int, help="CPU threads (default: all).")
def check(case: str, settings: tuple[str, ...], timing: bool, threads: int | None) -> int:
    """Say what would run, without running it: particles, time step, memory, time needed.

    Exit status 1 where it is known already that the run could not be trusted.
    """
    from particell.casefile.report import UNHEALTHY, report

    status = 0
    for line in report(described_case(case, settings), timing, threads):
        click.echo(line)
        status = FAILED if line.startswith(UNHEALTHY) else status
    return status


@cli.command()
@click.argument("case", metavar="CASE|FILE.toml")
@click.option("--set", "settings", multiple=True, metavar="KEY=VALUE", help="Set a parameter.")
@click.option("--equations", is_flag=True, help="Print what a pair adds (needs SymPy).")
@click.option("--exchange", is_flag=True, help="Print the fields that are read and written.")
@click.option("--show", metavar="SWEEP", help="Print the generated loop of a sweep.")
def laws(
    case: str, settings: tuple[str, ...], equations: bool, exchange: bool, show: str | None
) -> int:
    """List the laws that a case's particles obey, sweep by sweep."""
    from particell.cases.base import Context
    from particell.schemes.listing import describe, generated

    simulation = described_case(case, settings).build(Context(seed=1))
    lines = generated(simulation, show) if show else describe(simulation, equations, exchange)
    for line in lines:
        click.echo(line)
    return 0


@cli.command()
def schema() -> int:
    """Print the JSON schema of case files, for editors."""
    import json

    from particell.casefile.case import FileCase

    click.echo(json.dumps(FileCase.model_json_schema(), indent=1, ensure_ascii=False))
    return 0


@cli.command()
@click.argument("case", metavar="CASE|FILE.toml")
@click.option("--runs", type=int, required=True, help="Number of realisations.")
@click.option("--processes", type=int, help="Local processes (default: one per core).")
@click.option("--scheduler", "client", metavar="ADDRESS", help="Run on this dask cluster.")
@click.option("--set", "settings", multiple=True, metavar="KEY=VALUE", help="Set a parameter.")
@click.option("--out", type=click.Path(path_type=Path), help="Directory (default: out/CASE-runs).")
@click.option("--overwrite", is_flag=True, help="Replace what that directory holds.")
@run_options
def ensemble(case: str, settings: tuple[str, ...], out: Path | None, **options: Any) -> int:
    """Run many realisations of a case, each with a seed of its own and one thread."""
    from particell.cases import ensembles

    instance = described_case(case, settings)
    return ensembles.run(instance, out or Path("out") / f"{instance.name}-runs", **options)


@cli.command()
@click.argument("directory", type=click.Path(path_type=Path))
@own_case
@click.option("--progress/--no-progress", default=True, help="Show a progress bar.")
@click.option("--previous", is_flag=True, help="From the checkpoint before the last one.")
@click.option("--until", metavar="TIME", help="Another end, in s or with a unit; it may be later.")
def resume(
    directory: Path, progress: bool, kind: str | None, previous: bool, until: str | None
) -> int:
    """Go on with the run or the ensemble in DIRECTORY from its last checkpoints."""
    from particell.cases import directories, ensembles
    from particell.ensemble import is_ensemble

    if is_ensemble(directory):
        if previous or until is not None:
            allowed = "left out for an ensemble"
            raise InputError("--previous" if previous else "--until", previous or until, allowed)
        return ensembles.resume(directory, progress, kind)
    end = None if until is None else parse_settings([f"until={until}"])["until"]
    options = (progress, kind, previous, end)
    return guarded(directory, lambda: directories.resume(directory, *options))


@cli.command()
@click.argument("directory", type=click.Path(path_type=Path))
@own_case
def plot(directory: Path, kind: str | None) -> int:
    """Draw the figures of the run or the ensemble in DIRECTORY again."""
    from particell.cases import directories, ensembles
    from particell.ensemble import is_ensemble

    draw = ensembles.plot if is_ensemble(directory) else directories.replot
    for path in draw(directory, kind):
        click.echo(path)
    return 0


@cli.command()
@click.argument("directory", type=click.Path(path_type=Path))
@click.option(
    "--to", "kind", type=click.Choice(["vtkhdf", "h5md"]), default="vtkhdf", show_default=True
)
@click.option("--out", type=click.Path(path_type=Path), help="File (default: in DIRECTORY).")
def export(directory: Path, kind: str, out: Path | None) -> int:
    """Export the run in DIRECTORY: for ParaView (vtkhdf, the default), or MDAnalysis (h5md)."""
    from particell.output.export import export_vtkhdf
    from particell.output.export_h5md import export_h5md
    from particell.output.run import Run

    write = {"vtkhdf": export_vtkhdf, "h5md": export_h5md}[kind]
    click.echo(write(Run(directory), out or directory / f"run.{kind}"))
    return 0


@cli.command()
@click.argument("names", nargs=-1, metavar="[CASE|GROUP]...")
@click.option("--full", is_flag=True, help="At the papers' sizes.")
@click.option(
    "--out", type=click.Path(path_type=Path), help="Keep the output and a page of it here."
)
@click.option("--overwrite", is_flag=True, help="Make finished runs there again.")
@click.option(
    "--before",
    type=click.Path(path_type=Path),
    help="A page made before: rows that took long then are taken from it.",
)
@click.option(
    "--longest", type=float, default=10.0, show_default=True, help="What is long, in minutes."
)
@run_options
def validate(
    names: tuple[str, ...], full: bool, out: Path | None, overwrite: bool, **options: Any
) -> int:
    """Run cases (default: all) and compare with exact solutions, references and the papers.

    Groups: sdpd-ssa, stochastic, transport-velocity. With --out, one page of all numbers is
    written, and a run that is finished there, with the same version and parameters, is not made
    again.
    """
    from particell import validation

    return validation.validate(names, full, out, overwrite, **options)


@cli.command()
@click.option("--json", "path", type=click.Path(path_type=Path), help="Also write to this file.")
def bench(path: Path | None) -> int:
    """Measure the speed of the parts and of whole steps on this machine."""
    from particell.bench import main as measure

    measure(path)
    return 0


@cli.command()
@click.argument("directory", type=click.Path(path_type=Path), required=False)
def info(directory: Path | None) -> int:
    """Versions, backends, threads and devices; or how far the run in DIRECTORY is."""
    import os
    from importlib.metadata import version

    from particell.compute.threads import available_threads
    from particell.output.summary import versions

    if directory is not None:
        from particell.status import status_lines

        for line in status_lines(directory):
            click.echo(line)
        return 0
    click.echo(f"particell {version('particell')}")
    click.echo(", ".join(f"{name} {number}" for name, number in versions().items()))
    click.echo(f"cpu: {available_threads()} threads (of {os.cpu_count()} cores)")
    click.echo(f"cuda: {_cuda_devices()}")
    return 0


def _cuda_devices() -> str:
    try:
        from numba import cuda

        if not cuda.is_available():
            return "no usable GPU"
        return ", ".join(f"{g.id} {_text(g.name)}" for g in cuda.gpus)
    except ImportError:
        return "numba-cuda is not installed (extra 'cuda')"


def _text(name: str | bytes) -> str:
    return name.decode() if isinstance(name, bytes) else name


def call(arguments: Sequence[str] | None = None) -> int:
    """Run a command line; gives the exit status.

    Parameters
    ----------
    arguments
        Without the name of the program; by default those of this process.
    """
    from particell.output.files import OutputError

    try:
        status = cli.main(
            args=None if arguments is None else list(arguments),
            prog_name="particell",
            standalone_mode=False,
        )
    except click.ClickException as error:
        error.show()
        return error.exit_code
    except (click.Abort, KeyboardInterrupt) as error:
        if isinstance(error.__cause__, EOFError):  # which click takes for a wish to stop
            return unforeseen(error.__cause__)
        click.echo("interrupted", err=True)
        return INTERRUPTED
    except (OutputError, MemoryError) as error:
        click.echo(f"error: {one_line(error)}", err=True)
        return BROKEN
    except ParticellError as error:
        return complain(error)
    except Exception as error:
        return unforeseen(error)
    return status or 0


def _say(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Show a warning in one line, without the place in the program that it came from."""
    with contextlib.suppress(OSError, ValueError):
        if issubclass(category, LawWarning | CacheWarning):
            click.echo(f"warning: {message}", err=True)
        else:
            text = warnings.formatwarning(message, category, filename, lineno, line)
            click.echo(text, err=True, nl=False)


def _interrupt(number: int, frame: object) -> None:
    raise KeyboardInterrupt


def main() -> NoReturn:
    """The program ``particell``."""
    mend_streams()
    warnings.showwarning = _say
    with contextlib.suppress(ValueError, AttributeError):  # before a run begins, as Ctrl-C does
        signal.signal(signal.SIGTERM, _interrupt)
    streams = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = (Heedless(stream) for stream in streams)  # type: ignore[assignment]
    status = call()
    for stream in streams:
        try:
            stream.flush()
        except (OSError, ValueError):  # what is left in it would make a noise at the end
            with contextlib.suppress(OSError, ValueError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    sys.exit(status)
