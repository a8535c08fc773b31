"""A saved filter goes on bitwise in a process that knows no JAX."""

from __future__ import annotations

import inspect
import pickle
import subprocess
import sys

import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError, FileError, StepError
from coadjoint.estimation import Filter, GaussMarkov, Measurement, ModelProcess, StrapdownProcess, load_filter
from files import rewritten

H = 0.05
BODY = co.System(
    co.SO3(),
    lambda xi, p: 0.5 * xi @ (p.inertia * xi),
    parameters={"inertia": [1.0, 2.0, 2.5], "bias": [0.1]},
    forces=lambda motion, p: co.Force(torque=motion.inputs.torque - p.bias * motion.xi),
)


@pytest.fixture(scope="module")
def body():
    start = BODY.state(xi=[0.3, -0.2, 0.4])
    noise, drifting = {"torque": 0.05}, {"bias": GaussMarkov(0.1, 30.0, mean=0.1)}
    process = ModelProcess(BODY, start, inputs={"torque": np.zeros(3)}, noise=noise, drifting=drifting)
    seen = {
        "gyroscope": Measurement(lambda m: m.xi, deviation=0.02, gate=0.99),
        "attitude": Measurement(lambda m: m.g, space=co.SO3(), deviation=0.05, error_side="body", coordinates="wxyz"),
    }
    found = Filter(process, start, measurements=seen, deviations={"g": 0.1, "xi": 0.1, "bias": 0.05}, accuracy=False)
    found.predict(H, {"torque": [0.1, 0.0, 0.0]})
    found.update({"gyroscope": [0.3, -0.2, 0.41]})
    return found


def driven(one, steps=20):
    """Predictions and updates, a value beyond the gate and a missing one among them."""
    random, found = np.random.default_rng(3), []
    for k in range(steps):
        one.predict(H, {"torque": [0.0, 0.1 * k, -0.2]} if k % 2 else None)
        rate = random.normal(size=3) if k % 5 else np.full(3, 9.0)
        measured = {"gyroscope": rate if k != 7 else [np.nan, 0.0, 0.0], "attitude": [1.0, 0.1, 0.0, 0.0]}
        found += [tuple(map(float, each)) for each in one.update(measured).values()]
    return found


CHILD = """
import sys
sys.path[:0] = {path!r}
from coadjoint.estimation import load_filter
import numpy as np
H = {h}
{driven}
one = load_filter({file!r})
driven(one)
assert not {{"jax", "scipy"}} & set(sys.modules), "JAX was imported"
print((one.rows.tobytes() + one.covariance.tobytes()).hex())
"""


@pytest.mark.long
def test_it_goes_on_bitwise_in_a_process_without_jax(body, tmp_path):
    path = body.save(tmp_path / "body.filter")
    loaded = load_filter(path)
    begun = loaded.rows
    assert np.array_equal(driven(loaded), driven(body), equal_nan=True)
    assert np.array_equal(loaded.rows, body.rows) and np.array_equal(loaded.covariance, body.covariance)
    assert loaded.deviations == body.deviations and loaded.t == body.t
    assert np.array_equal(loaded.state["g"], body.state.g)
    script = CHILD.format(path=sys.path, h=H, driven=inspect.getsource(driven), file=str(path))
    child = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert child.returncode == 0, child.stderr
    assert bytes.fromhex(child.stdout.strip()) == body.rows.tobytes() + body.covariance.tobytes()
    loaded.reset()
    assert np.array_equal(loaded.rows, begun)


@pytest.mark.long
def test_another_processor_compiles_it_and_damaged_files_are_refused(body, tmp_path):
    path = body.save(tmp_path / "body.filter")

    def changed(name, **parts):
        return rewritten(path, tmp_path / name, of="filter", **parts)

    other = load_filter(changed("other", header={"processor": ["another"]}, **{"filter.o": b"nothing"}))
    other.predict(H)
    body.predict(H)
    assert np.array_equal(other.rows, body.rows)
    wrong = {
        "is of version 99": {"header": {"version": 99}},
        "holds no filter": {"header": {"format": "another"}},
        "damaged": {"P.npy": None},
        "cannot be compiled here by LLVM": {"header": {"processor": ["another"]}, "filter.ll": b"define nonsense"},
    }
    for i, (sentence, parts) in enumerate(wrong.items()):
        with pytest.raises(FileError, match=sentence):
            load_filter(changed(f"wrong{i}", **parts))
    with pytest.raises(FileError, match="exists already"):
        body.save(path)


def test_wrong_uses_of_a_saved_filter_raise_one_sentence_and_change_nothing(body, tmp_path):
    loaded = load_filter(body.save(tmp_path / "body.filter"))
    before = loaded.rows
    for call, sentence in (
        (lambda: loaded.predict(-1.0), "`dt` must be positive"),
        (lambda: loaded.predict(H, {"thrust": 1.0}), "no input `thrust`"),
        (lambda: loaded.predict(H, {"torque": 1.0}), "is 3 numbers at each time"),
        (lambda: loaded.update({"depth": 1.0}), "no measurement `depth`"),
        (lambda: loaded.update({"gyroscope": [1.0]}), "is 3 numbers at each time"),
    ):
        with pytest.raises(ArgumentError, match=sentence):
            call()
    with pytest.raises(StepError, match="the model has no step from the estimate"):
        loaded.predict(H, {"torque": [1e300, 1e300, 0.0]})
    assert np.array_equal(loaded.rows, before)


@pytest.mark.long
def test_a_strapdown_filter_awaits_its_first_reading_and_goes_on_bitwise(tmp_path):
    process = StrapdownProcess(noise={"gyroscope": 1e-4, "accelerometer": 1e-3})
    seen = {"depth": Measurement(lambda m: m.q[2], 0.01, gate=0.9, after_rejections=(1, "stop"))}
    first = co.estimation.InertialState()
    found = Filter(process, first, measurements=seen, deviations={"attitude": 0.01, "velocity": 0.1, "position": 1.0})
    loaded = load_filter(found.save(tmp_path / "unit.filter"))
    with pytest.raises(ArgumentError, match="no step without a reading of `imu`"):
        loaded.predict(0.01)
    for one in (found, loaded):
        one.predict(0.01, {"imu": [0.1, 0.0, 0.0, 0.2, 0.0, -9.8]})
        one.update({"depth": 0.3})
        one.predict(0.01)
    assert np.array_equal(loaded.rows, found.rows)
    with pytest.raises(StepError, match="1 values of `depth` in a row are beyond its gate"):
        loaded.update({"depth": 1e3})
    assert np.array_equal(loaded.rows, found.rows)
    many = Filter(process, first, measurements=seen, deviations={"position": 1.0}, members=3)
    with pytest.raises(ArgumentError, match="has 3 members cannot be saved"):
        many.save(tmp_path / "many.filter")


def test_a_saved_filter_leaves_the_process_with_its_estimate(body, tmp_path):
    loaded = load_filter(body.save(tmp_path / "body.filter"))
    loaded.predict(H)
    again = pickle.loads(pickle.dumps(loaded))
    loaded.predict(H)
    again.predict(H)
    assert np.array_equal(again.rows, loaded.rows) and np.array_equal(again.covariance, loaded.covariance)
