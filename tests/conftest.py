from __future__ import annotations

import pytest

from particell.compute.threads import Shared, available_threads, get_threads


@pytest.fixture
def always_shared(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every loop runs on all threads in use, however little there is to do."""
    if available_threads() < 2:
        pytest.skip("this machine has one thread")
    monkeypatch.setattr(Shared, "worth", lambda _, n: max(1, min(get_threads(), n)))
