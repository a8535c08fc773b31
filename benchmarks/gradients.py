"""What a gradient costs: the final depth of the vehicle by all parameters and the whole initial state."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np

import coadjoint as co
from benchmarks.clock import Contender, interleaved, table_of
from benchmarks.one import PAPER, H
from benchmarks.problems import ready, vehicle
from coadjoint.kernels.run import gradient
from coadjoint.mechanics.copies import replace_parameters

FORWARD = "native run"
METHODS = {"left rule": PAPER, "midpoint": co.Midpoint()}


def measure(quick: bool) -> dict[str, Any]:
    """Times relative to the native forward run of as many steps; the largest difference between the two gradients."""
    steps = 2000 if quick else 10_000
    found: dict[str, Any] = {"steps": steps, "methods": {}}
    for name, method in list(METHODS.items())[: 1 if quick else None]:
        found["methods"][name] = _of_method(method, steps, 3 if quick else 9)
    return found


def _of_method(method: co.methods.Method, steps: int, repetitions: int) -> dict[str, Any]:
    problem = vehicle()
    case = ready(problem, method, H)
    final_bar = jax.tree.map(np.zeros_like, case.run(1, steps).final)
    final_bar = final_bar.replace(n=np.ones(3), g=np.ones((3, 3)))

    def pullback() -> Any:
        arguments = (case.program, case.constants, case.state, H, 1, steps)
        return gradient.vjp(*arguments)[1](None, final_bar)

    def depth(parameters: Any, start: co.State, backend: Any, save_every: int) -> Any:
        system = replace_parameters(problem.system, parameters)
        path = co.trajectory(system, start, dt=H, steps=steps, method=method, save_every=save_every, backend=backend)
        return path.final.q[2]

    arguments = (problem.system.parameters, problem.start)
    # One block natively; by XLA blocks of √steps, so that its reverse pass keeps as little.
    by_backend = {"native": steps, "xla": 100}
    with co.float64():
        forward = jax.jit(depth, static_argnums=(2, 3))
        both = jax.jit(jax.value_and_grad(depth, argnums=(0, 1)), static_argnums=(2, 3))

    def call(function: Any, backend: str) -> Any:
        with co.float64():
            return jax.block_until_ready(function(*arguments, backend, by_backend[backend]))

    contenders = {
        FORWARD: Contender(lambda: case.run(1, steps)),
        "native run and its gradient": Contender(pullback),
        "jax.value_and_grad of co.trajectory, native": Contender(lambda: call(both, "native")),
        "co.trajectory, XLA": Contender(lambda: call(forward, "xla")),
        "jax.value_and_grad of co.trajectory, XLA": Contender(lambda: call(both, "xla")),
    }
    timings = interleaved(contenders, repetitions)
    ours, theirs = (np.concatenate([np.ravel(x) for x in jax.tree.leaves(call(both, b)[1])]) for b in by_backend)
    return {
        "rows": table_of(timings, FORWARD),
        "difference": float(np.max(np.abs(ours - theirs)) / np.max(np.abs(theirs))),
        "xla_over_xla": timings["jax.value_and_grad of co.trajectory, XLA"].ratio(timings["co.trajectory, XLA"]),
    }
