"""Rows (B1)–(B6): semidirect products, against matrices."""

from __future__ import annotations

import explicit
import jax
import jax.numpy as jnp
from explicit import move, turn
from theorem_row import Rows, off_each

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from systems import GROUPS, element, generator

ROWS = Rows("G ⋉ V, V linear")
row = ROWS.add

SEMIDIRECT = "groups/test_semidirect_product.py::"
S = "groups.SemidirectProduct."


def products():
    """S = G Ⓢ V with two elements, two vectors of its algebra and a covector."""
    for name, V in (
        ("SO3", co.Defining()),
        ("SL2", co.spaces.Dual()),
        ("SE2", co.spaces.Adjoint()),
        ("SO3", co.Coadjoint()),
    ):
        G, random = GROUPS[name], generator("product", name, V)
        made = co.SemidirectProduct(G, V)
        (g, h), (v, w) = (element(G, random) for _ in range(2)), random.normal(size=(2, V.ambient(G)))
        yield made, G, V, (g, v), (h, w), *random.normal(size=(3, made.dim))


@row(
    "(B1)–(B3)",
    "semidirect product: multiplication, inverse, bracket",
    (S + "compose", S + "inverse", S + "ad"),
    (SEMIDIRECT + "test_product_inverse_and_bracket_are_those_of_the_definition",),
)
def product():
    for made, G, V, first, second, xi, eta, _ in products():

        def sides(first, second, xi, eta, made=made, G=G, V=V):
            ((g, v), (h, w)), (x, y) = (first, second), (xi[: G.dim], eta[: G.dim])
            A, B = G.matrix(g), G.matrix(h)
            gh, gv = made.compose(first, second)
            back, bv = made.inverse(first)
            found = G.matrix(gh), gv, G.matrix(back), bv, made.ad(xi, eta)
            inverse = jnp.linalg.inv(A)
            moved = turn(V, G, x, eta[G.dim :]) - turn(V, G, y, xi[G.dim :])
            bracket = jnp.concatenate([explicit.bracket(G, x, y), moved])
            return found, (A @ B, v + move(V, G, A, w), inverse, -move(V, G, inverse, v), bracket)

        yield off_each(*evaluate(sides, first, second, xi, eta))


@row(
    "(B4)–(B6)",
    "adjoint and coadjoint actions, v⋄a",
    (S + "Ad", S + "Ad_dual", S + "ad", S + "ad_dual", "spaces.space.Space.diamond"),
    (SEMIDIRECT + "test_adjoint_actions_and_their_duals_are_those_of_the_definition",),
)
def adjoint():
    for made, G, V, first, _, xi, eta, mu in products():

        def sides(first, xi, eta, mu, made=made, G=G, V=V):
            A, v, size = G.matrix(first[0]), first[1], G.dim

            def Ad(x):
                turned = explicit.Ad(G, A, x[:size])
                return jnp.concatenate([turned, move(V, G, A, x[size:]) - turn(V, G, turned, v)])

            def ad(y):
                moved = turn(V, G, xi[:size], y[size:]) - turn(V, G, y[:size], xi[size:])
                return jnp.concatenate([explicit.bracket(G, xi[:size], y[:size]), moved])

            ways, b = jnp.eye(made.dim), mu[size:]
            found = made.Ad(first, eta), made.Ad_dual(first, mu), made.ad(xi, eta), made.ad_dual(xi, mu)
            of_v = -jax.vmap(lambda x: b @ turn(V, G, x, v))(jnp.eye(size))
            expected = Ad(eta), jax.vmap(Ad)(ways) @ mu, ad(eta), jax.vmap(ad)(ways) @ mu
            return (*found, V.diamond(G, b, v)), (*expected, of_v)

        yield off_each(*evaluate(sides, first, xi, eta, mu))
