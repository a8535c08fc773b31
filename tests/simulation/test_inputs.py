"""Inputs: signals keep the order of a method, held functions of the motion do not, and both reach every node."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.expressions.expression import reachable
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.kernels.trace.tracer import Tracer, flat
from coadjoint.mechanics.continuous import reference

DURATION = 1.0
SUZUKI = co.Suzuki4(co.Midpoint(co.Cayley()), negative_substeps="allow")


def _lagrangian(xi, p, *, inputs):
    return 0.5 * p.inertia @ xi**2 + 0.3 * inputs.spin * xi[2] + 0.1 * inputs.spin * xi[0] ** 2


def _motor(motion, p):
    return co.Force(torque=motion.inputs.torque - 0.1 * motion.xi)


BODY = co.System(
    co.SO3(), _lagrangian, parameters=co.Parameters(inertia=[1.0, 1.5, 2.0]), forces=_motor, name="driven body"
)
START = BODY.state(xi=[0.3, -0.4, 1.0], inputs={"spin": 0.0, "torque": np.zeros(3)})


def spin(t):
    return 1 + jnp.sin(3 * t)


def torque(t):
    return jnp.array([1.0, 0.5, -0.7]) * jnp.exp(-t) * jnp.cos(4 * t)


SMOOTH = {"spin": co.mechanics.Signal(spin), "torque": co.mechanics.Signal(torque)}


def exact(inputs) -> np.ndarray:
    """μ at the end, by DOP853."""
    end = reference(BODY.driven(inputs), START, [0.0, DURATION])
    return end.mu[-1]


def errors(method, inputs, steps) -> list[float]:
    best = exact(SMOOTH)
    runs = (co.trajectory(BODY, START, dt=DURATION / n, steps=n, method=method, inputs=inputs) for n in steps)
    return [float(np.max(np.abs(run.final.mu - best))) for run in runs]


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("method", "order"),
    [
        (co.LeftRectangle(co.Cayley()), 1),
        (co.RightRectangle(co.Cayley()), 1),
        (co.Midpoint(co.Cayley()), 2),
        (co.Trapezoidal(co.Cayley()), 2),
        (co.methods.LeftRight(co.Cayley()), 2),
        (SUZUKI, 4),
    ],
    ids=lambda value: getattr(value, "title", str(value)),
)
def test_smooth_signals_in_forces_and_in_the_lagrangian_keep_the_order(method, order):
    coarse, fine = errors(method, SMOOTH, (20, 40))
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.12)


@pytest.mark.long
@pytest.mark.parametrize("method", [co.Midpoint(co.Cayley()), SUZUKI])
def test_holding_the_same_inputs_over_each_step_costs_the_order(method):
    coarse, fine = errors(method, lambda motion: {"spin": spin(motion.t), "torque": torque(motion.t)}, (40, 80))
    assert np.log2(coarse / fine) == pytest.approx(1, abs=0.1)


HELD = {"spin": lambda motion: spin(motion.t), "torque": lambda motion: torque(motion.t)}


@pytest.mark.long
@pytest.mark.parametrize("inputs", [SMOOTH, HELD, {"spin": 0.7, "torque": np.ones(3)}], ids=["signals", "held", "set"])
def test_a_run_starts_from_the_momenta_that_the_start_shows_whatever_drives_it(inputs):
    """Of the start's own spin 0 in ∂ℓ/∂ξ₃ = 2ξ₃ + 0.3 spin, not of the run's first."""
    how = {"dt": 0.05, "inputs": inputs}
    np.testing.assert_allclose(START.mu, [0.3, -0.6, 2.0], rtol=1e-15)
    run = co.simulate(BODY, START, steps=1, progress=False, **how)
    path = co.trajectory(BODY, START, steps=1, **how)
    stepper = co.Stepper(BODY, START, **how)
    stepper.step()
    for start in (run.records.mu[0], path.records.mu[0]):
        np.testing.assert_array_equal(start, START.mu)
    np.testing.assert_allclose(stepper.state.mu, run.final.mu, rtol=1e-14)
    stepper.reset(START)
    np.testing.assert_array_equal(stepper.state.mu, START.mu)
    if inputs is SMOOTH:
        np.testing.assert_allclose(reference(BODY.driven(inputs), START, [0.0]).mu[0], START.mu, atol=1e-14)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("inputs", [SMOOTH, HELD], ids=["signals", "held"])
def test_members_start_from_their_own_momenta_whatever_drives_them(inputs):
    heavier, turning = co.each([[1.0, 1.5, 2.0], [2.0, 2.5, 3.0]]), co.each([[0.3, -0.4, 1.0], [0.0, 0.5, 2.0]])
    still = {"spin": 0.0, "torque": np.zeros(3)}
    for fleet, start, shown in (
        (BODY.replace(inertia=heavier), START, [[0.3, -0.6, 2.0], [0.6, -1.0, 3.0]]),
        (BODY, BODY.state(xi=turning, inputs=still), [[0.3, -0.6, 2.0], [0.0, 0.75, 4.0]]),
    ):
        ensemble = co.simulate(fleet, start, dt=0.05, steps=1, inputs=inputs, progress=False)
        np.testing.assert_allclose(ensemble.records.mu[:, 0], shown, rtol=1e-15)


@pytest.mark.long
def test_a_derivative_through_the_start_is_that_of_the_momenta_it_shows():
    """At one step of hardly any length dμ₃/dξ₃ = 2, and dμ₃/d(the start's spin) = 0.3."""
    with co.float64():

        def momentum(given):
            start = BODY.state(xi=jnp.array([0.3, -0.4, given[0]]), inputs={"spin": given[1], "torque": np.zeros(3)})
            return co.trajectory(BODY, start, dt=1e-9, steps=1, inputs=SMOOTH).final.mu[2]

        slope = jax.grad(momentum)(jnp.array([1.0, 0.0]))
    np.testing.assert_allclose(slope, [2.0, 0.3], rtol=1e-7)


@pytest.mark.long
def test_a_start_by_velocities_keeps_them_under_the_first_inputs():
    method = co.Midpoint(co.Cayley(), start="velocity")
    for inputs in (SMOOTH, HELD):
        run = co.simulate(BODY, START, dt=1e-6, steps=1, inputs=inputs, method=method, progress=False)
        np.testing.assert_allclose(run.records.xi[0], START.xi, atol=1e-12)
        assert run.records.mu[0][2] == pytest.approx(2.3, abs=1e-5)


def test_a_table_that_is_linear_between_steps_keeps_the_second_order():
    times = np.linspace(0, DURATION, 11)
    table = {
        "spin": co.Linear(times, np.asarray(evaluate(jax.vmap(spin), times))),
        "torque": co.Linear(times, np.asarray(evaluate(jax.vmap(torque), times))),
    }
    best = co.trajectory(
        BODY,
        START,
        dt=DURATION / 320,
        steps=320,
        method=SUZUKI,
        inputs=table,
    )
    found = [
        np.max(np.abs(co.trajectory(BODY, START, dt=DURATION / n, steps=n, inputs=table).final.mu - best.final.mu))
        for n in (20, 40)
    ]
    assert np.log2(found[0] / found[1]) == pytest.approx(2, abs=0.1)


def test_tables_are_what_numpy_interpolates():
    random = np.random.default_rng(7)
    for count in (1, 2, 3, 8, 37):
        times, values = np.cumsum(random.uniform(0.1, 1, count)), random.normal(size=(count, 2))
        at = np.concatenate([random.uniform(times[0] - 1, times[-1] + 1, 50), times])
        linear = evaluate(jax.vmap(co.Linear(times, values)), at)
        expected = np.stack([np.interp(at, times, column) for column in values.T], axis=1)
        np.testing.assert_allclose(linear, expected, atol=1e-13)
        held = evaluate(jax.vmap(co.Held(times, values)), at)
        rows = np.maximum(np.searchsorted(times, at, side="right") - 1, 0)
        np.testing.assert_array_equal(held, values[rows])


def test_a_jump_on_the_grid_belongs_to_the_step_that_starts_there_whatever_rounding_does():
    """t = 0.1 k is not the k-th multiple of 0.1 in floating point, and the table has the other."""
    times = np.array([0.1 * k for k in range(40)])
    grid = np.cumsum(np.full(40, 0.1)) - 0.1
    assert np.any(times != grid)
    np.testing.assert_array_equal(evaluate(jax.vmap(co.Held(times, np.arange(40.0))), grid), np.arange(40.0))


LONG = np.random.default_rng(11).normal(size=(20_000, 3))
ROWS = np.linspace(-3.0, 4.0, len(LONG))


def midpoints(steps: int, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """The times at which `Midpoint` looks, and the rows of the long table that are in force there."""
    at = (np.arange(steps) + 0.5) * dt
    return at, LONG[np.searchsorted(ROWS, at, side="right") - 1]


@pytest.mark.long
def test_a_long_table_drives_by_the_rows_in_force_on_every_path():
    """Alone, beside others, stepped and by XLA it is what a table of these rows only does; also its derivatives."""
    steps, dt = 20, 0.05
    at, used = midpoints(steps, dt)
    inputs = {"spin": 0.4, "torque": co.Held(ROWS, LONG)}
    run = co.trajectory(BODY, START, dt=dt, steps=steps, inputs=inputs, backend="native")
    few = {"spin": 0.4, "torque": co.Held(at - 0.3 * dt, used)}
    assert np.array_equal(run.final.mu, co.trajectory(BODY, START, dt=dt, steps=steps, inputs=few).final.mu)
    by_xla = co.trajectory(BODY, START, dt=dt, steps=steps, inputs=inputs, backend="xla")
    np.testing.assert_allclose(by_xla.final.mu, run.final.mu, rtol=1e-12)
    members = BODY.replace(inertia=co.each([[1.0, 1.5, 2.0], [1.1, 1.6, 2.1]]))
    told = {"monitors": False, "accuracy": False, "backend": "native"}
    beside = co.simulate(members, START, dt=dt, steps=steps, inputs=inputs, **told)
    np.testing.assert_allclose(beside.final.mu[0], run.final.mu, rtol=1e-12)
    stepper = co.Stepper(BODY, START, dt=dt, inputs={"spin": co.Held(ROWS, LONG[:, 0]), "torque": np.zeros(3)})
    for row in used:
        stepper.step({"torque": row})
    both = {"spin": co.Held(ROWS, LONG[:, 0]), "torque": co.Held(at - 0.3 * dt, used)}
    assert np.array_equal(stepper.state.mu, co.trajectory(BODY, START, dt=dt, steps=steps, inputs=both).final.mu)
    with co.float64():

        def speed(inertia, backend):
            system = BODY.replace(inertia=inertia)
            return co.trajectory(system, START, dt=dt, steps=steps, inputs=inputs, backend=backend).final.xi[2]

        slopes = [jax.grad(speed)(np.array([1.0, 1.5, 2.0]), backend) for backend in ("native", "xla")]
    np.testing.assert_allclose(slopes[0], slopes[1], rtol=1e-10)


def test_a_long_table_of_lines_is_the_function_that_it_tabulates():
    """Within the error of linear interpolation, h²/8 max|u″|, here 1.5e-9."""
    times = np.linspace(-1.0, 2.0, 30_000)
    table = {"spin": co.Linear(times, evaluate(jax.vmap(spin), times)), "torque": co.mechanics.Signal(torque)}
    options = {"dt": 0.05, "steps": 20, "backend": "native"}
    run, smooth = (co.trajectory(BODY, START, inputs=inputs, **options) for inputs in (table, SMOOTH))
    np.testing.assert_allclose(run.final.mu, smooth.final.mu, atol=5e-9)
    assert np.any(run.final.mu != smooth.final.mu)


@pytest.mark.parametrize("kind", [co.Held, co.Linear])
def test_what_a_table_costs_grows_with_the_logarithm_of_its_rows(kind):
    """100 000 rows are looked at 17 times, and come to fewer operations than 100 would by selection."""

    def operations(count: int) -> int:
        tracer = Tracer()
        found = tracer.trace(kind(np.arange(count), np.arange(2.0 * count).reshape(-1, 2)), tracer.symbols("t", 0.0))
        return len(reachable(flat(found)))

    assert operations(100_000) < 250


@pytest.mark.long
def test_tables_may_be_parameters_and_are_differentiated():
    """d(angular momentum)/d(knot) of a free body under a torque table is the area of the knot's hat."""
    times = np.linspace(0, 1, 5)

    def forces(motion, p):
        return co.Force(torque=co.Linear(times, p.torques)(motion.t))

    p = co.Parameters(torques=np.zeros(5))
    turning = co.System(co.SO2(), lambda xi, p: 0.5 * xi @ xi, parameters=p, forces=forces)
    start = turning.state()
    with co.float64():

        def momentum(torques):
            path = co.trajectory(turning.replace(torques=torques), start, dt=0.05, steps=20)
            return path.final.mu[0]

        slope = jax.grad(lambda knots: momentum(knots[:, None] * jnp.ones(1)))(np.ones(5))
    np.testing.assert_allclose(slope, [0.125, 0.25, 0.25, 0.25, 0.125], atol=1e-13)


@pytest.mark.long
def test_signals_and_held_inputs_go_together_and_are_in_the_dataset():
    inputs = {"spin": co.Linear([0, 1], [0, 2]), "torque": lambda motion: -0.5 * motion.xi}
    run = co.simulate(BODY, START, dt=0.05, steps=20, inputs=inputs)
    np.testing.assert_allclose(run.dataset.inputs_spin, 2 * run.dataset.time, atol=1e-14)
    # The held torque was taken at the start of the step, from the velocity of the momenta there.
    xi, spin = -2.0 * run.dataset.inputs_torque.values, run.dataset.inputs_spin.values
    mu = [1.0, 1.5, 2.0] * xi + np.stack([0.2 * spin * xi[:, 0], 0 * spin, 0.3 * spin], axis=1)
    np.testing.assert_allclose(run.dataset.mu, mu, atol=1e-12)
    path = co.trajectory(BODY, START, dt=0.05, steps=20, inputs=inputs)
    np.testing.assert_allclose(path.final.mu, run.final.mu, rtol=1e-12)


def test_a_single_input_has_no_name():
    forces = {"motor": lambda motion: co.Force(torque=motion.inputs)}
    body = co.System(co.SO3(), lambda xi: 0.5 * xi @ xi, forces=forces)
    run = co.simulate(
        body,
        body.state(),
        dt=0.01,
        steps=100,
        inputs=co.mechanics.Signal(lambda t: jnp.array([0, 0, 2 * t])),
        monitors=False,
    )
    assert run.final.mu[2] == pytest.approx(1.0, abs=1e-12)


@pytest.mark.cases(1)
@pytest.mark.parametrize("held", [False, pytest.param(True, marks=pytest.mark.long)])
def test_the_energy_budget_closes_when_inputs_reach_the_lagrangian(held):
    """Signals through −∂_tℓ, held inputs through the jumps of ℋ."""
    inputs = (lambda motion: {"spin": spin(motion.t), "torque": torque(motion.t)}) if held else SMOOTH
    gaps = []
    for n in (40, 80):
        run = co.simulate(BODY, START, dt=DURATION / n, steps=n, inputs=inputs)
        (low, high), first = run.extrema["energy_budget"], run.ends["energy_budget"][0]
        gaps.append(max(high - first, first - low))
        line = "work_inputs" if held else "work_time"
        assert abs(run.ends[line][1]) > 100 * gaps[-1], "a line that is missing would not show"
    assert np.log2(gaps[0] / gaps[1]) == pytest.approx(2, abs=0.1)


@pytest.mark.long
def test_the_energy_budget_closes_when_held_inputs_reach_a_hamiltonian():
    """ℋ jumps with its inputs; over a step the energy–momentum method keeps it."""
    inertia = np.diag([1.0, 2.0, 3.0])
    body = co.System(co.SO3(), hamiltonian=lambda mu, *, inputs: 0.5 * mu @ (mu / np.diag(inertia)) + inputs * mu[0])
    start = body.state(xi=[0.3, 1.0, 0.2], inputs=0.0)
    run = co.simulate(
        body, start, dt=0.05, steps=40, inputs=lambda m: jnp.sin(3 * m.t), method=co.EnergyMomentum(), progress=False
    )
    assert np.ptp(run.monitors["work_inputs"]) > 0.1
    assert run.summary()["energy_budget_error_max"] < 1e-13


@pytest.mark.long
def test_a_run_with_signals_goes_on_from_its_folder(tmp_path):
    whole = co.simulate(BODY, START, dt=0.05, steps=20, inputs=SMOOTH, store=tmp_path / "run")
    again = co.resume(tmp_path / "run", BODY, inputs=SMOOTH)
    np.testing.assert_array_equal(again.final.mu, whole.final.mu)
    with pytest.raises(co.errors.ArgumentError, match="give it again"):
        co.resume(tmp_path / "run", BODY)
    with pytest.raises(co.errors.ArgumentError, match="holds another run"):
        co.resume(tmp_path / "run", BODY, inputs={**SMOOTH, "spin": co.mechanics.Signal(jnp.cos)})


@pytest.mark.long
def test_every_member_takes_the_same_signal():
    fleet = BODY.replace(inertia=co.each([[1.0, 1.5, 2.0], [2.0, 2.5, 3.0]]))
    run = co.simulate(fleet, START, dt=0.05, steps=20, inputs=SMOOTH)
    alone = co.simulate(BODY, START, dt=0.05, steps=20, inputs=SMOOTH)
    np.testing.assert_allclose(run.final.mu[0], alone.final.mu, rtol=1e-12)


@pytest.mark.long
def test_a_number_as_an_input_is_the_signal_that_stays_as_it_is():
    constant = {"spin": 0.7, "torque": [0.1, 0.0, -0.2]}
    signals = {name: co.mechanics.Signal(lambda t, value=value: jnp.array(value)) for name, value in constant.items()}
    given, expected = (co.simulate(BODY, START, dt=0.01, steps=50, inputs=inputs) for inputs in (constant, signals))
    np.testing.assert_array_equal(given.final.mu, expected.final.mu)
    assert np.linalg.norm(given.final.mu - START.mu) > 0.01


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: co.Linear([0, 1, 1], [1, 2, 3]), "must be strictly increasing"),
        (lambda: co.Linear([0, 1], [1, 2, 3]), "k values"),
        (lambda: co.Held([], []), "one at least"),
        (lambda: co.Held([[0.0]], [1]), "k values"),
        (lambda: co.Linear([0, np.nan], [1, 2]), "must be finite"),
        (lambda: co.Held([0, 1], [1, 2])("a"), "The time of co.Held must be a number or an array of numbers"),
        (lambda: co.Linear([0, 1], [1, 2])(None), "The time of co.Linear must be a number"),
        (lambda: co.Linear([0, 1], [1, 2])([0.5, "b"]), "The time of co.Linear must be a number"),
        (lambda: co.Linear([0, 1], [1, 2])(np.inf), "The time of co.Linear must be finite"),
        (lambda: co.Held([0, 1], [1, 2])(10**400), "The time of co.Held must be a number of at most"),
        (lambda: co.Held([0, 1], [1, 2])(np.nan), "The time of co.Held must be finite"),
        (lambda: co.mechanics.Signal(3.0), "must be a function of time"),
        (
            lambda: co.simulate(
                BODY, START, dt=0.1, steps=2, inputs={**SMOOTH, "spin": co.mechanics.Signal(lambda t: None)}
            ),
            "A signal must be a number",
        ),
        (lambda: co.simulate(BODY, START, dt=0.1, steps=2, inputs="fast"), "must be a signal such as"),
        (lambda: co.simulate(BODY, START, dt=0.1, steps=2, inputs={}), "is empty"),
        (lambda: co.simulate(BODY, START, dt=0.1, steps=2, inputs={"spin": "fast"}), "under 'spin' must be"),
        (lambda: co.simulate(BODY, START, dt=0.1, steps=2, inputs=co.each([1, 2])), "same for all members"),
        (
            lambda: co.simulate(
                BODY, START, dt=0.1, steps=2, inputs={**SMOOTH, "spin": co.mechanics.Signal(lambda t: 1 / t)}
            ),
            "must be finite at the start",
        ),
        (
            lambda: co.simulate(
                BODY,
                START,
                dt=0.1,
                steps=2,
                inputs={**SMOOTH, "spin": co.mechanics.Signal(lambda t: jnp.float32(0.1) * t)},
            ),
            "holds float32",
        ),
        (lambda: co.simulate(BODY, START, dt=0.1, steps=2, inputs={"spin": co.mechanics.Signal(spin)}), "no `torque`"),
    ],
)
def test_what_cannot_be_an_input_is_refused_in_one_sentence(make, words):
    with pytest.raises(co.errors.CoadjointError) as caught:
        make()
    assert words in str(caught.value) and "\n" not in str(caught.value)
