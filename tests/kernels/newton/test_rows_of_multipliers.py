"""Unknowns that their own equations do not hold, as multipliers of joints: eliminated after what they couple."""

from __future__ import annotations

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from equations import Equations, Still

from coadjoint.kernels.emit import plan as plans
from coadjoint.kernels.newton.solver import Dense
from coadjoint.kernels.program import Code
from coadjoint.kernels.run import native
from coadjoint.kernels.trace.evaluate import evaluate

STRUCTURE = Dense(multipliers=True)


@dataclass(frozen=True)
class Joined(Equations):
    """Bodies v_i in a row and multipliers λ_i between them, listed in any order: M v + Aᵀλ + ε sin v = s, A v = s."""

    structure: Dense = STRUCTURE

    def residual(self, p, s, h, z):
        v, listed = z.reshape(2, -1, 3)
        order = np.argsort(np.sin(5.0 * np.arange(len(v))))
        strength = listed[np.argsort(order)]
        before = jnp.concatenate([jnp.zeros((1, 3)), v[:-1]])
        after = jnp.concatenate([strength[1:], jnp.zeros((1, 3))])
        forces = v @ p[0] + self.curved * jnp.sin(v) + strength @ p[1] - after @ p[2]
        held = v @ p[1].T - before @ p[2].T
        return jnp.concatenate([forces.ravel(), held[order].ravel()]) - s


RANDOM = np.random.default_rng(35)
MATRICES = RANDOM.normal(size=(3, 3, 3)) / 4 + np.eye(3)


def test_their_equations_are_solved():
    right = RANDOM.normal(size=12)
    chunk = native.run(Still((Joined(0.1),)), MATRICES, right, 0.1, 1, 1)
    assert chunk.code is Code.CONVERGED and chunk.iterations < 8
    left = evaluate(lambda z: Joined(0.1).residual(MATRICES, right, 0.1, z), chunk.records[0])
    assert np.abs(left).max() < 1e-13


def operations(links):
    """How many expressions Newton's increment takes."""
    program, right = Still((Joined(0.1),)), np.ones(6 * links)
    planned = plans.plan(program, MATRICES, right, (2,) * 27, False)
    return planned.graph._count


def test_the_elimination_of_a_chain_grows_as_its_length_whatever_the_order_of_its_joints():
    short, middle, long = map(operations, (4, 9, 14))
    assert long - middle == middle - short
