"""Chains of rods on ball joints in maximal coordinates: multipliers of joints are unknowns of links."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.newton.coupled import Coupled
from coadjoint.kernels.newton.solver import Dense
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics import reactions
from coadjoint.methods.rattle import Rattle

END = np.array([0, 0, 0.5])
INERTIA = np.diag([1.0, 1.0, 0.1]) / 12


def chain(count, coupling="chain", **more):
    """Rods of 1 m and 1 kg that hang from the origin, each by its upper end."""

    def lagrangian(xi, n, nu, a):
        return 0.5 * jnp.sum(xi * (xi @ INERTIA)) + 0.5 * jnp.sum(nu * nu) - 9.81 * jnp.sum(n * a.z)

    def joints(n, a):
        g = jnp.stack([a.x, a.y, a.z], axis=1)  # of each link: its axes in space
        upper, lower = jnp.einsum("ikj,ij->ik", g, n + END), jnp.einsum("ikj,ij->ik", g, n - END)
        return jnp.ravel(upper - jnp.concatenate([jnp.zeros((1, 3)), lower[:-1]]))

    axes = {name: co.Defining() for name in "xyz"}
    group = co.Power(co.SO3(), count, coupling=coupling)
    held = {"joints": co.Holonomic(joints), **more}
    return co.System(group, lagrangian, additional=co.Defining(), advected=axes, constraints=held)


def leaning(system):
    """The chain at rest, straight, leaning by 1 rad."""
    count, g = system.group.count, co.attitude.zyx(0, 1.0, 0)
    along = g @ [0, 0, -1]
    axes = {name: np.tile(e, (count, 1)) for name, e in zip("xyz", np.eye(3), strict=True)}
    q = [(i + 0.5) * along for i in range(count)]
    return system.state(g=np.broadcast_to(g, (count, 3, 3)), q=q, a0=axes)


def test_joints_of_a_chain_are_unknowns_of_its_links():
    step = Rattle(co.Midpoint())
    found = step.structure(chain(8))
    assert isinstance(found, Coupled) and found.sizes == (3, 3, 3)
    assert "factors" not in found.words and found.native
    assert not step.structure(chain(13)).native
    more = co.Holonomic(lambda n, a: n[0] @ n[0] - 1.0)
    assert isinstance(step.structure(chain(8, more=more)), Dense)


@pytest.mark.long
@pytest.mark.parametrize("count", [7, 24])
def test_a_chain_by_blocks_moves_as_by_a_dense_matrix_and_stays_together(count):
    runs = []
    for coupling, backend in (("chain", "auto"), ("all", "xla")):
        system = chain(count, coupling)
        quiet = {"monitors": False, "accuracy": False, "backend": backend}
        run = co.simulate(system, leaning(system), dt=0.002, steps=20, save_every=20, **quiet)
        runs.append(run.final)
        gap = evaluate(lambda s, system=system: system.constraints[0].value(system, reactions.site(s)), run.final)
        assert np.abs(gap).max() < 1e-14 * count
        assert run.dataset.reaction_joints.shape == (2, 3 * count)
    assert np.abs(runs[0].mu - runs[1].mu).max() < 1e-11
    assert np.abs(runs[0].g - runs[1].g).max() < 1e-12
