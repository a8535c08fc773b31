"""A space of the opposite group: its operations are those of the group at the inverse, and of their derivatives."""

from __future__ import annotations

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.groups import Opposite
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.spaces.by_inverse import ByInverse

GROUP = co.SE3()
OPPOSITE = Opposite(GROUP)
SPACES = [co.Defining(), co.spaces.Adjoint()]
_random = np.random.default_rng(5)
XI = _random.normal(size=6)


@pytest.mark.parametrize("space", SPACES, ids=lambda space: type(space).__name__)
def test_operations_are_those_of_the_derivative_of_the_action(space):
    """ξ·x = d/dt exp(tξ)x, and ⟨b ⋄ x, ξ⟩ = −⟨b, ξ·x⟩, of x and of tangent vectors at x."""
    turned = ByInverse(space)
    size = turned.ambient(OPPOSITE)
    x, v, b = _random.normal(size=(3, size))

    def moved(t):
        g = OPPOSITE.exp(t * XI)
        return turned.act(OPPOSITE, g, x), turned.push(OPPOSITE, g, x, v)

    along, lifted = evaluate(jax.jacfwd(moved), np.array(0.0))
    found = evaluate(lambda x, v: (turned.infinitesimal(OPPOSITE, XI, x), turned.lifted(OPPOSITE, XI, x, v)), x, v)
    assert found[0] == pytest.approx(along, rel=1e-12) and found[1] == pytest.approx(lifted, rel=1e-12)
    diamonds = evaluate(
        lambda b, x, v: (turned.diamond(OPPOSITE, b, x), turned.lifted_diamond(OPPOSITE, b, x, v)), b, x, v
    )
    assert [diamond @ XI for diamond in diamonds] == pytest.approx([-b @ along, -b @ lifted], rel=1e-12)


@pytest.mark.parametrize("space", SPACES, ids=lambda space: type(space).__name__)
def test_an_element_acts_as_its_inverse_under_the_group(space):
    turned = ByInverse(space)
    x, v, b = _random.normal(size=(3, turned.ambient(OPPOSITE)))

    def both(x, v, b):
        g = GROUP.exp(XI)
        back = GROUP.inverse(g)
        here = turned.act(OPPOSITE, g, x), turned.push(OPPOSITE, g, x, v), turned.pull(OPPOSITE, g, x, b)
        return here, (space.act(GROUP, back, x), space.push(GROUP, back, x, v), space.pull(GROUP, back, x, b))

    here, there = evaluate(both, x, v, b)
    for one, other in zip(here, there, strict=True):
        assert one == pytest.approx(other, rel=1e-13)
    assert here[2] @ v == pytest.approx(b @ here[1])
