"""Largest differences of reference data made anew from what the project has stored.

Usage: ``python references/compare.py DIR``, with the directory that a script of this folder wrote.
"""

import argparse
import pathlib

import numpy as np

STORED = pathlib.Path(__file__).parents[1] / "src" / "particell" / "cases" / "data"


def load(path):
    """The numbers of a data file, (rows, columns)."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return np.loadtxt([line for line in lines if not line.startswith("#")], delimiter=",", ndmin=2)


def difference(path):
    """Largest absolute difference, or a word where there is nothing of that name and form."""
    stored = STORED / path.name
    if not stored.exists():
        return "not stored"
    old, new = load(stored), load(path)
    if old.shape != new.shape:
        return f"{new.shape} instead of {old.shape} numbers"
    return float(np.nanmax(np.abs(old - new)))


def main():
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("directory", type=pathlib.Path)
    for path in sorted(parser.parse_args().directory.glob("*.csv")):
        found = difference(path)
        print(f"{path.name}: {found if isinstance(found, str) else format(found, '.1e')}")


if __name__ == "__main__":
    main()
