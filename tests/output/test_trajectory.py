from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
import sample_run as sample

from particell.errors import InputError
from particell.geometry.domain import Domain
from particell.output.files import OutputError
from particell.output.run import Run
from particell.output.trajectory import TrajectoryWriter


def write(path, frames: int, first: int = 0) -> TrajectoryWriter:
    writer = TrajectoryWriter(
        path, sample.domain(), sample.static(), sample.GROUPS, "Ada", '{"a": 1}'
    )
    for k in range(first, frames):
        writer.append(10 * k, 0.5 * k, sample.frame(k), sample.observables(k))
    return writer


def assert_frames(path, frames: int) -> None:
    run = Run(path)
    assert run.steps.tolist() == [10 * k for k in range(frames)]
    assert run.times.tolist() == [0.5 * k for k in range(frames)]
    for k in range(frames):
        found, expected = run.frame(k), sample.frame(k)
        assert found.keys() == expected.keys()
        for name, values in expected.items():
            assert found[name].dtype == values.dtype
            assert np.array_equal(found[name], values)
    assert run.observable("kinetic_energy").tolist() == [0.5 * k for k in range(frames)]


def test_is_h5md(tmp_path):
    write(tmp_path / "run.h5", 3).close()
    with h5py.File(tmp_path / "run.h5") as file:
        assert file["h5md"].attrs["version"].tolist() == [1, 1]
        assert file["h5md/author"].attrs["name"] == "Ada"
        assert file["h5md/creator"].attrs["name"] == "particell"
        assert file["h5md/creator"].attrs["version"]
        particles = file["particles/all"]
        assert particles["box"].attrs["dimension"] == 2
        assert list(particles["box"].attrs["boundary"]) == ["periodic", "none"]
        assert particles["box"].attrs["lower"].tolist() == [-1.0, 0.0]
        assert particles["box/edges/value"][-1].tolist() == [4.0, 2.0]
        for name in ("position", "velocity", "density", "image", "concentration/L", "box/edges"):
            assert set(particles[name]) == {"step", "time", "value"}
            assert particles[f"{name}/step"][:].tolist() == [0, 10, 20]
        assert particles["velocity/step"] == particles["position/step"]  # one dataset
        assert h5py.check_enum_dtype(particles["species"].dtype) == {"fluid": 0, "membrane": 1}
        assert particles["species"][:].tolist() == [0, 1, 0, 0, 1]
        assert particles["mass"].attrs["si_unit"] == "kg"
        assert particles["position/value"].attrs["si_unit"] == "m"
        assert file["observables/kinetic_energy/value"][:].tolist() == [0.0, 0.5, 1.0]
        assert file["parameters/run"][()] == b'{"a": 1}'


def test_can_be_read_while_it_grows(tmp_path):
    path = tmp_path / "run.h5"
    writer = write(path, 2)
    assert_frames(path, 2)
    run = Run(path)
    writer.append(20, 1.0, sample.frame(2), sample.observables(2))
    assert len(run) == 3
    assert np.array_equal(run.field("velocity")[-1], sample.frame(2)["velocity"])
    writer.sync()
    writer.close()
    assert_frames(path, 3)


@pytest.mark.parametrize("step, kept", [(20, 3), (29, 3), (0, 1), (1000, 5)])
def test_resume_drops_later_frames(tmp_path, step, kept):
    path = tmp_path / "run.h5"
    write(path, 5).close()
    with TrajectoryWriter.resume(path, step) as writer:
        assert_frames(path, kept)
        for k in range(kept, 7):
            writer.append(10 * k, 0.5 * k, sample.frame(k), sample.observables(k))
    assert_frames(path, 7)
    with h5py.File(path) as file:
        assert file["particles/all/velocity/step"] == file["particles/all/position/step"]
        assert file["h5md/author"].attrs["name"] == "Ada"
        assert file["parameters/run"][()] == b'{"a": 1}'
    assert [p.name for p in tmp_path.iterdir()] == ["run.h5"]


CHILD = """
import sys
sys.path.insert(0, sys.argv[2])
import sample_run as sample
from particell.output.trajectory import TrajectoryWriter
with TrajectoryWriter(sys.argv[1], sample.domain(), sample.static(), sample.GROUPS) as writer:
    k = 0
    while True:
        writer.append(10 * k, 0.5 * k, sample.frame(k), sample.observables(k))
        k += 1
        if k == 3:
            print("ready", flush=True)
"""


@pytest.mark.parametrize("delay", [0.0, 0.013, 0.05, 0.11])
def test_killed_writer(tmp_path, delay):
    path = tmp_path / "run.h5"
    command = [sys.executable, "-c", CHILD, str(path), str(Path(__file__).parent)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout.readline() == "ready\n"
        time.sleep(delay)
        frames = len(Run(path))  # while it grows
        assert frames >= 3
        child.kill()
    with pytest.raises(OSError, match="open"):  # this is what resume is up against
        h5py.File(path, "r+")
    assert len(Run(path)) >= frames
    assert_frames(path, len(Run(path)))
    with TrajectoryWriter.resume(path, 20) as writer:
        writer.append(30, 1.5, sample.frame(3), sample.observables(3))
    assert_frames(path, 4)
    h5py.File(path, "r").close()


def test_refusals(tmp_path):
    with pytest.raises(InputError, match="existing file"):
        TrajectoryWriter.resume(tmp_path / "none.h5", 0)
    (tmp_path / "text.h5").write_text("no HDF5")
    with pytest.raises(InputError, match="an HDF5 file"):
        TrajectoryWriter.resume(tmp_path / "text.h5", 0)
    with h5py.File(tmp_path / "other.h5", "w", libver="latest") as file:
        file["x"] = 1
    with pytest.raises(InputError, match="an H5MD file"):
        Run(tmp_path / "other.h5")
    write(tmp_path / "run.h5", 3, first=1).close()
    with pytest.raises(InputError, match="a frame up to step 5"):
        TrajectoryWriter.resume(tmp_path / "run.h5", 5)
    with pytest.raises(OutputError, match=r"cannot write .*: No such file"):
        write(tmp_path / "no" / "run.h5", 1)


def test_frames_must_be_alike(tmp_path):
    with write(tmp_path / "run.h5", 2) as writer:
        fewer = sample.frame(2)
        del fewer["density"]
        with pytest.raises(ValueError, match="fields of a frame"):
            writer.append(20, 1.0, fewer, sample.observables(2))
        with pytest.raises(ValueError, match="observables of a frame"):
            writer.append(20, 1.0, sample.frame(2), {})
        shorter = sample.frame(2) | {"density": np.zeros(3)}
        with pytest.raises(ValueError, match="shape"):
            writer.append(20, 1.0, shorter, sample.observables(2))
    assert_frames(tmp_path / "run.h5", 2)


def test_large_frames_are_compressed_and_stay_so(tmp_path):
    """Of what fills a chunk by itself; one of several frames would be written elsewhere anew."""
    n, path = 4000, tmp_path / "run.h5"
    static = {"id": np.arange(n), "group": np.zeros(n, np.int32), "mass": np.ones(n)}
    frame = {"position": np.random.default_rng(1).random((n, 3)), "still": np.zeros((n, 3))}
    box = Domain((0, 0, 0), (1, 1, 1), "xyz")
    with TrajectoryWriter(path, box, static, ["all"]) as writer:
        for k in range(3):
            writer.append(k, float(k), frame, {"a": float(k)})
    with TrajectoryWriter.resume(path, 1):
        pass
    with h5py.File(path) as file:
        still = file["particles/all/still/value"]
        assert (still.compression, still.compression_opts, still.shuffle) == ("gzip", 1, True)
        assert still.id.get_storage_size() < still.nbytes / 100 and still.shape == (2, n, 3)
        assert np.array_equal(file["particles/all/position/value"][1], frame["position"])
        assert file["observables/a/value"].compression is None
    assert path.stat().st_size < 3.5 * frame["position"].nbytes  # plain: 4, and what is constant
