"""Products of momenta on U(n) with passes by machine code, beside those of NumPy's complex matrices."""

from __future__ import annotations

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.groups.unitary import ComplexMatrix
from coadjoint.kernels.run.xla_function import PREFIX, ready
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.methods.isospectral_algebra import algebra_of
from coadjoint.methods.isospectral_products import plain, products
from systems import generator


@pytest.mark.parametrize(("dtype", "near"), [("float64", 1e-14), ("float32", 1e-5)])
@pytest.mark.parametrize("n", [8, 13])
def test_products_by_machine_code_are_those_of_complex_matrices(n, dtype, near):
    """[P, W] and PWP, where the tiles fill the matrix and where the last ones overlap."""
    group = co.Un(n)
    p, w = (generator("passes", n).normal(size=(2, n * n)) / n).astype(dtype)
    assert all(ready(f"{PREFIX}{name}_{dtype}") for name in ("opened", "closed"))
    with jax.enable_x64(True):
        found = [np.asarray(part) for part in jax.jit(products)(p, w)]
    assert all(part.dtype == dtype for part in found)
    P, W, odd, even = (A + 1j * B for A, B in (evaluate(group.parts, x.astype(float)) for x in (p, w, *found)))
    np.testing.assert_allclose(odd, P @ W - W @ P, rtol=0, atol=near)
    np.testing.assert_allclose(even, P @ W @ P, rtol=0, atol=near)
    for ours, by_numbers in zip(found, evaluate(products, p.astype(float), w.astype(float)), strict=True):
        np.testing.assert_allclose(ours, by_numbers, rtol=0, atol=near)


def test_products_by_machine_code_have_the_derivatives_of_plain_ones():
    n = 8
    group, (p, w, dp, dw) = co.Un(n), generator("slopes").normal(size=(4, n * n)) / n

    def in_jax(p, w):
        return plain(ComplexMatrix(*group.parts(p)), ComplexMatrix(*group.parts(w)), group)

    def slopes(function):
        forward = jax.jvp(function, (p, w), (dp, dw))[1]
        return *forward, *jax.vjp(function, p, w)[1]((dp, dw))

    with jax.enable_x64(True):
        found, expected = (jax.jit(lambda f=f: slopes(f))() for f in (products, in_jax))
    for ours, theirs in zip(found, expected, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-14)


def test_large_matrices_are_multiplied_by_machine_code(monkeypatch):
    """Of U(n) alone: the coordinates of SU(n) are others."""
    from coadjoint.methods import isospectral_products

    used = []
    monkeypatch.setattr(isospectral_products, "LEAST", 8)
    monkeypatch.setattr(isospectral_products, "products", lambda *given: used.append(given) or products(*given))
    for group in (co.Un(8), co.SUn(8), co.Un(7)):
        algebra = algebra_of(group)
        eta, z = generator("large", repr(group)).normal(size=group.dim), np.ones(algebra.unknowns)
        found = evaluate(algebra.products_of, eta, z)
        expected = evaluate(lambda eta, z, a=algebra: a.products(a.matrix(eta), a.unknown(z)), eta, z)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13)
    assert len(used) == 1
