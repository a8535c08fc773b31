"""Equations of links that act on each other in pairs: the block elimination solves what dense elimination does."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.newton.coupled import RENEWED, Coupled
from coadjoint.kernels.newton.layout import layout
from coadjoint.kernels.program import Code
from coadjoint.kernels.trace.evaluate import evaluate, tabulate
from coadjoint.mechanics.coupling import jacobian_solve, momenta_of_links_apart
from coadjoint.mechanics.reduced_functions import TRIVIAL
from coadjoint.mechanics.state import Places

CHAIN = tuple((i, i + 1) for i in range(6))
COUPLINGS = {
    "chain": CHAIN,
    "ring": (*CHAIN, (0, 6)),
    "tree": ((0, 1), (0, 2), (1, 3), (1, 4), (2, 5), (5, 6)),
    "none": (),
}


def equations(pairs, sizes, curved=0.3):
    """A random system r(z) = A z + ε sin(A z) − s with this coupling, as (r, z)."""
    random = np.random.default_rng(11)
    whole = np.zeros((7, sum(sizes), 7, sum(sizes)))
    for i, j in [*pairs, *((j, i) for i, j in pairs), *((i, i) for i in range(7))]:
        whole[i, :, j] = random.normal(size=2 * (sum(sizes),)) + 6 * (i == j) * np.eye(sum(sizes))
    how = Coupled(7, sizes, pairs)
    order = np.asarray(how.end_to_end(jnp.arange(7.0 * sum(sizes)).reshape(7, -1))).astype(int)
    A, s = whole.reshape(7 * sum(sizes), -1)[np.ix_(order, order)], random.normal(size=7 * sum(sizes))
    return how, A, lambda z: A @ z + curved * jnp.sin(A @ z) - s


@pytest.mark.cases(1)
@pytest.mark.parametrize(("kind", "sizes"), [("chain", (2,)), ("ring", (1, 2)), ("tree", (2,)), ("none", (1, 2))])
def test_block_elimination_solves_what_dense_elimination_does(kind, sizes):
    how, A, _ = equations(COUPLINGS[kind], sizes)
    right = np.random.default_rng(2).normal(size=len(A))
    found = evaluate(lambda b: how.jacobian_solve(lambda z: jnp.asarray(A) @ z, jnp.zeros(len(A)), b), right)
    assert np.max(np.abs(A @ found - right)) < 1e-13


def test_a_chain_has_three_colours_and_a_ring_is_folded_in_two():
    chain, ring = layout(1000, tuple((i, i + 1) for i in range(999))), layout(7, COUPLINGS["ring"])
    assert (chain.colours, chain.width, chain.rows) == (3, 1, 1000)
    assert (ring.width, ring.rows) == (2, 4)


def test_the_iteration_goes_on_until_every_link_is_solved():
    """Of parts one begins at its root, and the others near or so far away that increments hardly shrink."""
    how = Coupled(3, (1,), ())
    right = np.array([0.0, 2.0, 10.0])
    solve = tabulate(lambda z: how.root(lambda z: z + z**3 - right, z, jnp.asarray(0.1), (1, 1, 1)), np.zeros(3))
    for guess in ([0.0, 0.0, 0.0], [0.0, 1.0, 50.0]):
        found = solve(np.array(guess))
        np.testing.assert_allclose(found.unknowns, [0, 1, 2], atol=1e-14)
        assert found.code == Code.CONVERGED and found.iterations > 3
    assert solve(np.array([0.0, np.nan, 1.0])).iterations == 1, "no number comes of an equation that has none"


@pytest.mark.long
def test_factors_are_carried_over_and_the_root_has_the_derivative_of_its_equations():
    how, _, r = equations(CHAIN, (2,))

    @jax.jit
    def root(p, guess, h, carried):
        return how.root(lambda z: r(z) - p, guess, h, (14,), carried)

    p, none = np.zeros(14), how.nothing()
    with jax.enable_x64(True):
        first = root(p, np.zeros(14), 0.1, none)
        again = root(p, first.unknowns + 1e-3, 0.1, first.carried)
        assert (int(first.code), int(again.code)) == (Code.CONVERGED, Code.CONVERGED)
        assert np.max(np.abs(r(again.unknowns))) < 1e-13
        assert all(map(np.array_equal, first.carried[:4], again.carried[:4]))
        assert 1 < int(again.iterations) <= RENEWED
        # Of another h they are computed anew.
        assert float(root(p, first.unknowns + 1e-3, 0.2, first.carried).carried.h) == 0.2

        def found(p):
            return root(p, np.zeros(14), 0.1, none).unknowns

        slope, back = jax.jit(jax.jacfwd(found))(p), jax.jit(jax.jacrev(found))(p)
        expected = np.linalg.inv(np.asarray(jax.jit(jax.jacfwd(r))(found(p))))
    assert np.max(np.abs(slope - expected)) < 1e-12
    assert np.max(np.abs(back - expected)) < 1e-12


def test_the_root_has_the_second_derivative_of_its_equations():
    """r(pz) = 0 at z = z₁/p, of which the derivatives by p at 1 are −z₁ and 2z₁."""
    how, _, r = equations(CHAIN, (2,))

    def root(p):
        return how.root(lambda z: r(p * z), jnp.zeros(14), jnp.asarray(0.1), (14,)).unknowns

    def slope(p):
        return jax.jvp(root, (p,), (1.0,))

    (z, first), (_, second) = evaluate(lambda p: jax.jvp(slope, (p,), (1.0,)), np.float64(1.0))
    np.testing.assert_allclose(first, -z, rtol=0, atol=1e-13)
    np.testing.assert_allclose(second, 2 * z, rtol=0, atol=1e-13)


def solved(how, r, guess, carried):
    """The root of r from `guess`, over a stage of 0.1."""
    return jax.jit(lambda guess, h, carried: how.root(r, guess, h, (14,), carried))(guess, 0.1, carried)


@pytest.mark.long
@pytest.mark.parametrize("size", [1.0, 1e-6])
def test_a_pair_that_is_not_declared_gives_right_derivatives_or_none(size):
    with jax.enable_x64(True):
        whole, A, _ = equations(COUPLINGS["ring"], (2,))
        how, rows = Coupled(7, (2,), CHAIN), np.asarray(whole.by_links(jnp.arange(14))).astype(int)
        A = A.copy()
        for i, j in ((0, 6), (6, 0)):
            A[np.ix_(rows[i], rows[j])] *= size * 30
        right = np.random.default_rng(2).normal(size=14)

        def linear(b):
            return how.jacobian_solve(lambda z: jnp.asarray(A) @ z, jnp.zeros(14), b)

        ahead = jax.jit(linear)(right)
        back = jax.jit(lambda b: jax.vjp(linear, b)[1](b)[0])(right)
    for found, matrix in ((ahead, A), (back, A.T)):
        if size == 1.0:
            assert np.all(np.isnan(found))
        else:
            assert np.max(np.abs(found - np.linalg.solve(matrix, right))) < 1e-9 * np.max(np.abs(found))


@pytest.mark.long
def test_old_factors_with_which_increments_shrink_slowly_end_no_iteration_before_round_off():
    how, A, r = equations(CHAIN, (2,), 0.0)
    with jax.enable_x64(True):
        exact = np.linalg.solve(A, -np.asarray(r(jnp.zeros(14))))
        found = solved(how, r, exact, how.nothing()).carried
        # With 0.3 J⁻¹ in place of J⁻¹ seven tenths of an error are left by each iteration.
        slow = found._replace(inverse=0.3 * found.inverse, changes=np.zeros((2, 14)))
        again = solved(how, r, exact * (1 + 1e-8), slow)
    assert int(again.code) == Code.CONVERGED
    assert np.max(np.abs(again.unknowns - exact)) < 1e-14


@pytest.mark.long
def test_old_factors_that_are_no_numbers_are_renewed():
    how, _, r = equations(CHAIN, (2,))
    with jax.enable_x64(True):
        first = solved(how, r, np.zeros(14), how.nothing())
        lost = first.carried._replace(inverse=np.full_like(first.carried.inverse, np.nan))
        again = solved(how, r, np.zeros(14), lost)
    assert int(again.code) == Code.CONVERGED
    assert np.max(np.abs(again.unknowns - first.unknowns)) < 1e-14


@pytest.mark.long
def test_an_iteration_starts_where_the_last_three_solutions_point_to():
    how, A, _ = equations(CHAIN, (2,))
    s = np.random.default_rng(4).normal(size=(3, 14))

    @jax.jit
    def root(t, guess, h, carried):
        right = s[0] + t * s[1] + t * t * s[2]
        return how.root(lambda z: jnp.asarray(A) @ z - right, guess, h, (14,), carried)

    with jax.enable_x64(True):
        found, carried, codes = np.zeros(14), how.nothing(), []
        for t in 0.1 * np.arange(6):
            found, _, code, carried, _ = root(t, found, 0.1, carried)
            codes.append(int(code))
        ahead = 2 * np.asarray(carried.changes[0]) - np.asarray(carried.changes[1])
        following = np.linalg.solve(A, s[0] + 0.6 * s[1] + 0.36 * s[2])
    assert codes == [0] * 6
    assert np.max(np.abs(np.asarray(found) + ahead - following)) < 1e-13


@pytest.mark.parametrize("across", [0.0, 0.1])
def test_links_whose_momenta_are_apart_are_solved_without_a_loop_over_them(across):
    places, random = Places(co.Power(co.SO3(), 24, coupling="chain"), TRIVIAL, TRIVIAL), np.random.default_rng(5)
    A, right = np.zeros((24, 3, 24, 3)), random.normal(size=72)
    A[np.arange(24), :, np.arange(24)] = random.normal(size=(24, 3, 3)) + 4 * np.eye(3)
    A = A.reshape(72, 72) + across * np.eye(72, k=3)

    def solved(b):
        with momenta_of_links_apart():
            return jacobian_solve(places, lambda z: jnp.asarray(A) @ z, jnp.zeros(72), b)

    found = evaluate(solved, right)
    assert np.all(np.isnan(found)) if across else np.max(np.abs(A @ found - right)) < 1e-13
    with jax.enable_x64(True):
        assert "length=24" not in str(jax.make_jaxpr(solved)(right))
