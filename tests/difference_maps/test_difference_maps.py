"""Group difference maps: Definitions 3–5, (P33), (P35), closed forms against the derivation from τ alone, refusals."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.difference_maps import DifferenceMap
from coadjoint.difference_maps.second_kind import _cubic
from coadjoint.errors import GroupError
from coadjoint.groups import LieGroup
from coadjoint.kernels.trace.evaluate import evaluate
from stepping import Stepper
from systems import GROUPS, MAPS, generator

ROUND_OFF = 1e-13
"""Of the largest entry of the result; the matrices of dτ and Ad that enter have norms up to 30."""


def close(found, expected, size=1.0):
    for x, y in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        np.testing.assert_allclose(x, y, rtol=0, atol=ROUND_OFF * max(size, np.max(np.abs(y), initial=0.0)))


ALL_MAPS = MAPS | {"pade3": co.difference_maps.Pade(3)}
UNFIT_PAIRS = {(group, name) for group in ("SLn3", "SUn3") for name in ("cayley", "squared", "bent", "pade", "pade3")}
PAIRS = [(g, m) for g in GROUPS for m in ALL_MAPS if (g, m) not in UNFIT_PAIRS]
EXPENSIVE = {"SOn4", "SLn3", "SUn3", "Sp2", "SL2_dual", "nested"}
"""Groups of dimension 5 to 10 without closed forms: one map each by default, the others in the long tests."""


def _marked(index: int, pair: tuple[str, str]):
    return pytest.param(pair, marks=[pytest.mark.long] if pair[0] in EXPENSIVE and index % 5 else [])


@pytest.fixture(params=[_marked(*numbered) for numbered in enumerate(PAIRS)], ids="-".join)
def pair(request):
    """(τ, group, ξ, χ, μ) at random, ξ inside the chart."""
    group, tau = GROUPS[request.param[0]], ALL_MAPS[request.param[1]]
    xi, chi, mu = generator("map", *request.param).normal(scale=0.8, size=(3, group.dim))
    far = evaluate(lambda xi: tau.chart(group, xi), xi)
    return tau, group, xi * min(1.0, 0.95 / max(far, 1e-300)), chi, mu


@pytest.mark.cases(13)
def test_a_map_starts_at_the_identity_and_inverts_with_its_argument(pair):
    """τ(0) = e, τ(ξ)⁻¹ = τ(−ξ) (Definition 3), and τ(ξ) ∈ G."""
    tau, group, xi, *_ = pair

    def axioms(xi):
        ahead, behind = tau.tau(group, xi), tau.tau(group, -xi)
        start = tau.tau(group, jnp.zeros(group.dim))
        return group.matrix(start), group.matrix(group.inverse(ahead)), group.matrix(behind), group.defect(ahead)

    start, inverse, behind, defect = evaluate(axioms, xi)
    close(start, np.eye(group.matrix_size))
    close(inverse, behind, 10)
    assert defect <= ROUND_OFF * 10


MATRICES = ("SO2", "SO3", "SE2", "SE3", "R3", "quaternions", "H2", "GLn2", "SO3_R3", "opposite")
"""Groups on which Cayley's map is that of matrices, each with functions of its own."""


def test_closed_forms_of_cayley_are_those_of_matrices():
    """τ = (1 − ½ξ̂)⁻¹(1 + ½ξ̂), dτ_ξχ = (1 − ½ξ̂)⁻¹χ̂(1 + ½ξ̂)⁻¹, its inverse, and the dual of that; Gᵒᵖ by −ξ."""
    tau, random = co.Cayley(), generator("closed forms")
    given = {name: random.normal(scale=0.6, size=(3, GROUPS[name].dim)) for name in MATRICES}

    def forms(name, xi, chi, mu):
        group = GROUPS[name]
        F, plain = tau.tau(group, xi), getattr(group, "group", group) if name == "opposite" else group
        there = plain.hat(xi), plain.hat(chi), jax.vmap(plain.hat)(jnp.eye(plain.dim)), plain.matrix(F)
        return there, tau.dtau(group, xi, chi), tau.dtau_inverse_dual(group, xi, mu), tau.inverse(group, F)

    found = evaluate(lambda given: {name: forms(name, *three) for name, three in given.items()}, given)
    for name, ((xi_hat, chi_hat, basis, F), moved, dual, back) in found.items():
        xi, _, mu = given[name]
        one, half = np.eye(len(xi_hat)), 0.5 * xi_hat
        close(F, np.linalg.solve(one - half, one + half), 10)
        half = -half if name == "opposite" else half
        close(np.tensordot(moved, basis, 1), np.linalg.inv(one - half) @ chi_hat @ np.linalg.inv(one + half), 10)
        for e, weight in zip(basis, dual, strict=True):
            image = np.ravel((one - half) @ e @ (one + half))
            parts = np.linalg.lstsq(basis.reshape(len(basis), -1).T, image, rcond=None)[0]
            assert weight == pytest.approx(mu @ parts, abs=1e-12)
        close(back, xi, 10)


@pytest.mark.parametrize("name", ["SL2_dual"])
def test_cayley_of_a_product_by_another_representation_moves_vectors_by_half(name):
    """(F, ½(u + Fu)), whose tangent is that of its derivative, and the dual of its inverse undoes it."""
    tau, group = co.Cayley(), GROUPS[name]
    xi, chi, mu = 0.4 * generator("products", name).normal(size=(3, group.dim))

    def forms(xi, chi, mu):
        F, u = tau.tau(group.group, group.split(xi)[0]), group.split(xi)[1]
        there = F, 0.5 * (u + group.representation.act(group.group, F, u))
        moved, found = tau.dtau(group, xi, chi), tau.tau(group, xi)
        closed = moved, found, tau.inverse(group, found), tau.dtau_inverse_dual(group, xi, mu) @ moved
        return closed, (DifferenceMap._dtau(tau, group, xi, chi), there, xi, mu @ chi)

    close(*evaluate(forms, xi, chi, mu))


@pytest.mark.cases(16)
def test_tangent_at_zero_is_the_identity(pair):
    tau, group, _, chi, _ = pair
    close(evaluate(lambda chi: tau.dtau(group, jnp.zeros(group.dim), chi), chi), chi)


@pytest.mark.cases(13)
def test_tangent_is_right_trivialised(pair):
    """Dτ(ξ)·χ = (dτ_ξ χ) τ(ξ) (P32)."""
    tau, group, xi, chi, _ = pair

    def both(xi, chi):
        value, velocity = jax.jvp(lambda x: group.matrix(tau.tau(group, x)), (xi,), (chi,))
        return group.hat(tau.dtau(group, xi, chi)) @ value, velocity

    close(*evaluate(both, xi, chi), size=10)


@pytest.mark.cases(8)
def test_inverse_tangent_inverts_the_tangent(pair):
    """dτ⁻¹_ξ dτ_ξ χ = χ (P34)."""
    tau, group, xi, chi, _ = pair
    close(evaluate(lambda xi, chi: tau.dtau_inverse(group, xi, tau.dtau(group, xi, chi)), xi, chi), chi, 30)


@pytest.mark.cases(11)
def test_tangent_intertwines(pair):
    """dτ_ξ = Ad_{τ(ξ)} dτ_{−ξ} (P33)."""
    tau, group, xi, chi, _ = pair

    def both(xi, chi):
        return tau.dtau(group, xi, chi), group.Ad(tau.tau(group, xi), tau.dtau(group, -xi, chi))

    close(*evaluate(both, xi, chi), size=10)


@pytest.mark.cases(3)
def test_inverse_tangent_intertwines(pair):
    """dτ⁻¹_ξ = dτ⁻¹_{−ξ} Ad_{τ(−ξ)} (P35); dual: (dτ⁻¹_{−ξ})* = Ad*_{τ(ξ)} (dτ⁻¹_ξ)*, what makes momentum exact."""
    tau, group, xi, chi, mu = pair

    def both(xi, chi, mu):
        carried = group.Ad(tau.tau(group, -xi), chi)
        dual = group.Ad_dual(tau.tau(group, xi), tau.dtau_inverse_dual(group, xi, mu))
        return (
            (tau.dtau_inverse(group, xi, chi), tau.dtau_inverse(group, -xi, carried)),
            (tau.dtau_inverse_dual(group, -xi, mu), dual),
        )

    for found, expected in evaluate(both, xi, chi, mu):
        close(found, expected, 30)


@pytest.mark.cases(7)
def test_duals_pair(pair):
    """⟨(dτ⁻¹_ξ)* μ, χ⟩ = ⟨μ, dτ⁻¹_ξ χ⟩."""
    tau, group, xi, chi, mu = pair

    def both(xi, chi, mu):
        return tau.dtau_inverse_dual(group, xi, mu) @ chi, mu @ tau.dtau_inverse(group, xi, chi)

    close(*evaluate(both, xi, chi, mu), size=10)


@pytest.mark.cases(3)
def test_closed_form_equals_the_derivation_from_the_map_alone(pair):
    """The base class solves with the matrix of dτ_ξ, itself by differentiation of τ."""
    tau, group, xi, _, mu = pair

    def derived(xi, mu):
        tangent = jax.vmap(lambda chi: tau.dtau(group, xi, chi), out_axes=1)(jnp.eye(group.dim))
        return jnp.linalg.solve(tangent.T, mu)

    close(evaluate(lambda xi, mu: tau.dtau_inverse_dual(group, xi, mu), xi, mu), evaluate(derived, xi, mu), 30)


@pytest.mark.cases(6)
def test_every_map_here_fits_every_group_here(pair):
    tau, group, *_ = pair
    tau.require_fit(group)


@pytest.mark.parametrize("pair_of_names", sorted(UNFIT_PAIRS), ids="-".join)
def test_every_other_map_is_refused(pair_of_names):
    group, tau = pair_of_names
    with pytest.raises(GroupError, match="leaves the algebra"):
        ALL_MAPS[tau].require_fit(GROUPS[group])


def test_pade_is_refused_where_the_representation_has_another():
    """ρ(τ(ξ)) of SL(2) on its algebra is not the Padé approximant of ad_ξ, so τ(−ξ) is not τ(ξ)⁻¹ on the vectors."""
    group = co.SemidirectProduct(GROUPS["Sp1"], co.spaces.Adjoint())
    with pytest.raises(GroupError, match="is not a group difference map"):
        co.difference_maps.Pade(2).require_fit(group)
    for tau in (co.Cayley(), co.difference_maps.SecondKind(), co.Exponential()):
        tau.require_fit(group)


@pytest.mark.parametrize("name", ["SO3", "SE3", "SL2_dual", "Sp2", "H2"])
def test_first_pade_approximant_is_the_cayley_transform(name):
    group = GROUPS[name]
    xi, mu = generator("pade", name).normal(scale=0.4, size=(2, group.dim))

    def both(xi, mu):
        return [
            (t.tau(group, xi), t.dtau_inverse_dual(group, xi, mu)) for t in (co.difference_maps.Pade(1), co.Cayley())
        ]

    close(*evaluate(both, xi, mu), size=10)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_pade_approximants_are_the_exponential_up_to_their_order(order):
    """|N(−X)⁻¹N(X) − e^X| → |X^{2m+1}| (m!)²/((2m)!(2m+1)!)."""
    xi = generator("order").normal(size=3)
    xi /= np.linalg.norm(xi)

    def error(xi):
        return jnp.max(jnp.abs(co.difference_maps.Pade(order).tau(co.SO3(), xi) - co.SO3().exp(xi)))

    coarse, fine = (float(evaluate(error, scale * xi)) for scale in (0.4, 0.2))
    assert np.log2(coarse / fine) == pytest.approx(2 * order + 1, abs=0.1)


@pytest.mark.parametrize("tau", [co.Cayley(), co.difference_maps.Pade(2), co.difference_maps.SecondKind()], ids=repr)
def test_only_the_exponential_is_its_own_squared_map(tau):
    """τ(ξ/2)² = τ(ξ) for the exponential; the others need Squared where F must be the square of H."""
    xi = np.array([0.7, -0.4, 0.5])

    def gap(t):
        return float(
            evaluate(
                lambda xi: jnp.max(jnp.abs(t.tau(co.SO3(), xi) - co.difference_maps.Squared(t).tau(co.SO3(), xi))), xi
            )
        )

    assert gap(co.Exponential()) < 1e-15
    assert gap(tau) > 1e-5


def test_a_basis_that_is_nilpotent_up_to_round_off_has_polynomials():
    """e³ = κe of S N S⁻¹, N² = 0: κ is round-off, and counts as 0."""
    S, N = np.random.default_rng(3).normal(size=(3, 3)), np.eye(3, k=2)
    bent = co.MatrixGroup([S @ N @ np.linalg.inv(S)])
    (e,) = bent.basis
    assert abs(np.sum((e @ e @ e) * e)) > 0 and _cubic(bent) == (0.0,)
    assert _cubic(co.SO3()) == (-1.0,) * 3


def test_second_kind_goes_forwards_and_backwards():
    xi = np.array([0.7, -0.4, 0.5])
    x, y, z = (co.SO3().exp for _ in range(3))

    def product(xi):
        a, b, c = (turn(0.5 * xi * e) for turn, e in zip((x, y, z), np.eye(3), strict=True))
        return co.difference_maps.SecondKind().tau(co.SO3(), xi), a @ b @ c @ c @ b @ a

    close(*evaluate(product, xi))


def test_closed_forms_of_the_specification_on_rotations():
    xi, mu = generator("rotations").normal(size=(2, 3))
    group, cross = co.SO3(), np.cross
    angle = np.linalg.norm(xi)
    beta = (1 - angle / 2 / np.tan(angle / 2)) / angle**2
    once = mu + 0.5 * cross(xi, mu)
    expected = {
        co.Cayley(): once + 0.25 * xi * (xi @ mu),
        co.Exponential(): once + beta * cross(xi, cross(xi, mu)),
        co.difference_maps.Squared(co.Cayley()): once - (xi @ xi) / 16 * mu + xi * (xi @ mu) / 8,
    }
    for tau, value in expected.items():
        close(evaluate(lambda xi, mu, t=tau: t.dtau_inverse_dual(group, xi, mu), xi, mu), value)


def _by_matrix_exponential(group: LieGroup, xi, mu):
    """(ad/(e^ad − 1))* μ from the corner (e^ad − 1)/ad of exp [[ad, 1], [0, 0]]."""
    n = group.dim
    ad = jax.vmap(lambda eta: group.ad(xi, eta), out_axes=1)(jnp.eye(n))
    block = jnp.zeros((2 * n, 2 * n)).at[:n, :n].set(ad).at[:n, n:].set(jnp.eye(n))
    return jnp.linalg.solve(jax.scipy.linalg.expm(block)[:n, n:].T, mu)


# Both sides of the switch at θ = 2, tiny angles, and angles near the ends, always with a unit translation.
ANGLES = (0.0, 1e-9, 1e-5, 1e-2, 1.0, 2 - 1e-9, 2 + 1e-9, 2.5, 3.1, 5.5)


@pytest.fixture(params=["SO2", "SE2", "SO3", "SE3"])
def moving(request):
    """(group, unit rotation and unit translation directions, a direction to differentiate along)."""
    group = GROUPS[request.param]
    random = generator("angles", request.param)
    turning = group.dim - {"SE2": 2, "SE3": 3}.get(request.param, 0)
    turn, shift = random.normal(size=turning), random.normal(size=group.dim - turning)
    turn, shift = turn / np.linalg.norm(turn), shift / max(np.linalg.norm(shift), 1e-300)
    return group, turn, shift, random.normal(size=group.dim)


def _with_two_derivatives(function, x, v):
    """f(x + εv) and its first two derivatives in ε at 0."""

    def line(e):
        return function(x + e * v)

    def slope(e):
        return jax.jvp(line, (e,), (1.0,))[1]

    return line(0.0), slope(0.0), jax.jvp(slope, (0.0,), (1.0,))[1]


@pytest.mark.cases(1)
@pytest.mark.parametrize("angle", ANGLES)
def test_exponential_and_two_derivatives_on_both_sides_of_every_switch(moving, angle):
    group, turn, shift, along = moving
    xi = np.concatenate([angle * turn, shift])

    def both(xi, along):
        one = _with_two_derivatives(lambda x: group.matrix(group.exp(x)), xi, along)
        return one, _with_two_derivatives(lambda x: jax.scipy.linalg.expm(group.hat(x)), xi, along)

    close(*evaluate(both, xi, along), size=10)


@pytest.mark.cases(2)
@pytest.mark.parametrize("angle", ANGLES)
def test_inverse_tangent_and_two_derivatives_on_both_sides_of_every_switch(moving, angle):
    """Against ad/(e^ad − 1) by the matrix exponential; its solve loses 1/(2π − θ)³ in the second derivative."""
    group, turn, shift, along = moving
    xi = np.concatenate([angle * turn, shift])
    mu = generator("mu").normal(size=group.dim)

    def both(xi, along):
        one = _with_two_derivatives(lambda x: co.Exponential().dtau_inverse_dual(group, x, mu), xi, along)
        return one, _with_two_derivatives(lambda x: _by_matrix_exponential(group, x, mu), xi, along)

    close(*evaluate(both, xi, along), size=10 / min(1.0, 2 * np.pi - angle) ** 3)


def _special_linear(size: int) -> list[np.ndarray]:
    basis = []
    for i in range(size):
        for j in range(size):
            e = np.zeros((size, size))
            e[i, j] = 1.0
            if i == j:
                e[-1, -1] -= 1.0
            if (i, j) != (size - 1, size - 1):
                basis.append(e)
    return basis


def _special_unitary(size: int) -> list[np.ndarray]:
    """su(n) as real matrices: A + iB ↦ [[A, −B], [B, A]]."""
    basis = []
    for i in range(size):
        for j in range(i):
            real, imaginary = np.zeros((2, size, size))
            real[i, j], real[j, i] = 1, -1
            imaginary[i, j] = imaginary[j, i] = 1
            basis += [real + 0j, 1j * imaginary]
        if i:
            diagonal = np.zeros(size)
            diagonal[0], diagonal[i] = 1, -1
            basis.append(1j * np.diag(diagonal))
    return [np.block([[m.real, -m.imag], [m.imag, m.real]]) for m in basis]


FITTING = {
    "SL(2)": _special_linear(2),
    "SU(2)": _special_unitary(2),
    "GL(2)": [*_special_linear(2), np.eye(2)],
    "SO(2,1)": [
        [[0, 1, 0], [-1, 0, 0], [0, 0, 0]],
        [[0, 0, 1], [0, 0, 0], [1, 0, 0]],
        [[0, 0, 0], [0, 0, 1], [0, 1, 0]],
    ],
}
UNFIT = {"SL(3)": _special_linear(3), "SU(3)": _special_unitary(3)}


@pytest.mark.parametrize("name", FITTING)
def test_cayley_fits(name):
    co.Cayley().require_fit(co.MatrixGroup(FITTING[name], name=name))


@pytest.mark.parametrize("name", UNFIT)
@pytest.mark.parametrize("tau", [co.Cayley(), co.difference_maps.Squared(co.Cayley())], ids=repr)
def test_cayley_is_refused_where_it_leaves_the_group(name, tau):
    group = co.MatrixGroup(UNFIT[name], name=name)
    with pytest.raises(GroupError, match=r"leaves the algebra .* use Exponential\(\), which fits every group\.$"):
        tau.require_fit(group)
    with pytest.raises(GroupError, match="leaves the algebra"):
        tau.require_fit(co.DirectProduct(co.SO3(), group))
    co.Exponential().require_fit(group)


def test_a_method_refuses_a_map_that_does_not_fit():
    group = co.MatrixGroup(UNFIT["SL(3)"], name="SL(3)")
    system = co.System(group, lambda xi: 0.5 * xi @ xi)
    with pytest.raises(GroupError, match="leaves the algebra"):
        co.Midpoint(co.Cayley()).begin(system, system.state(xi=np.ones(8)), 0.1)


def test_a_map_that_is_not_inverted_by_its_argument_is_refused():
    class Lopsided(DifferenceMap):
        def _tau(self, group: LieGroup, xi):
            return group.exp((1 + 0.3 * jnp.sum(xi)) * xi)

    with pytest.raises(GroupError, match="is not a group difference map"):
        Lopsided().require_fit(co.SO3())


def test_squared_cayley_reaches_half_a_turn_and_cayley_does_not():
    def tau(difference_map, xi):
        return evaluate(lambda xi: difference_map.tau(co.SO3(), xi), np.array(xi))

    close(tau(co.difference_maps.Squared(co.Cayley()), [4.0, 0.0, 0.0]), np.diag([1.0, -1.0, -1.0]))
    angles = [np.arccos(np.clip((np.trace(tau(co.Cayley(), [x, 0.0, 0.0])) - 1) / 2, -1, 1)) for x in (4.0, 40.0)]
    assert max(angles) < np.pi - 0.09


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    "method",
    [co.LeftRectangle(co.difference_maps.Squared(co.Cayley()), start="velocity"), co.Midpoint(start="velocity")],
    ids=repr,
)
def test_a_step_may_turn_by_half_a_turn(method):
    body = co.System(co.SO3(), lambda xi: 0.5 * (3 * xi[0] ** 2 + 2 * xi[1] ** 2 + xi[2] ** 2))
    start = body.state(xi=[0, 0, 4.0])
    final = Stepper(body, method).final(start, 1.0, 1)
    close(final.g, np.diag([-1.0, -1.0, 1.0]))


def test_a_map_without_values_is_refused():
    class NotANumber(DifferenceMap):
        def _tau(self, group: LieGroup, xi):
            return jnp.sqrt(-(xi @ xi)) * group.exp(xi)

    with pytest.raises(GroupError):
        NotANumber().require_fit(co.SO3())


def test_a_map_does_not_fit_a_group_better_in_another_unit():
    small = co.MatrixGroup(1e-9 * np.array(UNFIT["SL(3)"]), name="SL(3)")
    with pytest.raises(GroupError, match="leaves the algebra"):
        co.Cayley().require_fit(small)
