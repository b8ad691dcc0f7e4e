"""A bar and lines for who watches a run: where nobody can read them, the run goes on without."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from typing import Any

from tqdm import tqdm

#: What a stream says that is closed, full, or has nobody at its other end.
BROKEN = (OSError, ValueError, AttributeError)


def say(text: str) -> None:
    """A line on stderr, above the bar."""
    if sys.stderr is not None:
        with contextlib.suppress(*BROKEN):
            tqdm.write(text, sys.stderr)


class Bar:
    """A progress bar that no broken stream keeps a run from.

    Parameters
    ----------
    shown
        Whether to show it.
    **options
        Of tqdm.
    """

    def __init__(self, shown: bool, **options: Any):
        self._bar: tqdm | None = None
        if shown and sys.stderr is not None:
            with contextlib.suppress(*BROKEN):
                self._bar = tqdm(**options)

    @contextlib.contextmanager
    def _trying(self) -> Iterator[tqdm | None]:
        try:
            yield self._bar
        except BROKEN:
            self._bar = None

    def update(self, number: int = 1) -> None:
        """So much more is done."""
        with self._trying() as bar:
            if bar is not None:
                bar.update(number)

    def words(self, text: str) -> None:
        """What stands behind the bar from its next update on."""
        with self._trying() as bar:
            if bar is not None:
                bar.set_postfix_str(text, refresh=False)

    def total(self, number: int) -> None:
        """How much there is to do in all."""
        if self._bar is not None:
            self._bar.total = number

    def __enter__(self) -> Bar:
        return self

    def __exit__(self, *_: object) -> None:
        with self._trying() as bar:
            if bar is not None:
                bar.close()
