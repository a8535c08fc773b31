"""Groups of matrices without a basis: their closed forms are those of the basis, and no array has dim · N² numbers."""

from __future__ import annotations

import jax
import numpy as np
import pytest
from jax.extend.core import jaxprs_in_params

import coadjoint as co
from coadjoint.errors import GroupError
from coadjoint.groups import matrix_elements
from coadjoint.groups.axioms import require_group
from coadjoint.groups.unitary import product, sum_of_parts
from coadjoint.kernels.trace.evaluate import evaluate
from systems import element, generator

KINDS = [co.SOn(4), co.groups.SLn(3), co.groups.GLn(3), co.Un(3), co.SUn(3)]
LARGE = [co.SOn(20), co.groups.SLn(12), co.groups.GLn(12), co.Un(10), co.SUn(10)]
FORMS = ("hat", "vee", "Ad", "Ad_dual", "ad", "ad_dual")


def _arguments(group, form, random):
    """Arguments of a member, random."""
    xi, eta = random.normal(size=(2, group.dim))
    if form == "hat":
        return (xi,)
    if form == "vee":
        return (random.normal(size=(group.matrix_size,) * 2),)
    return (element(group, random, 0.1), eta) if form.startswith("Ad") else (xi, eta)


@pytest.mark.cases(1)
@pytest.mark.parametrize("group", KINDS, ids=repr)
def test_without_a_basis_the_axioms_hold(group, monkeypatch):
    """Each closed form is the one that follows from the basis, also of a matrix outside the algebra."""
    monkeypatch.setattr(matrix_elements, "DENSE", 0)
    require_group.__wrapped__(group)
    outside = generator("outside").normal(size=(group.matrix_size,) * 2)
    expected = np.linalg.lstsq(group.basis.reshape(group.dim, -1).T, outside.ravel(), rcond=None)[0]
    np.testing.assert_allclose(evaluate(group.vee, outside), expected, atol=1e-13)
    np.testing.assert_allclose(group.basis_sizes(), np.max(np.abs(group.basis), axis=(1, 2)))


@pytest.mark.parametrize("group", KINDS, ids=repr)
def test_closed_forms_are_products_of_matrices(group, monkeypatch):
    """Ad_g ξ = g ξ̂ g⁻¹, ⟨Ad*_g μ, ξ⟩ = ⟨μ, Ad_g ξ⟩, ad_ξ η = ξ̂η̂ − η̂ξ̂, ⟨ad*_ξ μ, η⟩ = ⟨μ, ad_ξ η⟩."""
    monkeypatch.setattr(matrix_elements, "DENSE", 0)
    random, names = generator("closed"), FORMS[2:]
    g, (xi, eta, mu) = element(group, random, 0.4), random.normal(size=(3, group.dim))
    found = evaluate(
        lambda g: [
            getattr(group, name)(*pair)
            for name, pair in zip(names, [(g, xi), (g, mu), (xi, eta), (xi, mu)], strict=True)
        ],
        g,
    )
    G = evaluate(group.matrix, g)
    X, Y = (np.tensordot(v, group.basis, 1) for v in (xi, eta))
    flat = group.basis.reshape(group.dim, -1)

    def coordinates(matrix):
        return np.linalg.lstsq(flat.T, matrix.ravel(), rcond=None)[0]

    turn = np.stack([coordinates(G @ e @ np.linalg.inv(G)) for e in group.basis], axis=1)
    bracket = np.stack([coordinates(X @ e - e @ X) for e in group.basis], axis=1)
    for one, expected in zip(found, (turn @ xi, turn.T @ mu, coordinates(X @ Y - Y @ X), bracket.T @ mu), strict=True):
        np.testing.assert_allclose(one, expected, atol=1e-12)


def _sizes(jaxpr):
    """The sizes of all arrays in a program."""
    for equation in jaxpr.eqns:
        for inner in jaxprs_in_params(equation.params):
            yield from _sizes(inner)
        yield from (np.prod(out.aval.shape, dtype=int) for out in equation.outvars)
    yield from (np.size(constant) for constant in getattr(jaxpr, "consts", ()))


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("group", LARGE, ids=repr)
def test_no_array_is_larger_than_some_matrices(group, form):
    """Values and derivatives of all members: at most 8 N² numbers in an array, where a basis has dim · N²."""
    arguments = _arguments(group, form, generator(form))

    def member(*arguments):
        return getattr(group, form)(*arguments)

    def weighted(*arguments):
        return jax.numpy.sum(member(*arguments) ** 2)

    with jax.enable_x64(True):
        for function in (member, jax.grad(weighted, argnums=len(arguments) - 1)):
            closed = jax.make_jaxpr(function)(*arguments)
            sizes = [*_sizes(closed.jaxpr), *(np.size(constant) for constant in closed.consts)]
            assert max(sizes) <= 8 * group.matrix_size**2


@pytest.mark.long
def test_elements_of_unitary_groups_are_unitary():
    """(A, B) with A + iB unitary, and of determinant 1 in SU(n), after the exponential and a projection."""
    for group in (co.Un(3), co.SUn(3), co.SUn(8)):
        g = element(group, generator("unitary"))
        moved = [part + 1e-5 * generator("moved").normal(size=part.shape) for part in g]
        for A, B in (g, evaluate(lambda g, group=group: group.project(group.project(g)), moved)):
            U = A + 1j * B
            np.testing.assert_allclose(U.conj().T @ U, np.eye(group.size), atol=1e-13)
            if isinstance(group, co.SUn):
                np.testing.assert_allclose(np.linalg.det(U), 1, atol=1e-13)
                assert evaluate(group.defect, (A, B)) < 1e-13
                turned = U * np.exp(0.01j)
                assert evaluate(group.defect, (turned.real, turned.imag)) > 1e-3


def test_a_basis_that_does_not_fit_is_told():
    for group, size in ((co.Un(128), "8.59"), (co.SOn(300), "32.3"), (co.groups.GLn(200), "12.8")):
        with pytest.raises(GroupError, match=rf"would take {size} GB of memory: use `hat` and `vee`"):
            group.basis  # noqa: B018
    with pytest.raises(GroupError, match="`size` of SUn must be a whole number from 2, but is 1"):
        co.SUn(1)


def test_cayley_is_refused_on_special_unitary_groups():
    for group in (co.SUn(3), co.SUn(9)):
        with pytest.raises(GroupError, match="does not map the algebra"):
            co.Cayley().require_fit(group)
    for group in (co.SUn(2), co.Un(9), co.groups.GLn(9), co.SOn(12)):
        co.Cayley().require_fit(group)


def test_what_has_an_inverse_is_told_by_singular_values():
    """The determinant of a small matrix is 0 in float64, that of a singular one with round-off is not."""
    turned = np.linalg.qr(generator("singular").normal(size=(200, 200)))[0]
    nearly = turned[:5, :5] * np.array([1, 1, 1, 1, 0.0]) @ turned[:5, 5:10]
    assert np.linalg.det(0.01 * turned) == 0 != np.linalg.det(nearly)
    assert (
        evaluate(co.groups.GLn(200).outside, 0.01 * turned) == 0
        and evaluate(co.groups.GLn(5).outside, nearly) == np.inf
    )
    assert evaluate(co.groups.GLn(3).outside, np.zeros((3, 3))) == np.inf


def test_sizes_of_numpy_are_sizes():
    four, three = np.array([4, 3])
    assert co.SOn(four) == co.SOn(4) and co.Un(three).dim == 9


def test_two_real_products_give_what_an_anti_hermitian_product_is():
    """PWP by A + B alone, with P and W anti-Hermitian, beside NumPy's complex product."""
    group = co.Un(5)
    random = generator("sum of parts")
    P, W = (evaluate(group.parts, x) for x in random.normal(size=(2, group.dim)))
    X = evaluate(lambda P, W: sum_of_parts(product(P, W), P), P, W)
    found = 0.5 * (X - X.T) + 0.5j * (X + X.T)
    P, W = (matrix.real + 1j * matrix.imaginary for matrix in (P, W))
    np.testing.assert_allclose(found, P @ W @ P, rtol=0, atol=1e-13)


@pytest.mark.parametrize("group", [co.Un(3), co.SUn(3)], ids=str)
def test_matrices_and_coordinates_of_single_precision_are_of_single_precision(group):
    """Isospectral steps correct large momenta in single precision."""
    with jax.enable_x64(True):
        matrix = jax.eval_shape(group.parts, np.zeros(group.dim, np.float32))
        assert {part.dtype for part in (*matrix, jax.eval_shape(group.coordinates, matrix))} == {np.dtype("float32")}
