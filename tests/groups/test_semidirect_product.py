"""S = G ⋉ V by its definition (B1–B6), and SE(3) as SO(3) ⋉ ℝ³."""

from __future__ import annotations

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import GroupError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.spaces import Representation, Space
from systems import GROUPS, MAPS, SL2, SO4, element, generator

ROUND_OFF = 1e-13
"""Of the largest entry of the result, and of 10 where matrices meet."""

PRODUCTS = {
    "SO3 Defining": co.SemidirectProduct(co.SO3(), co.Defining()),
    "SO3 Adjoint": co.SemidirectProduct(co.SO3(), co.spaces.Adjoint()),
    "SL2 Dual": GROUPS["SL2_dual"],
    "SL2 Coadjoint": co.SemidirectProduct(SL2, co.Coadjoint()),
    "SE2 Dual": co.SemidirectProduct(co.SE2(), co.spaces.Dual()),
    "SO4 Defining": co.SemidirectProduct(SO4, co.Defining()),
    "SO3 Trivial": co.SemidirectProduct(co.SO3(), co.Trivial(2)),
    "SO3xSO2 Defining": co.SemidirectProduct(co.DirectProduct(co.SO3(), co.SO2()), co.Defining()),
}


def close(found, expected, size=10.0):
    for x, y in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        np.testing.assert_allclose(x, y, rtol=0, atol=ROUND_OFF * max(size, np.max(np.abs(y), initial=0.0)))


@pytest.fixture(params=PRODUCTS)
def product(request):
    S = PRODUCTS[request.param]
    return S, S.group, S.representation, generator("semidirect", request.param)


@pytest.mark.cases(5)
def test_product_inverse_and_bracket_are_those_of_the_definition(product):
    """(g₁g₂, v₁ + g₁v₂), (g⁻¹, −g⁻¹v), ([ξ, η], ξ·w − η·u) (B1–B3)."""
    S, group, V, random = product
    first, second = element(S, random), element(S, random)
    xi, eta = random.normal(size=(2, S.dim))

    def both(first, second, xi, eta):
        (g, v), (h, w), (x, u), (y, z) = first, second, S.split(xi), S.split(eta)
        back = group.inverse(g)
        bracket = V.infinitesimal(group, x, z) - V.infinitesimal(group, y, u)
        return (
            (S.compose(first, second), (group.compose(g, h), v + V.act(group, g, w))),
            (S.inverse(first), (back, -V.act(group, back, v))),
            (S.ad(xi, eta), jnp.concatenate([group.ad(x, y), bracket])),
        )

    for found, expected in evaluate(both, first, second, xi, eta):
        close(found, expected)


@pytest.mark.cases(4)
def test_adjoint_actions_and_their_duals_are_those_of_the_definition(product):
    """Ad = (Ad_gξ, gu − (Ad_gξ)·v), Ad* = (Ad*_g(μ + β⋄v), g*β), ad* = (ad*_ξμ + β⋄u, L*_ξβ) (B4–B6).

    The diamond and the duals are taken from their definitions, one basis vector after the other.
    """
    S, group, V, random = product
    g = element(S, random)
    xi, mu = random.normal(size=(2, S.dim))

    def rows(linear, size):
        return jax.vmap(linear)(jnp.eye(size))

    def both(g, xi, mu):
        (R, v), (x, u), (m, beta) = g, S.split(xi), S.split(mu)
        size = beta.shape[0]

        def diamond(b, y):
            return -rows(lambda e: b @ Space.infinitesimal(V, group, e, y), group.dim)

        turned = group.Ad(R, x)
        pulled = rows(lambda e: beta @ V.act(group, R, e), size)
        lifted = rows(lambda e: beta @ V.infinitesimal(group, x, e), size)
        return (
            (S.Ad(g, xi), (turned, V.act(group, R, u) - V.infinitesimal(group, turned, v))),
            (S.Ad_dual(g, mu), (group.Ad_dual(R, m + diamond(beta, v)), pulled)),
            (S.ad_dual(xi, mu), (group.ad_dual(x, m) + diamond(beta, u), lifted)),
        )

    for found, expected in evaluate(both, g, xi, mu):
        close(found, np.concatenate(expected))


def test_matrices_hold_the_element_and_its_action(product):
    """[[g, v], [0, 1]] where ρ(g) is g; else g beside [[ρ(g), v], [0, 1]]."""
    S, group, V, random = product
    g = element(S, random)
    size = V.ambient(group)
    matrix, own, acting = evaluate(
        lambda g: (S.matrix(g), group.matrix(g[0]), jax.vmap(lambda e: V.act(group, g[0], e))(jnp.eye(size)).T), g
    )
    close(matrix[-size - 1 :, -size - 1 :], np.block([[acting, g[1][:, None]], [np.zeros(size), np.ones(1)]]))
    close(matrix[: len(own), : len(own)], own)
    assert len(matrix) == (size + 1 if len(own) == size and np.allclose(own, acting) else len(own) + size + 1)


@pytest.mark.cases(1)
@pytest.mark.parametrize("tau", MAPS)
def test_every_map_is_a_difference_map_on_every_product(product, tau):
    """The inverse tangent intertwines, (dτ⁻¹_{−ξ})* = Ad*_{τ(ξ)}(dτ⁻¹_ξ)*, and inverts the derivative of τ."""
    S, _, V, random = product
    if tau == "pade" and co.Coadjoint() == V:
        pytest.skip("the Padé approximant of SL(2) in its coadjoint representation is another")
    tau = MAPS[tau]
    tau.require_fit(S)
    xi, mu = random.normal(scale=0.5, size=(2, S.dim))

    def both(xi, mu):
        dual = tau.dtau_inverse_dual(S, xi, mu)
        tangent = jax.vmap(lambda chi: tau.dtau(S, xi, chi))(jnp.eye(S.dim))
        carried = S.Ad_dual(tau.tau(S, xi), dual)
        return (tangent @ dual, mu), (tau.dtau_inverse_dual(S, -xi, mu), carried)

    for found, expected in evaluate(both, xi, mu):
        close(found, expected, 30)


def test_rotations_with_vectors_are_the_rigid_motions():
    """SO(3) ⋉ ℝ³ is SE(3), with ξ = (ω, v): same basis, elements, actions, exponential and difference maps."""
    S, group = PRODUCTS["SO3 Defining"], co.SE3()
    random = generator("SE3")
    g, h = element(group, random), element(group, random)
    xi, eta, mu = random.normal(size=(3, 6))
    np.testing.assert_array_equal(S.basis, group.basis)

    def everything(G, g, h, xi, eta, mu):
        made = [G.compose(g, h), G.inverse(g), G.matrix(g), G.tangent(xi), G.project(g), G.defect(g)]
        made += [G.Ad(g, xi), G.Ad_dual(g, mu), G.ad(xi, eta), G.ad_dual(xi, mu), G.exp(xi)]
        made += [G.angle_squared(xi), G.rotation_angle(xi), G.rotation(g)]
        for tau in MAPS.values():
            made += [tau.tau(G, xi), tau.dtau_inverse_dual(G, xi, mu), tau.chart(G, xi)]
        made += [co.spaces.Points().act(G, g, mu[:3]), co.spaces.Points().diamond(G, mu[:3], xi[:3])]
        return made

    found, expected = (evaluate(lambda *x, G=G: everything(G, *x), g, h, xi, eta, mu) for G in (S, group))
    close(found, expected)


@pytest.mark.long
@pytest.mark.parametrize("method", [co.Midpoint(co.Cayley()), co.LeftRectangle(co.Exponential())], ids=repr)
def test_a_body_moves_alike_on_the_rigid_motions_and_on_the_semidirect_product(method):
    """A heavy Kirchhoff body, its weight −ℓ ∋ a·r with a ∈ (ℝ⁴)* advected, and a buoy that its hull drags along."""
    parameters = {"M": np.diag([2.0, 3.0, 4.0, 5.0, 6.0, 9.0]), "mass": 0.7}

    def lagrangian(xi, n, nu, a, p):
        return 0.5 * xi @ p.M @ xi + 0.3 * xi[0] * xi[4] + 0.5 * p.mass * nu @ nu - 0.2 * n @ n + a[3] + 0.1 * a[0]

    def end(group):
        system = co.System(
            group,
            lagrangian,
            additional=co.spaces.Points(),
            advected=co.spaces.Dual(),
            parameters=parameters,
            name="body",
        )
        start = system.state(q=[1.0, 0.5, 0.2], qdot=[0, 0.1, 0], xi=[0.5, -0.3, 0.8, 1.0, 0.2, 0.1], a0=[0, 0, 1, 0])
        run = co.simulate(system, start, dt=0.05, steps=200, method=method, backend="native", monitors=False)
        return [run.final.g, run.final.n, run.final.mu, run.final.pi]

    close(end(PRODUCTS["SO3 Defining"]), end(co.SE3()), 200)


def test_a_product_on_a_product_names_its_parts():
    S = co.SemidirectProduct(PRODUCTS["SO3 Defining"], co.spaces.Dual())
    assert S.leaf_names == ("R", "v", "v_2")
    assert S.dim == 10
    assert co.SemidirectProduct(co.SemidirectProduct(co.SO3(), co.Defining()), co.spaces.Dual()) == S


@dataclass(frozen=True)
class _RightAction(Representation):
    """x ↦ g⁻¹x, which is no left action."""

    def ambient(self, group):
        return group.matrix_size

    def act(self, group, g, x):
        return group.matrix(group.inverse(g)) @ x


class _Shifted(Space):
    """ℝ², which ℝ moves along the first axis."""

    def ambient(self, group):
        return 2

    def act(self, group, g, x):
        return x + jnp.stack([g[0], 0.0])


def test_what_is_no_representation_is_refused_in_one_sentence():
    with pytest.raises(GroupError, match=r"needs a linear action, but .* moves the origin by"):
        co.SemidirectProduct(co.Translation(1), _Shifted())
    with pytest.raises(GroupError, match=r"must carry a left action of .*, act\(gh, x\) = act\(g, act\(h, x\)\)"):
        co.SemidirectProduct(co.SO3(), _RightAction())
    with pytest.raises(GroupError, match="needs a linear action, but Points\\(\\) moves the origin"):
        co.SemidirectProduct(co.SE3(), co.spaces.Points())
    for stranger in (co.Sphere(), co.SO3(), 3):
        with pytest.raises(GroupError, match="must be a representation such as"):
            co.SemidirectProduct(co.SO3(), stranger)
    with pytest.raises(GroupError, match="must be a Lie group"):
        co.SemidirectProduct(3, co.Defining())  # type: ignore[arg-type]
    with pytest.raises(GroupError, match="dimension 1 or more"):
        co.SemidirectProduct(co.SO3(), co.Trivial(0))
