"""The trap: one multiplier at the midpoint, with the constraint there, blows up on Suslov's body."""

from __future__ import annotations

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np

import coadjoint as co

AXIS = np.array([0.0, 0.0, 1.0])
INERTIA = np.array([[2.0, 0.3, 0.6], [0.3, 1.2, 0.4], [0.6, 0.4, 1.0]])


def kinetic(xi, p):
    return 0.5 * xi @ p.inertia @ xi


@dataclass(frozen=True)
class OneMultiplier(co.Midpoint):
    """`Midpoint` with the torque λ·AXIS at its node, where ξ·AXIS = 0."""

    def blocks(self, system):
        return (3, 0, 1)

    def remember(self, system, state):
        return state.replace(memory=np.zeros(1))

    def guess(self, system, state, h):
        return jnp.concatenate([state.xi, state.memory])

    def record(self, system, state, h, z):
        return state.replace(xi=z[:3], memory=z[3:])

    def equations(self, system, record, h):
        rows = super().equations(system, record, h) - h * record.memory[0] * AXIS
        return jnp.concatenate([rows, (AXIS @ record.xi)[None]])

    def advance(self, system, record, h):
        half = self.turn(system, h, record.xi)
        after = super().advance(system, record, h)
        return after.replace(mu=after.mu + system.group.Ad_dual(half, h * record.memory[0] * AXIS))


def energies(method, **constraints):
    system = co.System(co.SO3(), kinetic, parameters={"inertia": INERTIA}, **constraints)
    start = system.state(xi=[1.0, 0.5, 0])
    run = co.simulate(system, start, dt=0.1, steps=450, method=method, accuracy=False, monitors=False)
    return 0.5 * np.sum(run.records.mu * np.linalg.solve(INERTIA, run.records.mu.T).T, axis=1)


def test_one_multiplier_at_the_midpoint_blows_up_where_rattle_stays_in_a_band():
    trap = energies(OneMultiplier())
    assert np.abs(trap[:150] / trap[0] - 1).max() < 1e-2
    assert trap.max() > 1e3 * trap[0]
    held = energies(co.Midpoint(), constraints={"axis": co.Nonholonomic(lambda p: [AXIS])})
    assert np.abs(held / held[0] - 1).max() < 2e-2
