"""Executes the notebooks beside this file and keeps what they show.

    python docs/notebooks/execute.py [NAME ...]

The documentation shows them as they are committed; `make notebooks` brings them up to date.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import nbformat
from nbclient import NotebookClient

HERE = Path(__file__).parent
#: Seconds that a cell may take: the first one that runs may compile.
LIMIT = 900


def executed(path: Path, directory: str) -> nbformat.NotebookNode:
    """The notebook with new outputs, run in a directory; a cell that fails raises its error."""
    notebook = nbformat.read(path, as_version=4)
    client = NotebookClient(
        notebook,
        timeout=LIMIT,
        startup_timeout=LIMIT,
        resources={"metadata": {"path": directory}},
    )
    client.execute()
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)  # times of day, which are new every time
    notebook.metadata["language_info"] = {"name": "python"}
    return notebook


def main() -> None:
    """Execute the named notebooks, or all."""
    for path in sorted(HERE.glob("*.ipynb")):
        if len(sys.argv) == 1 or path.stem in sys.argv[1:]:
            with tempfile.TemporaryDirectory() as directory:
                nbformat.write(executed(path, directory), path)
            print(f"{path.name}: {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
