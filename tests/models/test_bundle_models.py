"""Elroy's beanie, the falling cat and the three-link swimmer against their closed forms."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.models import beanie, catalogue, falling_cat, swimmer


def angle(R) -> float:
    """The angle of a rotation of the plane."""
    return float(np.arctan2(R[1, 0], R[0, 0]))


# Elroy's beanie.


@pytest.mark.long
def test_a_turn_of_the_cap_turns_the_body_by_its_share_of_the_inertia():
    """A = I₂/(I₁ + I₂) is flat: after ψ from 0 to 2π the body has turned by −2πI₂/(I₁ + I₂)."""
    system = beanie.make(body=3.0, cap=1.0, stiffness=2.0)
    connection = co.mechanics.mechanical_connection(system)
    assert abs(connection([0.7])[0, 0] - 0.25) <= 1e-15 and np.max(np.abs(connection.curvature([0.7]))) == 0
    turned = co.mechanics.horizontal_lift(connection, lambda t: jnp.stack([2 * jnp.pi * t**2]), times=[0.0, 1.0])[-1]
    assert abs(angle(turned) + np.pi / 2) <= 1e-14
    discrete = co.theory.discrete_mechanical_connection(system, co.Midpoint(co.Exponential()), 0.1)
    turned = co.mechanics.horizontal_lift(discrete, np.linspace(0, 2 * np.pi, 11)[:, None])[-1]
    assert abs(angle(turned) + np.pi / 2) <= 1e-14


def test_a_beanie_with_a_spring_swings_and_drifts_as_its_closed_form():
    """ψ = ψ₀ cos wt + (ψ̇₀/w) sin wt, w² = k(I₁ + I₂)/(I₁I₂), and θ = θ₀ + μt/(I₁ + I₂) − A(ψ − ψ₀)."""
    system = beanie.make(body=2.0, cap=1.0, stiffness=1.0)
    start = beanie.start(system, angle=0.4, angular_velocity=0.5, cap_angle=1.0, cap_rate=-0.3)
    w, mu = np.sqrt(1.5), 2.0 * 0.5 + 0.2
    errors = []
    for dt in (0.02, 0.01):
        run = co.simulate(system, start, dt=dt, duration=10.0, method=co.Suzuki4(co.Midpoint(co.Exponential())))
        t = run.dataset.time.values
        psi = np.cos(w * t) - 0.3 / w * np.sin(w * t)
        theta = 0.4 + mu / 3 * t - (psi - 1.0) / 3
        found = np.unwrap(np.arctan2(run.dataset.R.values[:, 1, 0], run.dataset.R.values[:, 0, 0]))
        errors.append(max(np.max(np.abs(run.records.n[:, 0] - psi)), np.max(np.abs(found - theta))))
    print(errors)
    assert errors[1] < 1e-9 and errors[0] / errors[1] > 14


# The falling cat.

EQUAL = {"mass": (1.5, 1.5), "reach": (0.12, 0.12), "stiffness": 0.0}


def bend_round(size):
    """A loop of the bend's direction at a constant angle."""
    return lambda t: size * jnp.stack([jnp.cos(2 * jnp.pi * t), jnp.sin(2 * jnp.pi * t)])


@pytest.mark.long
@pytest.mark.cases(3)
@pytest.mark.parametrize(("ratio", "size"), [(0.25, 1.0), (0.25, 2.0), (0.4, 0.6), (0.9, 1.3)])
def test_a_cat_that_carries_its_bend_round_turns_about_its_spine_by_the_closed_form(ratio, size):
    """Equal bodies of revolution, axial and transverse inertia J and I, bent by 2β: 2πJ cos β/(J cos²β + I sin²β).

    The bend goes round once with momentum zero (Rademaker and ter Braak 1935), so that J(Ω cos β − φ̇) cos β +
    I Ω sin²β = 0 for the angular velocity Ω of the plane of the bend about the mean direction of the spine.
    """
    cat = falling_cat.make(axial=(ratio, ratio), transverse=(1.0, 1.0), **EQUAL)
    turned = co.mechanics.holonomy(co.mechanics.mechanical_connection(cat), bend_round(size))
    c, s = np.cos(size / 2), np.sin(size / 2)
    phase = 2 * np.pi * ratio * c / (ratio * c**2 + s**2)
    about_the_spine = np.array([[1, 0, 0], [0, np.cos(phase), -np.sin(phase)], [0, np.sin(phase), np.cos(phase)]])
    print(ratio, size, np.degrees(phase - 2 * np.pi), np.max(np.abs(turned - about_the_spine)))
    assert np.max(np.abs(turned - about_the_spine)) <= 1e-11


@pytest.mark.long
def test_a_cat_of_kane_and_schers_proportions_turns_over_with_a_bend_of_59_degrees():
    """J/I = 1/4: half a turn at cos β = (√13 − 1)/3."""
    cat = falling_cat.make(axial=(0.0025, 0.0025), transverse=(0.01, 0.01), **EQUAL)
    size = 2 * np.arccos((np.sqrt(13) - 1) / 3)
    assert 59.4 < np.degrees(size) < 59.5
    turned = co.mechanics.holonomy(co.mechanics.mechanical_connection(cat), bend_round(size))
    assert np.max(np.abs(turned - np.diag([1.0, -1.0, -1.0]))) <= 1e-11


@pytest.mark.long
def test_the_momentum_of_the_cat_is_that_of_its_two_bodies_in_space():
    """∂ℓ/∂ξ in the space frame is Σ RJω + r × mṙ over both bodies about the common mass centre."""
    values = {
        "mass": (1.2, 2.0),
        "axial": (0.002, 0.003),
        "transverse": (0.01, 0.015),
        "reach": (0.1, 0.14),
        "stiffness": 0.0,
    }
    cat = falling_cat.make(**values)
    xi, x, v = np.array([0.3, -1.0, 0.7]), np.array([0.5, -0.8]), np.array([1.0, 2.0])
    state = cat.state(xi=xi, q=x, qdot=v)

    def bodies(t):
        g = co.SO3().exp(t * xi)
        front, rear = (g @ R for R in falling_cat.halves(x + t * v))
        places = jnp.stack([values["reach"][0] * front[:, 0], -values["reach"][1] * rear[:, 0]])
        mass = jnp.asarray(values["mass"])
        return jnp.stack([front, rear]), places - mass @ places / jnp.sum(mass)

    def momentum(t):
        (R, r), (turning, moving) = jax.jvp(bodies, (t,), (jnp.ones(()),))
        total = 0.0
        for k in range(2):
            J = jnp.diag(jnp.stack([values["axial"][k], values["transverse"][k], values["transverse"][k]]))
            total += R[k] @ J @ co.SO3().vee(R[k].T @ turning[k]) + values["mass"][k] * jnp.cross(r[k], moving[k])
        return total

    assert np.max(np.abs(evaluate(momentum, np.float64(0.0)) - state.mu)) <= 1e-16


@pytest.mark.long
def test_a_cat_moved_by_its_muscles_turns_over_as_the_horizontal_lift_of_its_shapes():
    """Torques in the joint leave the momentum at zero, whatever they are."""
    entry = catalogue["falling_cat"]
    values = {**entry.parameters, "stiffness": 0.0}
    cat = entry.make(**values)
    pull = co.System(
        co.SO3(), falling_cat.lagrangian, additional=co.Trivial(2), parameters=cat.parameters,
        forces=lambda motion, p: co.Force(
            force=0.5 * (bend_round(1.0)(motion.t) - motion.n) - 0.05 * motion.nu
        ),
    )  # fmt: skip
    start = pull.state(q=[1.0, 0.0])
    dt, method = 0.02, co.Midpoint()
    run = co.simulate(pull, start, dt=dt, duration=0.4, method=method)
    assert np.max(np.abs(run.records.mu)) <= 1e-17
    lift = co.mechanics.horizontal_lift(co.theory.discrete_mechanical_connection(cat, method, dt), run.records.n)
    assert np.max(np.abs(lift - run.records.g)) <= 1e-13
    assert np.max(np.abs(run.records.g[-1] - np.eye(3))) > 0.1


# The swimmer.


def paddle(t):
    """A stroke of both joints."""
    return jnp.stack([0.8 * jnp.cos(2 * jnp.pi * t), 0.7 * jnp.sin(2 * jnp.pi * t)])


def test_the_connection_of_a_straight_swimmer_is_the_closed_form():
    """ω = −(𝒥 + 2a²M)(ẋ₁ + ẋ₂)/(3𝒥 + 8a²M), w = −a(ẋ₁ − ẋ₂)/3 with M the mass across."""
    system = swimmer.make(semi_axes=(0.5, 0.1), density=2.0, stiffness=0.0)
    turning, _, across = evaluate(swimmer.inertias, system.parameters)
    spin = (turning + 2 * 0.25 * across) / (3 * turning + 8 * 0.25 * across)
    expected = [[spin, spin], [0.0, 0.0], [0.5 / 3, -0.5 / 3]]
    assert np.max(np.abs(co.mechanics.mechanical_connection(system)([0.0, 0.0]) - expected)) <= 1e-15


@pytest.mark.long
def test_circles_do_not_swim():
    """Added mass that is the same in all directions leaves the mean of the centres where it is."""
    system = swimmer.make(semi_axes=(0.3, 0.3), density=1.0, stiffness=0.0)
    times = np.linspace(0, 0.7, 15)
    R, place = co.mechanics.horizontal_lift(co.mechanics.mechanical_connection(system), paddle, times=times)

    def middle(R, place, t):
        return place + R @ jnp.mean(swimmer.links(paddle(t), system.parameters)[1], axis=0)

    found = evaluate(jax.vmap(middle), R, place, times)
    assert np.max(np.abs(found - found[0])) <= 1e-12 and np.max(np.abs(place - place[0])) > 0.1


@pytest.mark.long
def test_a_stroke_there_and_back_goes_nowhere_and_a_loop_does():
    """What Purcell's scallop is to viscous fluids: a path in a line of shapes has no holonomy."""
    connection = co.mechanics.mechanical_connection(catalogue["three_link_swimmer"].make())
    R, place = co.mechanics.holonomy(
        connection, lambda t: jnp.stack([jnp.sin(2 * jnp.pi * t), jnp.sin(2 * jnp.pi * t) ** 2])
    )
    assert max(np.max(np.abs(R - np.eye(2))), np.max(np.abs(place))) <= 1e-12
    assert np.max(np.abs(co.mechanics.holonomy(connection, paddle)[1])) > 0.05


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: beanie.make(body=-1.0, cap=1.0, stiffness=0.0), "`body` must be positive"),
        (lambda: falling_cat.make(axial=(0.1,), transverse=(1.0, 1.0), **EQUAL), "`axial` must have shape (2,)"),
        (lambda: falling_cat.make(axial=(0.1, -0.1), transverse=(1.0, 1.0), **EQUAL), "`axial` must be positive"),
        (lambda: swimmer.make(semi_axes=(0.5, 0.0), density=1.0, stiffness=0.0), "`semi_axes` must be positive"),
        (lambda: swimmer.make(semi_axes=(0.5, 0.1), density=1.0, stiffness=-1.0), "`stiffness` must be at least 0"),
    ],
)
def test_what_no_body_can_have_is_refused(call, says):
    with pytest.raises(co.errors.ArgumentError) as caught:
        call()
    assert says in str(caught.value)
