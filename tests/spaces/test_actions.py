"""The axioms of a left action, its derivatives and duals, and the diamond (P14, P45), over groups and spaces."""

from __future__ import annotations

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError, GroupError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.spaces import Representation, Several, Space
from systems import FRAMES, GROUPS, element, flat, generator, point

ROUND_OFF = 1e-13
"""Of the largest entry of the result, of 1, and of the products of matrices of norm up to 10 that enter."""

LINEAR: dict[str, Space] = {
    "Defining": co.Defining(),
    "Dual": co.spaces.Dual(),
    "Adjoint": co.spaces.Adjoint(),
    "Coadjoint": co.Coadjoint(),
    "Trivial": co.Trivial(2),
}
SEVERAL = Several({"buoy": co.spaces.Points(), "row": co.spaces.Dual(), "fill": co.Trivial(1)})
PLACES = [(g, s) for g in GROUPS for s in LINEAR]
PLACES += [(g, s) for g in ("SE2", "SE3") for s in ("Points", "Several")]
PLACES += [("SO3", "Sphere"), ("SO4", "Sphere"), ("SO2", "Sphere")]
CURVED = [("SO3", "frames"), ("SO4", "frames"), ("Sp1", "hyperboloid")]
CURVED += [(g, "itself") for g in ("SO3", "SE3", "SL2", "quaternions", "SO3xSE2", "H2")]
CURVED += [(g, "conjugation") for g in ("SE3", "Sp1")]
PLACES += CURVED
SPACES = LINEAR | {
    "Points": co.spaces.Points(),
    "Sphere": co.Sphere(),
    "Several": SEVERAL,
    "frames": FRAMES,
    "itself": co.spaces.GroupItself(),
    "conjugation": co.spaces.GroupItself("conjugation"),
    "hyperboloid": co.spaces.Submanifold(lambda m: m[0] ** 2 + 4 * m[1] * m[2] - 1.0, co.Coadjoint()),
}


@pytest.fixture(params=PLACES, ids="-".join)
def place(request):
    """(group, space, x, random): a random point of a space under a group."""
    group, space = GROUPS[request.param[0]], SPACES[request.param[1]]
    random = generator("space", *request.param)
    return group, space, space.point(group, point(space, group, random), "x"), random


def ambient(group, space, random, count):
    return random.normal(size=(count, space.ambient(group)))


def close(found, expected, size=1.0):
    np.testing.assert_allclose(found, expected, rtol=0, atol=ROUND_OFF * max(size, np.max(np.abs(expected), initial=1)))


@pytest.mark.cases(7)
def test_identity_does_nothing_and_products_act_in_turn(place):
    group, space, x, random = place
    g, h = element(group, random), element(group, random)

    def actions(g, h, x):
        both = space.act(group, group.compose(g, h), x)
        return space.act(group, group.identity(), x), both, space.act(group, g, space.act(group, h, x))

    still, both, turn = evaluate(actions, g, h, x)
    close(still, x)
    close(both, turn, 100)


@pytest.mark.cases(12)
def test_push_is_the_derivative_of_the_action(place):
    group, space, x, random = place
    g = element(group, random)
    (v,) = ambient(group, space, random, 1)
    found, expected = evaluate(
        lambda g, x, v: (space.push(group, g, x, v), jax.jvp(lambda y: space.act(group, g, y), (x,), (v,))[1]), g, x, v
    )
    close(found, expected, 10)


@pytest.mark.cases(11)
def test_pull_is_dual_to_push(place):
    """⟨g*b, v⟩ = ⟨b, g·v⟩."""
    group, space, x, random = place
    g = element(group, random)
    v, b = ambient(group, space, random, 2)
    found, expected = evaluate(
        lambda g, x, v, b: (space.pull(group, g, x, b) @ v, b @ space.push(group, g, x, v)), g, x, v, b
    )
    close(found, expected, 10)


@pytest.mark.cases(13)
def test_infinitesimal_action_is_the_derivative_along_the_exponential(place):
    group, space, x, random = place
    xi = random.normal(size=group.dim)

    def both(xi, x):
        along = jax.jvp(lambda e: space.act(group, group.exp(e * xi), x), (0.0,), (1.0,))[1]
        return space.infinitesimal(group, xi, x), along

    close(*evaluate(both, xi, x), size=10)


@pytest.mark.cases(13)
def test_infinitesimal_action_by_finite_differences(place):
    """Central differences at ε = 1e-4 leave ε²/6 of the third derivative and 1e-16/ε of round-off."""
    group, space, x, random = place
    xi = 0.5 * random.normal(size=group.dim)

    def both(xi, x):
        ahead, behind = (space.act(group, group.exp(e * xi), x) for e in (1e-4, -1e-4))
        return space.infinitesimal(group, xi, x), (ahead - behind) / 2e-4

    found, expected = evaluate(both, xi, x)
    np.testing.assert_allclose(found, expected, atol=1e-7 * max(1.0, np.max(np.abs(x), initial=0.0)))


@pytest.mark.cases(22)
def test_lifted_action_is_the_derivative_of_the_infinitesimal_one(place):
    group, space, x, random = place
    xi = random.normal(size=group.dim)
    (v,) = ambient(group, space, random, 1)

    def both(xi, x, v):
        return space.lifted(group, xi, x, v), jax.jvp(lambda y: space.infinitesimal(group, xi, y), (x,), (v,))[1]

    close(*evaluate(both, xi, x, v), size=10)


@pytest.mark.cases(21)
def test_bracket_acts_as_the_commutator(place):
    """L_ξ(η·x) − L_η(ξ·x) = [ξ, η]·x."""
    group, space, x, random = place
    xi, eta = random.normal(size=(2, group.dim))

    def both(xi, eta, x):
        one = space.lifted(group, xi, x, space.infinitesimal(group, eta, x))
        other = space.lifted(group, eta, x, space.infinitesimal(group, xi, x))
        return one - other, space.infinitesimal(group, group.ad(xi, eta), x)

    close(*evaluate(both, xi, eta, x), size=30)


@pytest.mark.cases(15)
def test_diamond_is_minus_the_transpose_of_the_infinitesimal_action(place):
    """⟨b⋄x, ξ⟩ = −⟨b, ξ·x⟩, ⟨b⋄v, ξ⟩ = −⟨b, L_ξ v⟩."""
    group, space, x, random = place
    xi = random.normal(size=group.dim)
    b, v = ambient(group, space, random, 2)

    def both(xi, x, b, v):
        return (
            (space.diamond(group, b, x) @ xi, -b @ space.infinitesimal(group, xi, x)),
            (space.lifted_diamond(group, b, x, v) @ xi, -b @ space.lifted(group, xi, x, v)),
        )

    for found, expected in evaluate(both, xi, x, b, v):
        close(found, expected, 10)


@pytest.mark.cases(8)
def test_diamond_is_equivariant(place):
    """(g⁻*b)⋄(g·x) = Ad*_{g⁻¹}(b⋄x)."""
    group, space, x, random = place
    g = element(group, random)
    (b,) = ambient(group, space, random, 1)

    def both(g, x, b):
        back = group.inverse(g)
        moved = space.act(group, g, x)
        carried = space.pull(group, back, moved, b)
        return space.diamond(group, carried, moved), group.Ad_dual(back, space.diamond(group, b, x))

    close(*evaluate(both, g, x, b), size=1e3)


@pytest.mark.cases(7)
def test_closed_forms_equal_the_derivation_from_the_action(place):
    group, space, x, random = place
    g, xi = element(group, random), random.normal(size=group.dim)
    b, v = ambient(group, space, random, 2)

    def forms(g, xi, x, b, v):
        arguments = {
            "infinitesimal": (xi, x),
            "diamond": (b, x),
            "lifted": (xi, x, v),
            "lifted_diamond": (b, x, v),
            "push": (g, x, v),
            "pull": (g, x, b),
        }
        return {
            name: (getattr(space, name)(group, *given), getattr(Space, name)(space, group, *given))
            for name, given in arguments.items()
        }

    for found, expected in evaluate(forms, g, xi, x, b, v).values():
        close(found, expected, 30)


@pytest.mark.cases(15)
@pytest.mark.parametrize("name", GROUPS)
def test_dual_spaces_pair_invariantly(name):
    """⟨g⁻ᵀa, gv⟩ = ⟨a, v⟩ and ⟨Ad*_{g⁻¹}μ, Ad_gξ⟩ = ⟨μ, ξ⟩."""
    group = GROUPS[name]
    random = generator("pairing", name)
    g = element(group, random)
    for one, other in ((co.spaces.Dual(), co.Defining()), (co.Coadjoint(), co.spaces.Adjoint())):
        a, v = random.normal(size=(2, one.ambient(group)))
        found = evaluate(lambda g, a, v, s=one, t=other: s.act(group, g, a) @ t.act(group, g, v), g, a, v)
        close(found, a @ v, 100)


def test_diamond_of_vectors_under_rotations_is_the_cross_product():
    b, x = generator("cross").normal(size=(2, 3))
    for space in (co.Defining(), co.spaces.Dual(), co.spaces.Adjoint(), co.Coadjoint()):
        close(evaluate(lambda b, x, s=space: s.diamond(co.SO3(), b, x), b, x), np.cross(b, x))


def test_points_and_velocities_under_rigid_motions_differ_by_the_translation():
    g = element(co.SE3(), generator("rigid"))
    x, v = generator("rigid points").normal(size=(2, 3))
    R, p = g
    close(evaluate(lambda g, x: co.spaces.Points().act(co.SE3(), g, x), g, x), R @ x + p, 10)
    close(evaluate(lambda g, x, v: co.spaces.Points().push(co.SE3(), g, x, v), g, x, v), R @ v, 10)
    assert not isinstance(co.spaces.Points(), Representation)
    with pytest.raises(GroupError, match="rigid motions"):
        co.spaces.Points().ambient(co.SO3())


def test_a_dictionary_of_spaces_is_seen_by_name_and_acts_part_by_part():
    group, several = co.SE3(), SEVERAL
    random = generator("several")
    g, given = element(group, random), point(several, group, random)
    x = several.point(group, given, "a0")
    view = several.view(group, x)
    np.testing.assert_array_equal(view.buoy, given["buoy"])
    np.testing.assert_array_equal(evaluate(flat, view), x)
    moved = evaluate(lambda g, x: several.act(group, g, x), g, x)
    factors = zip(several.names, several.factors, strict=True)
    parts = [evaluate(lambda g, x, s=s: s.act(group, g, x), g, given[name]) for name, s in factors]
    close(moved, np.concatenate(parts), 10)
    assert several.components(group, "a") == {"a_buoy": slice(0, 3), "a_row": slice(3, 7), "a_fill": slice(7, 8)}
    with pytest.raises(ArgumentError, match="buoy, row, fill"):
        several.point(group, {"buoy": [0, 0, 0]}, "a0")
    with pytest.raises(ArgumentError, match=r"`a0.row` must have shape \(4,\)"):
        several.point(group, given | {"row": [0.0]}, "a0")
    with pytest.raises(ArgumentError, match="at least one"):
        Several({})


SPHERES = ("SO2", "SO3", "SO4")


@pytest.fixture(params=SPHERES)
def sphere(request):
    """(group, x, y): points of a sphere, also next to both poles of the frame, and frame coordinates."""
    group = GROUPS[request.param]
    random = generator("sphere", request.param)
    size = group.matrix_size
    points = [random.normal(size=size), np.eye(size)[0], -np.eye(size)[0], np.eye(size)[-1]]
    points += [p + 1e-9 * random.normal(size=size) for p in points[1:]]
    return group, [p / np.linalg.norm(p) for p in points], random.normal(size=size - 1)


def test_sphere_frame_is_orthonormal_and_tangent(sphere):
    group, points, y = sphere
    space = co.Sphere()
    for x in points:
        frame = evaluate(lambda x: jax.vmap(lambda e: space.tangent(group, x, e), out_axes=1)(jnp.eye(y.size)), x)
        close(frame.T @ frame, np.eye(y.size))
        close(x @ frame, np.zeros(y.size))
        back = evaluate(lambda x, y: space.coordinates(group, x, space.tangent(group, x, y)), x, y)
        close(back, y)


def test_sphere_retraction_stays_on_the_sphere_and_starts_along_its_tangent(sphere):
    group, points, y = sphere
    space = co.Sphere()
    for x in points:

        def moved(x, y):
            return x + space.difference(group, x, space.tangent(group, x, y))

        close(np.linalg.norm(evaluate(moved, x, 3 * y)), 1.0)
        slope, u = evaluate(
            lambda x, y: (jax.jvp(lambda e: moved(x, e * y), (0.0,), (1.0,))[1], space.tangent(group, x, y)), x, y
        )
        close(slope, u)


def test_sphere_difference_of_a_small_step_keeps_all_digits(sphere):
    """|u| = 1e-9: forming ρ(x, u) − x from the points would leave seven digits of sixteen."""
    group, points, y = sphere
    for x in points:
        u = evaluate(lambda x, y: co.Sphere().tangent(group, x, y), x, 1e-9 * y / np.linalg.norm(y))
        found = evaluate(lambda x, u: co.Sphere().difference(group, x, u), x, u)
        expected = u - 0.5 * (u @ u) * x
        np.testing.assert_allclose(found, expected, rtol=0, atol=4e-16 * float(np.linalg.norm(u)))


def test_sphere_projection_leaves_the_pairing_with_tangents(sphere):
    group, points, y = sphere
    space = co.Sphere()
    b = generator("covector").normal(size=group.matrix_size)
    for x in points:
        projected = evaluate(lambda x, b: space.project(group, x, b), x, b)
        close(projected @ x, 0.0)
        u = evaluate(lambda x, y: space.tangent(group, x, y), x, y)
        close(projected @ u, b @ u)


def test_sphere_refuses_a_point_off_it():
    with pytest.raises(ArgumentError, match="unit vector"):
        co.Sphere().point(co.SO3(), [1, 0, 1e-3], "q")


@pytest.fixture(params=CURVED, ids="-".join)
def curved(request):
    """(group, space, x, y): a random point of a curved space and frame coordinates."""
    group, space = GROUPS[request.param[0]], SPACES[request.param[1]]
    random = generator("curved", *request.param)
    x = space.point(group, point(space, group, random), "x")
    return group, space, x, 0.4 * random.normal(size=space.dim(group))


@pytest.mark.cases(2)
def test_frames_are_orthonormal_and_span_the_tangent_space(curved):
    """EᵀE = 1, and EEᵀ takes a covector to the one of T*Q that pairs alike with tangents."""
    group, space, x, y = curved
    b = generator("b").normal(size=x.size)

    def parts(x, y, b):
        frame = jax.vmap(lambda e: space.tangent(group, x, e), out_axes=1)(jnp.eye(y.size))
        u, projected = space.tangent(group, x, y), space.project(group, x, b)
        return frame.T @ frame, space.coordinates(group, x, u), projected @ u - b @ u, frame @ (frame.T @ b) - projected

    gram, back, pairing, rest = evaluate(parts, x, y, b)
    close(gram, np.eye(y.size))
    close(back, y)
    close(pairing, 0.0)
    close(rest, np.zeros(x.size), 10)


@pytest.mark.cases(2)
def test_retractions_stay_on_the_space_and_start_along_their_tangent(curved):
    group, space, x, y = curved

    def parts(x, y):
        def moved(e):
            return x + space.difference(group, x, space.tangent(group, x, e * y))

        return space.defect(group, moved(1.0)), jax.jvp(moved, (0.0,), (1.0,))[1], space.tangent(group, x, y)

    off, slope, u = evaluate(parts, x, y)
    close(off, 0.0, 100)
    close(slope, u)


@pytest.mark.cases(3)
def test_orbits_are_tangent_to_curved_spaces(curved):
    """ξ·x ∈ T_xQ and gx ∈ Q."""
    group, space, x, _ = curved
    random = generator("orbit")
    g, xi = element(group, random), random.normal(size=group.dim)

    def parts(g, xi, x):
        v = space.infinitesimal(group, xi, x)
        within = space.tangent(group, x, space.coordinates(group, x, v))
        return space.defect(group, space.act(group, g, x)), within - v

    off, outside = evaluate(parts, g, xi, x)
    close(off, 0.0, 300)
    close(outside, np.zeros(x.size), 100)


@pytest.mark.parametrize("group", ["SO2", "SO3", "SO4"])
def test_a_sphere_is_the_submanifold_of_its_constraint(group):
    """Another frame and retraction, the same tangents, momenta and action."""
    group = GROUPS[group]
    space = co.spaces.Submanifold(lambda x: x @ x - 1)
    x, b = generator("both").normal(size=(2, group.matrix_size))
    x /= np.linalg.norm(x)
    assert space.dim(group) == co.Sphere().dim(group)
    close(*evaluate(lambda x, b: [s.project(group, x, b) for s in (space, co.Sphere())], x, b))


def test_submanifolds_refuse_what_is_none():
    rotations, sphere = co.SO3(), co.spaces.Submanifold(lambda x: x @ x - 1)
    with pytest.raises(GroupError, match="must leave a Submanifold invariant"):
        co.spaces.Submanifold(lambda x: x[0] ** 2 + 2 * x[1] ** 2 + x[2] ** 2 - 1).require_fit(rotations)
    with pytest.raises(GroupError, match="must leave a Submanifold invariant"):
        sphere.require_fit(GROUPS["SL2"])

    class Still(co.Trivial):
        def require_fit(self, group):
            raise GroupError(f"{group!r} does not fit.")

    with pytest.raises(GroupError, match=r"SO3\(\) does not fit"):
        co.spaces.Submanifold(lambda x: x @ x - 1, Still(3)).require_fit(rotations)
    twice = co.spaces.Submanifold(lambda x: jnp.stack([x @ x - 1, 2 * x @ x - 2]))
    with pytest.raises(GroupError, match="constraints of a Submanifold must be independent, but of 2 only 1"):
        twice.point(rotations, [1, 0, 0], "q")
    with pytest.raises(ArgumentError, match="`q` must lie in its space, but the constraint there is 1"):
        sphere.point(rotations, [1, 1, 0], "q")
    with pytest.raises(ArgumentError, match="Submanifold needs a function"):
        co.spaces.Submanifold(3)  # type: ignore[arg-type]


def test_a_group_as_a_space_takes_its_elements_only():
    space = co.spaces.GroupItself()
    np.testing.assert_array_equal(space.point(co.SE3(), (np.eye(3), [1.0, 2.0, 3.0]), "q")[-3:], [1, 2, 3])
    with pytest.raises(ArgumentError, match=r"`q` must be an element of SO3\(\), but is outside by 7"):
        space.point(co.SO3(), 2 * np.eye(3), "q")
    with pytest.raises(ArgumentError, match=r"`q` must have .*, arrays of shape \(3, 3\), but holds 4 n"):
        space.point(co.SO3(), np.eye(2), "q")
    with pytest.raises(ArgumentError, match='must be "multiplication", "conjugation" or "trivial"'):
        co.spaces.GroupItself("right")  # type: ignore[arg-type]


@dataclass(frozen=True)
class _FromTheRight(Representation):
    """x ↦ gᵀx: an action from the right."""

    def ambient(self, group):
        return group.matrix_size

    def act(self, group, g, x):
        return group.matrix(g).T @ x


def test_an_action_from_the_right_is_refused():
    with pytest.raises(co.errors.GroupError, match=r"must carry a left action of SO3\(\), act\(gh, x\)"):
        co.System(co.SO3(), lambda xi, a: xi @ xi, advected=_FromTheRight())


@dataclass(frozen=True)
class _BentPlane(Space):
    """The plane in the chart (x, y + x²), on which rotations act by polynomials: flat by name only."""

    def ambient(self, group):
        return 2

    def act(self, group, g, x):
        turned = g @ jnp.stack([x[0], x[1] - x[0] ** 2])
        return jnp.stack([turned[0], turned[1] + turned[0] ** 2])


def test_an_action_that_bends_a_flat_space_is_refused_because_node_forms_do_not_hold_there():
    with pytest.raises(co.errors.GroupError, match="must be affine in the point"):
        co.System(co.SO2(), lambda xi, n, nu: 0.5 * nu @ nu, additional=_BentPlane())


def test_a_sphere_needs_orthogonal_matrices():
    with pytest.raises(co.errors.GroupError, match="acts by orthogonal matrices"):
        co.System(co.SE3(), lambda xi, n, nu: 0.5 * nu @ nu, additional=co.Sphere())


@pytest.mark.long
def test_a_retraction_that_finds_no_point_says_so():
    """From |x| = 1 along u: x + u − 2λx reaches the sphere where |u| < 1 and never beyond; no point off it is given."""
    group, space = co.SO3(), co.spaces.Submanifold(lambda x: x @ x - 1)
    x, e = np.array([0.0, 0.6, 0.8]), np.array([1.0, 0.0, 0.0])
    for size in (0.0, 1e-17, 0.1, 0.5, 0.9):
        there = x + evaluate(lambda u: space.difference(group, x, u), size * e)
        np.testing.assert_allclose(there, size * e + np.sqrt(1 - size**2) * x, rtol=0, atol=1e-12)
    for size in (0.99999, 1.0, 1.2, 3.0):
        assert np.all(np.isnan(evaluate(lambda u: space.difference(group, x, u), size * e)))
    system = co.System(group, lambda xi, n, nu: 0.5 * xi @ xi + 0.5 * nu @ nu, additional=space)
    with pytest.raises(co.errors.StepError, match="not finite"):
        co.simulate(system, system.state(q=[0, 0, 1], qdot=[0, 6, 0], xi=[0.1, 0, 0]), dt=0.2, steps=20)


def test_a_sphere_lies_in_a_representation():
    for inside in (3, co.Sphere()):
        with pytest.raises(ArgumentError, match="Sphere must be a representation"):
            co.Sphere(inside)  # type: ignore[arg-type]
