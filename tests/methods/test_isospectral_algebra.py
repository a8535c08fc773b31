"""Brackets and products by which isospectral steps move their unknowns, beside those of NumPy's complex matrices."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import coadjoint as co
from coadjoint.groups.unitary import ComplexMatrix
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.methods.isospectral_algebra import algebra_of
from systems import generator

TWICE = co.DirectProduct(co.SO3(), co.SO3())
GROUPS = [co.SOn(4), co.Un(3), co.SUn(3), co.Power(co.SUn(2), 3), TWICE, co.groups.Opposite(co.SO3())]


def numbers(X: Any) -> np.ndarray:
    return X.real + 1j * X.imaginary if isinstance(X, ComplexMatrix) else X


@pytest.mark.parametrize("group", GROUPS, ids=repr)
def test_brackets_and_products_are_those_of_matrices(group):
    """[P, W], PWP, [B, Θ] and BΘP + PΘB, of copies of a group of each."""
    algebra, random = algebra_of(group), generator("products", repr(group))

    def products(x, y, z, t):
        P, B, W, Theta = algebra.matrix(x), algebra.matrix(y), algebra.unknown(z), algebra.unknown(t)
        found = *algebra.products(P, W), *algebra.products_of_force(B, Theta, P)
        return (P, B, W, Theta), tuple(map(algebra.unknown, found))

    given = *random.normal(size=(2, group.dim)), *random.normal(size=(2, algebra.unknowns))
    matrices, found = evaluate(products, *given)
    P, B, W, Theta = map(numbers, matrices)
    expected = P @ W - W @ P, P @ W @ P, B @ Theta - Theta @ B, B @ Theta @ P + P @ Theta @ B
    for ours, theirs in zip(map(numbers, found), expected, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-13)


def single(group, parts):
    """The matrices of all copies, one after the other, as complex ones."""
    if isinstance(group, co.groups.Opposite):
        return single(group.group, parts)
    if isinstance(group, co.DirectProduct):
        return [numbers(part) for part in parts]
    return list(numbers(parts)) if isinstance(group, co.Power) else [numbers(parts)]


@pytest.mark.parametrize("group", [group for group in GROUPS if group not in (co.Un(3), co.SUn(3))], ids=repr)
def test_a_step_turns_by_cayleys_transform_of_each_copy(group):
    """D = C − 1 of C = (1 − εP)⁻¹(1 + εP), whose element is C⁻¹, and C of Gᵒᵖ, where P is that of −ξ."""
    algebra, random, epsilon = algebra_of(group), generator("turns", repr(group)), 0.3
    xi, mu, z = random.normal(size=group.dim), random.normal(size=group.dim), random.normal(size=algebra.unknowns)

    def turned(xi, mu, z):
        D = algebra.turn(xi, epsilon)
        same = algebra.momentum(algebra.lifted(mu)), algebra.products_of(xi, z)
        return (algebra.matrix(xi), algebra.element(D)), same, algebra.products(algebra.matrix(xi), algebra.unknown(z))

    (P, element), (back, found), expected = evaluate(turned, xi, mu, z)
    np.testing.assert_allclose(back, mu, rtol=0, atol=1e-14)
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-13)
    kept = group.group if isinstance(group, co.groups.Opposite) else group
    matrices = numbers(P) if algebra.copies > 1 else numbers(P)[None]
    for X, g in zip(matrices, single(kept, element), strict=True):
        one = np.eye(len(X))
        C = np.linalg.solve(one - epsilon * X, one + epsilon * X)
        np.testing.assert_allclose(g, C if kept is not group else np.linalg.inv(C), rtol=0, atol=1e-13)
