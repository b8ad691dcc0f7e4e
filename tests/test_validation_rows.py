"""Which runs a validation consists of."""

from __future__ import annotations

from particell.validation import select


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
