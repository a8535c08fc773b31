"""Discrete connections of flat and of bent connections, and the discrete mechanical one of a body with a rotor."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.models import beanie

SO2 = co.SO2()


class Bent:
    """g⁻¹ġ = −x² ẋ on SO(2) with one shape."""

    group, size, shapes = SO2, 1, None

    def velocity(self, x: Any, v: Any) -> Any:
        return jnp.stack([-(x[0] ** 2) * v[0]])


def angle(R: Any) -> float:
    return float(np.arctan2(R[1, 0], R[0, 0]))


@pytest.mark.parametrize(("at", "place"), [("middle", 0.4), ("start", 0.3)])
def test_an_increment_is_that_of_the_connection_in_the_middle_or_at_the_start(at, place):
    found: Any = co.mechanics.DiscreteConnection.from_connection(Bent(), at=at)  # pyright: ignore[reportArgumentType]
    step = evaluate(found.increment, np.array([0.3]), np.array([0.5]))
    assert angle(step) == pytest.approx(-(place**2) * 0.2, rel=1e-13)
    with pytest.raises(ArgumentError, match='must be "middle" or "start", but is \'end\''):
        co.mechanics.DiscreteConnection.from_connection(Bent(), at="end")  # pyright: ignore[reportArgumentType]


def test_the_discrete_mechanical_connection_of_a_rotor_turns_the_body_by_its_share_of_the_inertia():
    """Ω = τ(hξ/2)² with hξ = −I₂(x⁺ − x)/(I₁ + I₂), of which Cayley's map turns by 2 arctan(hξ/4) twice."""
    found = co.theory.discrete_mechanical_connection(beanie.make(body=3.0, cap=1.0, stiffness=2.0), co.Midpoint(), 0.1)
    step = evaluate(found.increment, np.array([0.3]), np.array([0.7]))
    assert 4 * np.tan(angle(step) / 4) == pytest.approx(-0.25 * 0.4, rel=1e-12)
