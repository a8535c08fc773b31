"""What goes wrong with a folder of a run is said in one sentence, and nothing in it is lost or overwritten."""

import errno
import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import interrupted
import numpy as np
import pytest
from test_store import stopped_after

import coadjoint as co
from coadjoint import disk
from coadjoint.manifest import MANIFEST, Manifest
from coadjoint.simulation import configuration
from coadjoint.simulation import store as streaming
from coadjoint.simulation.lock import Lock

RUN = {"dt": 0.01, "steps": 2_000, "save_every": 2, "progress": False}


@pytest.fixture(scope="module")
def vehicle():
    return interrupted.system()


@pytest.fixture(scope="module")
def whole(vehicle):
    return co.simulate(vehicle, interrupted.start(vehicle), **RUN)


@pytest.fixture(scope="module")
def ended(tmp_path_factory, vehicle):
    """The folder of a run that ended, which no test changes."""
    folder = tmp_path_factory.mktemp("ended") / "run"
    co.simulate(vehicle, interrupted.start(vehicle), **RUN, store=folder)
    return folder


@pytest.fixture
def folder(ended, tmp_path):
    return Path(shutil.copytree(ended, tmp_path / "run"))


@pytest.fixture
def cut(tmp_path, vehicle, monkeypatch):
    """The folder of a run that was interrupted."""
    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr(streaming, "PERIOD", 0.0)
        stopped_after(patched, 2)
        co.simulate(vehicle, interrupted.start(vehicle), **RUN, store=tmp_path / "cut")
    return tmp_path / "cut"


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
    return next((folder / "records.zarr" / name).glob(f"c.{index}*"))


@pytest.mark.long
def test_the_same_call_again_returns_a_finished_run(unchanged, vehicle):
    folder, _ = unchanged
    run = co.simulate(vehicle, interrupted.start(vehicle), **RUN, store=folder)
    assert run.good_steps == RUN["steps"]
    assert str(run) == str(co.load(folder))


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"dt": 0.02}, "dt is 0.01 there and 0.02 here"),
        ({"save_every": 4}, "save_every is 2 there and 4 here"),
        ({"accuracy": False}, "accuracy is True there and False here"),
        ({"method": co.Trapezoidal()}, r"the method differs \(lagrangian, Midpoint.* there, lagrangian, Trapezoidal"),
    ],
)
def test_a_folder_with_a_run_takes_no_other(unchanged, vehicle, changes, told):
    folder, _ = unchanged
    with pytest.raises(
        co.errors.ArgumentError, match=f"holds another run: {told}.*; choose another folder for `store`"
    ):
        co.simulate(vehicle, interrupted.start(vehicle), **{**RUN, **changes}, store=folder)


@pytest.mark.long
def test_the_same_call_again_goes_on_with_an_interrupted_run(cut, vehicle, whole):
    with pytest.raises(co.errors.ArgumentError, match="holds another run: the parameters differ"):
        co.simulate(interrupted.system(mass=1.0), interrupted.start(vehicle), **RUN, store=cut)
    begun = len(co.load(cut).dataset.time)
    run = co.simulate(vehicle, interrupted.start(vehicle), **RUN, store=cut)
    assert 0 < begun < run.count
    np.testing.assert_array_equal(run.dataset.xi, whole.dataset.xi)
    assert not (cut / "lock").exists()


def test_nothing_is_written_to_a_folder_that_took_the_place_of_that_of_a_run():
    run: Any = SimpleNamespace(lock=SimpleNamespace(held=False), folder="there", seconds=0.0)
    run._require_there, written = lambda: streaming.Store._require_there(run), []
    with (
        pytest.raises(co.errors.FileError, match=r"its folder there was deleted or moved"),
        streaming.Store._writing(run),
    ):
        written.append(1)
    assert not written and run.seconds > 0


def test_a_folder_that_is_deleted_under_a_run_is_told(tmp_path, vehicle, monkeypatch):
    folder = tmp_path / "run"
    append = streaming.Store.append

    def deleted(self, *given):
        shutil.rmtree(folder, ignore_errors=True)
        append(self, *given)

    monkeypatch.setattr(streaming.Store, "append", deleted)
    with pytest.raises(co.errors.FileError, match=r"its folder .* was deleted or moved while it ran"):
        co.simulate(vehicle, interrupted.start(vehicle), **RUN, store=folder)
    assert not folder.exists()


def test_a_folder_of_the_old_format_is_told(unchanged, vehicle):
    folder, before = unchanged
    (folder / MANIFEST).unlink()
    (folder / "checkpoint.npz").write_bytes(b"")
    before.clear()
    before.update(contents(folder))
    for opened in (
        lambda: co.load(folder),
        lambda: co.resume(folder, vehicle),
        lambda: co.simulate(vehicle, interrupted.start(vehicle), **RUN, store=folder),
    ):
        with pytest.raises(co.errors.FileError, match="format 1 of stored runs, by an older version"):
            opened()


def test_a_folder_with_something_else_takes_no_run(tmp_path, vehicle):
    (tmp_path / "letters").mkdir()
    (tmp_path / "letters" / "letter.txt").write_text("dear")
    with pytest.raises(co.errors.FileError, match="holds something else"):
        co.simulate(vehicle, interrupted.start(vehicle), **RUN, store=tmp_path / "letters")
    with pytest.raises(co.errors.FileError, match="does not exist: make it first"):
        co.simulate(vehicle, interrupted.start(vehicle), **RUN, store=tmp_path / "none" / "run")
    assert [file.name for file in tmp_path.rglob("*")] == ["letters", "letter.txt"]
    with pytest.raises(co.errors.FileError, match="There is no folder"):
        co.resume(tmp_path / "none", vehicle)
    with pytest.raises(co.errors.FileError, match="holds no run"):
        co.resume(tmp_path / "letters", vehicle)
    with pytest.raises(co.errors.FileError, match="holds no run"):
        co.load(tmp_path / "letters")


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"mass": 123.9}, "the parameters differ"),
        ({"extra": 1.0}, "equations differ"),
    ],
)
def test_other_parameters_are_another_run(unchanged, changes, told):
    with pytest.raises(co.errors.ArgumentError, match=f"holds another run: .*{told}"):
        co.resume(unchanged[0], interrupted.system(**changes))


@pytest.mark.long
def test_another_lagrangian_or_method_is_another_run(unchanged, vehicle):
    folder, _ = unchanged

    def lagrangian(xi, n, nu, a, p):
        return interrupted.lagrangian(xi, n, nu, a, p) + 1e-9 * xi @ nu

    other = co.System(
        co.SO3(), lagrangian, additional=co.Defining(), advected=co.Defining(), parameters=vehicle.parameters
    )
    with pytest.raises(co.errors.ArgumentError, match="holds another run: the system's or the method's equations"):
        co.resume(folder, other)
    with pytest.raises(co.errors.ArgumentError, match="holds another run: the system's or the method's equations"):
        co.resume(folder, vehicle, method=co.Trapezoidal())
    with pytest.raises(co.errors.ArgumentError, match="holds another run: the values at the start"):
        co.resume(folder, vehicle, start=vehicle.state(q=[0, 0, 2], a0=[0, 0, 1]))


@pytest.mark.long
def test_a_constant_inside_a_lagrangian_belongs_to_the_fingerprint(tmp_path, vehicle):
    def scaled(matrix):
        return co.System(co.SO3(), lambda xi: 0.5 * xi @ matrix @ xi)

    one, other = scaled(np.diag([1.0, 2.0, 3.0])), scaled(np.diag([1.0, 2.0, 3.0 + 1e-12]))
    co.simulate(one, one.state(xi=[1, 2, 3]), dt=0.01, steps=10, store=tmp_path / "run")
    with pytest.raises(co.errors.ArgumentError, match="equations"):
        co.resume(tmp_path / "run", other)
    same = scaled(np.diag([1.0, 2.0, 3.0]))
    assert co.resume(tmp_path / "run", same).good_steps == 10


@pytest.mark.long
def test_a_fingerprint_is_the_same_in_every_process(folder):
    script = f"""
import sys
sys.path.insert(0, {str(Path(interrupted.__file__).parent)!r})
import coadjoint as co, interrupted
print(co.resume({str(folder)!r}, interrupted.system()).good_steps)
"""
    for seed in ("1", "2"):
        environment = {**os.environ, "PYTHONHASHSEED": seed}
        found = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True)
        assert found.stdout.strip() == "2000", found.stderr
    assert set(Manifest.read(folder).facts["fingerprint"]) == {
        "names",
        "tracing", "equations", "parameters", "start", "monitors", "grid",
    }  # fmt: skip


def test_a_run_whose_equations_were_traced_in_another_way_is_of_another_version(folder, vehicle, monkeypatch):
    monkeypatch.setattr(configuration, "TRACING", "1")
    with pytest.raises(co.errors.ArgumentError, match="another version of coadjoint began"):
        co.resume(folder, vehicle)


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", ["xi", "R", "time", "energy"])
def test_a_truncated_or_missing_chunk_is_told(unchanged, vehicle, name):
    folder, before = unchanged
    file = chunk(folder, name, 0)
    data = file.read_bytes()
    for spoiled, told in ((data[:-9], "truncated"), (b"", "truncated"), (None, "missing")):
        spoil(folder, before, file, spoiled)
        for opened in (lambda: co.resume(folder, vehicle), lambda: co.load(folder)):
            with pytest.raises(co.errors.FileError, match=told) as error:
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
    with pytest.raises(co.errors.FileError, match="is damaged: put back a copy") as error:
        dataset.mu.values  # noqa: B018
    assert str(file) in str(error.value)


@pytest.mark.long
def test_a_damaged_or_missing_checkpoint_is_told(unchanged, vehicle):
    folder, before = unchanged
    file = next(folder.glob("checkpoint-*.npz"))
    data = file.read_bytes()
    broken = bytearray(data)
    broken[len(data) // 2] ^= 1
    cases = ((data[:-30], "truncated"), (b"", "truncated"), (bytes(broken), "damaged"), (None, "missing"))
    for spoiled, told in cases:
        spoil(folder, before, file, spoiled)
        for opened in (lambda: co.resume(folder, vehicle), lambda: co.load(folder)):
            with pytest.raises(co.errors.FileError, match=told):
                opened()


@pytest.mark.long
def test_a_checkpoint_of_another_run_is_told(unchanged, vehicle, tmp_path):
    folder, before = unchanged
    co.simulate(vehicle, interrupted.start(vehicle), **{**RUN, "dt": 0.02}, store=tmp_path / "other")
    (here,), (there,) = (place.glob("checkpoint-*.npz") for place in (folder, tmp_path / "other"))
    spoil(folder, before, here, there.read_bytes())
    for opened in (lambda: co.resume(folder, vehicle), lambda: co.load(folder)):
        with pytest.raises(co.errors.FileError, match=r"checkpoint-.*npz of the run is (damaged|truncated)"):
            opened()


def test_a_chunk_in_the_place_of_another_is_told(tmp_path, vehicle, monkeypatch):
    monkeypatch.setattr("coadjoint.simulation.store.BLOCK_ROWS", 205)
    co.simulate(vehicle, interrupted.start(vehicle), **RUN, store=tmp_path / "run")
    first, second = (chunk(tmp_path / "run", "mu", index) for index in (0, 1))
    first.write_bytes(second.read_bytes())
    with pytest.raises(co.errors.FileError, match="is damaged: put back a copy"):
        co.load(tmp_path / "run").dataset.mu.values  # noqa: B018


@pytest.mark.cases(1)
@pytest.mark.parametrize("data", [None, b'"float32"'])
def test_a_missing_or_changed_description_of_an_array_is_told(cut, vehicle, data):
    file = cut / "records.zarr" / "xi" / "zarr.json"
    file.write_bytes(file.read_bytes().replace(b'"float64"', data)) if data else file.unlink()
    for opened in (lambda: co.load(cut), lambda: co.resume(cut, vehicle)):
        with pytest.raises(co.errors.FileError, match=f"{file} of the run is (missing|damaged)"):
            opened()


@pytest.mark.long
def test_two_processes_do_not_share_a_folder(cut, vehicle):
    before = contents(cut)
    script = f"""
import sys
from pathlib import Path
from coadjoint.simulation.folder import Lock
lock = Lock(Path({str(cut)!r}))
print("held", flush=True)
sys.stdin.read()
"""
    process = subprocess.Popen([sys.executable, "-c", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    try:
        assert process.stdout.readline() == b"held\n"
        for going_on in (
            lambda: co.resume(cut, vehicle),
            lambda: co.simulate(vehicle, interrupted.start(vehicle), **RUN, store=cut),
        ):
            with pytest.raises(co.errors.FileError, match=f"in use by process {process.pid}: wait"):
                going_on()
        assert 0 < len(co.load(cut).dataset.time) < 1001
        with pytest.raises(subprocess.TimeoutExpired):  # whoever asks leaves the other process alone
            process.wait(0.1)
    finally:
        process.kill()
        process.communicate()
    assert {name: found for name, found in contents(cut).items() if not name.endswith("lock")} == before
    assert co.resume(cut, vehicle).good_steps == 2_000
    Lock(cut).release()
    assert not (cut / "lock").exists()


@pytest.mark.cases(1)
@pytest.mark.parametrize("writes", [0, 40, 63, 90])
def test_a_full_disk_stops_the_run_and_loses_nothing(tmp_path, vehicle, whole, monkeypatch, writes):
    monkeypatch.setattr("coadjoint.simulation.store.BLOCK_ROWS", 205)
    left = iter(range(writes))

    def full(operation, path):
        if operation == "write" and path.name.startswith(".c.") and next(left, None) is None:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patched:
        patched.setattr(disk, "before", full)
        with pytest.raises(co.errors.FileError, match="could not be written: No space left on device; its first"):
            co.simulate(vehicle, interrupted.start(vehicle), **RUN, store=tmp_path / "run")
    run = co.resume(tmp_path / "run", vehicle)
    for name, values in whole.dataset.variables.items():
        np.testing.assert_array_equal(run.dataset[name], values)


@pytest.mark.long
def test_a_file_that_may_not_grow_stops_the_run(tmp_path, vehicle):
    """The operating system itself refuses: a limit on the size of files."""
    script = f"""
import resource, sys
sys.path.insert(0, {str(Path(interrupted.__file__).parent)!r})
import coadjoint as co, interrupted
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
try:
    interrupted.simulate({str(tmp_path / "run")!r})
except co.errors.FileError as error:
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


@pytest.mark.long
def test_a_folder_that_may_not_be_written_is_told_and_a_finished_run_in_it_is_read(open_place, vehicle, cut):
    done, unfinished = open_place / "done", open_place / "cut"
    co.simulate(vehicle, interrupted.start(vehicle), **RUN, store=done)
    shutil.move(cut, unfinished)
    script = f"""
import os, sys
sys.path.insert(0, {str(Path(interrupted.__file__).parent)!r})
import coadjoint as co, interrupted
from coadjoint.simulation.configuration import versions
vehicle = interrupted.system()
co.simulate(vehicle, interrupted.start(vehicle), dt=0.01, steps=2)
co.load({str(done)!r})
versions()  # what is loaded late lies where others may not read
if os.geteuid() == 0:
    os.setuid(65534)
for attempt in (
    lambda: interrupted.simulate({str(open_place / "new")!r}),
    lambda: co.resume({str(unfinished)!r}, vehicle),
    lambda: print(co.resume({str(done)!r}, vehicle).good_steps),
    lambda: print(co.simulate(vehicle, interrupted.start(vehicle), **{RUN}, store={str(done)!r}).good_steps),
):
    try:
        attempt()
    except co.errors.FileError as error:
        print(error)
"""
    before = contents(open_place)
    places = (done, unfinished, open_place)
    for place in places:
        place.chmod(place.stat().st_mode & ~0o222)
    try:
        found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    finally:
        for place in reversed(places):
            place.chmod(place.stat().st_mode | 0o200)
    assert found.stdout.count("\n") == 4, found.stderr
    first, second, *rest = found.stdout.splitlines()
    assert "cannot be made: Permission denied" in first
    assert "cannot be written: Permission denied" in second
    assert rest == ["2000", "2000"]
    assert contents(open_place) == before


@pytest.fixture(scope="module")
def short(tmp_path_factory, vehicle):
    """The folder of a run of few steps."""
    place = tmp_path_factory.mktemp("short") / "run"
    co.simulate(vehicle, interrupted.start(vehicle), dt=0.01, steps=4, progress=False, accuracy=False, store=place)
    return place


def forged(folder: Path, key: str, value: object) -> Path:
    """A folder as somebody changes it who can compute checksums, too."""
    manifest = Manifest.read(folder)
    if key in ("checkpoint", "fingerprint"):
        manifest.facts[key] = value
    else:
        name = "configuration.npz" if key not in ("records", "attributes") else manifest.facts["checkpoint"]
        header, arrays = configuration.unpacked(manifest.path(name))
        header[key] = value
        manifest.path(name).write_bytes(configuration.packed(header, arrays))
        manifest.enter(name)
    manifest.write()
    return folder


@pytest.mark.cases(3)
@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("again", 7), ("again", ["x"]), ("method", "x"), ("method", {"class": "Nothing"}), ("start", 7), ("dt", {}),
        ("method", {"class": "Midpoint"}), ("method", {"class": "Midpoint", "7": 1}), ("start", {"t": "..", "g": []}),
        ("fingerprint", 1.5), ("attributes", None), ("checkpoint", 7), ("records", [1]),
    ],
)  # fmt: skip
def test_a_folder_that_was_forged_is_neither_read_nor_taken_up(short, tmp_path, vehicle, key, value):
    folder = forged(Path(shutil.copytree(short, tmp_path / "run")), key, value)
    if key in ("attributes", "checkpoint", "records"):
        with pytest.raises(co.errors.FileError, match=r"does not write|not among those"):
            co.load(folder)
    with pytest.raises(co.errors.FileError, match=r"does not write|not among those"):
        co.resume(folder, vehicle)
