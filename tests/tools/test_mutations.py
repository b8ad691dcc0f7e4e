"""What the script that mutates takes for computing, and what it makes of it."""

from __future__ import annotations

from mutations import Finder, applied, chosen

SOURCE = b'''"""Text with 2 + 2."""
import math


def force(x: float = 1.0, walls=False) -> "a + b":
    """And 3 * 3."""
    if x < 0.0:
        raise ValueError(f"{x + 1}")
    if walls and not x > 2.0:
        self.save(x, -x)
    return math.sin(x) / "\xc3\xa9".count("e" + "f")
'''


def mutants(refusals=False):
    found = {}
    for line, mutations in Finder(SOURCE, refusals).by_line().items():
        lines = [applied(SOURCE, m).decode().splitlines()[line - 1].strip() for m in mutations]
        found[line] = set(lines)
    return found


def test_what_is_mutated():
    found = mutants()
    assert found == {
        5: {
            'def force(x: float = 2.0, walls=False) -> "a + b":',
            'def force(x: float = 1.0, walls=True) -> "a + b":',
        },
        9: {
            "if walls or not x > 2.0:",
            "if walls and x > 2.0:",
            "if walls and not x <= 2.0:",
            "if walls and not x > 4.0:",
        },
        10: {"pass", "self.save(x, x)"},
        11: {
            'return math.sin(x) * "é".count("e" + "f")',
            'return math.cos(x) / "é".count("e" + "f")',
        },
    }
    assert set(mutants(refusals=True)) == {5, 7, 9, 10, 11}


def test_one_for_each_line_and_the_same_for_a_seed():
    first, again, other = (chosen(SOURCE, seed) for seed in ("1", "1", "4"))
    assert [m.line for m in first] == [5, 9, 10, 11]
    assert first == again != other
