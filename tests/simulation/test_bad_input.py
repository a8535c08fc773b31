"""Bad input is refused in one sentence that names it, before or at the step where it shows."""

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.simulation.arguments import _rate
from paper_vehicle import PARAMETERS, lagrangian, start, system

VEHICLE = system()
START = start(VEHICLE)


def simulate(**changes):
    return co.simulate(VEHICLE, START, **{"dt": 0.01, "steps": 10, **changes})


def sentence_of(function) -> str:
    """The message of the error, which must be one of the library's own."""
    with pytest.raises(co.errors.CoadjointError) as caught:
        function()
    message = str(caught.value)
    assert "\n" not in message and len(message) < 400
    return message


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"dt": -0.01}, "Argument `dt` must be positive, but is -0.01."),
        ({"dt": float("nan")}, "`dt` must be positive"),
        ({"dt": "fast"}, "`dt` must be a positive number"),
        ({"steps": 0}, "Argument `steps` must be a whole number from 1, but is 0."),
        ({"steps": 1.5}, "whole number"),
        ({"steps": None, "duration": 0.015}, "1.5 steps of 0.01 s"),
        ({"duration": 1.0}, "either `duration` or `steps`"),
        ({"save_every": 0}, "`save_every` must be a whole number"),
        ({"method": co.Midpoint}, "must be a method such as"),
        ({"backend": "gpu"}, '"auto", "native" or "xla"'),
        ({"kelvin_noether": co.mechanics.KelvinNoether([0, 0])}, "`c0` must have shape (3,)"),
        ({"kelvin_noether": co.mechanics.KelvinNoether([0, 0, 1], K=lambda c, a: c * c)}, "Ad_g"),
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
        ({"xi": "abc"}, "`xi` must hold 3 numbers, but is 'abc'"),
        ({"xi": None, "qdot": None, "mu": "a"}, "`mu` must hold 3 numbers, but is 'a'"),
        ({"xi": None, "qdot": None, "pi": {"x": 1.0}}, "`pi` must hold 3 numbers, but is {'x': 1.0}"),
        ({"qdot": True}, "`qdot` must hold 3 numbers, but is True"),
        ({"q": "north"}, "`q` must hold 3 numbers, but is 'north'"),
        ({"a0": ["down"]}, "`a0` must hold 3 numbers, but is ['down']"),
        ({"g": "identity"}, "`g` must hold the numbers of an element of SO3(), but is 'identity'"),
        ({"xi": 1.0}, "`xi` must have shape (3,), but has shape ()"),
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


@pytest.mark.long
def test_a_matrix_of_forces_may_be_asymmetric():
    drag = np.array([[1.0, 2.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    parameters = co.Parameters(**{**PARAMETERS.asdict(), "drag": drag})
    vehicle = system(parameters=parameters, forces=lambda motion, p: co.Force(force=-p.drag @ motion.nu))
    assert co.simulate(vehicle, start(vehicle), dt=0.01, steps=3, monitors=False).good_steps == 3


def test_a_singular_inertia_is_refused_and_an_indefinite_one_is_warned_of():
    vehicle = system(parameters=PARAMETERS.replace(inertia=np.diag([5.0, 5.0, 0.0])))
    assert "Legendre transform must be regular" in sentence_of(lambda: co.simulate(vehicle, START, dt=0.01, steps=3))
    vehicle = system(parameters=PARAMETERS.replace(inertia=np.diag([5.0, 5.0, -1.0])))
    assert "not positive definite" in co.simulate(vehicle, START, dt=0.01, steps=3).warnings[0]


@pytest.mark.parametrize("value", [np.float32(5.46), np.ones(3, np.float32), "heavy", np.nan, [1, [2]]])
def test_a_parameter_that_is_no_float64_number_is_refused(value):
    assert "`mass` must be" in sentence_of(lambda: co.Parameters(mass=value))


SHORT = [np.float32(5.46), [np.float32(5.46)], jnp.bfloat16(5.46), np.full((1,), 5.46, np.float16), jnp.array([5.46])]
NOT_NUMBERS = ["5.46", ["5.46"], np.array(["5.46"], dtype=object), [5.46 + 0j], True, [1.0, None]]


@pytest.mark.parametrize("value", SHORT, ids=lambda value: type(value).__name__)
def test_numbers_that_have_lost_digits_enter_by_no_door(value):
    vector = value if np.ndim(value) else [value]
    doors = [
        lambda: co.Parameters(mass=value),
        lambda: co.Parameters(mass=co.each(vector)),
        lambda: start(VEHICLE, q=[*vector, 0, 1]),
        lambda: start(VEHICLE, xi=[*vector, 0, 1]),
        lambda: start(VEHICLE, qdot=[*vector, 0, 1]),
        lambda: start(VEHICLE, a0=[*vector, 0, 1]),
        lambda: start(VEHICLE, g=[[*vector, 0, 0], [0, 1, 0], [0, 0, 1]]),
        lambda: start(VEHICLE, t=value),
    ]
    for door in doors:
        assert "which has lost digits already" in sentence_of(door)


@pytest.mark.parametrize("value", NOT_NUMBERS, ids=repr)
def test_text_complex_numbers_and_truth_values_are_no_numbers(value):
    vector = value if np.ndim(value) else [value]
    assert "`mass` must be a number or an array of numbers" in sentence_of(lambda: co.Parameters(mass=value))
    assert "must be a number or an array of numbers" in sentence_of(lambda: co.each(vector))
    padded = [*vector, 0, 0, 0][:3]
    assert "`xi` must be a number or an array of numbers" in sentence_of(lambda: start(VEHICLE, xi=padded))


def test_a_step_size_of_fewer_digits_is_refused():
    assert "`dt` must be float64" in sentence_of(lambda: simulate(dt=np.float32(0.01)))
    assert "`duration` must be float64" in sentence_of(lambda: simulate(steps=None, duration=np.float32(0.5), dt=0.25))


@pytest.mark.parametrize(
    "torque",
    [
        lambda motion: np.ones(3, np.float32),
        lambda motion: np.float32(0.1) * motion.xi,
        lambda motion: jnp.float32(0.1) * motion.xi,
        lambda motion: [0, 0, jnp.float32(0.1)],
    ],
)
def test_forces_and_inputs_that_hold_float32_numbers_are_refused(torque):
    vehicle = system(forces=lambda motion, p: co.Force(torque=torque(motion)))
    said = sentence_of(lambda: co.simulate(vehicle, start(vehicle), dt=0.01, steps=3))
    assert said.startswith("The function `forces` holds float32 numbers")
    driven = system(forces=lambda motion, p: co.Force(torque=motion.inputs.torque * np.ones(3)))
    inputs = {"torque": lambda motion: torque(motion)[2]}
    said = sentence_of(lambda: co.simulate(driven, start(driven), dt=0.01, steps=3, inputs=inputs))
    assert said.startswith("The function `inputs` holds float32 numbers")


def test_a_list_of_traced_numbers_is_a_vector():
    import jax

    def spin(rate):
        return start(VEHICLE, xi=[0, 0, rate]).mu[2]

    assert evaluate(jax.grad(spin), 1.0) == 5.72
    assert "with co.float64():" in sentence_of(lambda: jax.grad(spin)(1.0))


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"masss": 1}, "There is no `masss` to replace; there is: mass, rudder."),
        ({"fin.area": 1}, "There is no `fin.area` to replace; there is: mass, rudder."),
        ({"rudder.area": 1}, "`rudder.area` is a number within `rudder`: replace it by rudder={'area': …}."),
        ({"rudder.arm.x": 1}, "`rudder.arm.x` is a number within `rudder`: replace it by rudder={'arm': {'x': …}}."),
        (
            {"rudder": {"arm.x": 1}},
            "`rudder.arm.x` is a number within `rudder`: replace it by rudder={'arm': {'x': …}}.",
        ),
        ({"rudder_area": 1}, "no `rudder_area` to replace: it is `rudder.area`, replaced by rudder={'area': …}."),
        ({"rudder.chord": 1}, "There is no `rudder.chord` to replace; in `rudder` there is: area, arm."),
        ({"rudder": {"chord": 1}}, "There is no `rudder.chord` to replace; in `rudder` there is: area, arm."),
    ],
)
def test_an_unknown_parameter_is_answered_with_those_there_are(changes, says):
    parameters = co.Parameters(mass=2.0, rudder={"area": 0.1, "arm": {"x": 1.0}})
    assert says in sentence_of(lambda: parameters.replace(**changes))
    assert "no `masss` to replace" in sentence_of(lambda: VEHICLE.replace(masss=1.0))


def test_groups_and_spaces_that_do_not_fit_are_refused():
    assert "must be a Lie group" in sentence_of(lambda: co.System(co.SO3, lagrangian))
    assert "must be a space" in sentence_of(lambda: co.System(co.SO3(), lagrangian, additional=co.Defining))
    assert "rigid motions" in sentence_of(lambda: co.System(co.SO3(), lagrangian, additional=co.spaces.Points()))
    assert "must be a difference map" in sentence_of(lambda: co.Midpoint(co.Cayley))


SHEAR = co.MatrixGroup([[[0, 1], [0, 0]]], name="Shear")
MIRROR = np.diag([1.0, -1.0])


@pytest.mark.parametrize(
    ("group", "g"),
    [
        (co.SO2(), MIRROR),
        (co.SE2(), (MIRROR, np.zeros(2))),
        (co.SE3(), (-np.eye(3), np.zeros(3))),
        (co.DirectProduct(co.SO3(), co.SO3()), (np.eye(3), -np.eye(3))),
        (co.SO3(), co.each(np.stack([np.eye(3), -np.eye(3)]))),
        (co.DirectProduct(SHEAR, co.SE2()), (np.eye(2), (MIRROR, np.zeros(2)))),
    ],
)
def test_a_reflection_is_no_group_element(group, g):
    body = co.System(group, lambda xi: 0.5 * xi @ xi)
    assert "determinant is −1" in sentence_of(lambda: body.state(g=g))


@pytest.mark.long
def test_the_factor_of_a_product_that_knows_its_equations_is_held_to_them():
    group = co.DirectProduct(co.SO3(), SHEAR)
    body = co.System(group, lambda xi: 0.5 * xi @ xi)
    assert "in its factor SO3() the defining equations fail by 3" in sentence_of(
        lambda: body.state(g=(2 * np.eye(3), np.eye(2)))
    )
    assert f"in its factor {SHEAR!r} the defining equations fail" in sentence_of(
        lambda: body.state(g=(np.eye(3), 2 * np.eye(2)))
    )
    run = co.simulate(body, body.state(g=(np.eye(3), [[1, 2], [0, 1]]), xi=[1, 2, 3, 4]), dt=0.01, steps=3)
    assert np.max(run.dataset.group_defect) < 1e-14


def test_a_velocity_that_leaves_the_sphere_is_refused():
    ball = co.System(co.SO3(), lambda xi, n, nu: 0.5 * xi @ xi + 0.5 * nu @ nu, additional=co.Sphere())
    assert ball.state(q=[0, 0, 1], qdot=[0, 2, 0]).nu.tolist() == [0, 2, 0]
    assert "leaves it by 0.5" in sentence_of(lambda: ball.state(q=[0, 0, 1], qdot=[0, 2, 0.5]))
    velocities = co.each([[0, 2, 0], [0, 2, 0.5]])
    assert "leaves it by 0.5" in sentence_of(lambda: ball.state(q=[0, 0, 1], qdot=velocities))
    places = {"ball": co.Sphere(), "buoy": co.Defining()}
    both = co.System(co.SO3(), lambda xi, n, nu: xi @ xi + nu.ball @ nu.ball + nu.buoy @ nu.buoy, additional=places)
    q = {"buoy": [0, 0, 1], "ball": [0, 0, 1]}
    assert both.state(q=q, qdot={"buoy": [0, 0, 1], "ball": [0, 1, 0]}).nu.tolist() == [0, 1, 0, 0, 0, 1]
    assert "leaves it by 1" in sentence_of(lambda: both.state(q=q, qdot={"buoy": [0, 1, 0], "ball": [0, 0, 1]}))


def two_buoys(force):
    """The start and (T, f) of a body with two points a and b."""
    places = {"a": co.Defining(), "b": co.Trivial(2)}
    body = co.System(
        co.SO3(), lambda xi, n, nu: xi @ xi + nu.a @ nu.a + nu.b @ nu.b, additional=places, forces=lambda motion: force
    )
    begun = body.state(q={"a": [0, 0, 1], "b": [0, 0]}, xi=[0, 0, 3])
    body.check(begun)
    return body.body_force(body.motion(begun.xi, begun.n, begun.nu, begun.a, 0.0))


def test_forces_on_several_spaces_go_by_name_whatever_their_order():
    a, b = np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0])
    with co.float64():
        for force in ({"a": a, "b": b}, {"b": b, "a": a}, {"b": [4.0, 5.0], "a": a}):
            assert np.array_equal(two_buoys(co.Force(force=force))[1], [1, 2, 3, 4, 5])
        assert np.array_equal(two_buoys(co.Force(force={"a": a, "b": None}))[1], [1, 2, 3, 0, 0])
    said = sentence_of(lambda: two_buoys(co.Force(force={"a": a, "c": b})))
    assert "must have the parts a, b, but has the parts a, c" in said
    said = sentence_of(lambda: two_buoys(co.Force(force={"a": b, "b": a})))
    assert "force.a of co.Force must have shape (3,), but has shape (2,)" in said
    assert "one array of shape (3,)" in sentence_of(lambda: two_buoys(co.Force(torque={"a": a})))


@pytest.mark.long
def test_a_torque_may_be_a_list_of_numbers_that_depend_on_the_motion():
    def decay(torque):
        vehicle = system(forces=lambda motion, p: co.Force(torque=torque(motion)))
        return co.simulate(vehicle, start(vehicle), dt=0.01, steps=3, monitors=False).dataset.xi.values

    brake = jnp.stack
    assert np.array_equal(decay(lambda m: [0, 0, -m.xi[2]]), decay(lambda m: brake([0.0, 0.0, -m.xi[2]])))


def test_a_lagrangian_that_lacks_its_inputs_asks_for_them():
    body = co.System(co.SO3(), lambda xi, *, inputs: inputs.stiffness * xi @ xi)
    assert "needs `inputs`: give those of the start" in sentence_of(body.state)
    begun = body.state(xi=[0, 0, 1], inputs={"stiffness": 3.0})
    assert begun.mu[2] == 6.0 and body.check(begun) == []


def test_both_lagrangians_of_a_system_are_checked():
    body = co.System(co.SO3(), lambda xi: xi @ xi, discrete_lagrangian=lambda xi, h: h * xi)
    assert "The discrete Lagrangian must return one number" in sentence_of(lambda: body.check(body.state()))


def test_a_matrix_that_is_rightly_asymmetric_passes_where_the_lagrangian_is_defined_near_the_start_only():
    coupling = np.array([[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])

    def body(ell):
        found = co.System(co.SO3(), ell, additional=co.Defining(), parameters={"coupling": coupling})
        return found.check(found.state(q=[2, 2, 2], xi=[1, 0, 0]))

    def defined_for_positive_n(xi, n, nu, p):
        return 3 * xi @ xi + 3 * nu @ nu + jnp.sum(jnp.log(n)) * (xi @ p.coupling @ nu)

    def symmetric(xi, n, nu, p):
        return 3 * nu @ nu + jnp.sum(jnp.log(n)) * (xi @ p.coupling @ xi)

    assert body(defined_for_positive_n) == []
    assert "`coupling` must be symmetric" in sentence_of(lambda: body(symmetric))


def check_mass_matrix(group, ell):
    body = co.System(group, ell)
    return body.check(body.state(xi=np.full(group.dim, 0.1)))


def test_a_regular_mass_matrix_may_have_zeros_on_its_diagonal_and_any_units():
    sl2 = co.MatrixGroup([[[1, 0], [0, -1]], [[0, 1], [0, 0]], [[0, 0], [1, 0]]])
    killing = check_mass_matrix(sl2, lambda xi: xi[0] ** 2 + xi[1] * xi[2])
    assert "1 of its 3 axes are negative" in killing[0]
    assert check_mass_matrix(co.SE3(), lambda xi: 1e-27 * xi[:3] @ xi[:3] + 1e-12 * xi[3:] @ xi[3:]) == []


def test_a_direction_without_kinetic_energy_is_told_in_the_velocities_of_the_user():
    def heavy_and_light(xi):
        return 1e-27 * xi[:3] @ xi[:3] + (xi[3] + 2 * xi[4]) ** 2 + xi[5] ** 2

    said = sentence_of(lambda: check_mass_matrix(co.SE3(), heavy_and_light)).replace("-0.0,", "0.0,")
    assert "(ξ, ν) = [0.0, 0.0, 0.0, 1.0, -0.5, 0.0]" in said.replace("-0.0]", "0.0]")
    said = sentence_of(lambda: check_mass_matrix(co.SO3(), lambda xi: xi[0] ** 2 + 1e-20 * xi[2] ** 2))
    assert "(ξ, ν) = [0.0, 1.0, 0.0]" in said


def test_a_basis_that_is_no_algebra_is_refused():
    e, f = [[0, 1], [0, 0]], [[0, 0], [1, 0]]
    assert "closed under the bracket" in sentence_of(lambda: co.MatrixGroup([e, f]))
    assert "linearly independent" in sentence_of(lambda: co.MatrixGroup([e, e]))
    assert "square matrices" in sentence_of(lambda: co.MatrixGroup("sl2"))


@pytest.mark.cases(1)
@pytest.mark.parametrize("backend", ["native", pytest.param("xla", marks=pytest.mark.long)])
def test_a_force_that_becomes_infinite_stops_the_run_at_that_step_and_keeps_what_was_computed(backend):
    vehicle = system(forces=lambda motion, p: co.Force(torque=motion.xi * jnp.log(0.0525 - motion.t)))
    with pytest.raises(
        co.errors.StepError, match=r"Step 5 of 30 \(t = 0.05 s\) gave numbers that are not finite"
    ) as caught:
        co.simulate(vehicle, start(vehicle), dt=0.01, steps=30, backend=backend)
    run = caught.value.run
    assert run.good_steps == 5 and run.count == 5
    assert all(np.all(np.isfinite(values)) for values in run.dataset.data_vars.values())


@pytest.mark.cases(1)
@pytest.mark.parametrize("backend", ["native", pytest.param("xla", marks=pytest.mark.long)])
def test_a_step_too_large_to_converge_stops_the_run_with_the_remedy(backend):
    def stiff(xi, n, nu, a, p):
        return 0.5 * nu @ nu + 0.5 * xi @ xi - jnp.exp(20.0 * (n @ n))

    body = co.System(co.SO3(), stiff, additional=co.Defining(), advected=co.Defining(), parameters=PARAMETERS)
    begun = body.state(q=[0.1, 0, 0], qdot=[10.0, 0, 0], a0=[0, 0, 1])
    with pytest.raises(co.errors.StepError, match="take a smaller dt") as caught:
        co.simulate(body, begun, dt=0.3, steps=100, backend=backend)
    assert caught.value.run.good_steps < 100


def test_a_step_that_leaves_the_chart_stops_the_run():
    def spinning_up(motion, p):
        return co.Force(torque=jnp.array([0.0, 0.0, 400.0]))

    vehicle = system(forces=spinning_up)
    with pytest.raises(co.errors.StepError, match="left the chart of the difference map"):
        co.simulate(vehicle, start(vehicle), dt=0.1, steps=200, method=co.methods.LeftRight())


def test_a_traced_float32_parameter_asks_for_the_float64_scope():
    import jax

    def height(mass):
        return co.trajectory(VEHICLE.replace(mass=mass), START, dt=0.01, steps=2).final.q[2]

    assert "with co.float64():" in sentence_of(lambda: jax.grad(height)(123.8))


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"system": 3}, "`system` must be a co.System, but is 3"),
        ({"start": 3}, "`start` must be a state, system.state(…), but is 3"),
        ({"start": co.System(co.SO3(), lambda xi: xi @ xi).state()}, "another group or other spaces"),
        ({"method": co.Midpoint}, "must be a method such as"),
        ({"dt": [0.1, 0.1]}, "`dt` must be one number, but has shape (2,)"),
        ({"dt": 0.0}, "`dt` must not be zero"),
        ({"dt": np.inf}, "`dt` must be finite"),
        ({"dt": np.float32(0.1)}, "`dt` must be float64"),
        ({"steps": True}, "`steps` must be a whole number"),
        ({"save_every": 3}, "`save_every` must divide steps = 4, but is 3"),
    ],
)
def test_a_trajectory_that_makes_no_sense_is_refused(changes, says):
    arguments = {"system": VEHICLE, "start": START, "dt": 0.01, "steps": 4, **changes}
    assert says in sentence_of(lambda: co.trajectory(**arguments))


def test_a_trajectory_goes_back_by_negative_steps_counted_by_any_integer():
    there = co.trajectory(VEHICLE, START, dt=0.01, steps=np.int64(4)).final
    back = co.trajectory(VEHICLE, there, dt=-0.01, steps=np.int32(4)).final
    np.testing.assert_allclose(back.q, START.q, rtol=0, atol=1e-12)


def test_a_lagrangian_that_closes_over_a_traced_value_is_told_to_take_it_as_a_parameter():
    import jax

    def height(factor, own_start):
        vehicle = system(lambda xi, n, nu, a, p: factor * lagrangian(xi, n, nu, a, p))
        begun = start(vehicle) if own_start else START
        return co.trajectory(vehicle, begun, dt=0.01, steps=2).final.q[2]

    with co.float64():
        for own_start in (True, False):
            assert "put it into co.Parameters" in sentence_of(lambda own=own_start: jax.grad(height)(1.0, own))


def test_records_that_would_not_fit_in_memory_are_refused_before_the_run():
    assert "GB of memory" in sentence_of(lambda: simulate(steps=10**12))


def test_arguments_in_another_order_are_refused_because_they_are_passed_by_position():
    assert "in this order" in sentence_of(lambda: system(lambda xi, nu, n, a, p: lagrangian(xi, n, nu, a, p)))


def test_what_jax_traces_is_sent_to_the_pure_trajectory():
    import jax

    def height(mass):
        return co.simulate(VEHICLE.replace(mass=mass), START, dt=0.01, steps=2).final.q[2]

    with co.float64():
        assert "use co.trajectory" in sentence_of(lambda: jax.grad(height)(123.8))


def test_kelvin_noether_quantities_must_be_such():
    assert "must be co.mechanics.KelvinNoether" in sentence_of(lambda: simulate(kelvin_noether=[1]))


def test_the_card_says_that_a_start_by_velocities_costs_the_second_order():
    card = str(simulate(method=co.Midpoint(start="velocity")))
    assert "order 1, because it starts by velocities" in card
    assert "order 2" in str(simulate())


def test_the_rate_of_damping_is_the_fastest_decay_and_zero_where_nothing_decays():
    """Of v̇ = M⁻¹(∂F/∂v)v: 3 of drags 1 and 6 on masses 1 and 2, and none of a turn, of round-off, of no mass."""
    mass, turn = np.diag([1.0, 2.0]), np.array([[0.0, 1.0], [-1.0, 0.0]])
    assert _rate(np.diag([-1.0, -6.0]), mass) == pytest.approx(3.0)
    for slope, given in ((turn, mass), (turn - 1e-12 * mass, np.eye(2)), (-mass, 0 * mass), (np.nan * mass, mass)):
        assert _rate(slope, given) == 0.0
