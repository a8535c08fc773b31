"""What a call costs: a second co.simulate of a small system, and the slowest of a million steps and updates."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np

import coadjoint as co
from benchmarks import stepping
from benchmarks.clock import Contender, interleaved, table_of
from coadjoint.estimation import Filter, InertialState, Measurement, StrapdownProcess

STEPS = 100
BARE = "bare: without monitors and accuracy"
PARTS = (50.0, 99.0, 99.9, 100.0)
"""Percentiles."""


def measure(quick: bool) -> dict[str, Any]:
    """Processor time of second calls, and percentiles of that of single calls with Python's collector on."""
    calls = 20_000 if quick else 1_000_000
    tails = {name: _tail(call, calls) for name, call in _calls().items()}
    return {"second": table_of(interleaved(_seconds(), 5 if quick else 25), BARE), "tails": tails, "calls": calls}


def _seconds() -> dict[str, Contender]:
    """A heavy top of 100 steps, all saved, that has been run before."""

    def lagrangian(xi, a, p):
        return 0.5 * xi @ p.inertia @ xi - p.weight * a[2]

    parameters = {"inertia": np.diag([1.0, 2.0, 3.0]), "weight": 3.0}
    top = co.System(co.SO3(), lagrangian, advected=co.Defining(), parameters=parameters)
    start = top.state(g=np.eye(3), xi=[1.0, 2.0, 3.0], a0=[0.0, 0.0, 1.0])

    def run(**options: Any) -> co.Run:
        return co.simulate(top, start, dt=0.01, steps=STEPS, progress=False, **options)

    found: dict[str, Callable[[], object]] = {
        BARE: lambda: run(monitors=False, accuracy=False),
        "with monitors": lambda: run(accuracy=False),
        "with monitors and accuracy, the default": run,
        "the default and its dataset": lambda: run().dataset,
    }
    return {name: Contender(call) for name, call in found.items()}


def _calls() -> dict[str, Callable[[int], object]]:
    """Number of the call ↦ a call."""
    rows = [tuple(map(float, row)) for row in stepping._moving(np.random.default_rng(stepping.SEED), 64)]
    vehicle, (predict, update) = stepping.remus(), _filter()
    return {
        "Stepper.step, REMUS 100, two steps, commands that jump": lambda i: vehicle.step(rows[i & 63], stepping.PERIOD),
        "Filter.predict, an inertial unit, 15 error states": predict,
        "Filter.update, its depth": update,
    }


def _filter() -> tuple[Callable[[int], object], Callable[[int], object]]:
    """A step, and an update, of a filter at rest, each by a filter of its own."""

    def made() -> Filter:
        process = StrapdownProcess(gravity=9.81, noise={"gyroscope": 4e-5, "accelerometer": 4e-4})
        row = process.row(InertialState(0.0, np.eye(3), np.zeros(3), np.zeros(3)))
        known = {"depth": Measurement(lambda m: jnp.reshape(m.q[2], (1,)), 0.03**2)}
        return Filter(
            process, row, measurements=known, deviations={"attitude": 0.01, "velocity": 0.03, "position": 0.3}
        )

    one, other = made(), made()
    rest, seen = {"imu": np.array([0.0, 0.0, 0.0, 0.0, 0.0, -9.81])}, {"depth": np.zeros(1)}
    return lambda _: one.predict(0.01, rest), lambda _: other.update(seen)


def _tail(call: Callable[[int], object], calls: int) -> dict[str, list[float]]:
    """Percentiles of the seconds of a call, of processor time and of the wall clock; the collector is on."""
    for i in range(1000):
        call(i)
    gc.collect()
    gc.enable()
    spent, passed = np.empty(calls, np.int64), np.empty(calls, np.int64)
    processor, wall = time.thread_time_ns, time.perf_counter_ns
    for i in range(calls):
        begun, began = wall(), processor()
        call(i)
        spent[i] = processor() - began
        passed[i] = wall() - begun
    return {name: (1e-9 * np.percentile(x, PARTS)).tolist() for name, x in (("processor", spent), ("wall", passed))}
