from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable

import h5py
import numpy as np
import pytest

from particell.output import checkpoint
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
    path.write_bytes(whole.replace(b"particell-checkpoint 2 ", b"particell-checkpoint 9 ", 1))
    assert "has format 9, written by particell 0" in complaint()
    path.write_bytes(whole)
    with h5py.File(path, "r+") as file:
        del file["state/a"]
    assert "damaged" in complaint()
    checkpoint.seal(path)
    assert "there is no array 'state/a'" in complaint()


def test_every_flipped_bit_is_found(tmp_path):
    """In the header, in what HDF5 finds its way by, in numbers, in room that nobody uses."""
    path = tmp_path / "c.h5"
    write_checkpoint(path, {"a": np.arange(300.0), "b": {"c": np.arange(5), "text": "x" * 50}})
    whole = path.read_bytes()
    random = np.random.default_rng(17)
    inside = random.integers(0, 8 * len(whole), 300)
    for bit in {*inside.tolist(), *range(0, 8 * 600, 41)}:
        damaged = bytearray(whole)
        damaged[bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        with pytest.raises(CheckpointError) as error:
            read_checkpoint(path)
        assert "\n" not in str(error.value), bit


def _tree(change) -> Callable[[h5py.File], None]:
    """What changes the text of the tree."""

    def spoil(file: h5py.File) -> None:
        text = file["tree"][()].tobytes().decode()
        del file["tree"]
        file["tree"] = np.frombuffer(change(text).encode(), np.uint8)

    return spoil


def _instead(**options) -> Callable[[h5py.File], None]:
    """What stores an array in another way."""

    def spoil(file: h5py.File) -> None:
        del file["state/a"]
        file.create_dataset("state/a", **options)

    return spoil


def _soft(file: h5py.File) -> None:
    file["state/b"] = h5py.SoftLink("/state/b")


def _circle(file: h5py.File) -> None:
    file["state/again"] = file["state"]
    del file["state/a"]


MADE = {
    "no tree": lambda file: file.__delitem__("tree"),
    "a tree of text": lambda file: (
        file.__delitem__("tree"),
        file.create_dataset("tree", data="x"),
    ),
    "no JSON": _tree(lambda text: text[:-1]),
    "no parts": _tree(lambda text: "{}"),
    "deep": _tree(lambda text: "[" * 100_000),
    "deep tables": _tree(lambda text: '{"state": ' + '{"a": ' * 5000 + "1" + "}" * 5001),
    "a long number": _tree(lambda text: '{"meta": {}, "state": ' + "9" * 5000 + "}"),
    "the same array twice": _tree(
        lambda text: text.replace('"k": 3', '"k": {"__array__": "state/a"}')
    ),
    "an array by another name": _tree(lambda text: text.replace('"state/a"', "7")),
    "a group as an array": _tree(lambda text: text.replace('"state/a"', '"state"')),
    "an array that is not there": _tree(lambda text: text.replace('"state/a"', '"/nowhere"')),
    "a huge array": _instead(shape=(2**40,), dtype="f8"),
    "a huge array in chunks": _instead(shape=(2**40,), dtype="f8", chunks=(1024,)),
    "a compressed array": _instead(data=np.zeros(10**6), compression="gzip"),
    "text for numbers": _instead(data="text"),
    "records": _instead(data=np.zeros(3, "i4,f8")),
    "an outside file": _instead(shape=(4,), dtype="f8", external=[("secret", 0, 32)]),
    "a soft link": _soft,
    "a circle of groups": _circle,
}


@pytest.mark.parametrize("spoil", MADE.values(), ids=MADE)
def test_what_was_made_on_purpose(tmp_path, spoil):
    """With the right digest, which is no secret."""
    path = tmp_path / "c.h5"
    write_checkpoint(path, {"a": np.arange(4.0), "k": 3})
    with h5py.File(path, "r+") as file:
        spoil(file)
    checkpoint.seal(path)
    with pytest.raises(CheckpointError) as error:
        read_checkpoint(path)
    assert "\n" not in str(error.value) and len(str(error.value)) < 400


def test_the_last_two_are_kept(tmp_path, monkeypatch):
    path = tmp_path / "c.h5"

    def kept() -> list[int]:
        files = (path, checkpoint.previous(path))
        return [read_checkpoint(file)[0]["k"] for file in files if file.exists()]

    for k in range(3):
        write_checkpoint(path, {"k": k})
        assert kept() == [k, k - 1][: k + 1]

    def no_links(*_) -> None:
        raise OSError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", no_links)
    write_checkpoint(path, {"k": 3})
    assert kept() == [3, 2]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["c-previous.h5", "c.h5"]
    checkpoint.take_previous(path)
    assert kept() == [2]


FULL = """
import resource, signal, sys
import numpy as np
from particell.output.checkpoint import read_checkpoint, write_checkpoint
from particell.output.files import OutputError
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000))
for _ in range(2):
    try:
        write_checkpoint(sys.argv[1], {"a": np.arange(1e6), "b": np.arange(1e5)})
    except OutputError as error:
        print(error)
    assert len(read_checkpoint(sys.argv[1])[0]["a"]) == 10  # the old one
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
    assert {p.name for p in tmp_path.iterdir()} == {"c.h5", "c-previous.h5"}
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
