"""The secant of an action by its definition: H·v − H⁻¹·v = hξ·(A v) with H = τ(hξ/2)."""

from __future__ import annotations

import numpy as np
import pytest

import coadjoint as co
from coadjoint.difference_maps.secant import secant
from coadjoint.kernels.trace.evaluate import evaluate
from systems import GROUPS, generator

CASES = [
    (co.Cayley(), "SO3", co.Defining()),
    (co.Exponential(), "SO3", co.Defining()),
    (co.Exponential(), "SE3", co.Coadjoint()),
    (co.Exponential(), "SLn3", co.spaces.Adjoint()),
]


@pytest.mark.parametrize(("tau", "name", "space"), CASES)
def test_a_secant_is_what_leads_from_one_end_of_a_chord_to_the_other(tau, name, space):
    group = GROUPS[name]
    random = generator("secant", name)
    hxi = random.normal(size=group.dim)
    x, v = random.normal(size=(2, space.ambient(group)))

    def both(hxi, x, v):
        half = tau.tau(group, 0.5 * hxi)
        chord = space.push(group, half, x, v) - space.push(group, group.inverse(half), x, v)
        return chord, space.lifted(group, hxi, x, secant(tau, group, space, hxi, x, v))

    chord, found = evaluate(both, hxi, x, v)
    np.testing.assert_allclose(found, chord, rtol=0, atol=1e-13 * max(1.0, np.max(np.abs(chord))))
    assert np.max(np.abs(chord)) > 0.1
