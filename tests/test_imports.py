"""Who imports whom: no circles, those of typing and of lazy imports included."""

from __future__ import annotations

import ast
import functools
from collections.abc import Iterator, Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

import particell

ROOT = Path(particell.__file__).parent


def sources() -> dict[str, str]:
    """The program's modules: their texts by name."""
    found = {}
    for path in ROOT.rglob("*.py"):
        parts = path.relative_to(ROOT.parent).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        found[name] = path.read_text(encoding="utf-8")
    return found


def imported(text: str) -> Iterator[tuple[str, str]]:
    """Module and name of all imports, wherever in the text they are (without a name: empty)."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, "a relative import, which is not looked through here"
            yield from ((node.module or "", alias.name) for alias in node.names)


def graph(texts: Mapping[str, str]) -> dict[str, set[str]]:
    """For each module the others that it imports."""
    found: dict[str, set[str]] = {}
    for name, text in texts.items():
        pairs = imported(text)
        targets = {f"{m}.{n}" if f"{m}.{n}" in texts else m for m, n in pairs}
        found[name] = (targets & set(texts)) - {name}
    return found


@functools.cache
def program() -> dict[str, set[str]]:
    """The :func:`graph` of the program."""
    return graph(sources())


def circle(edges: Mapping[str, set[str]]) -> list[str]:
    """The modules of one circle of imports in order; empty without any."""
    try:
        TopologicalSorter(edges).prepare()
    except CycleError as error:
        return error.args[1]
    return []


@pytest.mark.parametrize(
    "text",
    [
        "from particell.a import thing",
        "from particell import a",
        "import particell.a",
        "def f():\n    from particell.a import thing",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from particell.a import thing",
        "import particell",  # which imports the others
    ],
)
def test_circles_of_every_kind_are_found(text):
    texts = {"particell": "", "particell.a": "from particell.b import x", "particell.b": text}
    if text == "import particell":
        texts["particell"] = "def __getattr__(name):\n    import particell.b"
    assert {"particell.b"} < set(circle(graph(texts)))
    assert circle(graph({**texts, "particell.b": "import numpy"})) == []


def test_no_circle_of_imports():
    assert " -> ".join(circle(program())) == ""


def reached(names: list[str]) -> set[str]:
    """The modules that some import, and what these import, and so on."""
    edges, found, waiting = program(), set(), list(names)
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            waiting += edges[name]
    return found


def test_execution_and_ensembles_know_recipes_but_no_cases():
    execution = "particell.cases.execution"
    below = [name for name in program() if name.startswith("particell.ensemble")]
    found = reached([execution, *below])
    above = {n for n in found if n.startswith(("particell.cases", "particell.casefile"))}
    assert above == {execution} and "particell.recipe" in found
