"""Native kernels against a hand-written numba loop and against XLA, on the paper's vehicle: one table of ratios.

    python benchmarks/kernels_ratios.py

Ratios matter, not the figures; each time is the least of several. One thread, except where it says otherwise.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

import coadjoint as co
from coadjoint.kernels.emit import plan, stepping
from coadjoint.kernels.run import ensemble, gradient, machine, native, xla
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.methods.program import Constants, StepProgram
from kernels_yardstick import run as yardstick

H, STEPS, EVERY = 0.01, 50_000, 1000
MEMBERS = 64

PARAMETERS = co.Parameters(
    mass=123.8,
    added_mass=np.diag([65.0, 70.0, 75.0]),
    inertia=np.diag([5.46, 5.29, 5.72]),
    net_weight=123.8 * 9.81 - 1215.8,
    buoyancy=1215.8,
    center=[0.0, 0.0, -0.007],
)


def lagrangian(xi, n, nu, a, p):
    kinetic = 0.5 * nu @ (p.mass * nu + p.added_mass @ nu) + 0.5 * xi @ p.inertia @ xi
    return kinetic + p.net_weight * n @ a - p.buoyancy * p.center @ a


def least(function: Callable[[], Any], times: int = 7) -> float:
    """Seconds of the quickest call."""
    spent = []
    for _ in range(times):
        began = time.perf_counter()
        function()
        spent.append(time.perf_counter() - began)
    return min(spent)


def program(method) -> tuple[StepProgram, Constants, Any]:
    """A method on the vehicle as a program, its parameters and its start."""
    vehicle = co.System(co.SO3(), lagrangian, additional=co.Defining(), advected=co.Defining(), parameters=PARAMETERS)
    xi = np.deg2rad([10.0, 0.0, 20.0])
    start = vehicle.state(g=np.eye(3), q=[0, 0, 1], xi=xi, qdot=[0.1, 0.1, 0.8], a0=[0, 0, 1])
    state = jax.tree.map(np.asarray, method.begin(vehicle, start, H))
    return StepProgram(replace_parameters(vehicle, None), method), Constants(vehicle.parameters, None), state


def by_hand(state: Any) -> float:
    """Seconds a step of the numba loop."""
    p = PARAMETERS
    moment = -p.buoyancy * np.asarray(p.center)
    mass = p.mass + np.diag(p.added_mass)
    numbers = tuple(map(float, (*mass, *np.diag(p.inertia), p.net_weight, *moment)))
    leaves = (state.t, state.g, state.n, state.a, state.mu, state.pi, state.xi, state.nu)
    packed = np.concatenate([np.ravel(leaf) for leaf in leaves])
    out = np.zeros((STEPS // EVERY, packed.size))

    def go():
        return yardstick(numbers, H, packed.copy(), STEPS // EVERY, EVERY, out)

    steps, _ = go()
    assert steps == STEPS
    return least(go) / STEPS


def row(name: str, seconds: float, ratio: float, unit: float = 1e9) -> None:
    print(f"{name:<58} {seconds * unit:>10.1f} {ratio:>9.3f}")


def compare(method, yard: float) -> None:
    """One trajectory, certificates, an ensemble and the adjoint by native code, and one trajectory by XLA."""
    work = program(method)
    blocks, few = (H, STEPS // EVERY, EVERY), (H, 2, EVERY)
    native.run(*work, H, 1, 1, False)
    ours = least(lambda: native.run(*work, *blocks, False)) / STEPS
    row(f"{method.title}, native", ours, ours / yard)
    watched = least(lambda: native.run(*work, *blocks, True)) / STEPS
    row("  with certificates at every step", watched, watched / yard)
    xla.run(*work, *few, False)
    theirs = least(lambda: xla.run(*work, *few, False), 3) / (2 * EVERY)
    row("  by XLA", theirs, theirs / yard)
    many = jax.tree.map(lambda x: np.repeat(np.asarray(x)[None], MEMBERS, 0), work[2])
    fleet = (work[0], work[1], many, H, 10, EVERY, False)
    each = least(lambda: ensemble.run_ensemble(*fleet, axes=(False, True), threads=1)) / (10 * EVERY * MEMBERS)
    row(f"  a member of an ensemble, {ensemble.lanes()} lanes", each, each / yard)
    chunk, pull = gradient.vjp(*work, *blocks)
    back = least(lambda: pull(None, chunk.final), 3) / STEPS
    row("  its adjoint", back, back / yard)


def set_up() -> None:
    """Seconds from a program to machine code, without the cache."""
    print(f"\n{'set-up, seconds':<58} {'traced':>10} {'compiled':>9}")
    for method in (co.LeftRectangle(co.Cayley()), co.Midpoint(co.Exponential()), co.Suzuki4(co.Midpoint(co.Cayley()))):
        steps, parameters, state = program(method)
        _, numbers = native.pack(parameters)
        pattern = plan.specialised(numbers)

        def trace(arguments=(steps, parameters, state, pattern, True)):
            return stepping.assemble(plan.plan(*arguments))

        assembly = trace()
        traced, compiled = least(trace, 3), least(lambda a=assembly: machine.object_code(a), 3)
        print(f"{method.title:<58} {traced:>10.3f} {compiled:>9.3f}")


def main() -> None:
    print(f"{'a step, nanoseconds':<58} {'time':>10} {'ratio':>9}")
    yard = by_hand(program(co.LeftRectangle(co.Cayley()))[2])
    row("LeftRectangle(Cayley), hand-written in numba", yard, 1.0)
    for method in (co.LeftRectangle(co.Cayley()), co.Midpoint(co.Cayley()), co.Midpoint(co.Exponential())):
        compare(method, yard)
    set_up()


if __name__ == "__main__":
    main()
