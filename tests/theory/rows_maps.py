"""Rows of Definitions 3–5: group difference maps, against their definitions on matrices."""

from __future__ import annotations

import explicit
import jax
import jax.numpy as jnp
from explicit import hat, vee
from theorem_row import Rows, off_each

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from systems import GROUPS, MAPS, generator

ROWS = Rows("every G whose Lie algebra the map fits")
row = ROWS.add

TESTS = "difference_maps/test_difference_maps.py::"
FITTING = ("SO2", "SO3", "SE2", "SE3", "SO3xSE2", "SL2")
TAU = "difference_maps.difference_map.DifferenceMap."


def maps():
    """Groups and maps with ξ, χ and μ."""
    for name in FITTING:
        for label in ("cayley", "exponential", "squared", "bent"):
            if (name, label) != ("SL2", "bent"):
                yield (
                    GROUPS[name],
                    MAPS[label],
                    *0.6 * generator("maps", name, label).normal(size=(3, GROUPS[name].dim)),
                )


def tangent(group, tau, xi):
    """The matrix of χ ↦ ((Dτ(ξ)·χ) τ(ξ)⁻¹)ᵛ, and τ(ξ)."""
    F = group.matrix(tau.tau(group, xi))
    slope = jax.jacfwd(lambda x: group.matrix(tau.tau(group, x)))(xi)
    return jax.vmap(lambda d: vee(group, d @ jnp.linalg.inv(F)), in_axes=2, out_axes=1)(slope), F


@row(
    "[Definition 3](theorems/difference-maps.md)",
    "group difference map: τ(0) = e, τ(ξ)⁻¹ = τ(−ξ)",
    (TAU + "tau", TAU + "require_fit"),
    (TESTS + "test_a_map_starts_at_the_identity_and_inverts_with_its_argument",),
)
def difference_map():
    for group, tau, xi, chi, _ in maps():

        def sides(xi, chi, group=group, tau=tau):
            def tried(x):
                return group.matrix(tau.tau(group, x))

            rest, first = jax.jvp(tried, (jnp.zeros_like(xi),), (chi,))
            return (rest, first, tried(xi) @ tried(-xi)), (jnp.eye(len(rest)), hat(group, chi), jnp.eye(len(rest)))

        yield off_each(*evaluate(sides, xi, chi))
        yield 0.0 if fits(tau, group) else 1.0
    yield 1.0 if fits(co.Cayley(), GROUPS["SLn3"]) else 0.0


def fits(tau, group) -> bool:
    """Whether a map is accepted."""
    try:
        tau.require_fit(group)
    except co.errors.GroupError:
        return False
    return True


@row(
    "[Definition 4](theorems/difference-maps.md), (P32)–(P33)",
    "right-trivialised tangent dτ",
    (TAU + "tau", TAU + "dtau", TAU + "dtau_dual", "groups.group.LieGroup.Ad"),
    (TESTS + "test_tangent_is_right_trivialised", TESTS + "test_tangent_intertwines"),
)
def right_trivialised():
    for group, tau, xi, chi, mu in maps():

        def sides(xi, chi, mu, group=group, tau=tau):
            slope, F = tangent(group, tau, xi)
            carried = group.Ad(tau.tau(group, xi), tau.dtau(group, -xi, chi))
            found = (
                tau.dtau(group, xi, chi),
                carried,
                tau.dtau_dual(group, xi, mu),
                F @ group.matrix(tau.tau(group, -xi)),
            )
            return found, (slope @ chi, slope @ chi, slope.T @ mu, jnp.eye(len(F)))

        yield off_each(*evaluate(sides, xi, chi, mu))


@row(
    "[Definition 5](theorems/difference-maps.md), (P34)–(P35)",
    "inverse map τ⁻¹ and its right-trivialised tangent dτ⁻¹",
    (
        TAU + "inverse",
        TAU + "dtau_inverse",
        TAU + "dtau_inverse_dual",
        "groups.group.LieGroup.Ad",
        "groups.group.LieGroup.Ad_dual",
    ),
    (
        "difference_maps/test_inverse_maps.py::test_it_undoes_the_map",
        "difference_maps/test_inverse_maps.py::test_its_derivative_is_the_inverse_tangent",
        TESTS + "test_inverse_tangent_inverts_the_tangent",
        TESTS + "test_inverse_tangent_intertwines",
    ),
)
def inverse_tangent():
    for group, tau, xi, chi, mu in maps():

        def sides(xi, chi, mu, group=group, tau=tau):
            slope, _ = tangent(group, tau, xi)
            F = tau.tau(group, xi)
            turned = tau.dtau_inverse(group, -xi, group.Ad(tau.tau(group, -xi), chi))
            dual = group.Ad_dual(F, tau.dtau_inverse_dual(group, xi, mu))
            found = tau.dtau_inverse(group, xi, chi), turned, dual, tau.dtau_inverse_dual(group, xi, mu)
            moved = jax.jvp(lambda t: tau.inverse(group, group.compose(group.exp(t * chi), F)), (0.0,), (1.0,))
            back, covector = jnp.linalg.solve(slope, chi), jnp.linalg.solve(slope.T, mu)
            expected = back, back, explicit.Ad_dual(group, group.matrix(F), covector), covector, xi, back
            return (*found, *moved), expected

        yield off_each(*evaluate(sides, xi, chi, mu))
