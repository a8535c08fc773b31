"""What goes wrong with a folder of a run is said in one sentence, and nothing in it is lost or overwritten."""

import errno
import hashlib
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import interrupted
import numpy as np
import pytest
import zarr.storage._local as local

import coadjoint as co
from coadjoint.simulation.lock import Lock

RUN = {"dt": 0.01, "steps": 20_000, "save_every": 2, "progress": False}


@pytest.fixture(scope="module")
def vehicle():
    return interrupted.system()


@pytest.fixture(scope="module")
def whole(vehicle):
    return co.simulate(vehicle, interrupted.start(vehicle), **RUN)


@pytest.fixture
def folder(tmp_path, vehicle):
    """The folder of a run that ended."""
    co.simulate(vehicle, interrupted.start(vehicle), **RUN, store=tmp_path / "run")
    return tmp_path / "run"


@pytest.fixture
def unchanged(folder):
    """The folder of a run; no file of it may change in the test, except what the test says."""
    before = contents(folder)
    yield folder, before
    assert contents(folder) == before


def contents(folder: Path) -> dict[str, str]:
    files = [file for file in folder.rglob("*") if file.is_file()]
    return {str(file): hashlib.sha256(file.read_bytes()).hexdigest() for file in files}


def spoil(folder: Path, before: dict[str, str], file: Path, data: bytes | None) -> None:
    file.unlink() if data is None else file.write_bytes(data)
    before.clear()
    before.update(contents(folder))


def chunk(folder: Path, name: str, index: int) -> Path:
    place = folder / "records.zarr" / name / "c" / str(index)
    return next(file for file in (place, *place.rglob("*")) if file.is_file())


def test_a_folder_with_a_run_takes_no_other(unchanged, vehicle):
    folder, _ = unchanged
    with pytest.raises(co.FileError, match="holds a run already: continue it"):
        co.simulate(vehicle, interrupted.start(vehicle), **RUN, store=folder)


def test_a_folder_with_something_else_takes_no_run(tmp_path, vehicle):
    (tmp_path / "letters").mkdir()
    (tmp_path / "letters" / "letter.txt").write_text("dear")
    with pytest.raises(co.FileError, match="holds something else"):
        co.simulate(vehicle, interrupted.start(vehicle), **RUN, store=tmp_path / "letters")
    with pytest.raises(co.FileError, match="does not exist: make it first"):
        co.simulate(vehicle, interrupted.start(vehicle), **RUN, store=tmp_path / "none" / "run")
    assert [file.name for file in tmp_path.rglob("*")] == ["letters", "letter.txt"]
    with pytest.raises(co.FileError, match="There is no folder"):
        co.resume(tmp_path / "none", vehicle)
    with pytest.raises(co.FileError, match="holds no run"):
        co.resume(tmp_path / "letters", vehicle)
    with pytest.raises(co.FileError, match="holds no run"):
        co.load(tmp_path / "letters")


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"mass": 123.9}, "the parameters differ"),
        ({"extra": 1.0}, "equations differ"),
    ],
)
def test_other_parameters_are_another_run(unchanged, changes, told):
    with pytest.raises(co.ArgumentError, match=f"holds another run: .*{told}"):
        co.resume(unchanged[0], interrupted.system(**changes))


def test_another_lagrangian_or_method_is_another_run(unchanged, vehicle):
    folder, _ = unchanged

    def lagrangian(xi, n, nu, a, p):
        return interrupted.lagrangian(xi, n, nu, a, p) + 1e-9 * xi @ nu

    other = co.System(
        co.SO3(), lagrangian, additional=co.Defining(), advected=co.Defining(), parameters=vehicle.parameters
    )
    with pytest.raises(co.ArgumentError, match="holds another run: the system's or the method's equations"):
        co.resume(folder, other)
    with pytest.raises(co.ArgumentError, match="holds another run: the system's or the method's equations"):
        co.resume(folder, vehicle, method=co.Trapezoidal())
    with pytest.raises(co.ArgumentError, match="holds another run: the values at the start"):
        co.resume(folder, vehicle, start=vehicle.state(q=[0, 0, 2], a0=[0, 0, 1]))


def test_a_constant_inside_a_lagrangian_belongs_to_the_fingerprint(tmp_path, vehicle):
    def scaled(matrix):
        return co.System(co.SO3(), lambda xi: 0.5 * xi @ matrix @ xi)

    one, other = scaled(np.diag([1.0, 2.0, 3.0])), scaled(np.diag([1.0, 2.0, 3.0 + 1e-12]))
    co.simulate(one, one.state(xi=[1, 2, 3]), dt=0.01, steps=10, store=tmp_path / "run")
    with pytest.raises(co.ArgumentError, match="equations"):
        co.resume(tmp_path / "run", other)
    same = scaled(np.diag([1.0, 2.0, 3.0]))
    assert co.resume(tmp_path / "run", same).good_steps == 10


def test_a_fingerprint_is_the_same_in_every_process(folder):
    from coadjoint.simulation.reading import read_configuration

    script = f"""
import sys
sys.path.insert(0, {str(Path(interrupted.__file__).parent)!r})
import coadjoint as co, interrupted
print(co.resume({str(folder)!r}, interrupted.system()).good_steps)
"""
    for seed in ("1", "2"):
        environment = {**os.environ, "PYTHONHASHSEED": seed}
        found = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True)
        assert found.stdout.strip() == "20000", found.stderr
    assert set(read_configuration(folder)[0]["fingerprint"]) == {
        "equations", "parameters", "start", "monitors", "grid",
    }  # fmt: skip


@pytest.mark.parametrize("name", ["xi", "R", "time", "energy"])
def test_a_truncated_or_missing_chunk_is_told(unchanged, vehicle, name):
    folder, before = unchanged
    file = chunk(folder, name, 0)
    data = file.read_bytes()
    for spoiled, told in ((data[:-9], "truncated"), (b"", "truncated"), (None, "missing")):
        spoil(folder, before, file, spoiled)
        for opened in (lambda: co.resume(folder, vehicle), lambda: co.load(folder)):
            with pytest.raises(co.FileError, match=told) as error:
                opened()
            assert str(file) in str(error.value)


def test_a_chunk_with_a_wrong_bit_is_told_when_it_is_read(unchanged):
    folder, before = unchanged
    file = chunk(folder, "mu", 0)
    data = bytearray(file.read_bytes())
    data[1000] ^= 4
    spoil(folder, before, file, bytes(data))
    dataset = co.load(folder).dataset
    assert np.isfinite(dataset.xi.values).all()
    with pytest.raises(co.FileError, match="is damaged: put back a copy") as error:
        dataset.mu.values  # noqa: B018
    assert str(file) in str(error.value)


def test_a_damaged_or_missing_checkpoint_is_told(unchanged, vehicle):
    folder, before = unchanged
    file = folder / "checkpoint.npz"
    data = file.read_bytes()
    broken = bytearray(data)
    broken[len(data) // 2] ^= 1
    cases = ((data[:-30], "damaged"), (b"", "damaged"), (bytes(broken), "damaged"), (None, "lost its checkpoint"))
    for spoiled, told in cases:
        spoil(folder, before, file, spoiled)
        for opened in (lambda: co.resume(folder, vehicle), lambda: co.load(folder)):
            with pytest.raises(co.FileError, match=told):
                opened()


def test_a_checkpoint_of_another_configuration_is_told(unchanged, vehicle, tmp_path):
    folder, before = unchanged
    co.simulate(vehicle, interrupted.start(vehicle), **{**RUN, "dt": 0.02}, store=tmp_path / "other")
    spoil(folder, before, folder / "checkpoint.npz", (tmp_path / "other" / "checkpoint.npz").read_bytes())
    for opened in (lambda: co.resume(folder, vehicle), lambda: co.load(folder)):
        with pytest.raises(co.FileError, match="checkpoint of another configuration"):
            opened()


def test_two_processes_do_not_share_a_folder(unchanged, vehicle):
    folder, _ = unchanged
    script = f"""
import sys
from pathlib import Path
from coadjoint.simulation.lock import Lock
lock = Lock(Path({str(folder)!r}))
print("held", flush=True)
sys.stdin.read()
"""
    process = subprocess.Popen([sys.executable, "-c", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    try:
        assert process.stdout.readline() == b"held\n"
        with pytest.raises(co.FileError, match="in use by another process"):
            co.resume(folder, vehicle)
        assert len(co.load(folder).dataset.time) == 10_001
    finally:
        process.kill()
        process.communicate()
    assert co.resume(folder, vehicle).good_steps == 20_000
    Lock(folder).release()


@pytest.mark.parametrize("writes", [0, 40, 63, 90])
def test_a_full_disk_stops_the_run_and_loses_nothing(tmp_path, vehicle, whole, monkeypatch, writes):
    monkeypatch.setattr("coadjoint.simulation.store.BLOCK_ROWS", 2048)
    put, left = local._put, iter(range(writes))

    def full(path, value, exclusive=False):
        if "/c/" in str(path) and next(left, None) is None:
            path.parent.mkdir(parents=True, exist_ok=True)
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return put(path, value, exclusive)

    with monkeypatch.context() as patched:
        patched.setattr(local, "_put", full)
        with pytest.raises(co.FileError, match="could not be written: No space left on device; its first"):
            co.simulate(vehicle, interrupted.start(vehicle), **RUN, store=tmp_path / "run")
    run = co.resume(tmp_path / "run", vehicle)
    for name, values in whole.dataset.variables.items():
        np.testing.assert_array_equal(run.dataset[name], values)


def test_a_file_that_may_not_grow_stops_the_run(tmp_path, vehicle):
    """The operating system itself refuses: a limit on the size of files."""
    script = f"""
import resource, sys
sys.path.insert(0, {str(Path(interrupted.__file__).parent)!r})
import coadjoint as co, interrupted
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
try:
    interrupted.simulate({str(tmp_path / "run")!r})
except co.FileError as error:
    print(error)
"""
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=environment)
    assert "could not be written: File too large" in found.stdout, found.stderr
    assert len(co.load(tmp_path / "run").dataset.time) == 0
    assert co.resume(tmp_path / "run", vehicle).good_steps == interrupted.STEPS


@pytest.fixture
def open_place():
    """A folder that other users may enter, which those of pytest are not."""
    with tempfile.TemporaryDirectory() as place:
        Path(place).chmod(0o755)
        yield Path(place)


def test_a_folder_that_may_not_be_written_is_told(open_place, vehicle):
    folder = open_place / "run"
    co.simulate(vehicle, interrupted.start(vehicle), **RUN, store=folder)
    script = f"""
import os, sys
sys.path.insert(0, {str(Path(interrupted.__file__).parent)!r})
import coadjoint as co, interrupted
vehicle = interrupted.system()
co.simulate(vehicle, interrupted.start(vehicle), dt=0.01, steps=2)
co.load({str(folder)!r})
if os.geteuid() == 0:
    os.setuid(65534)
for attempt in (
    lambda: interrupted.simulate({str(open_place / "new")!r}),
    lambda: co.resume({str(folder)!r}, vehicle),
):
    try:
        attempt()
    except co.FileError as error:
        print(error)
"""
    before = contents(folder)
    places = (folder / "lock", folder, open_place)
    for place in places:
        place.chmod(place.stat().st_mode & ~0o222)
    try:
        found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    finally:
        for place in reversed(places):
            place.chmod(place.stat().st_mode | 0o200)
    assert found.stdout.count("\n") == 2, found.stderr
    first, second = found.stdout.splitlines()
    assert "cannot be made: Permission denied" in first
    assert "cannot be written: Permission denied" in second
    assert contents(folder) == before
    assert [place.name for place in open_place.iterdir()] == ["run"]
