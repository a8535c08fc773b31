"""The functions of which strains are made, against their integrals."""

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.groups import attitude
from coadjoint.groups.small_angle import arctangent_ratio
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.models import rods
from coadjoint.models.rods.cosserat import RodLayout, strains
from coadjoint.models.rods.strains import logarithm, rotation_vector

NODES, WEIGHTS = np.polynomial.legendre.leggauss(60)
U = 0.5 * (NODES + 1)


def integral(k: int, n: int, t: float) -> float:
    """dⁿ/dtⁿ ∫₀¹ u²ᵏ/(1 + tu²) du by Gauss's rule."""
    factor = np.prod([-float(i) for i in range(1, n + 1)])
    return float(0.5 * WEIGHTS @ (factor * U ** (2 * k + 2 * n) / (1 + t * U**2) ** (n + 1)))


@pytest.mark.cases(10)
@pytest.mark.parametrize("t", [0.0, 1e-9, 0.03, 0.249, 0.251, 1.0, 4.0])
@pytest.mark.parametrize("k", [0, 1])
def test_ratios_of_the_arctangent_and_two_derivatives_are_their_integrals(k: int, t: float):
    def ratio(t):
        return arctangent_ratio(k, t)

    for n, function in enumerate([ratio, jax.grad(ratio), jax.grad(jax.grad(ratio))]):
        found = float(evaluate(function, np.float64(t)))
        bound = 1e-15 * 4 ** (n + k)  # each further ratio loses as much where it leaves its series
        assert abs(found - integral(k, n, t)) < bound


@pytest.mark.cases(3)
@pytest.mark.parametrize("angle", [0.3, 1.5])
@pytest.mark.parametrize("group", [co.SE3(), co.SE2(), co.SO3()], ids=repr)
def test_the_logarithm_is_the_inverse_of_the_exponential_in_two_derivatives(group: co.groups.LieGroup, angle: float):
    """log exp(ξ + tη) is ξ + tη: η is its first derivative by t at 0, and its second one is 0."""
    log, turning = (rotation_vector, 3) if isinstance(group, co.SO3) else (logarithm, group.dim // 2)
    xi, eta = np.cos(np.arange(float(group.dim))), np.sin(1.0 + np.arange(group.dim))
    xi[:turning] *= angle / np.linalg.norm(xi[:turning])

    def slope(t):
        return jax.jvp(lambda t: log(group.exp(xi + t * eta)), (t,), (1.0,))

    (value, first), (_, second) = evaluate(lambda t: jax.jvp(slope, (t,), (1.0,)), np.float64(0.0))
    np.testing.assert_allclose(value, xi, rtol=0, atol=5e-15)
    np.testing.assert_allclose(first, eta, rtol=0, atol=1e-14)
    np.testing.assert_allclose(second, np.zeros(group.dim), rtol=0, atol=1e-13)


def test_a_driven_end_strains_its_element_by_where_it_is_and_how_it_is_turned():
    """An end at (A, y) and a section at the pose A·g: the strain is that of g alone."""
    rod = rods.cosserat(
        elements=2, length=(0.5, 0.7), EI=1.0, GJ=1.0, EA=3.0, GA=2.0, mass=1.0, inertia=(0.02, 0.01, 0.01)
    )
    random, layout = np.random.default_rng(3), RodLayout(2, "clamped")
    A = attitude.from_rotation_vector([0.3, -0.5, 0.4])
    y = np.array([0.1, 0.2, -0.3])
    R = np.stack([attitude.from_rotation_vector(v) for v in 0.4 * random.normal(size=(2, 3))])
    x = np.array([[0.4, 0.1, 0.0], [0.6, -0.1, 0.2]])
    turned = np.stack([A @ R[0], R[1]]), np.stack([A @ x[0] + y, x[1]])
    plain, driven = evaluate(lambda p: (strains(layout, (R, x), p), strains(layout, turned, p, (A, y))), rod.parameters)
    np.testing.assert_allclose(driven, plain, atol=1e-13)
    assert np.max(np.abs(plain[:, 0])) > 0.01
