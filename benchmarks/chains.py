"""Chains by `co.Power`: set-up and time of a step of each size, and beside hand-written dense Newton iterations.

Run as: python -m benchmarks.chains [FAMILY …]; it prints the tables of docs/performance.md. Seconds are processor time
of one thread, each size in a process of its own with an empty folder for machine code.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import coadjoint as co
from benchmarks.fresh import fresh
from coadjoint.models import rods

LIMIT = 400
"""Seconds of a process, above which a size is not waited for."""

INERTIA = np.array([3.0, 2.0, 1.0])
STIFFNESS = 1.5
STEP = 0.01


def _velocities(count: int) -> np.ndarray:
    return 0.3 * np.cos(np.arange(3 * count)).reshape(count, 3)


def free(count: int) -> tuple[co.System, co.State, float]:
    """Bodies on SO(3) that do not act on each other, which `coupling` does not say."""
    system = co.System(co.Power(co.SO3(), count), lambda xi: 0.5 * jnp.sum(INERTIA * xi**2))
    return system, system.state(xi=_velocities(count)), STEP


def springs(count: int) -> tuple[co.System, co.State, float]:
    """Bodies on SO(3), each turned back by springs to where the one before it points."""

    def lagrangian(xi, a):
        return 0.5 * jnp.sum(INERTIA * xi**2) + 0.5 * STIFFNESS * jnp.sum(jnp.trace(a, axis1=1, axis2=2))

    system = co.System(co.Power(co.SO3(), count), lagrangian, advected=co.spaces.RelativePoses())
    return system, system.state(xi=_velocities(count)), STEP


def pendulums(count: int) -> tuple[co.System, co.State, float]:
    """Bodies on ball joints, all coupled by their masses."""
    system = rods.pendulums(links=count, length=0.5, mass=1.0, inertia=(0.01, 0.02, 0.02))
    turned = np.asarray(co.attitude.zyx(0, 0.3, 0.1))
    return system, rods.pendulums_start(system, rotation=turned, angular_velocity=(1.0, 0.2, 0.3)), 0.002


def rod(count: int) -> tuple[co.System, co.State, float]:
    """A free rod of `count` sections on SE(3), Courant number 1, smooth data."""
    system = rods.cosserat(
        elements=count - 1, length=1.0, EI=1.0, GJ=0.8, EA=100.0, GA=100.0, mass=1.0, inertia=(0.02, 0.01, 0.01)
    )
    start = rods.start(system, curvature=(0.0, 0.3, 0.2), angular_velocity=(0.2, 0.3, 0.1))
    return system, start, 0.1 / (count - 1)


FAMILIES: dict[str, tuple[Callable[[int], tuple[co.System, co.State, float]], list[int]]] = {
    "free": (free, [10, 20, 21, 30, 40, 60, 100]),
    "springs": (springs, [10, 20, 21, 30, 40, 60, 100]),
    "pendulums": (pendulums, [5, 10, 20, 21, 30]),
    "rod": (rod, [10, 11, 20, 50, 200, 1000]),
}
"""Family → (how a size is made, sizes)."""


def by_hand(count: int) -> Callable[[int], Any]:
    """`springs` by hand: n ↦ n steps by Newton's method with the whole Jacobian, jitted.

        μ_k = Jξ + h/2 ξ × Jξ + h²/4 (ξ·Jξ) ξ − h/2 T(R_k cay(hξ/2)),  the same with −h for −μ_{k+1}

    T is the torque of the springs; R_{k+1} = R_k cay(hξ).
    """
    eye, h = jnp.eye(3), STEP

    def cayley(w):
        hat = jnp.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
        return eye + (hat + 0.5 * hat @ hat) / (1.0 + 0.25 * w @ w)

    def torque(R):
        other = jnp.zeros_like(R).at[1:].add(R[:-1]).at[:-1].add(R[1:])
        M = jnp.einsum("nji,njk->nik", R, other)
        axial = jnp.stack([M[:, 1, 2] - M[:, 2, 1], M[:, 2, 0] - M[:, 0, 2], M[:, 0, 1] - M[:, 1, 0]], axis=1)
        return -0.5 * STIFFNESS * axial

    def side(xi, R, s):
        p, middle = INERTIA * xi, jnp.einsum("nij,njk->nik", R, jax.vmap(cayley)(0.5 * h * xi))
        turned = 0.5 * s * jnp.cross(xi, p) + 0.25 * h**2 * jnp.sum(xi * p, axis=1, keepdims=True) * xi
        return p + turned - 0.5 * s * torque(middle)

    def step(_, state):
        R, mu, xi = state

        def newton(carry):
            z, _, n = carry
            residual = lambda z: (side(z.reshape(count, 3), R, h) - mu).reshape(-1)  # noqa: E731
            change = jnp.linalg.solve(jax.jacfwd(residual)(z), -residual(z))
            return z + change, jnp.max(jnp.abs(change)), n + 1

        start = (xi.reshape(-1), jnp.asarray(jnp.inf), 0)
        z = jax.lax.while_loop(lambda c: (c[1] > 1e-7) & (c[2] < 25), newton, start)[0].reshape(count, 3)
        return jnp.einsum("nij,njk->nik", R, jax.vmap(cayley)(h * z)), side(z, R, -h), z

    @jax.jit
    def steps(n):
        xi, R = jnp.asarray(_velocities(count)), jnp.broadcast_to(eye, (count, 3, 3))
        return jax.lax.fori_loop(0, n, step, (R, INERTIA * xi, xi))

    return lambda n: jax.block_until_ready(steps(n))


def _rate(call: Callable[[int], Any]) -> tuple[float, float]:
    """Seconds before the first step, and of a step: the least of several calls, less that of shorter ones."""

    def seconds(n: int) -> float:
        began = time.process_time()
        call(n)
        return time.process_time() - began

    set_up, n = seconds(1), 50
    while (taken := min(seconds(n), seconds(n))) < 0.15 and n < 50_000:
        n *= 4
    shorter, longer = (min(seconds(k) for _ in range(4)) for k in (n, 3 * n))
    return set_up, max(longer - shorter, 0.1 * taken) / (2 * n)


def measure(family: str, count: int) -> dict[str, Any]:
    """One size, in this process."""
    if family == "hand":
        with jax.enable_x64(True):
            set_up, step = _rate(by_hand(count))
        return {"unknowns": 3 * count, "by": "XLA, dense", "set_up": set_up, "step": step}
    began = time.process_time()
    system, start, dt = FAMILIES[family][0](count)
    made, plans = time.process_time() - began, []

    def call(n: int) -> None:
        run = co.simulate(system, start, dt=dt, steps=n, save_every=n, monitors=False, accuracy=False)
        plans.append(run.plan.backend)

    set_up, step = _rate(call)
    return {"unknowns": system.unknowns, "by": plans[0], "set_up": made + set_up, "step": step}


def main() -> None:
    if sys.argv[1:2] == ["--one"]:
        print(json.dumps(measure(sys.argv[2], int(sys.argv[3]))))
        return
    for family in sys.argv[1:] or FAMILIES:
        print(f"\n{family}\n\n| N | unknowns | by | set-up, s | µs/step | dense |\n|--:|--:|---|--:|--:|--:|")
        for count in FAMILIES[family][1]:
            row, dense = (
                fresh("chains", family, count, LIMIT),
                fresh("chains", "hand", count, LIMIT) if family == "springs" else None,
            )
            if row is None:
                print(f"| {count} | | | over {LIMIT} s | | |", flush=True)
                continue
            beside = f"{1e6 * dense['step']:,.3g}" if dense else ""
            figures = f"{row['unknowns']} | {row['by']} | {row['set_up']:.2g} | {1e6 * row['step']:,.3g} | {beside}"
            print(f"| {count} | {figures} |", flush=True)


if __name__ == "__main__":
    main()
