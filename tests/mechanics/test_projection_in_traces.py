"""Projections and starts inside jit, grad and vmap, and the independent rows that a trace finds."""

from __future__ import annotations

import contextlib
from types import SimpleNamespace
from typing import Any

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.kernels.program import Code
from coadjoint.kernels.trace.evaluate import evaluate, tabulate
from coadjoint.mechanics.constrained_start import _independent, checked_members, known_start
from coadjoint.mechanics.independent_rows import independent_rows, kept_rows
from coadjoint.mechanics.members import stacked
from coadjoint.mechanics.projection import _masked, tangent_start
from pinned import INERTIA, PIN, RATES, body, hold, pinned, start


def doubled():
    return body(constraints={"pin": co.Holonomic(hold), "again": co.Holonomic(hold)})


def after(system, state):
    """ξ₀ after ten steps."""
    return co.trajectory(system, state, dt=0.01, steps=10, accuracy=False).final.xi[0]


def test_a_trace_finds_the_independent_rows_that_numbers_have():
    random = np.random.default_rng(3)
    cases = [random.normal(size=(6, k)) @ random.normal(size=(k, 8)) for k in (1, 3, 6)]
    cases.append(np.eye(3, 8)[[0, 0, 1, 2, 1, 2]])
    with co.float64():
        found = jax.jit(jax.vmap(kept_rows))(np.stack([A @ A.T for A in cases]))
    for A, kept in zip(cases, found, strict=True):
        rows = independent_rows(A @ A.T)
        assert len(rows) == np.linalg.matrix_rank(A) == np.linalg.matrix_rank(A[list(rows)])
        assert tuple(np.flatnonzero(kept)) == rows


def test_members_keep_the_independent_rows_of_the_first():
    system = doubled().replace(mass=co.each([1.0, 2.0]))
    starts = start(system, xi=co.each([RATES, RATES]))
    parameters, axes = stacked(system.parameters)
    assert checked_members(system, parameters, axes, starts) == (0, 1, 2)


def test_members_of_different_rank_raise_with_the_member():
    crossing = co.System(
        co.SO2(),
        lambda xi, n, nu: 0.5 * xi @ xi + 0.5 * nu @ nu,
        additional=co.Trivial(2),
        constraints={"rail": co.Nonholonomic(lambda n: [[0, 1, 0], [0, 1, n[0]]])},
    )
    begun = crossing.state(q=co.each([[1.0, 0.0], [0.0, 0.0]]))
    with pytest.raises(co.errors.ArgumentError, match=r"same independent rows .* of member 1"):
        co.simulate(crossing, begun, dt=0.1, steps=1)


def test_a_start_of_known_numbers_off_a_constraint_raises_inside_a_derivative():
    system = pinned()
    begun = start(system, qdot=[0.0, 0.0, 0.0])
    off = "velocities of the start must satisfy the constraint `pin`"
    with co.float64(), pytest.raises(co.errors.ArgumentError, match=off):
        jax.grad(lambda mass: after(system.replace(mass=mass), begun))(2.0)


def test_parameters_that_constraints_read_make_the_start_unknown():
    found = {}
    for name in ("mass", "pin"):

        def given(value, name=name):
            found[name] = known_start(doubled().replace(**{name: value}), start(doubled()))
            return value

        with co.float64():
            jax.eval_shape(given, np.asarray(getattr(doubled().parameters, name)))
    assert found == {"mass": (True, (0, 1, 2)), "pin": (False, None)}


@pytest.mark.long
@pytest.mark.parametrize("backend", ["native", "xla"])
def test_derivatives_with_redundant_rows_are_those_with_independent_ones(backend):
    """And those of the velocities at the nodes, against differences of runs."""

    def turned(k, system, run=co.trajectory, **options):
        heavier = system.replace(inertia=k * INERTIA)
        return run(heavier, start(system), dt=0.01, steps=10, accuracy=False, **options).final.xi[0]

    with co.float64():
        one, other = (float(jax.grad(turned)(1.0, system, backend=backend)) for system in (pinned(), doubled()))
    assert other == pytest.approx(one, rel=1e-10)
    e = 1e-4
    ends = [turned(k, pinned(), co.simulate, progress=False) for k in (1 - e, 1 + e)]
    assert one == pytest.approx((ends[1] - ends[0]) / (2 * e), abs=1e-8)


@pytest.mark.long
def test_derivatives_by_geometry_are_those_of_projected_runs():
    """Against differences, from a start that follows the pin, and from one that stays and is moved onto it."""

    def turned(pin, follows):
        here = doubled().replace(pin=pin)
        state = here.state(q=-pin, xi=RATES, a0=[0.0, 0.0, 1.0]) if follows else start(here)
        return after(here, here.project(state))

    def stays(pin):
        return after(doubled().replace(pin=pin), start(doubled()))

    e = 1e-5
    for follows in (True, False):
        exact = [(turned(PIN + e * d, follows) - turned(PIN - e * d, follows)) / (2 * e) for d in np.eye(3)]
        with co.float64():
            np.testing.assert_allclose(jax.jit(jax.grad(turned), static_argnums=1)(PIN, follows), exact, atol=1e-7)
    with co.float64():
        np.testing.assert_allclose(jax.jit(jax.grad(stays))(PIN), exact, atol=1e-7)


@pytest.mark.parametrize("rows", [1, 2], ids=["independent", "redundant"])
def test_a_start_in_a_trace_stays_and_moves_along_the_constraints(rows):
    """A point on a circle of radius r, its derivatives by x, v, and r those of the nearest point and velocity on it:
    ẋ = t (t·ẋ) + n ṙ, v̇ = t (t·v̇) − n (t·v)(t·ẋ)/r with the normal n and the tangent t."""

    def made(radius):
        circle = co.Holonomic(lambda n, p: 0.5 * (n @ n - p.radius**2))
        return co.System(
            co.Translation(0), lambda xi, n, nu, p: 0.5 * nu @ nu, additional=co.Trivial(2),
            parameters={"radius": radius}, constraints={f"circle_{k}": circle for k in range(rows)},
        )  # fmt: skip

    angle, radius, speed = 0.7, 2.0, 1.5
    n, t = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    start = made(radius).state(q=radius * n, qdot=speed * t)

    def numbers(x, v, r):
        found, kept, on = tangent_start(made(r), start.replace(n=x, nu=v, pi=v))
        return (found.n, found.pi), (kept if rows > 1 else x[:1], on)

    at, along = (radius * n, speed * t, radius), (np.array([0.3, -0.8]), np.array([0.4, 0.9]), 0.6)
    (x, v), (dx, dv), (kept, on) = evaluate(lambda at, along: jax.jvp(numbers, at, along, has_aux=True), at, along)
    np.testing.assert_array_equal(np.stack([x, v]), np.stack(at[:2]))
    np.testing.assert_allclose(dx, t * (t @ along[0]) + n * along[2], atol=1e-13)
    np.testing.assert_allclose(dv, t * (t @ along[1]) - n * speed * (t @ along[0]) / radius, atol=1e-13)
    assert on and (rows == 1 or kept.tolist() == [1, 0])
    if rows == 1:
        seen = tabulate(lambda *at: numbers(*at)[1][1], *at)
        assert [bool(seen(*one)) for one in (at, (1.01 * at[0], *at[1:]), (at[0], at[1] + n, radius))] == [
            True,
            False,
            False,
        ]


@pytest.mark.long
def test_projections_have_the_derivatives_of_their_iterations_far_from_the_constraint():
    """From 0.4 off a sphere and a plane that cut in a circle, in both modes and under vmap."""

    def made(radius):
        return co.System(
            co.SO3(),
            lambda xi, n, nu, p: 0.5 * xi @ xi + 0.5 * nu @ (np.array([1.0, 2.0, 3.0]) * nu),
            additional=co.Defining(),
            parameters={"radius": radius},
            constraints={
                "sphere": co.Holonomic(lambda n, p: n @ n - p.radius**2),
                "plane": co.Holonomic(lambda n, p: n[2] - 0.3),
            },
        )

    def place(x):
        found = made(x[0]).project(made(x[0]).state(q=x[1:4], qdot=x[4:]))
        return jax.numpy.concatenate([found.n, found.nu])

    x, e = np.array([1.0, 0.9, 0.8, 0.5, 0.3, -0.2, 0.4]), 1e-5
    with co.float64():
        exact = np.stack([(place(x + e * d) - place(x - e * d)) / (2 * e) for d in np.eye(7)], axis=1)
        np.testing.assert_allclose(jax.jit(jax.jacfwd(place))(x), exact, atol=1e-8)
        np.testing.assert_allclose(jax.jit(jax.jacrev(place))(x), exact, atol=1e-8)
        np.testing.assert_allclose(jax.jit(jax.vmap(place))(x[None])[0], place(x), atol=1e-12)


@pytest.mark.long
def test_a_traced_start_off_the_constraints_has_a_code():
    system = pinned()

    def run(q):
        begun = system.state(q=q, xi=RATES, qdot=np.cross(RATES, -PIN), a0=[0.0, 0.0, 1.0])
        return co.trajectory(system, begun, dt=0.01, steps=2, accuracy=False).code

    with co.float64():
        codes = jax.jit(jax.vmap(run))(np.stack([-PIN, -PIN + 0.01]))
    assert codes.tolist() == [Code.CONVERGED, Code.OFF_CONSTRAINTS]


@pytest.mark.parametrize(("held", "expected"), [([1, 1], [[2, 3], [3, 5]]), ([1, 0], [[2, 0], [0, 9]])])
def test_rows_that_are_not_of_places_are_decoupled(held, expected):
    matrix = np.array([[2.0, 3.0], [3.0, 5.0]])
    np.testing.assert_array_equal(_masked(matrix, np.array(held), 9.0), expected)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize(("sizes", "named"), [((1.0, 4.0), None), ((1.0, 1e-40), "belt"), ((0.0, 1.0), "wheel")])
def test_a_row_without_a_derivative_next_to_the_largest_is_named(sizes, named):
    system: Any = SimpleNamespace(constraints=[SimpleNamespace(name=name, size=1) for name in ("wheel", "belt")])
    with (
        pytest.raises(ArgumentError, match=f"Every row of the constraint `{named}` must restrict the velocities")
        if named
        else contextlib.nullcontext()
    ):
        assert _independent(system, np.sqrt(np.diag(sizes)), np.diag(sizes)) is None
