"""Which runs a validation consists of."""

from __future__ import annotations

from particell.validation import select
from particell.validation.page import Page
from particell.validation.rows import GROUPS


def test_groups_take_the_rows_of_their_scheme():
    for name, scheme in (("sdpd-ssa", "sdpd"), ("transport-velocity", "transport-velocity")):
        for full in (False, True):
            rows = select([name], full)
            found = [row.kind(**row.parameters) for row in rows]
            assert {c.scheme for c in found if hasattr(c, "scheme")} == {scheme}
    once = select(["taylor-green"], True)
    assert len(select(["taylor-green", "transport-velocity"], True)) == len(
        select(["transport-velocity"], True)
    ) + sum(row.parameters.get("scheme") is None for row in once)


def test_every_row_stands_in_a_group():
    grouped = select(list(GROUPS), True)
    assert [row.command for row in select([], True) if row not in grouped] == []


def test_a_page_says_what_is_missing(tmp_path):
    rows = select(["couette"], True)
    page = Page(tmp_path, rows, "particell validate --full couette")
    page.add(rows[0], 3, tmp_path / "nowhere")
    text = (tmp_path / "index.md").read_text()
    done, missing = text.split("## Not made yet")
    assert f"| {rows[0].settings} | did not finish" in done
    assert [row.command in missing for row in rows] == [False, True, True]
