"""Bad input is refused in one sentence that names it, before or at the step where it shows."""

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from paper_vehicle import PARAMETERS, lagrangian, start, system

VEHICLE = system()
START = start(VEHICLE)


def simulate(**changes):
    return co.simulate(VEHICLE, START, **{"dt": 0.01, "steps": 10, **changes})


def sentence_of(function) -> str:
    """The message of the error, which must be one of the library's own."""
    with pytest.raises(co.CoadjointError) as caught:
        function()
    message = str(caught.value)
    assert "\n" not in message and len(message) < 400
    return message


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"dt": -0.01}, "Argument `dt` must be positive, but is -0.01."),
        ({"dt": float("nan")}, "`dt` must be positive"),
        ({"dt": "fast"}, "`dt` must be positive"),
        ({"steps": 0}, "Argument `steps` must be a whole number of at least 1, but is 0."),
        ({"steps": 1.5}, "whole number"),
        ({"steps": None, "duration": 0.015}, "1.5 steps of 0.01 s"),
        ({"duration": 1.0}, "either `duration` or `steps`"),
        ({"save_every": 0}, "`save_every` must be a whole number"),
        ({"method": co.Midpoint}, "must be a method such as"),
        ({"backend": "gpu"}, '"auto", "native" or "xla"'),
        ({"kelvin_noether": co.KelvinNoether([0, 0])}, "`c0` must have shape (3,)"),
        ({"kelvin_noether": co.KelvinNoether([0, 0, 1], K=lambda c, a: c * c)}, "Ad_g"),
        ({"dt": 20.0}, "leave the chart of Cayley()"),
    ],
)
def test_a_run_that_makes_no_sense_is_refused(changes, says):
    assert says in sentence_of(lambda: simulate(**changes))


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"q": [0, 0]}, "`q` must have shape (3,), but has shape (2,)"),
        ({"q": None}, "give `q`"),
        ({"a0": None}, "give `a0`"),
        ({"xi": [0, 0, np.nan]}, "`xi` must be finite"),
        ({"xi": "abc"}, "`xi` must have shape (3,)"),
        ({"g": np.diag([1, 2, 1])}, "must lie in SO3()"),
        ({"g": np.diag([1, 1, -1])}, "determinant is −1"),
        ({"g": np.eye(4)}, "but has shape (4, 4)"),
        ({"g": (np.eye(3), np.zeros(3))}, "another structure"),
    ],
)
def test_a_start_outside_its_spaces_is_refused(changes, says):
    assert says in sentence_of(lambda: start(VEHICLE, **changes))


@pytest.mark.parametrize(
    ("ell", "says"),
    [
        (lambda xi, n, nu, a, p: xi, "must return one number, but returns (3,)"),
        (lambda xi, n, nu, a, p: None, "but returns nothing"),
        (lambda xi, n, nu, a, p: 1j * lagrangian(xi, n, nu, a, p), "complex128"),
        (lambda xi, n, nu, a, p: jnp.nan * lagrangian(xi, n, nu, a, p), "must be finite at the start"),
        (lambda xi, n, nu, a, p: jnp.float32(5.46) * lagrangian(xi, n, nu, a, p), "float32"),
        (lambda xi, n, nu, a, p: lagrangian(xi, n, nu, a, p) + np.ones(3, np.float32) @ n, "float32"),
        (lambda xi, n, nu, a, p: np.linalg.norm(nu), "write it with jax.numpy"),
        (lambda xi, n, nu, a, p: lagrangian(xi, n, nu, a, p) if xi[0] > 0 else 0.0, "without `if`"),
        (lambda xi, n, nu, a, p: lagrangian(xi, n, nu, a, p) + jnp.linalg.norm(xi), "gradient of the Lagrangian in xi"),
        (lambda xi, n, nu, a, p: 1 / 0, "ZeroDivisionError"),
        (lambda xi, n, nu, a: 0.0, "must take (xi, n, nu, a, p), but takes (xi, n, nu, a)"),
        (lambda xi, n, nu, a, p: 0.5 * xi @ xi + n @ a, "carries no kinetic energy"),
    ],
)
def test_a_lagrangian_that_cannot_be_integrated_is_refused(ell, says):
    def run():
        vehicle = system(ell)
        co.simulate(vehicle, start(vehicle, xi=[0, 0, 0], qdot=[0, 0, 1]), dt=0.01, steps=3)

    assert says in sentence_of(run)


def test_an_asymmetric_inertia_is_refused_because_the_lagrangian_drops_its_antisymmetric_part():
    inertia = np.diag([5.0, 5.0, 5.0])
    inertia[0, 1] = 1.0
    vehicle = system(parameters=PARAMETERS.replace(inertia=inertia))
    assert "`inertia` must be symmetric" in sentence_of(lambda: co.simulate(vehicle, START, dt=0.01, steps=3))


def test_a_matrix_of_forces_may_be_asymmetric():
    drag = np.array([[1.0, 2.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    parameters = co.Parameters(**{**PARAMETERS.asdict(), "drag": drag})
    vehicle = system(parameters=parameters, forces=lambda motion, p: co.Force(force=-p.drag @ motion.nu))
    assert co.simulate(vehicle, start(vehicle), dt=0.01, steps=3).good_steps == 3


def test_a_singular_inertia_is_refused():
    vehicle = system(parameters=PARAMETERS.replace(inertia=np.diag([5.0, 5.0, 0.0])))
    assert "Legendre transform must be regular" in sentence_of(lambda: co.simulate(vehicle, START, dt=0.01, steps=3))


def test_an_indefinite_inertia_is_warned_of():
    vehicle = system(parameters=PARAMETERS.replace(inertia=np.diag([5.0, 5.0, -1.0])))
    assert "not positive definite" in co.simulate(vehicle, START, dt=0.01, steps=3).warnings[0]


@pytest.mark.parametrize("value", [np.float32(5.46), np.ones(3, np.float32), "heavy", np.nan, [1, [2]]])
def test_a_parameter_that_is_no_float64_number_is_refused(value):
    assert "`mass` must be" in sentence_of(lambda: co.Parameters(mass=value))


def test_an_unknown_parameter_is_named():
    assert "no `masss` to replace" in sentence_of(lambda: VEHICLE.replace(masss=1.0))


def test_groups_and_spaces_that_do_not_fit_are_refused():
    assert "must be a Lie group" in sentence_of(lambda: co.System(co.SO3, lagrangian))
    assert "must be a space" in sentence_of(lambda: co.System(co.SO3(), lagrangian, additional=co.Defining))
    assert "rigid motions" in sentence_of(lambda: co.System(co.SO3(), lagrangian, additional=co.Points()))
    assert "must be a difference map" in sentence_of(lambda: co.Midpoint(co.Cayley))


def test_a_basis_that_is_no_algebra_is_refused():
    e, f = [[0, 1], [0, 0]], [[0, 0], [1, 0]]
    assert "closed under the bracket" in sentence_of(lambda: co.MatrixGroup([e, f]))
    assert "linearly independent" in sentence_of(lambda: co.MatrixGroup([e, e]))
    assert "square matrices" in sentence_of(lambda: co.MatrixGroup("sl2"))


@pytest.mark.parametrize("backend", ["native", "xla"])
def test_a_force_that_becomes_infinite_stops_the_run_at_that_step_and_keeps_what_was_computed(backend):
    vehicle = system(forces=lambda motion, p: co.Force(torque=motion.xi * jnp.log(0.0525 - motion.t)))
    with pytest.raises(co.StepError, match=r"Step 5 of 30 \(t = 0.05 s\) gave numbers that are not finite") as caught:
        co.simulate(vehicle, start(vehicle), dt=0.01, steps=30, backend=backend)
    run = caught.value.run
    assert run.good_steps == 5 and run.count == 5
    assert all(np.all(np.isfinite(values)) for values in run.dataset.data_vars.values())


@pytest.mark.parametrize("backend", ["native", "xla"])
def test_a_step_too_large_to_converge_stops_the_run_with_the_remedy(backend):
    def stiff(xi, n, nu, a, p):
        return 0.5 * nu @ nu + 0.5 * xi @ xi - jnp.exp(20.0 * (n @ n))

    body = co.System(co.SO3(), stiff, additional=co.Defining(), advected=co.Defining(), parameters=PARAMETERS)
    begun = body.state(q=[0.1, 0, 0], qdot=[10.0, 0, 0], a0=[0, 0, 1])
    with pytest.raises(co.StepError, match="take a smaller dt") as caught:
        co.simulate(body, begun, dt=0.3, steps=100, backend=backend)
    assert caught.value.run.good_steps < 100


def test_a_step_that_leaves_the_chart_stops_the_run():
    def spinning_up(motion, p):
        return co.Force(torque=jnp.array([0.0, 0.0, 400.0]))

    vehicle = system(forces=spinning_up)
    with pytest.raises(co.StepError, match="left the chart of the difference map"):
        co.simulate(vehicle, start(vehicle), dt=0.1, steps=200, method=co.LeftRight())


def test_a_traced_float32_parameter_asks_for_the_float64_scope():
    import jax

    def height(mass):
        return co.trajectory(VEHICLE.replace(mass=mass), START, dt=0.01, steps=2).final.q[2]

    assert "with co.float64():" in sentence_of(lambda: jax.grad(height)(123.8))
