"""Which momenta are conserved, and which 𝒦 are equivariant (P25)."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.noether import isotropy_algebra
from systems import WORLDS, random_system


@pytest.mark.cases(6)
@pytest.mark.parametrize("world", WORLDS)
def test_isotropy_algebra_is_what_leaves_the_advected_parameters_alone(world):
    """c₀·a₀ = 0 for its rows, orthonormal, as many as dim 𝔤 minus the rank of the action at a₀."""
    system, start = random_system(world)
    group, V = system.group, system.advected
    rows = isotropy_algebra(system, start)
    a0 = evaluate(lambda s: V.act(group, s.g, s.a), start)
    moved = [evaluate(lambda c: V.infinitesimal(group, c, a0), row) for row in rows]
    assert np.max(np.abs(moved), initial=0.0) <= 1e-13 * max(1.0, np.max(np.abs(a0), initial=0.0))
    action = np.array([evaluate(lambda c: V.infinitesimal(group, c, a0), e) for e in np.eye(group.dim)])
    rank = np.linalg.matrix_rank(action) if a0.size else 0
    assert rows.shape == (group.dim - rank, group.dim)
    np.testing.assert_allclose(np.linalg.norm(rows, axis=1), 1.0, atol=1e-14)
    assert np.linalg.matrix_rank(rows) == len(rows) if len(rows) else True


def test_gravity_leaves_the_vertical_and_horizontal_momentum():
    """Under SO(3), a₀ = e_z: rotation about e_z; under SE(3), a₀ = (e_z, 0): also both horizontal translations."""
    turning = co.System(co.SO3(), lambda xi, a: xi @ xi + a @ a, advected=co.Defining())
    np.testing.assert_allclose(isotropy_algebra(turning, turning.state(a0=[0, 0, 1])), [[0, 0, 1]], atol=1e-15)
    moving = co.System(co.SE3(), lambda xi, a: xi @ xi + a @ a, advected=co.spaces.Dual())
    rows = isotropy_algebra(moving, moving.state(a0=[0, 0, 1, 0]))
    np.testing.assert_allclose(rows, np.eye(6)[[2, 3, 4]], atol=1e-15)


def test_a_map_that_is_not_equivariant_is_refused():
    system, start = random_system("SO3")
    for K in (lambda c, a: c * c, lambda c, a: c + jnp.array([0.0, 0.0, 1.0]), lambda c, a: a.down[::-1]):
        with pytest.raises(ArgumentError, match="must satisfy"):
            co.mechanics.KelvinNoether([0.1, 0.2, 0.3], K).require_equivariant(system, start)
    with pytest.raises(ArgumentError, match=r"`c0` must have shape \(3,\)"):
        co.mechanics.KelvinNoether([1.0, 0.0]).require_equivariant(system, start)
    for c0 in ([0.1, 0.2, 0.3], [1e9, 0, 0]):  # round-off grows with c₀
        quantity = co.mechanics.KelvinNoether(c0, lambda c, a: jnp.cross(c, a.down) + a.spin)
        quantity.require_equivariant(system, start)


@pytest.mark.parametrize("size", [1e-11, 1.0, 1e11])
def test_directions_of_conserved_momenta_do_not_depend_on_the_size_of_the_advected_parameters(size):
    body = co.System(co.SO3(), lambda xi, a: 0.5 * xi @ xi, advected={"weak": co.Defining(), "strong": co.Defining()})
    along = body.state(a0={"weak": [0, 0, size], "strong": [0, 0, 1]})
    across = body.state(a0={"weak": [0, size, 0], "strong": [0, 0, 1]})
    np.testing.assert_allclose(np.abs(isotropy_algebra(body, along)), [[0, 0, 1]], atol=1e-12)
    assert len(isotropy_algebra(body, across)) == 0
