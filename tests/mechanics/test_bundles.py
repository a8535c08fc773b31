"""Connections on bundles: equivariance, reduction, horizontal lifts, holonomy, refusals (B28–B34)."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from bundles import (
    SIZE,
    TURNED,
    apart,
    difference_map,
    generator,
    kinetic_system,
    random_connection,
    random_motion,
    random_system,
    smooth_connection,
    turned_motion,
    turned_system,
)
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.bundle import _in_pieces, reconstructed, reduced
from stepping import Stepper
from systems import GROUPS, RULES

ROUND_OFF = 1e-13
NAMES = sorted(GROUPS)


def matrices(group, g):
    return evaluate(jax.vmap(group.matrix), g)


@pytest.mark.cases(3)
@pytest.mark.parametrize("name", NAMES)
def test_a_discrete_connection_is_equivariant_and_its_global_form_gives_it_back(name):
    """(B29), (B31): 𝒜(fζ, f⁺ζ⁺) = f⁺𝒜(ζ, ζ⁺)f⁻¹, and Ω(x, x⁺) = 𝒜((x, e), (x⁺, e))⁻¹."""
    group, connection = GROUPS[name], random_connection(name)
    again = co.mechanics.DiscreteConnection.from_form(group, SIZE, connection.form)
    (x, x_next), e = generator("places", name).normal(size=(2, SIZE)), evaluate(group.identity)
    assert apart(again(x, x_next), connection(x, x_next)) <= ROUND_OFF
    assert apart(evaluate(connection.form, e, x, connection(x, x_next), x_next), e) <= ROUND_OFF


@pytest.mark.cases(2)
@pytest.mark.parametrize("name", NAMES)
def test_reduction_and_reconstruction_are_inverse(name):
    """(B32)–(B34): g_{k+1} = g_kΩσ_k⁻¹, and 𝒜 = g_{k+1}σ_k⁻¹g_{k+1}⁻¹."""
    group, connection = GROUPS[name], random_connection(name)
    g, x = random_motion(name, 6)
    sigma = reduced(connection, g, x)
    first = jax.tree.map(lambda leaf: leaf[0], g)
    assert apart(reconstructed(connection, first, x, sigma), g) <= 20 * ROUND_OFF

    def misfit(g, g_next, x, x_next, sigma):
        seen = group.matrix(connection.form(g, x, g_next, x_next))
        return seen - group.matrix(group.compose(g_next, group.inverse(group.compose(g_next, sigma))))

    ends = [jax.tree.map(lambda leaf, s=s: leaf[s], (g, x)) for s in (slice(None, -1), slice(1, None))]
    (g0, x0), (g1, x1) = ends
    assert apart(evaluate(jax.vmap(misfit), g0, g1, x0, x1, sigma), 0.0 * matrices(group, g0)) <= 20 * ROUND_OFF


@pytest.mark.cases(2)
@pytest.mark.parametrize("name", NAMES)
def test_sigma_is_e_exactly_on_horizontal_steps(name):
    """σ = e ⇔ 𝒜 = e ⇔ F = Ω."""
    group, connection = GROUPS[name], random_connection(name)
    g, x = random_motion(name, 6)
    lift = co.mechanics.horizontal_lift(connection, x, jax.tree.map(lambda leaf: leaf[0], g))
    e = evaluate(group.identity)
    assert apart(matrices(group, reduced(connection, lift, x)), evaluate(group.matrix, e)) <= 20 * ROUND_OFF
    steps = matrices(group, reduced(connection, g, x)) - evaluate(group.matrix, e)
    assert np.all(np.max(np.abs(steps), axis=(1, 2)) > 1e-2)


def test_a_piece_of_a_horizontal_lift_is_exact_for_shapes_that_turn_by_a_cubic():
    """Gauss' two nodes; on a commutative group the lift is a quadrature."""
    planar: Any = SimpleNamespace(group=co.SO2(), velocity=lambda x, v: jnp.stack([x**3 * v]))
    turned = evaluate(lambda: co.SO2().exp(jnp.array([0.25])))
    found = _in_pieces(planar, lambda t: t, np.array([0.0, 1.0]), 1)
    np.testing.assert_allclose(np.ravel(found), np.ravel(turned), atol=1e-15)


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", NAMES)
def test_a_change_of_section_conjugates_sigma_and_carries_horizontal_lifts_along(name):
    """g̃ = gχ(x)⁻¹: Ω̃ = χ(x)Ωχ(x⁺)⁻¹ and σ̃ = χ(x⁺)σχ(x⁺)⁻¹."""
    group, connection = GROUPS[name], random_connection(name)
    C = generator("section", name).normal(size=(group.dim, SIZE))

    def section(x):
        return difference_map(name).tau(group, 0.6 * jnp.sin(C @ x + 0.3))

    def seen(g, x):
        return group.compose(g, group.inverse(section(x)))

    other = connection.in_section(section)
    g, x = random_motion(name, 5)
    moved = evaluate(jax.vmap(seen), g, x)

    def conjugated(sigma, x_next):
        chi = section(x_next)
        return group.compose(group.compose(chi, sigma), group.inverse(chi))

    expected = evaluate(jax.vmap(conjugated), reduced(connection, g, x), x[1:])
    assert apart(reduced(other, moved, x), expected) <= 50 * ROUND_OFF
    begin = [jax.tree.map(lambda leaf: leaf[0], way) for way in (g, moved)]
    lift = co.mechanics.horizontal_lift(connection, x, begin[0])
    assert apart(co.mechanics.horizontal_lift(other, x, begin[1]), evaluate(jax.vmap(seen), lift, x)) <= 50 * ROUND_OFF


def round_the_origin(t):
    """A closed loop of shapes."""
    return jnp.stack([jnp.cos(2 * jnp.pi * t), 0.5 * jnp.sin(4 * jnp.pi * t) + 0.2 * jnp.cos(2 * jnp.pi * t)])


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("name", ["SO3", "SE2", "SL2"])
@pytest.mark.parametrize(("at", "order"), [("start", 1), ("middle", 2)])
def test_the_holonomy_of_a_discretised_connection_converges_with_its_order(name, at, order):
    connection = smooth_connection(name)
    exact = co.mechanics.holonomy(connection, round_the_origin)
    discrete = co.mechanics.DiscreteConnection.from_connection(connection, at=at)
    errors = []
    for count in (100, 200, 400):
        loop = evaluate(jax.vmap(round_the_origin), np.arange(count) / count)
        errors.append(apart(co.mechanics.holonomy(discrete, [*loop, loop[0]]), exact))
    print(name, at, errors)
    assert abs(np.log2(errors[1] / errors[2]) - order) < 0.15 and abs(np.log2(errors[0] / errors[1]) - order) < 0.3


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", ["SO3", "SE3", "Heisenberg"])
def test_the_holonomy_of_small_loops_is_their_area_times_curvature(name):
    """exp(−ε²B(u, v)), B(u, v) = DA(u)v − DA(v)u − [Au, Av]; the third order falls out between ε and −ε."""
    group, connection, at = GROUPS[name], smooth_connection(name), np.array([0.3, -0.2])

    def corner(t, side):
        return jnp.clip(4 * t - side, 0.0, 1.0)

    def around(size):
        def loop(t):
            u, v = corner(t, 0) - corner(t, 2), corner(t, 1) - corner(t, 3)
            return at + size * jnp.stack([u, v])

        turned = evaluate(group.matrix, co.mechanics.holonomy(connection, loop))
        return evaluate(group.vee, turned - np.eye(len(turned))) / size**2

    bent = connection.curvature(at)[:, 0, 1]
    errors = [apart(0.5 * (around(e) + around(-e)), -bent) for e in (0.04, 0.02)]
    print(name, errors)
    assert errors[1] < 0.01 * np.max(np.abs(bent)) and errors[0] / errors[1] > 3.5


@pytest.mark.long
def test_a_path_lifted_from_time_to_time_is_the_whole_lift():
    connection = smooth_connection("SO3")
    coarse, fine = (
        co.mechanics.horizontal_lift(connection, round_the_origin, times=np.linspace(0, 1, count)) for count in (3, 33)
    )
    assert apart(coarse[-1], fine[-1]) < 1e-11


@pytest.mark.cases(2)
@pytest.mark.parametrize("name", NAMES)
def test_the_mechanical_connection_makes_momentum_vanish(name):
    """∂_ξℓ(−A(x)ẋ, x, ẋ) = 0."""
    system = kinetic_system(name)
    connection = co.mechanics.mechanical_connection(system)
    x, v = generator("velocities", name).normal(size=(2, SIZE))
    state = system.state(q=x, qdot=v, xi=evaluate(connection.velocity, x, v))
    moving = system.state(q=x, qdot=v)
    assert np.max(np.abs(state.mu)) <= ROUND_OFF * np.max(np.abs(moving.mu))


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("rule", ["left", "right", "midpoint", "trapezoidal"])
@pytest.mark.parametrize("name", ["SO3", "SE2", "SL2"])
def test_motion_with_momentum_zero_is_the_horizontal_lift_of_its_shapes(name, rule):
    """Ω(x, x⁺) is the F with D^R_FΛ(F, x, x⁺) = 0."""
    system, method, h = kinetic_system(name), RULES[rule](co.Cayley()), 0.1
    start = system.state(q=[0.2, -0.3], qdot=[0.9, 0.7])
    start = start.replace(mu=0.0 * start.mu, from_velocities=False)
    leaps = Stepper(system, method).run(start, h, 8)
    states = [leaps[0].record, *(leap.after for leap in leaps)]
    g = jax.tree.map(lambda *rows: np.stack(rows), *(state.g for state in states))
    x = np.stack([state.n for state in states])
    assert np.max(np.abs(x[-1] - x[0])) > 0.1
    connection = co.theory.discrete_mechanical_connection(system, method, h)
    assert apart(co.mechanics.horizontal_lift(connection, x), g) <= ROUND_OFF * 10
    other_step = co.theory.discrete_mechanical_connection(system, method, 10 * h)
    assert apart(connection(x[0], x[1]), other_step(x[0], x[1])) <= ROUND_OFF


@pytest.mark.long
def test_the_discrete_mechanical_connection_tends_to_the_continuous_one_with_the_order_of_the_rule():
    system = kinetic_system("SE2")
    exact = co.mechanics.holonomy(co.mechanics.mechanical_connection(system), round_the_origin)
    for rule, order in (("left", 1), ("midpoint", 2), ("trapezoidal", 2)):
        connection, errors = co.theory.discrete_mechanical_connection(system, RULES[rule](co.Cayley()), 0.1), []
        for count in (100, 200):
            loop = evaluate(jax.vmap(round_the_origin), np.arange(count) / count)
            errors.append(apart(co.mechanics.holonomy(connection, [*loop, loop[0]]), exact))
        print(rule, errors)
        assert abs(np.log2(errors[0] / errors[1]) - order) < 0.2


@pytest.mark.long
@pytest.mark.cases(2)
@pytest.mark.parametrize("latitude", [0.3, -0.5, 0.8])
def test_the_mechanical_connection_of_a_point_on_a_sphere_has_its_holonomy_and_curvature_in_closed_form(latitude):
    """ℓ = ½|ξ|² + ½|ẋ|² + ξ·(x × ẋ) of a point that rolls a ball: A = x ×, a circle at x₃ = c turns by Rodrigues.

    On it g⁻¹ġ = −x × ẋ is 2πs(c cos, c sin, −s) with s = √(1 − c²), constant in the frame of the point: the turn is
    exp(w + 2πe₃) with its value w at the beginning. B(u, v) = 2u × v − (x × u) × (x × v), both along x.
    """
    connection = spherical()
    c, s = latitude, np.sqrt(1 - latitude**2)

    def circle(t):
        return jnp.stack([s * jnp.cos(2 * jnp.pi * t), s * jnp.sin(2 * jnp.pi * t), 0 * t + c])

    turned = co.mechanics.holonomy(connection, circle)
    first = 2 * np.pi * s * np.array([c, 0.0, -s])
    expected = evaluate(co.SO3().exp, first + np.array([0.0, 0.0, 2 * np.pi]))
    assert apart(turned, expected) <= 1e-11
    x = np.array([s, 0.0, c])
    u, v = np.array([0.0, 1.0, 0.0]), np.array([-c, 0.0, s])
    bent = np.einsum("gij,i,j->g", connection.curvature(x), u, v)
    assert apart(bent, 2 * np.cross(u, v) - np.cross(np.cross(x, u), np.cross(x, v))) <= ROUND_OFF


@pytest.mark.long
def test_a_ball_with_a_rotor_frame_inside_turns_back_by_its_share():
    """Shapes R ∈ SO(3): ℓ = ½I|ξ|² + ½J|ξ + ω|² with R⁻¹Ṙ = ω turned to the body, A = J/(I + J) of Ṙ R⁻¹."""
    inner = co.spaces.GroupItself("trivial", of=co.SO3())

    def lagrangian(xi, R, V):
        spin = co.SO3().vee(V @ R.T)
        return 0.5 * 3.0 * xi @ xi + 0.5 * (xi + spin) @ (xi + spin)

    system = co.System(co.SE3(), lambda xi, R, V: lagrangian(xi[:3], R, V) + xi[3:] @ xi[3:], additional=inner)
    connection = co.mechanics.mechanical_connection(system)

    def turning(t):
        return jnp.ravel(co.SO3().exp(2 * jnp.pi * t * jnp.array([0.0, 0.6, 0.8])))

    R, place = co.mechanics.holonomy(connection, turning)
    assert apart(R, evaluate(co.SO3().exp, -0.25 * 2 * np.pi * np.array([0.0, 0.6, 0.8]))) <= 1e-12
    assert np.max(np.abs(place)) <= 1e-15


@pytest.mark.parametrize("advected", [pytest.param(False, marks=pytest.mark.long), True])
def test_horizontal_motions_of_vectors_that_turn_have_total_momentum_zero(advected):
    """m = μ − π⋄n at ξ = −A(x)ẋ with ẋ = ν − ξ·x, whatever the advected parameter of a potential."""
    spaces = {"additional": TURNED, "advected": co.Defining()} if advected else {"additional": TURNED}

    def energy(xi, x, v, a):
        spin = xi + jnp.cross(x.direction, v.direction)
        return 0.5 * spin @ (jnp.arange(1.0, 4.0) * spin) + v.place @ v.place * (1 + x.direction[2] ** 2) - x.place @ a

    system = co.System(co.SO3(), energy if advected else lambda xi, x, v: energy(xi, x, v, jnp.ones(3)), **spaces)
    connection = co.mechanics.mechanical_connection(system)
    x, v = turned_motion(1)[1][0], generator("turned velocity").normal(size=6)

    def momentum(x, v):
        v = connection.project(x, v)
        xi = connection.velocity(x, v)
        nu = v + TURNED.infinitesimal(system.group, xi, x)
        a = jnp.array([0.3, -0.2, 0.9]) if advected else jnp.zeros(0)
        mu, pi = jax.grad(system.reduced_lagrangian, argnums=(0, 2))(xi, x, nu, a)
        return mu - TURNED.diamond(system.group, pi, x), mu

    total, part = evaluate(momentum, x, v)
    assert np.max(np.abs(total)) <= 1e-14 and np.max(np.abs(part)) > 0.1


SPHERE = co.Sphere(co.Trivial(3))


def spherical() -> co.mechanics.Connection:
    """A point that rolls a ball."""
    system = co.System(co.SO3(), lambda xi, x, v: 0.5 * (xi @ xi + v @ v) + xi @ jnp.cross(x, v), additional=SPHERE)
    return co.mechanics.mechanical_connection(system)


SO3, CONNECTION = co.SO3(), random_connection("SO3")
REFUSED = {
    "form that ignores g": (
        lambda: co.mechanics.DiscreteConnection.from_form(SO3, 1, lambda g, x, g_next, x_next: g_next @ g_next),
        "A discrete connection must be equivariant",
    ),
    "the printed (B29)": (
        lambda: co.mechanics.DiscreteConnection.from_form(
            SO3, 2, lambda g, x, g_next, x_next: g_next.T @ CONNECTION.increment(x, x_next).T @ g.T
        ),
        "A discrete connection must be equivariant",
    ),
    "outside the group": (
        lambda: co.mechanics.DiscreteConnection(SO3, 1, lambda x, y: (1 + x[0]) * jnp.eye(3)),
        "must lie in SO3(), but is outside by",
    ),
    "another shape": (
        lambda: co.mechanics.DiscreteConnection(SO3, 1, lambda x, y: jnp.eye(2)),
        "must be an element of SO3(), with arrays of shape (3, 3), but has (2, 2)",
    ),
    "a form of another shape": (
        lambda: co.mechanics.Connection(SO3, 2, lambda x: jnp.zeros(3)),
        "must have shape (3, 2)",
    ),
    "a form in NumPy": (lambda: co.mechanics.Connection(SO3, 1, lambda x: np.sin(x)), "write it with jax.numpy"),
    "no shapes": (lambda: co.mechanics.Connection(SO3, 0, lambda x: x), "must be a whole number from 1, but is 0"),
    "no group": (lambda: co.mechanics.Connection("SO3", 1, lambda x: x), "must be a Lie group"),  # type: ignore[arg-type]
    "open loop": (lambda: co.mechanics.holonomy(CONNECTION, [[0, 0], [1, 1]]), "must end where it begins"),
    "shapes of another size": (lambda: co.mechanics.horizontal_lift(CONNECTION, [[0.0], [1.0]]), "(n, 2)"),
    "shapes that are not numbers": (
        lambda: co.mechanics.horizontal_lift(CONNECTION, [[0, 0], [1, np.nan]]),
        "must be finite",
    ),
    "a function for a discrete one": (lambda: co.mechanics.holonomy(CONNECTION, round_the_origin), "not a function"),
    "an array for a continuous one": (
        lambda: co.mechanics.horizontal_lift(smooth_connection("SO3"), [[0, 0], [1, 1]], times=[0, 1]),
        "give `shapes` as such",
    ),
    "no times": (lambda: co.mechanics.horizontal_lift(smooth_connection("SO3"), round_the_origin), "needs `times`"),
    "elements that are too few": (
        lambda: reduced(CONNECTION, np.stack([np.eye(3)] * 2), np.zeros((3, 2))),
        "must be arrays of shape (3, 3, 3)",
    ),
    "a Lagrangian of time": (
        lambda: co.mechanics.mechanical_connection(random_system("SO3")[0]),
        "but this one takes `t`",
    ),
    "no space of shapes": (
        lambda: co.mechanics.mechanical_connection(co.System(SO3, lambda xi: xi @ xi)),
        "A bundle needs a space of shapes, such as additional=co.Trivial(m), but there is none",
    ),
    "shapes of a curved space of another size": (
        lambda: co.mechanics.Connection(SO3, 2, lambda x: jnp.zeros((3, 2)), shapes=SPHERE),
        "must be the length of arrays of shapes, 3 in Sphere",
    ),
    "shapes that are no space": (
        lambda: co.mechanics.Connection(SO3, 2, lambda x: jnp.zeros((3, 2)), shapes="S2"),  # type: ignore[arg-type]
        "must be a space of shapes such as co.Sphere(co.Trivial(3))",
    ),
    "a shape off the sphere": (lambda: spherical()([0.6, 0.0, 0.9]), "must lie in Sphere(inside=Trivial(size=3))"),
    "a curvature off the sphere": (lambda: spherical().curvature([[0.6, 0.0, 0.9]]), "must lie in Sphere"),
    "a discrete path off the sphere": (
        lambda: co.mechanics.horizontal_lift(
            co.mechanics.DiscreteConnection.from_connection(spherical()), [[0.0, 0.0, 1.0], [0.0, 0.6, 0.9]]
        ),
        "must lie in Sphere",
    ),
    "a path off the sphere": (
        lambda: co.mechanics.holonomy(spherical(), lambda t: jnp.stack([t, t, 1.0 + t])),
        "must lie in Sphere",
    ),
    "momentum of advected parameters": (
        lambda: co.mechanics.mechanical_connection(
            co.System(
                SO3,
                lambda xi, x, v, a: (1 + a @ a) * (xi @ xi) + xi[0] * v[0],
                additional=co.Trivial(1),
                advected=co.Defining(),
            )
        ),
        "with other advected parameters it differs by",
    ),
    "advected parameters": (
        lambda: co.theory.discrete_mechanical_connection(turned_system()[0], co.Midpoint(), 0.1),
        "With advected parameters momentum is not conserved",
    ),
    "another group under multiplication": (
        lambda: co.spaces.GroupItself("multiplication", of=co.SE3()),
        'must be "trivial" for a space that is another group',
    ),
    "a momentum at rest": (
        lambda: co.mechanics.mechanical_connection(
            co.System(SO3, lambda xi, x, v: xi @ xi + v @ v + xi[0], additional=co.Trivial(1))
        ),
        "needs ∂ℓ/∂ξ linear",
    ),
    "no inertia": (
        lambda: co.mechanics.mechanical_connection(
            co.System(SO3, lambda xi, x, v: xi[0] ** 2 + v @ v, additional=co.Trivial(1))
        ),
        "locked inertia",
    ),
    "a composition": (
        lambda: co.theory.discrete_mechanical_connection(kinetic_system("SO3"), co.Suzuki4(co.Midpoint()), 0.1),
        "needs a variational rule of one stage",
    ),
}


@pytest.mark.parametrize("case", sorted(REFUSED))
def test_what_is_no_connection_is_refused_in_one_sentence(case):
    call, says = REFUSED[case]
    with pytest.raises(co.errors.CoadjointError) as caught:
        call()
    assert says in str(caught.value) and str(caught.value).count(". ") == 0, caught.value
