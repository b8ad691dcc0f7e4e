"""How objects show themselves: small tables for notebooks, and one line of text.

A notebook asks an object for ``_repr_html_``; each class says what is in its tables, and this
module how they look. Whatever a table shows is read from headers or from memory, never from a
trajectory.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import MISSING, fields
from html import escape
from typing import Any

import numpy as np

#: Most entries of a list that are written out.
MOST = 12
_LEFT = ' style="text-align:left"'


def table(rows: Iterable[Sequence[object]], header: Sequence[str] = (), caption: str = "") -> str:
    """An HTML table; whatever it holds is escaped. Without rows there is none.

    Parameters
    ----------
    rows
        The cells of each row.
    header
        The columns' names; without them the first cell of every row is its name.
    caption
        What stands above.
    """
    body = "".join(_row(row, 0 if header else 1) for row in rows)
    if not body:
        return ""
    top = f"<caption{_LEFT}>{escape(caption)}</caption>" if caption else ""
    head = f"<thead>{_row(header, len(header))}</thead>" if header else ""
    return f"<table>{top}{head}<tbody>{body}</tbody></table>"


def block(title: str, *tables: str) -> str:
    """Tables under one title."""
    return f'<div class="particell"><b>{escape(title)}</b>{"".join(tables)}</div>'


def _row(cells: Sequence[object], names: int) -> str:
    """A row of which the first cells are names."""
    parts: list[str] = []
    for k, cell in enumerate(cells):
        kind = "th" if k < names else "td"
        parts.append(f"<{kind}{_LEFT}>{escape(shown(cell))}</{kind}>")
    return f"<tr>{''.join(parts)}</tr>"


def shown(value: object) -> str:
    """A cell's text: numbers with four digits, names joined by commas, nothing for None."""
    if value is None:
        return ""
    if isinstance(value, bool | np.bool_ | str):
        return str(value)
    if isinstance(value, int | np.integer):
        return str(int(value))
    if isinstance(value, float | np.floating):
        return f"{value:.4g}"
    if isinstance(value, np.ndarray):
        return shown(value.tolist())
    if isinstance(value, dict):
        return shown([f"{name}: {shown(item)}" for name, item in value.items()])
    if isinstance(value, list | tuple):
        more = [f"… ({len(value)})"] if len(value) > MOST else []
        return ", ".join([shown(item) for item in value[:MOST]] + more)
    return str(value)


def span(values: np.ndarray) -> str:
    """``"least … greatest"`` of (n,), or of each component of (n, D); one number if they agree."""
    if not values.size:
        return "–"
    lows, highs = np.atleast_1d(values.min(axis=0)), np.atleast_1d(values.max(axis=0))
    ends = [(shown(a), shown(b)) for a, b in zip(lows, highs, strict=True)]
    return "; ".join(a if a == b else f"{a} … {b}" for a, b in ends)


def brief(instance: Any, unnamed: int = 1, without: Sequence[str] = ()) -> str:
    """A dataclass as the call that makes it, without what is at its default.

    Parameters
    ----------
    instance
        The dataclass.
    unnamed
        How many of its first fields are shown without their names.
    without
        Fields that follow from others.
    """
    parts: list[str] = []
    for k, f in enumerate(f for f in fields(instance) if f.name not in without):
        value = getattr(instance, f.name)
        if f.default is MISSING or value != f.default:
            # Behind one that is left out, a value without its name would be another's.
            parts.append(f"{value!r}" if k < unnamed and k == len(parts) else f"{f.name}={value!r}")
    return f"{type(instance).__name__}({', '.join(parts)})"
