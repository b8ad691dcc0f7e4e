from __future__ import annotations

import subprocess
import sys
import time

import h5py
import numpy as np
import pytest

from particell.output.checkpoint import read_checkpoint, write_checkpoint
from particell.output.files import CheckpointError, OutputError


def assert_same(one, two) -> None:
    assert type(one) is type(two)
    if isinstance(one, dict):
        assert list(one) == list(two)
        for key in one:
            assert_same(one[key], two[key])
    elif isinstance(one, list | tuple):
        assert len(one) == len(two)
        for a, b in zip(one, two, strict=True):
            assert_same(a, b)
    elif isinstance(one, np.ndarray | np.generic):
        assert one.dtype == two.dtype
        assert one.shape == two.shape
        assert one.tobytes() == two.tobytes()
    elif isinstance(one, float):
        assert one.hex() == two.hex()
    else:
        assert one == two


def test_round_trip_is_exact(tmp_path):
    random = np.random.default_rng(1)
    state = {
        "particles": {
            "x": random.random((7, 3)),
            "single": random.random(4).astype(np.float32),
            "flags": np.array([True, False]),
            "special": np.array([np.nan, -np.inf, -0.0, 5e-324]),
            "empty": np.zeros((0, 3), np.int32),
            "zero_dimensional": np.array(3.5),
            "complex": np.array([1 + 2j]),
            "fortran": np.asfortranarray(random.random((2, 3))),
            "bytes": np.array([0, 255], np.uint8),
            "big": np.array([2**63], np.uint64),
        },
        "concentration/L": np.arange(3.0),
        "concentration": {"L": np.arange(4.0)},
        "..": {"": np.arange(2)},
        "time": 0.1 + 0.2,
        "tiny": 5e-324,
        "minus": -0.0,
        "infinite": float("inf"),
        "step": 2**70,
        "nothing": None,
        "yes": True,
        "name": "µ-Kanal\n",
        "list": [1, 2.5, None, np.arange(2)],
        "tuple": (1, "a"),
        "scalars": [np.float64(0.1), np.int32(-3), np.bool_(True), np.float32(0.1)],
        "no items": {},
        "random": np.random.Generator(np.random.Philox(3)).bit_generator.state,
        "random128": np.random.PCG64(3).state,
    }
    write_checkpoint(tmp_path / "c.h5", state, {"note": "x", "step": 5})
    found, meta = read_checkpoint(tmp_path / "c.h5")
    assert_same(found, state)
    assert meta == {"note": "x", "step": 5}
    assert [p.name for p in tmp_path.iterdir()] == ["c.h5"]


def test_what_it_cannot_hold(tmp_path):
    for state in ({"a": object()}, {1: 2}, {"a": np.array([None])}, {"__array__": 1}):
        with pytest.raises(TypeError):
            write_checkpoint(tmp_path / "c.h5", state)
    assert not list(tmp_path.iterdir())


def test_bad_files_in_one_line(tmp_path):
    path = tmp_path / "c.h5"

    def complaint() -> str:
        with pytest.raises(CheckpointError) as error:
            read_checkpoint(path)
        assert "\n" not in str(error.value)
        assert str(path) in str(error.value)
        return str(error.value)

    assert "there is no checkpoint" in complaint()
    write_checkpoint(path, {"a": np.arange(10_000)})
    whole = path.read_bytes()
    for size in (len(whole) - 1, len(whole) // 2, 100, 0):
        path.write_bytes(whole[:size])
        assert "damaged" in complaint()
    path.write_bytes(b"something else" * 100)
    assert "damaged or no checkpoint" in complaint()
    with h5py.File(path, "w") as file:
        file["x"] = 1
    assert "not a checkpoint of particell" in complaint()
    path.write_bytes(whole)
    with h5py.File(path, "r+") as file:
        file.attrs["format_version"] = 99
    assert "has format 99" in complaint()
    path.write_bytes(whole)
    with h5py.File(path, "r+") as file:
        del file["state/a"]
    assert "damaged" in complaint()


FULL = """
import resource, signal, sys
import numpy as np
from particell.output.checkpoint import write_checkpoint
from particell.output.files import OutputError
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000))
for _ in range(2):
    try:
        write_checkpoint(sys.argv[1], {"a": np.arange(1e6), "b": np.arange(1e5)})
    except OutputError as error:
        print(error)
write_checkpoint(sys.argv[1], {"a": np.arange(11)})
"""


@pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX limits")
def test_no_room_keeps_the_old_one(tmp_path):
    path = tmp_path / "c.h5"
    write_checkpoint(path, {"a": np.arange(10)})
    done = subprocess.run(
        [sys.executable, "-c", FULL, str(path)], capture_output=True, text=True, check=True
    )
    assert done.stdout == f"cannot write {path}: File too large\n" * 2
    assert len(read_checkpoint(path)[0]["a"]) == 11
    assert [p.name for p in tmp_path.iterdir()] == ["c.h5"]
    with pytest.raises(OutputError, match="cannot write"):
        write_checkpoint(tmp_path / "no" / "c.h5", {})


CHILD = """
import sys
import numpy as np
from particell.output.checkpoint import write_checkpoint
k = 0
while True:
    write_checkpoint(sys.argv[1], {"k": k, "a": np.full(200_000, k)})
    if k == 1:
        print("ready", flush=True)
    k += 1
"""


@pytest.mark.parametrize("delay", [0.0, 0.007, 0.03])
def test_killed_writer_leaves_a_good_one(tmp_path, delay):
    path = tmp_path / "c.h5"
    with subprocess.Popen(
        [sys.executable, "-c", CHILD, str(path)], stdout=subprocess.PIPE, text=True
    ) as child:
        assert child.stdout.readline() == "ready\n"
        time.sleep(delay)
        child.kill()
    state, _ = read_checkpoint(path)
    assert state["k"] >= 1
    assert np.all(state["a"] == state["k"])
