"""Steps that do not resolve the motion are found wherever steps are taken: steppers, trajectories, files."""

from __future__ import annotations

import subprocess
import sys
import warnings
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.simulation.accuracy.local_error import InternalPlaces, PartsOfSteps, Ruler
from coadjoint.simulation.accuracy.ruler import structure
from coadjoint.simulation.accuracy.sample import Kept, with_steps_between
from coadjoint.simulation.accuracy.verdict import SampledSteps

J = np.array([1.0, 2.0, 3.0])
UNRESOLVED = "does not resolve this motion"


def push(motion):
    return co.Force(torque=motion.inputs.torque)


BODY = co.System(co.SO3(), lambda xi: 0.5 * xi @ (J * xi))
PUSHED = co.System(co.SO3(), lambda xi: 0.5 * xi @ (J * xi), forces=push)
SPIN = [0.3, 8.0, 0.3]


@contextmanager
def told():
    """The sentences about accuracy that are warned of."""
    found: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield found
    found += [str(one.message) for one in caught if UNRESOLVED in str(one.message)]


def stepper(dt, **more):
    return co.Stepper(BODY, BODY.state(xi=SPIN), dt=dt, observe={"xi": lambda s: s.xi}, **more)


@pytest.mark.parametrize("backend", ["native", pytest.param("xla", marks=pytest.mark.long)])
def test_a_stepper_whose_first_step_is_too_long_warns_when_it_is_made(backend):
    with told() as said:
        made = stepper(0.3, backend=backend)
    assert len(said) == 1 and said[0].startswith("dt = 0.3 ") and not made.judging
    proposed = float(said[0].split("Take dt = ")[1].split(" or less")[0])
    with told() as said:
        made = stepper(proposed)
        made.step(n=50)
    assert said == []


def test_steps_that_become_too_long_warn_once_while_they_are_taken():
    """A body at rest that a command spins up: its first steps, which move next to nothing, are no cause."""
    with told() as said:
        body = co.Stepper(PUSHED, PUSHED.state(), dt=0.2, inputs={"torque": np.zeros(3)})
        body.step({"torque": [0.0, 8.0, 0.1]})
    assert said == [] and body.judging
    with told() as said:
        for _ in range(40):
            body.step()
        other = body.clone()
        other.step(n=10)
    assert len(said) == 1 and not body.judging


@pytest.mark.parametrize("n", [pytest.param(1, marks=pytest.mark.long), 7, 6000])
def test_judging_changes_no_bit_and_ends(n):
    judged, plain = stepper(0.005), stepper(0.005, accuracy=False)
    assert judged.judging and not plain.judging
    for _ in range(-(-6000 // n)):
        judged.step(n=n)
        plain.step(n=n)
    assert judged.observed.tobytes() == plain.observed.tobytes() and judged.steps == plain.steps
    assert not judged.judging


@pytest.mark.parametrize("backend", ["native", pytest.param("xla", marks=pytest.mark.long)])
def test_steps_that_become_too_long_after_the_sample_warn_once(backend):
    """A command spins the body up after the 4096 first steps."""
    with told() as said:
        body = co.Stepper(PUSHED, PUSHED.state(), dt=0.2, inputs={"torque": np.zeros(3)}, backend=backend)
        body.step(n=5000)
        body.step({"torque": [0.0, 8.0, 0.1]}, n=40)
        body.step({"torque": [0.0, 0.0, 0.0]}, n=3000)
    assert said == [] and not body.judging
    other = body.clone()
    for one in (body, other):
        with told() as said:
            for _ in range(3):
                one.step(n=4000)
        assert len(said) == 1


@pytest.mark.long
def test_a_resolved_motion_is_judged_at_few_steps(monkeypatch):
    body = stepper(0.005)
    seen = []
    monkeypatch.setattr(type(body), "_judgement", lambda self, sample: seen.append(int(self.steps)))
    for _ in range(10_000):
        body.step()
    for _ in range(9):
        body.step(n=33_000)
    assert seen == [0, 1, 2, *(2**k for k in range(2, 14)), 43_000, 76_000, 142_000, 274_000]


@pytest.mark.long
def test_many_members_are_judged_with_their_own_parameters():
    system = co.System(co.SO3(), lambda xi, p: 0.5 * xi @ (p.J * xi), parameters={"J": co.each(np.tile(J, (20, 1)))})
    for spin, count in ((8.0, 1), (0.5, 0)):
        with told() as said:
            many = co.Stepper(system, system.state(xi=[0.3, spin, 0.3]), dt=0.1)
            many.step(n=20)
        assert len(said) == count


def test_an_event_and_a_step_that_fails_are_as_without_judging():
    until = {"until": lambda s: s.t - 0.1234}
    ends = []
    for accuracy in (True, False):
        body = stepper(0.01, accuracy=accuracy, **until)
        body.step(n=50)
        ends.append((body.event, body.observed.tobytes()))
    assert ends[0] == ends[1] and ends[0][0] == pytest.approx(0.1234)


def test_what_jumps_at_nodes_is_held_over_a_step_that_is_judged():
    """A sampled controller and noise, drawn anew in each step, in a motion that the steps resolve."""

    def rule(motion, h, p):
        return {"torque": co.mechanics.jumped(-3.0 * motion.xi + jnp.sin(1e3 * motion.t))}

    rule.jumping = ("torque",)
    system = co.System(
        co.SO3(), lambda xi, p: 0.5 * xi @ (J * xi), forces=lambda m, p: co.Force(torque=m.internal.torque),
        internal=rule, parameters={"k": 1.0},
    )  # fmt: skip
    with told() as said:
        made = co.Stepper(system, system.state(xi=[0.3, 0.2, 0.1], internal={"torque": np.zeros(3)}), dt=0.05)
        made.step(n=100)
    assert said == []


def test_a_loaded_stepper_is_judged_without_jax(tmp_path):
    with told() as said:
        stepper(0.3).save(tmp_path / "fast.step")
        stepper(0.01).save(tmp_path / "slow.step")
        stepper(0.3, accuracy=False).save(tmp_path / "silent.step")
    assert len(said) == 1
    code = (
        "import sys, warnings\n"
        "from coadjoint.simulation.steppers.stepping import load_stepper\n"
        "warnings.simplefilter('always')\n"
        "for name in sys.argv[1:]:\n"
        "    with warnings.catch_warnings(record=True) as said:\n"
        "        made = load_stepper(name)\n"
        "        made.step(n=20)\n"
        "        made.save(name + '2')\n"
        "    print(len(said), *[str(one.message)[:37] for one in said])\n"
        "assert 'jax' not in sys.modules\n"
    )
    files = [str(tmp_path / f"{name}.step") for name in ("fast", "slow", "silent")]
    found = subprocess.run([sys.executable, "-c", code, *files], capture_output=True, text=True)
    assert found.stdout.splitlines() == [f"1 dt = 0.3 {UNRESOLVED}", "0", "0"], found.stderr
    with told() as said:
        co.load_stepper(files[0] + "2")
    assert len(said) == 1


@pytest.mark.long
@pytest.mark.parametrize(
    ("group", "space"),
    [
        (co.SE2(), co.spaces.Points()),
        pytest.param(co.SO3(), co.Defining(), marks=pytest.mark.long),
        pytest.param(co.SE3(), co.Defining(), marks=pytest.mark.long),
        pytest.param(co.SO3(), {"a": co.Defining()}, marks=pytest.mark.long),
    ],
)
def test_what_a_file_measures_of_positions_is_what_a_stepper_measures(group, space):
    """q = g·n of a point that turns, of one that moves with a body, and of a named one."""
    from coadjoint.kernels.packing import layout, pack
    from coadjoint.simulation.accuracy.ruler import plain, ruler_of

    random = np.random.default_rng(5)
    system = co.System(group, lambda xi, n, nu: 0.5 * xi @ xi, additional=space)
    q = random.normal(size=system.additional.ambient(system.group))
    given = {"a": q} if isinstance(space, dict) else q
    state = system.state(g=jax.tree.map(np.asarray, _element(group, random)), q=given, xi=random.normal(size=group.dim))
    ruler, row = ruler_of(layout(state), system.places), pack(state)[1][None]
    kept = plain(ruler, layout(state), system.places)
    assert np.allclose(kept.q(row), ruler.q(row)) and np.allclose(kept.q(row)[0], q)
    assert np.allclose(kept.turning(state.xi[None]), ruler.turning(state.xi[None]))


@pytest.mark.parametrize(
    ("every", "largest", "lengths"), [(200, [200], [50]), (30, [0, 200], [30, 20]), (200, [990], [10])]
)
def test_few_steps_are_taken_again_and_none_beyond_the_end(monkeypatch, every, largest, lengths):
    """A twentieth of 1000 steps at most; the record before the largest change is kept."""
    asked = []

    def records(rows, h, length, members):
        asked.append(length)
        return np.where(np.arange(length) > 7, 1.0, 0.0)[None, :, None] + rows[:, None]

    places = SimpleNamespace(xi=np.array([0]), nu=np.zeros(0, int), mu=np.zeros(0, int), pi=np.zeros(0, int))
    model = SimpleNamespace(layout=SimpleNamespace(places=places), records=records)
    monkeypatch.setattr("coadjoint.simulation.accuracy.sample.steps_of", lambda *_: model)
    plan: Any = SimpleNamespace(steps=1000, save_every=every, backend="native", h=0.1)
    state: Any = None
    kept = Kept(np.array([0, 200, 990]), np.array([[5.0], [6.0], [7.0]]))
    found = with_steps_between(kept, largest, plan, state)
    assert asked == lengths
    assert set(found.steps) == {0, 200, 990, *(step + 7 for step in largest)}
    assert dict(zip(found.steps.tolist(), found.rows[:, 0], strict=True))[largest[0] + 7] in kept.rows[:, 0]


def test_structure_constants_give_the_bracket():
    xi, eta = np.random.default_rng(6).normal(size=(2, 3))
    for group in (co.SE2(), co.groups.SLn(2)):
        found = np.einsum("ijk,j,k", structure(group), xi, eta)
        np.testing.assert_allclose(found, evaluate(group.ad, xi, eta), atol=1e-15)


def _element(group, random):
    with co.float64():
        return group.exp(jnp.asarray(random.normal(size=group.dim)))


def test_a_trajectory_is_judged_where_its_numbers_are_known():
    arguments = {"dt": 0.3, "steps": 20}
    start = BODY.state(xi=SPIN)
    with told() as said:
        co.trajectory(BODY, start, **arguments)
    assert len(said) == 1
    with told() as said:
        co.trajectory(BODY, start, **arguments, accuracy=False)
        co.trajectory(BODY, start, dt=0.01, steps=20, save_every=5)
        with co.float64():
            jax.jit(lambda dt: co.trajectory(BODY, start, dt=dt, steps=20).final.xi)(0.3)
    assert said == []


@pytest.mark.parametrize("given", ["yes", 1, None])
def test_accuracy_must_be_true_or_false(given):
    with pytest.raises(co.errors.ArgumentError, match="`accuracy` must be True or False"):
        stepper(0.01, accuracy=given)


def test_warnings_name_the_line_that_called(tmp_path):
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        made = co.Stepper(BODY, BODY.state(xi=SPIN), dt=0.3)
        co.load_stepper(made.save(tmp_path / "fast.step"))
        co.trajectory(BODY, BODY.state(xi=SPIN), dt=0.3, steps=3)
        co.Stepper(BODY, BODY.state(xi=SPIN), dt=0.1).step(n=40)
    assert [one.filename for one in said] == [__file__] * 4


@pytest.mark.parametrize("speed", [1.0, 20.0])
def test_momenta_that_move_alone_are_judged_by_how_far_they_move(speed):
    """As of a fluid whose method leaves g out: μ of size 1 turns by hω, which a midpoint step takes as 2 atan(hω/2)."""

    def midpoint(rows, h, steps=1, members=None):
        turn = steps * 2 * np.arctan(h * speed / 2)
        mu, way = rows[:, 1] + 1j * rows[:, 2], np.exp(1j * turn)
        after = np.stack([rows[:, 0] + steps * h, (mu * way).real, (mu * way).imag], axis=1)
        return after, rows, np.zeros(len(rows), int)

    ruler = Ruler(0, (), (), (), (1, 2), (), (1, 2), (), None, lambda xi: np.zeros(len(xi)))
    row = np.array([[0.0, 1.0, 0.0]])
    for turn, resolved in ((0.6, True), (0.9, False)):
        parts = PartsOfSteps(midpoint, ruler, InternalPlaces(), 2)
        errors, _ = parts.errors(row, np.array([turn / speed]))
        exact = (turn - 2 * np.arctan(turn / 2)) / (2 * np.sin(turn / 2))
        assert errors.local[0] == pytest.approx(exact, rel=0.15)
        found = SampledSteps(parts).judge(row, turn / speed)
        assert (found is None) is resolved
        if found is not None:
            assert "of what it moves (μ, t = 0 s)" in found
            proposed = float(found.split("Take dt = ")[1].split(" or less")[0])
            assert turn / speed / 4 <= proposed < turn / speed
