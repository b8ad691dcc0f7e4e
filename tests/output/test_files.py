from __future__ import annotations

import json

import numpy as np
import pytest

from particell.errors import InputError
from particell.output.files import OutputError, read_json, replacing, write_json


def test_failure_keeps_the_old_file(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(KeyError), replacing(path) as partial:
        partial.write_text("half")
        raise KeyError
    assert path.read_text() == "old"
    with replacing(path) as partial:
        partial.write_text("new")
    assert path.read_text() == "new"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_json_is_standard_json(tmp_path):
    path = tmp_path / "a.json"
    write_json(path, {"a": np.float32(0.5), "b": np.arange(2), "c": float("nan"), "d": (path,)})
    assert json.loads(path.read_text()) == {"a": 0.5, "b": [0, 1], "c": None, "d": [str(path)]}
    with pytest.raises(OutputError, match="No such file"):
        write_json(tmp_path / "no" / "a.json", {})
    path.write_text("{")
    with pytest.raises(InputError, match="readable JSON"):
        read_json(path, "summary")
