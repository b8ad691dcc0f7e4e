from __future__ import annotations

import pytest

from long_tests import LONG
from particell.compute.threads import Shared, available_threads, get_threads


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests of :mod:`long_tests`."""
    for item in items:
        if item.nodeid.startswith(LONG):
            item.add_marker("long")


@pytest.fixture
def always_shared(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every loop runs on all threads in use, however little there is to do."""
    if available_threads() < 2:
        pytest.skip("this machine has one thread")
    monkeypatch.setattr(Shared, "worth", lambda _, n: max(1, min(get_threads(), n)))


@pytest.fixture(autouse=True)
def no_label_is_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every figure that any test writes has all its text on the canvas: those of all cases too."""
    from particell.plots import Picture

    write = Picture.savefig

    def looked_at(self, *args, **options):
        write(self, *args, **options)
        beyond = cut_text(self)
        assert not beyond, f"beyond the figure's edge: {beyond}"

    monkeypatch.setattr(Picture, "savefig", looked_at)


def cut_text(figure, slack: float = 1.5) -> list[str]:
    """Texts of a figure that reach beyond its edge by more than some pixels."""
    from matplotlib.text import Text

    engine = figure.get_layout_engine()
    figure.set_layout_engine("none")  # axes stay where they were in the file
    figure.canvas.draw()  # places of labels are those of the last drawing, in its pixels
    figure.set_layout_engine(engine)
    renderer = figure.canvas.get_renderer()
    width, height = figure.canvas.get_width_height()
    found = []
    for artist in figure.findobj(lambda a: isinstance(a, Text) and a.get_visible()):
        if not artist.get_text().strip() or not _is_drawn(figure, artist):
            continue
        box = artist.get_window_extent(renderer)
        inside = box.x0 >= -slack and box.y0 >= -slack
        if not (inside and box.x1 <= width + slack and box.y1 <= height + slack):
            found.append(artist.get_text())
    return found


def _is_drawn(figure, text) -> bool:
    """Whether a text is no tick label beyond an axis' limits, and all that holds it is visible."""
    for axes in figure.findobj(lambda a: hasattr(a, "xaxis") and hasattr(a, "get_xlim")):
        for axis in (axes.xaxis, axes.yaxis):
            ticks = [*axis.get_major_ticks(), *axis.get_minor_ticks()]
            for tick in ticks:
                if text in (tick.label1, tick.label2):
                    low, high = sorted(axis.get_view_interval())
                    room = 1e-9 * (high - low)
                    return axes.axison and low - room <= tick.get_loc() <= high + room
    return True
