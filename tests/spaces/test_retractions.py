"""Retractions stay in their space and begin along their tangent; spaces of an opposite group are those of the group."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.spaces import ByInverse, Several, Space, Submanifold

UNIT = np.array([0.48, 0.6, 0.64])
ROUND = Submanifold(lambda x: jnp.stack([x @ x - 1.0]))
CURVED: dict[str, tuple[Space, np.ndarray]] = {
    "sphere": (co.Sphere(), UNIT),
    "sphere by its equation": (ROUND, UNIT),
    "several": (Several({"a": co.Sphere(), "b": co.Defining(), "c": ROUND}), np.concatenate([UNIT, 2 * UNIT, -UNIT])),
}


@pytest.mark.parametrize("name", CURVED)
def test_a_retraction_stays_in_the_space_and_begins_along_its_tangent(name):
    """ρ(x, u) ∈ Q, dρ(x, εu)/dε = u at 0, E_x E_xᵀ u = u, and what the projection leaves is in T*Q."""
    space, x = CURVED[name]
    group, random = co.SO3(), np.random.default_rng(4)
    b = 0.3 * random.normal(size=x.shape)

    def measure(x, b):
        u = space.project(group, x, b)
        end, slope = jax.jvp(lambda u: space.difference(group, x, u), (0 * u,), (u,))
        there = x + space.difference(group, x, u)
        within = space.tangent(group, x, space.coordinates(group, x, u))
        return (
            u,
            slope,
            within,
            space.project(group, x, u),
            space.defect(group, there),
            end,
            space.defect(group, 1.1 * x),
        )

    u, slope, within, again, defect, end, off = evaluate(measure, x, b)
    for found in (slope, within, again):
        np.testing.assert_allclose(found, u, atol=1e-13)
    assert np.max(np.abs(end)) < 1e-14 and defect < 1e-12 and np.linalg.norm(u) > 0.1 and off > 0.05
    assert evaluate(lambda x: space.coordinates(group, x, x), x).shape == (space.dim(group),)


def test_members_of_a_space_by_inverses_are_those_of_the_space():
    """On Gᵒᵖ g acts as g⁻¹; tangents, frames and retractions are of the space alone."""
    group = co.groups.Opposite(co.SO3())
    one, plain, within = ByInverse(co.Sphere()), co.Sphere(), co.SO3()
    random = np.random.default_rng(5)
    u, b = (v - UNIT * (UNIT @ v) for v in 0.2 * random.normal(size=(2, 3)))
    y, xi = 0.1 * random.normal(size=2), random.normal(size=3)
    g = evaluate(within.exp, xi)

    def both(g, x, u, b, y):
        back = within.inverse(g)
        return [
            (one.act(group, g, x), plain.act(within, back, x)),
            (one.push(group, g, x, u), plain.push(within, back, x, u)),
            (one.pull(group, g, x, b), plain.pull(within, back, x, b)),
            (one.tangent(group, x, y), plain.tangent(within, x, y)),
            (one.coordinates(group, x, b), plain.coordinates(within, x, b)),
            (one.difference(group, x, u), plain.difference(within, x, u)),
            (one.project(group, x, b + x), plain.project(within, x, b + x)),
            (one.momentum(group, x, b, u), plain.momentum(within, x, b, u)),
            (one.defect(group, 2 * x), plain.defect(within, 2 * x)),
        ]

    for found, expected in evaluate(both, g, UNIT, u, b, y):
        np.testing.assert_allclose(found, expected, rtol=1e-14, atol=1e-15)
    assert one.dim(group) == plain.dim(within) == 2
    one.require_fit(group)
    for wrong, says in ((within, "is a space of the opposite of a group"), (co.SE2(), "opposite of a group")):
        with pytest.raises(co.errors.GroupError, match=says):
            one.dim(wrong)
    with pytest.raises(co.errors.GroupError, match=r"ByInverse must be a space such as co.Defining\(\), but is 3"):
        ByInverse(3)  # type: ignore[arg-type]
