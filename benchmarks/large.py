"""How large a system can be: set-up and steps a second of families that grow, each in a process of its own.

Run as: python -m benchmarks.large [FAMILY …]; it prints the tables of docs/performance.md. Seconds are processor time
of one core, so that other programs on the machine matter little; the set-up is one with an empty folder for machine
code.
"""

from __future__ import annotations

import json
import resource
import sys
import time
from collections.abc import Callable

import jax.numpy as jnp
import numpy as np

import coadjoint as co
from benchmarks.fresh import fresh
from coadjoint.simulation.run import Run

LIMIT = 400
"""Seconds of a process, above which a size is not waited for."""


def chain(unknowns: int) -> tuple[co.System, co.State]:
    """A body on SO(3) with points on springs, one after the other: neighbours alone are coupled."""
    points = (unknowns - 3) // 3
    names = [f"x{k}" for k in range(points)]

    def lagrangian(xi, n, nu, p):
        x, v = (jnp.stack([getattr(of, name) for name in names]) for of in (n, nu))
        inner = jnp.concatenate([jnp.zeros((1, 3)), x[:-1]])
        stretch = jnp.sum((x - inner) ** 2, axis=1)
        return (
            0.5 * xi @ p.inertia @ xi + 0.5 * p.mass * jnp.sum(v**2) - 0.5 * p.stiffness * jnp.sum((stretch - 1) ** 2)
        )

    parameters = {"inertia": np.diag([3.0, 2.0, 1.0]), "mass": 0.5, "stiffness": 4.0}
    system = co.System(co.SO3(), lagrangian, additional=dict.fromkeys(names, co.Defining()), parameters=parameters)
    q = {name: [k + 1.0, 0.1 * (-1) ** k, 0.0] for k, name in enumerate(names)}
    return system, system.state(xi=[0.1, 0.2, 0.3], q=q, qdot={name: [0.0, 0.05, 0.02] for name in names})


def free(group: co.groups.LieGroup) -> tuple[co.System, co.State]:
    """Free motion on a group: ℓ = ½ Σ w_i ξ_i², where all unknowns are coupled."""
    weights = 1.0 + np.linspace(0, 1, group.dim)
    system = co.System(group, lambda xi: 0.5 * xi @ (weights * xi))
    return system, system.state(xi=0.3 * np.cos(np.arange(group.dim)))


def unitary(size: int, special: bool) -> co.groups.LieGroup:
    """U(N) or SU(N) by matrices like those of Gell-Mann."""
    basis = []
    for i in range(size):
        for j in range(i):
            real, imaginary = np.zeros((2, size, size), complex)
            real[i, j], real[j, i] = 1, -1
            imaginary[i, j] = imaginary[j, i] = 1j
            basis += [real, imaginary]
    basis += [np.diag([1j * (k == i) - 1j * (k == i + 1) for k in range(size)]) for i in range(size - 1)]
    if not special:
        basis.append(1j * np.eye(size))
    return co.MatrixGroup(basis, name=f"{'SU' if special else 'U'}({size})")


FAMILIES: dict[str, tuple[Callable, list[int], str]] = {
    "chain": (chain, [6, 12, 24, 36, 48, 60, 63, 120, 240], "a body with points on springs, by unknowns"),
    "so": (lambda n: free(co.SOn(n)), [3, 4, 5, 6, 7, 8, 10, 12], "free motion on SO(n), by n"),
    "u": (
        lambda n: free(unitary(n, special=False)),
        [2, 3, 4, 5, 6, 7, 8],
        "free motion on U(N) by Cayley's map, by N",
    ),
    "su": (lambda n: free(unitary(n, special=True)), [2, 3, 4, 5], "free motion on SU(N) by the exponential, by N"),
}
"""Family → (how a size is made, sizes, what it is)."""


def measure(family: str, size: int) -> dict[str, float | str]:
    """One size, in this process: seconds of set-up, steps a second, and what ran it."""
    system, start = FAMILIES[family][0](size)
    method = co.Midpoint(co.Exponential() if family == "su" else co.Cayley())

    def seconds(steps: int) -> tuple[float, Run]:
        began = time.process_time()
        options = {"method": method, "monitors": False, "accuracy": False, "save_every": steps}
        run = co.simulate(system, start, dt=0.01, steps=steps, **options)
        return time.process_time() - began, run

    set_up, run = seconds(10)
    steps = 250
    seconds(steps)
    taken = fewer = seconds(steps)[0]
    while taken - fewer < 0.5 and steps < 4 * 10**6:
        fewer = taken
        steps *= 4
        seconds(steps)  # XLA compiles a program for each number of steps
        taken, run = seconds(steps)
    return {
        "size": size,
        "unknowns": system.unknowns,
        "backend": run.plan.backend,
        "set_up": set_up,
        "rate": 0.75 * steps / (taken - fewer),  # what both calls take before the first step drops out
        "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6,
    }


def main() -> None:
    if sys.argv[1:2] == ["--one"]:
        print(json.dumps(measure(sys.argv[2], int(sys.argv[3]))))
        return
    for family in sys.argv[1:] or FAMILIES:
        _, sizes, title = FAMILIES[family]
        print(f"\n{title}\n\n| size | unknowns | by | set-up, s | steps/s | memory, GB |\n|---|---|---|---|---|---|")
        for size in sizes:
            row = fresh("large", family, size, LIMIT)
            if row is None:
                print(f"| {size} | | | over {LIMIT} s | | |", flush=True)
                break
            figures = f"{row['set_up']:.2g} | {row['rate']:,.0f} | {row['memory']:.2g}"
            print(f"| {size} | {row['unknowns']} | {row['backend']} | {figures} |", flush=True)


if __name__ == "__main__":
    main()
