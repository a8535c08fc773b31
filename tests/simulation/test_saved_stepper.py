"""A saved stepper goes on to the bit in a process that knows no JAX, and refuses what it cannot do with a sentence."""

from __future__ import annotations

import io
import pickle
import subprocess
import sys
import tracemalloc
import zipfile

import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError, FileError, StepError
from coadjoint.simulation.steppers.stepping import opened
from files import rewritten

STEPS = 25
TOP = co.System(
    co.SO3(),
    lambda xi, a, p: 0.5 * p.inertia @ xi**2 - p.weight * a[2],
    advected=co.Defining(),
    parameters=co.Parameters(inertia=[1.0, 1.2, 0.5], weight=0.7, grip=1.0),
    forces=lambda motion, p: co.Force(torque=p.grip * motion.inputs.torque - motion.internal.brake * motion.xi),
    internal=lambda motion, h, p: {"brake": 0.9 * motion.internal.brake},
    name="braked top",
)
START = TOP.state(xi=[0.1, 0.2, 3.0], a0=[0.0, 0.6, 0.8], internal={"brake": 0.05})


def made(**options) -> co.Stepper:
    observe = {"mu": lambda s: s.mu, "t": lambda s: s.t}
    return co.Stepper(TOP, START, dt=0.05, inputs={"torque": np.zeros(3)}, observe=observe, **options)


@pytest.fixture(scope="module")
def top() -> co.Stepper:
    return made()


@pytest.fixture(scope="module")
def saved(top, tmp_path_factory):
    """A file of a stepper that stands at its third step."""
    body = top.clone()
    body.step({"torque": [0.1, 0.0, -0.2]}, n=3)
    return body.save(tmp_path_factory.mktemp("saved") / "top.step"), body


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("name", "size"), [("step.ll", 300 << 20), ("state.npy", 50 << 20), ("stepper.json", 50 << 20)]
)
def test_an_archive_that_would_grow_beyond_measure_is_refused_before_it_is_read(saved, tmp_path, name, size):
    with zipfile.ZipFile(saved[0]) as archive:
        parts = {part: archive.read(part) for part in archive.namelist()}
    bomb = tmp_path / "bomb.step"
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive:
        for part, content in parts.items():
            if part != name:
                archive.writestr(part, content)
        with archive.open(name, "w") as file:
            for _ in range(size >> 20):
                file.write(bytes(1 << 20))
    assert bomb.stat().st_size < 2 << 20
    tracemalloc.start()
    try:
        with pytest.raises(FileError, match=rf"{name} would take {size:,} bytes, but [0-9,]+ are the most"):
            co.load_stepper(bomb)
        assert tracemalloc.get_traced_memory()[1] < 20 << 20
    finally:
        tracemalloc.stop()


CHILD = """
import sys
import coadjoint as co
top = co.load_stepper(sys.argv[1])
for k in range({steps}):
    top.step({{"torque": [0.01 * k, 0.0, -0.1]}})
print(top.observation["mu"].tobytes().hex())
assert not {{"jax", "scipy"}} & set(sys.modules), "JAX was imported"
"""


def test_it_goes_on_to_the_bit_in_a_process_without_jax(saved):
    path, body = saved
    ours = body.clone()
    for k in range(STEPS):
        ours.step({"torque": [0.01 * k, 0.0, -0.1]})
    child = [sys.executable, "-c", CHILD.format(steps=STEPS), str(path)]
    found = subprocess.run(child, capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stderr
    assert bytes.fromhex(found.stdout.strip()) == ours.observation["mu"].tobytes()


def test_another_processor_compiles_it_from_its_assembly(saved, tmp_path):
    path, body = saved
    other = co.load_stepper(
        rewritten(path, tmp_path / "other.step", header={"processor": ["another"]}, **{"step.o": b"nothing"})
    )
    ours = body.clone()
    for one in (other, ours):
        one.step({"torque": [0.3, 0.0, 0.0]}, n=STEPS)
    assert np.array_equal(other.observation["mu"], ours.observation["mu"])


def test_it_stands_where_it_stood_and_resets_to_the_start(saved, top):
    path, body = saved
    loaded = co.load_stepper(path)
    assert loaded.steps == body.steps == 3
    assert np.array_equal(loaded.observation["mu"], body.observation["mu"])
    assert np.array_equal(loaded.command["torque"], [0.1, 0.0, -0.2])
    assert loaded.state["internal.brake"] == body.state.internal.brake
    kept = loaded.state
    loaded.step(n=4)
    loaded.restore(kept)
    assert np.array_equal(loaded.state["mu"], kept["mu"])
    loaded.reset({"internal.brake": 0.5})
    assert loaded.t == 0.0
    assert loaded.state["internal.brake"] == 0.5
    loaded.reset()
    fresh = top.clone()
    fresh.reset()
    for one in (loaded, fresh):
        one.step(n=3)
    assert np.array_equal(loaded.observation["mu"], fresh.observation["mu"])


def test_many_members_are_saved_with_their_parameters(tmp_path):
    many = made(members=5)
    many.change(weight=np.linspace(0.5, 0.9, 5))
    many.step({"torque": np.ones((5, 3))})
    loaded = co.load_stepper(many.save(tmp_path / "many.step"))
    for body in (many, loaded):
        body.step(n=STEPS)
    assert np.array_equal(loaded.observation["mu"], many.observation["mu"])
    assert len(set(many.observation["mu"][:, 0])) == 5


def test_a_stepper_is_pickled(saved):
    _, body = saved
    other = pickle.loads(pickle.dumps(body))
    ours = body.clone()
    for one in (other, ours):
        one.step(n=2)
    assert np.array_equal(other.observation["mu"], ours.observation["mu"])
    again = pickle.loads(pickle.dumps(other))
    assert again.steps == other.steps


def test_parameters_change_in_a_saved_one_where_nothing_must_be_compiled(saved, tmp_path):
    loaded = co.load_stepper(saved[0])
    loaded.change(weight=0.2, keep="momentum")
    assert loaded.parameters["weight"] == 0.2
    with pytest.raises(ArgumentError, match="`grip` is compiled into this stepper"):
        loaded.change(grip=0.0, keep="momentum")
    with pytest.raises(ArgumentError, match='pass keep="momentum"'):
        loaded.change(weight=0.3)
    free = co.load_stepper(made(changing="grip").save(tmp_path / "free.step"))
    free.change(grip=0.0, keep="momentum")
    free.step({"torque": [9.0, 9.0, 9.0]})


def test_an_event_stops_a_saved_one_at_the_node_before(tmp_path):
    body = made(until=lambda state: state.t - 0.42)
    loaded = co.load_stepper(body.save(tmp_path / "until.step"))
    loaded.step(n=20)
    assert loaded.ended
    assert loaded.event == pytest.approx(0.4)


def test_one_that_was_saved_at_its_event_stays_there():
    body = made(until=lambda state: state.t - 0.42)
    body.step(n=20)
    for other in (pickle.loads(pickle.dumps(body)), pickle.loads(pickle.dumps(body.clone()))):
        assert other.event == body.event == pytest.approx(0.42)
        with pytest.raises(StepError, match="came at t ="):
            other.step()
        assert np.array_equal(other.state["mu"], body.state.mu)
        other.reset()
        assert other.event is None


def test_a_damaged_file_is_refused_in_one_sentence_or_is_the_same_stepper(saved):
    """200 files with a bit flipped or the end cut off: the checksums find all that matters."""
    path, body = saved
    whole, random, refused = path.read_bytes(), np.random.default_rng(14), 0
    ours = body.clone()
    ours.step(n=2)
    directory = whole.rindex(b"PK\x01\x02", 0, whole.index(b"PK\x01\x02") + 4)
    for mutation in range(200):
        damaged = bytearray(whole)
        if mutation % 4 == 0:
            damaged = damaged[: random.integers(len(whole))]
        else:
            first = directory if mutation % 4 == 1 else 0
            damaged[random.integers(first, len(whole))] ^= 1 << int(random.integers(8))
        try:
            other = opened(bytes(damaged))
        except FileError as error:
            refused += 1
            assert str(error).count("\n") == 0
            assert "damaged" in str(error) or "version" in str(error)
        else:
            other.step(n=2)
            assert np.array_equal(other.observation["mu"], ours.observation["mu"])
    assert refused > 150


@pytest.mark.long
def test_files_that_are_none_are_refused(saved, tmp_path, top):
    path, body = saved
    whole = path.read_bytes()
    (tmp_path / "text.step").write_text("hello")
    (tmp_path / "half.step").write_bytes(whole[: len(whole) // 2])
    damaged = bytearray(whole)
    damaged[len(whole) // 2] ^= 0xFF
    (tmp_path / "damaged.step").write_bytes(damaged)
    rewritten(path, tmp_path / "newer.step", header={"version": 99})
    rewritten(path, tmp_path / "stranger.step", header={"format": "another"})
    rewritten(path, tmp_path / "lacking.step", **{"state.npy": None})
    kept = io.BytesIO()
    np.save(kept, np.zeros((1, 2, 1)))
    rewritten(path, tmp_path / "short.step", **{"state.npy": kept.getvalue()})
    rewritten(path, tmp_path / "bad.step", header={"processor": ["another"]}, **{"step.ll": b"define nonsense"})
    sentences = {
        "absent": "cannot be read",
        "text": "holds no stepper",
        "half": "holds no stepper",
        "damaged": "damaged",
        "newer": "is of version 99",
        "stranger": "holds no stepper",
        "lacking": "damaged",
        "short": "damaged",
        "bad": "cannot be compiled here by LLVM",
    }
    for name, sentence in sentences.items():
        with pytest.raises(FileError, match=sentence):
            co.load_stepper(tmp_path / f"{name}.step")
    with pytest.raises(FileError, match="exists already"):
        body.save(path)
    assert body.save(path, overwrite=True) == path
    with pytest.raises(FileError, match="does not exist"):
        body.save(tmp_path / "nowhere" / "top.step")
    with pytest.raises(ArgumentError, match="runs by XLA, or loops over links, cannot be saved"):
        made(backend="xla").save(tmp_path / "xla.step")
