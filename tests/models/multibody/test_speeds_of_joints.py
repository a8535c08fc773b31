"""Rates of joints' coordinates, and what acts there, against coordinates of bodies that have moved a little."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.models.multibody.bonds import Bond, Coordinate, HeldCoordinates, HeldSpeeds

RANDOM = np.random.default_rng(41)
TURN = np.asarray(evaluate(co.SO3().exp, np.array([0.4, -0.2, 0.7])))
AXES = tuple(tuple(map(tuple, frame.tolist())) for frame in (TURN, TURN.T))
EPS = 1e-6


def bond(kind: str, first: int = 0) -> Bond:
    return Bond("hinge", kind, first, 1, 0, AXES)


PARAMETERS: Any = SimpleNamespace(
    hinge=SimpleNamespace(first=np.array([0.1, 0.2, -0.3]), second=np.array([-0.4, 0.1, 0.2]), damping=0.7)
)


def placed(g, q, first: int) -> tuple[np.ndarray, Any]:
    """n of two bodies, and a of the pair."""
    R = g if first >= 0 else np.stack([np.eye(3), g[1]])
    return np.einsum("nij,ni->nj", g, q), SimpleNamespace(pose=(R[0].T @ R[1])[None])


def moving(first: int):
    """n, a, ξ, ν of two bodies with parallel joint axes, about which they turn, and n and a nearby in time."""
    A, B = (np.array(frame) for frame in AXES)
    g = evaluate(jax.vmap(co.SO3().exp), RANDOM.normal(size=(2, 3)))
    turned = np.asarray(evaluate(co.SO3().exp, np.array([0.0, 0.0, 0.8])))
    g[1] = (g[0] if first >= 0 else np.eye(3)) @ A @ turned @ B.T
    q, xi, qdot = RANDOM.normal(size=(3, 2, 3))
    xi[1] = 1.3 * B[:, 2] + (g[1].T @ g[0] @ xi[0] if first >= 0 else 0.0)
    n, a = placed(g, q, first)
    ends = []
    for t in (-EPS, EPS):
        moved = np.einsum("nij,njk->nik", g, evaluate(jax.vmap(co.SO3().exp), t * xi))
        ends.append(placed(moved, q + t * qdot, first))
    return n, a, xi, np.einsum("nij,ni->nj", g, qdot), ends


@pytest.mark.parametrize(("kind", "first"), [("revolute", 0), ("cylindrical", -1), ("strut", 0)])
def test_speeds_are_rates_of_coordinates_and_forces_do_their_work(kind, first):
    n, a, xi, nu, ends = moving(first)
    joint = bond(kind, first)
    motion: Any = SimpleNamespace(n=n, a=a, xi=xi, nu=nu, inputs=SimpleNamespace(hinge=2.0))

    def forces(n, xi, nu):
        motion.n, motion.xi, motion.nu = n, xi, nu
        acting = [
            joint.acting(3.0, motion, PARAMETERS),
            joint.damper(motion, PARAMETERS),
            joint.motor(motion, PARAMETERS),
        ]
        places = [joint.coordinates(*end, PARAMETERS) for end in ends]
        return places, joint.speeds(xi, nu, n, a, PARAMETERS), [(one.torque, one.force) for one in acting]

    (before, after), speeds, acting = evaluate(forces, n, xi, nu)
    np.testing.assert_allclose(speeds, (after - before) / (2 * EPS), rtol=0, atol=1e-8)
    works = [np.sum(torque * xi) + np.sum(force * np.ravel(nu)) for torque, force in acting]
    assert works == pytest.approx([3.0 * speeds[0], -0.7 * speeds[0] ** 2, 2.0 * speeds[0]], rel=1e-12)
    motion.inputs = SimpleNamespace()
    with pytest.raises(ArgumentError, match="The motor of the joint `hinge` needs an input"):
        joint.motor(motion, PARAMETERS)


def test_held_coordinates_and_speeds_are_gaps_and_rows_of_the_same():
    n, a, xi, nu, _ = moving(0)
    joint, one = bond("cylindrical"), Coordinate(bond("prismatic"), PARAMETERS)
    held, both = HeldCoordinates(joint, ((0.1, 0.2), (0.5, -0.3))), HeldSpeeds(joint, (1.0, 2.0))
    read, other = Coordinate(joint, PARAMETERS), SimpleNamespace(hinge=SimpleNamespace(first=np.zeros(3), second=1.0))

    def everything(n, xi, nu, t):
        motion: Any = SimpleNamespace(n=jnp.ravel(n), a=a, xi=jnp.ravel(xi), nu=jnp.ravel(nu))
        here = joint.coordinates(n, a, PARAMETERS), joint.speeds(xi, nu, n, a, PARAMETERS)
        shown = held.gap(n, a, PARAMETERS, t=t), both.rows(n, a, PARAMETERS), both.right(n, a, PARAMETERS)
        return here, shown, (read(motion), read.speed(motion)), (one(motion), one(motion, other))

    here, (gap, rows, right), there, (distance, another) = evaluate(everything, n, xi, nu, np.float64(2.0))
    angle, along = here[0]
    assert gap == pytest.approx([np.sin(angle - 0.1 - 0.5 * 2.0), along - 0.2 + 0.3 * 2.0], abs=1e-12)
    assert rows.shape == (2, 12) and rows @ np.concatenate([np.ravel(xi), np.ravel(nu)]) == pytest.approx(here[1])
    assert right.tolist() == [1.0, 2.0] and np.shape(distance) == () and distance == pytest.approx(along)
    assert there[0] == pytest.approx(here[0]) and there[1] == pytest.approx(here[1]) and another != pytest.approx(along)
