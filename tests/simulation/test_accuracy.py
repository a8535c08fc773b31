"""The certificate tells runs that dt resolves from those that it does not, and how accurate a step is."""

import pickle
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels import packing
from coadjoint.simulation.accuracy.local_error import relative
from coadjoint.simulation.accuracy.resolution import _excited, trajectory_errors
from coadjoint.simulation.accuracy.ruler import Doubling
from resolution import RESOLVED, UNRESOLVED, driven, lag, near_collision, spring, top

QUICK = (
    "spring, hω = 100.0",
    "quadratic drag, hcv = 100",
    "top, h|ω| = 1.0",
    "held input at 2π/h",
    "force of time at 2π/h",
    "body, inertia 1e-6 about one axis",
    "force of time at 1 · 2π/h on a free mass",
    "held pulse within a step",
    "triangle within a step",
    "ripple on a constant force",
    "actuator whose command is at 1000 rad/s",
    "held command that jumps within a step",
    "body about a principal axis, 2 rad a step, exponential",
    "slow spring beside one of hω = 100 at rest",
    "stiff drag 3, at its final speed",
    "body, 0.2 rad a step, variable step",
    "at rest",
    "vehicle, dt = 0.05",
    "held input at 2 rad/s",
)


def selected(cases):
    marks = {True: (), False: (pytest.mark.long,)}
    return [pytest.param(case, id=case.name, marks=marks[case.name in QUICK]) for case in cases]


def warned(run):
    return [sentence for sentence in run.warnings if "does not resolve this motion" in sentence]


@pytest.mark.cases(1)
@pytest.mark.parametrize("case", selected(UNRESOLVED))
def test_a_run_that_is_not_resolved_says_so_and_names_a_dt_that_would_do(case):
    try:
        run = case.simulate()
    except co.errors.StepError as error:
        run = error.run
    assert run.accuracy is not None and not run.accuracy.resolved
    assert len(warned(run)) == 1 and "accuracy " in str(run) and "unresolved: " in str(run)
    assert 0 < run.accuracy.resolving < run.dt
    assert run.summary()["resolved"] == 0 and run.summary()["dt_resolving"] == run.accuracy.resolving


@pytest.mark.long
def test_the_dt_that_resolves_a_command_does_not_depend_on_the_lag_that_follows_it():
    quick, slow = (co.simulate(*made[:2], **made[2]) for made in (lag(tau, rate=1000.0)() for tau in (1.0, 50.0)))
    assert slow.accuracy.resolving == quick.accuracy.resolving < np.pi / 1000


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("case", selected(RESOLVED))
def test_a_run_that_is_resolved_is_no_alarm(case):
    run = case.simulate()
    assert warned(run) == [] and run.accuracy is not None and run.accuracy.resolved
    assert run.summary()["resolved"] == 1 and "local error" in str(run)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("members", [None, 3])
def test_a_collision_between_two_saved_records_is_seen(members):
    system, start, arguments = near_collision(0.02, steps=2000, core=0.05)()
    if members is not None:
        speeds = np.linspace(0.2, 0.25, members)[:, None] * [0, 1, 0]
        start = system.state(q=[1.0, 0, 0], qdot=co.each(speeds))
    every, tenth = (co.simulate(system, start, **arguments, save_every=n) for n in (1, 50))
    assert not every.accuracy.resolved and not tenth.accuracy.resolved
    assert np.any(tenth.accuracy.steps % 50)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("case", selected([case for case in UNRESOLVED if case.name in QUICK[:2]]))
def test_the_dt_that_is_named_resolves_the_motion(case):
    coarse = case.simulate()
    fine = case.simulate(dt=coarse.accuracy.resolving)
    assert fine.accuracy.resolved


def exact_errors(run):
    """The local errors of the judged steps against 64 steps of h/64, and the certificate's own."""
    accuracy, plan = run.accuracy, run.plan
    index = np.isin(run.steps_saved, accuracy.steps)

    records = jax.tree.map(lambda leaf: leaf[index], run.records)
    doubling = Doubling(plan, jax.tree.map(lambda leaf: leaf[0], records))
    rows, h = packing.rows(records), np.full(int(index.sum()), plan.h)
    errors, sizes = doubling.errors(rows, h)
    begun, whole, fine = rows, doubling.over(rows, h, (1.0,))[0], doubling.over(rows, h, (1 / 64,) * 64)[0]

    return errors.local, relative(doubling.compare(begun, fine, whole), sizes)[0]


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(
    "case",
    selected(
        [
            case
            for case in RESOLVED
            if not case.name.startswith(
                (
                    "at rest",
                    "body that does not",
                    "stiff drag",
                    "stiff spring",
                    "slow spring",
                    "body, 0.2 rad a step, v",
                )
            )
        ]
    ),
)
def test_the_local_error_is_that_against_a_step_of_h_64(case):
    """Within a factor of 3 at 95 % of the steps judged, down to round-off; stiff modes, hω ≫ 1, have no order there."""
    found, exact = exact_errors(case.simulate())
    well = (found < 3 * exact + 1e-12) & (exact < 3 * found + 1e-12)
    assert np.mean(well) >= 0.95


@pytest.mark.long
def test_no_accuracy_is_judged_where_none_is_asked_for():
    system, start, arguments = spring([1e4])()
    run = co.simulate(system, start, accuracy=False, **arguments)
    assert run.accuracy is None and "accuracy" not in str(run) and warned(run) == []


@pytest.mark.cases(1)
@pytest.mark.parametrize("backend", ["native", pytest.param("xla", marks=pytest.mark.long)])
def test_the_worst_member_of_an_ensemble_is_told(backend):
    def lagrangian(xi, n, nu, p):
        return 0.5 * xi @ np.diag([1.0, 2.0, 3.0]) @ xi + 0.5 * nu @ nu - 0.5 * p.rate**2 * n @ n

    def run(fastest):
        parameters = {"rate": co.each(np.linspace(1.0, fastest, 5))}
        system = co.System(co.SO3(), lagrangian, additional=co.Trivial(1), parameters=parameters)
        start = system.state(q=[1.0], xi=[0.1, 0.2, 0.1])
        return co.simulate(system, start, dt=0.01, steps=20, backend=backend)

    slow, fast = run(10.0), run(1e4)
    assert warned(slow) == [] and slow.accuracy.resolved
    assert len(warned(fast)) == 1 and fast.accuracy.worst > 1


@pytest.mark.long
def test_a_run_by_xla_is_judged_as_the_native_one():
    """Of the same steps, to round-off; XLA judges fewer."""
    system, start, arguments = top(0.3, steps=30)()
    native, xla = (co.simulate(system, start, backend=backend, **arguments) for backend in ("native", "xla"))
    both = np.intersect1d(native.accuracy.steps, xla.accuracy.steps)
    assert len(both) >= 3
    of = [run.accuracy.local_errors[np.isin(run.accuracy.steps, both)] for run in (native, xla)]
    np.testing.assert_allclose(of[0], of[1], rtol=1e-2)


@pytest.mark.long
def test_a_streamed_run_keeps_its_accuracy(tmp_path):
    system, start, arguments = spring([1e4])()
    run = co.simulate(system, start, store=tmp_path / "run", **arguments)
    again = co.resume(tmp_path / "run", system)
    assert again.accuracy.worst == run.accuracy.worst and again.accuracy.reasons == run.accuracy.reasons
    assert "unresolved" in str(co.load(tmp_path / "run")) and warned(again) == warned(run) != []


def test_steps_at_which_the_motion_changes_most_are_judged_however_few_they_are():
    """A stiff spring of 10 ms length is met once in 4000 steps: those steps are found."""
    case = next(case for case in RESOLVED if case.name == "long ellipse, short steps")
    run = case.simulate()
    fast = np.argmax(np.linalg.norm(np.diff(run.records.pi, axis=0), axis=1))
    assert np.min(np.abs(run.accuracy.steps - fast)) <= 1


@pytest.mark.long
def test_the_step_at_which_a_momentum_is_largest_is_judged_though_it_changes_least_there():
    """Errors are relative to the largest momentum, which a spring at resonance has at t ≈ 8 of 10."""
    system, _, arguments = driven(1.0, explicit=True, steps=200)()
    for members in ({}, {"q": co.each([[0.0], [0.01]])}):
        run = co.simulate(system, system.state(**{"q": [0.0], **members}), **arguments)
        sizes = np.linalg.norm(run.records.pi, axis=-1)
        largest = sizes.argmax() % sizes.shape[-1]
        assert 150 < largest < 170 and largest in run.accuracy.steps


@pytest.mark.long
def test_the_dt_named_for_a_force_of_a_lagging_actuator_is_the_largest_power_of_two_that_resolves():
    """u̇ = −10u and a force u³: a step takes the force at the mean of u, which depends on its length."""

    def rule(motion, h):
        return {"thrust": motion.internal.thrust * jnp.exp(-10 * h)}

    def forces(motion):
        return co.Force(force=motion.internal.thrust**3 * np.array([1.0]))

    def lagrangian(xi, n, nu):
        return 0.5 * xi @ xi + 0.5 * nu @ nu

    system = co.System(co.SO2(), lagrangian, additional=co.Trivial(1), forces=forces, internal=rule)
    start = system.state(q=[0.0], internal={"thrust": 1.0})
    coarse = co.simulate(system, start, dt=0.1, steps=20)
    fine = co.simulate(system, start, dt=2 * coarse.accuracy.resolving, steps=20)
    assert coarse.accuracy.resolving == 0.0125 and fine.accuracy.worst > 0.025


def test_held_inputs_stay_over_a_judged_step_and_lags_do_not():
    system, start, arguments = driven(2.0, held=True)()
    run = co.simulate(system, start, **arguments)

    record = jax.tree.map(lambda leaf: leaf[5:6], run.records)
    doubling = Doubling(run.plan, jax.tree.map(lambda leaf: leaf[0], record))
    end, _ = doubling.over(packing.rows(record), np.full(1, run.dt), (0.5, 0.5))
    assert doubling.probe.layout.unpack(end).inputs == record.inputs != run.records.inputs[6]

    system, start, arguments = lag(0.5)()
    run = co.simulate(system, start, **arguments)
    record = jax.tree.map(lambda leaf: leaf[5:6], run.records)
    doubling = Doubling(run.plan, jax.tree.map(lambda leaf: leaf[0], record))
    end, _ = doubling.over(packing.rows(record), np.full(1, run.dt), (0.5,))
    between, thrust = doubling.probe.layout.unpack(end).internal.thrust[0], run.records.internal.thrust
    assert between == pytest.approx(0.5 * (thrust[5] + thrust[6]), rel=1e-2)
    end, _ = doubling.over(packing.rows(record), np.full(1, run.dt), (0.5, 0.5))
    # The second half follows the command of its own beginning.
    assert thrust[6] < doubling.probe.layout.unpack(end).internal.thrust[0] < 0.5 * (thrust[6] + thrust[7])


FULL = ("spring, hω = 0.1", "vehicle, dt = 0.05", "signal at 2 rad/s", "linear drag, hc = 0.1")
WHOLE = (
    *FULL,
    "spring, hω = 0.3",
    "top, h|ω| = 0.1",
    "body, 0.2 rad a step",
    "ellipsoid",
    "pendulum, 0.05 s",
    "beanie",
)


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, id=case.name, marks=() if case.name in FULL[:2] else (pytest.mark.long,))
        for case in RESOLVED
        if case.name in WHOLE
    ],
)
def test_the_error_of_a_trajectory_is_within_a_factor_of_two(case):
    """Against the same run with steps of dt/16."""
    run = case.simulate(accuracy="full")
    system, start, arguments = case.make()
    fine = {**arguments, "dt": run.dt / 16, "steps": 16 * run.steps, "save_every": 16}
    exact = trajectory_errors(run, co.simulate(system, start, accuracy=False, **fine).records, 16.0).max()
    assert 0.5 * exact < run.accuracy.trajectory < 2 * exact
    assert "trajectory " in run.certificate.long() and run.summary()["trajectory_error_max"] == run.accuracy.trajectory


@pytest.mark.long
def test_a_trajectory_that_parts_from_the_true_one_tells_until_when_it_holds():
    """A top that spins by 0.3 rad a step: its phase is lost after some turns."""
    system, start, arguments = top(0.3)()
    run = co.simulate(system, start, accuracy="full", **arguments)
    assert run.accuracy.trajectory > 0.1 and 0 < run.accuracy.holds < 5
    assert "under 10 % until t = " in str(run)
    system, start, arguments = top(2.5)()
    assert co.simulate(system, start, accuracy="full", **arguments).accuracy.holds == 0.0, "lost in the first step"


def test_a_whole_trajectory_is_judged_only_where_two_runs_share_their_nodes():
    system, start, arguments = top(0.3)()
    with pytest.raises(co.errors.ArgumentError, match="does not go with a method with steps of its own"):
        co.simulate(system, start, accuracy="full", **{**arguments, "method": co.methods.VariableStep()})
    with pytest.raises(co.errors.ArgumentError, match="leave out `until`"):
        co.simulate(system, start, accuracy="full", until=lambda state: state.t - 1.0, **arguments)
    with pytest.raises(co.errors.ArgumentError, match="`accuracy` must be"):
        co.simulate(system, start, accuracy="fully", **arguments)


def test_turn_and_rate_are_those_of_the_run_when_first_read_later():
    system = co.System(co.SO3(), lambda xi, p: 0.5 * xi @ (p.inertia * xi), parameters={"inertia": [1.0, 2.0, 3.0]})
    start = system.state(g=np.eye(3), xi=[1.0, 2.0, 0.5])
    known, later, copied = (co.simulate(system, start, dt=0.01, steps=20).accuracy for _ in range(3))
    numbers = known.numbers()
    assert numbers["turn_max"] > 0 and numbers["fastest_rate"] > 0
    copied = pickle.loads(pickle.dumps(copied))
    assert not {"turn", "rate"} & vars(later).keys() and {"turn", "rate"} < vars(copied).keys()
    assert later.numbers() == copied.numbers() == numbers
    assert replace(later, count=0).rate == known.rate and vars(later)["rate"] == known.rate
    with pytest.raises(AttributeError, match="'rates'"):
        _ = later.rates


def test_modes_that_are_not_found_give_no_rate():
    assert _excited(np.full((2, 2), np.nan), np.ones(2), 1e-3) is None
