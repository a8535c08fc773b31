"""Geodesics, splines and means of elements of a group."""

from __future__ import annotations

import jax
import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import coadjoint as co
from coadjoint.errors import ArgumentError, GroupError
from coadjoint.groups import Spline, geodesic, mean
from coadjoint.kernels.trace.evaluate import evaluate
from systems import GROUPS, generator

NAMES = ["SO3", "SE3", pytest.param("SLn3", marks=pytest.mark.long), pytest.param("SL2_dual", marks=pytest.mark.long)]


def apart(group, *pairs) -> float:
    """The largest entry by which pairs of elements differ."""
    return max(np.max(np.abs(x - y)) for pair in pairs for x, y in zip(*map(jax.tree.leaves, pair), strict=True))


def elements(group, count, size=0.5):
    xi = generator("measured", group).normal(size=(count, group.dim))
    return evaluate(jax.vmap(group.exp), size * xi / np.linalg.norm(xi, axis=1, keepdims=True))


def moved(group, h, g, k):
    """h g_i k of all elements."""
    return evaluate(lambda h, g, k: jax.vmap(lambda one: group.compose(group.compose(h, one), k))(g), h, g, k)


@pytest.mark.parametrize("name", NAMES)
def test_the_mean_is_moved_by_translations_and_solves_its_equation(name):
    group = GROUPS[name]
    g, (h, k) = elements(group, 5), (jax.tree.map(lambda x, i=i: x[i], elements(group, 2, 0.4)) for i in (0, 1))
    w = np.array([1.0, 2.0, 0.5, 0.0, 1.5])
    m = mean(group, g, w)
    logs = [group.log(evaluate(lambda m, g: group.compose(group.inverse(m), g), m, one)) for one in _each(g)]
    assert np.max(np.abs(w @ np.array(logs))) < 1e-12
    expected = evaluate(lambda h, m, k: group.compose(group.compose(h, m), k), h, m, k)
    assert apart(group, (mean(group, moved(group, h, g, k), w), expected)) < 1e-12


def _each(g):
    return [jax.tree.map(lambda x, i=i: x[i], g) for i in range(len(jax.tree.leaves(g)[0]))]


def test_the_mean_of_turns_about_one_axis_is_the_turn_by_the_mean_angle_even_across_half_a_turn():
    angles = np.radians([170.0, 178.0, -176.0])
    R = [co.attitude.zyx(angle, 0, 0) for angle in angles]
    np.testing.assert_allclose(mean(co.SO3(), R), co.attitude.zyx(np.radians(532 / 3), 0, 0), atol=1e-14)
    weighted = mean(co.SO3(), R, weights=[3, 0, 1])
    np.testing.assert_allclose(weighted, co.attitude.zyx(np.radians(173.5), 0, 0), atol=1e-14)


def test_the_mean_of_turns_that_differ_by_round_off_is_one_of_them():
    R = co.attitude.zyx(0.3, -0.2, 0.7)
    near = np.stack([R, np.nextafter(R, 1), np.nextafter(R, -1), R @ R @ R.T])
    np.testing.assert_allclose(mean(co.SO3(), near), R, atol=1e-15)


def test_the_mean_of_vectors_is_theirs():
    x = generator("vectors").normal(size=(6, 3))
    np.testing.assert_allclose(mean(co.Translation(3), x), np.mean(x, axis=0), atol=1e-15)


@pytest.mark.parametrize("name", NAMES)
def test_a_geodesic_is_the_same_from_either_end_and_with_elements_moved(name):
    group = GROUPS[name]
    g, h = _each(elements(group, 2))
    s = np.array([0.0, 0.25, 1.0])
    there, back = geodesic(group, g, h, s), geodesic(group, h, g, 1 - s)
    assert apart(group, (there, back)) < 1e-14
    assert apart(group, (_each(there)[0], g), (_each(there)[2], h)) < 1e-14
    turned = geodesic(group, *(evaluate(group.compose, one, h) for one in (g, h)), 0.25)
    assert apart(group, (turned, evaluate(group.compose, _each(there)[1], h))) < 1e-13


def test_a_geodesic_of_rotations_turns_at_a_constant_rate():
    R, S = co.attitude.zyx(0.4, 1.2, -0.3), co.attitude.zyx(-2.0, 0.1, 0.5)
    angle = np.linalg.norm(co.SO3().log(R.T @ S))
    part = geodesic(co.SO3(), R, S, 0.3)
    assert abs(np.linalg.norm(co.SO3().log(R.T @ part)) - 0.3 * angle) < 1e-15
    with co.float64():
        np.testing.assert_allclose(jax.jit(lambda s: geodesic(co.SO3(), R, S, s))(0.3), part, atol=1e-15)


def test_the_spline_of_vectors_is_the_natural_cubic_spline_or_the_clamped_one():
    random = generator("spline")
    t, x = np.cumsum(random.uniform(0.5, 1.5, size=7)), random.normal(size=(7, 3))
    s = np.linspace(t[0], t[-1], 40)
    np.testing.assert_allclose(Spline(co.Translation(3), t, x)(s), CubicSpline(t, x, bc_type="natural")(s), atol=1e-13)
    ends = random.normal(size=(2, 3))
    clamped = CubicSpline(t, x, bc_type=tuple((1, end) for end in ends))
    np.testing.assert_allclose(Spline(co.Translation(3), t, x, velocities=ends)(s), clamped(s), atol=1e-13)
    np.testing.assert_allclose(Spline(co.Translation(3), t, x, ends).velocity(s), clamped(s, 1), atol=1e-12)


@pytest.mark.parametrize("name", ["SO3", *(pytest.param(name, marks=pytest.mark.long) for name in ("SE3", "SL2_dual"))])
def test_a_spline_passes_its_elements_with_continuous_velocity_and_acceleration(name):
    group = GROUPS[name]
    t, g = np.array([0.0, 0.7, 2.0, 2.9, 3.5]), elements(group, 5, 0.9)
    spline, e = Spline(group, t, g), 1e-5
    assert apart(group, (spline(t), g)) < 1e-14
    inner = t[1:-1]
    v = spline.velocity(np.stack([inner - 2 * e, inner - e, inner, inner + e, inner + 2 * e]))
    np.testing.assert_allclose(v[2], spline.velocities[1:-1], atol=1e-12)
    before, after = (3 * v[2] - 4 * v[1] + v[0]) / (2 * e), (4 * v[3] - 3 * v[2] - v[4]) / (2 * e)
    np.testing.assert_allclose(before, after, atol=1e-7)
    assert np.max(np.abs(before)) > 0.1
    rest = (spline.velocity(e) - spline.velocity(0.0)) / e
    assert np.max(np.abs(rest)) < 1e-3


@pytest.mark.long
def test_a_clamped_spline_converges_with_order_four():
    group = co.SO3()

    def curve(t):
        xi = jax.numpy.stack([jax.numpy.sin(2 * t), 0.5 * t, jax.numpy.cos(t)])
        return group.compose(group.exp(xi), group.exp(0.3 * xi[::-1]))

    def velocity(t):
        return group.vee(
            group.matrix(group.inverse(curve(t))) @ jax.jvp(lambda t: group.matrix(curve(t)), (t,), (1.0,))[1]
        )

    fine, errors = np.linspace(0, 2, 57), []
    for count in (21, 41):
        t = np.linspace(0, 2, count)
        ends = evaluate(jax.vmap(velocity), t[[0, -1]])
        spline = Spline(group, t, evaluate(jax.vmap(curve), t), velocities=ends)
        errors.append(apart(group, (spline(fine), evaluate(jax.vmap(curve), fine))))
    assert 3.7 < np.log2(errors[0] / errors[1]) < 4.4


WRONG = {
    "no elements": (lambda: mean(co.SO3(), np.zeros((0, 3, 3))), ArgumentError, "must be one or more"),
    "vectors": (lambda: mean(co.SO3(), np.zeros((4, 3))), ArgumentError, "must be arrays of shape ('count', 3, 3)"),
    "a text": (lambda: mean(co.SE3(), "poses"), ArgumentError, "or a list of elements, but are 'poses'"),
    "negative weights": (lambda: mean(co.SO2(), [np.eye(2)] * 2, [1, -1]), ArgumentError, "`weights` must be 2"),
    "no mean": (lambda: mean(co.SOn(4), [np.eye(4), -np.eye(4)]), GroupError, "Element 1: The element of SOn(size=4)"),
    "not on the group": (
        lambda: mean(co.SO3(), [np.eye(3), 2 * np.eye(3)]),
        GroupError,
        "Element 1: The argument must",
    ),
    "times": (lambda: Spline(co.SO2(), [0, 0], [np.eye(2)] * 2), ArgumentError, "`times` must be strictly increasing"),
    "ends": (lambda: Spline(co.SO2(), [0, 1], [np.eye(2)] * 2, [1, 2]), ArgumentError, "shape (2, 1)"),
    "outside": (lambda: Spline(co.SO2(), [0, 1], [np.eye(2)] * 2)(1.5), ArgumentError, "must be from 0 to 1 s"),
    "half a turn": (lambda: geodesic(co.SOn(4), np.eye(4), -np.eye(4), 0.5), GroupError, "outside the image of exp"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_use_raises_one_sentence(case):
    call, kind, sentence = WRONG[case]
    with pytest.raises(kind) as caught:
        call()
    assert sentence in str(caught.value) and "\n" not in str(caught.value)
