"""Ensembles of vehicles with starts and masses of their own: time per trajectory and step."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import jax
import numba
import numpy as np

import coadjoint as co
from benchmarks import kernels_yardstick
from benchmarks.clock import Contender, interleaved, table_of
from benchmarks.one import PAPER, H
from benchmarks.problems import vehicle
from coadjoint.kernels.run import ensemble, xla
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.simulation.members import begin_members

SEED = 20
YARDSTICK = "hand-written, numba"


class Fleet:
    """`count` vehicles: masses between 110 and 140 kg, each turning and moving in its own way."""

    def __init__(self, count: int):
        problem, random = vehicle(), np.random.default_rng(SEED)
        self.count = count
        self.system = problem.system.replace(mass=co.each(random.uniform(110.0, 140.0, count)))
        xi = problem.start.xi + 0.1 * random.normal(size=(count, 3))
        qdot = problem.start.qdot + 0.1 * random.normal(size=(count, 3))
        self.start = problem.system.state(q=[0, 0, 1], xi=co.each(xi), qdot=co.each(qdot), a0=[0, 0, 1])
        members = begin_members(self.system, self.start, PAPER, H, count, False)
        flags = jax.tree.map(lambda axis: axis == 0, members.axes, is_leaf=lambda x: x is None)
        self.states, self.axes = members.states, (Constants(flags, False), True)
        self.program = StepProgram(replace_parameters(problem.system, None), PAPER)
        self.constants = Constants(members.parameters, {})

    def native(self, steps: int, threads: int) -> Any:
        """`steps` steps of all members."""
        arguments = (self.program, self.constants, self.states, H, 1, steps, False)
        return ensemble.run_ensemble(*arguments, axes=self.axes, threads=threads)

    def by_xla(self, steps: int) -> Any:
        return xla.run_ensemble(self.program, self.constants, self.states, H, 1, steps, False, axes=self.axes)

    def by_hand(self, steps: int, threads: int = 1) -> Callable[[], np.ndarray]:
        """The hand-written loop over members, an equal part a thread; the final states, (members, 28)."""
        s, p, body = self.states, self.constants.system, vehicle().body
        rows = [x.reshape(self.count, -1) for x in (s.t, s.g, s.n, s.a, s.mu, s.pi, s.xi, s.nu)]
        begin = np.concatenate(rows, axis=1)
        numbers = np.tile(np.array(body.numbers), (self.count, 1))
        numbers[:, :3] = p.mass[:, None] + np.diag(p.added_mass)
        numbers[:, 6] = p.mass * p.gravity - p.buoyancy

        def run() -> np.ndarray:
            states = begin.copy()
            if threads == 1:
                _members(numbers, H, states, steps)
                return states
            parts = zip(np.array_split(numbers, threads), np.array_split(states, threads), strict=True)
            with ThreadPoolExecutor(threads) as pool:
                list(pool.map(lambda part: _members(part[0], H, part[1], steps), parts))
            return states

        return run


@numba.njit(nogil=True)
def _members(numbers, h, states, steps):
    out = np.empty((1, 28))
    for i in range(len(states)):
        p = numbers[i]
        given = (p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7], p[8], p[9])
        kernels_yardstick.run(given, h, states[i], 1, steps, out)


def measure(quick: bool) -> dict[str, Any]:
    """Time per trajectory and step on the cores that this process may use: processor time on one, wall time on more.

    A call costs the same for any number of steps, so that two lengths are measured.
    """
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1
    count, lengths = (1000, (1000,)) if quick else (10_000, (1000, 5000))
    fleet = Fleet(count)
    by_hand, ours = fleet.by_hand(200)(), fleet.native(200, cores).final
    found = {
        "cores": cores,
        "lanes": ensemble.lanes(),
        "members": count,
        "difference": float(np.max(np.abs(by_hand[:, 10:13] - ours.n) / (1 + np.abs(ours.n)))),
        "lengths": {},
    }
    for steps in lengths:
        repetitions = 3 if quick else 7 if steps == 1000 else 3
        found["lengths"][str(steps)] = _of_length(fleet, steps, cores, repetitions)
    return found


def _of_length(fleet: Fleet, steps: int, cores: int, repetitions: int) -> dict[str, Any]:
    work, few = float(fleet.count * steps), 20
    contenders = {YARDSTICK: Contender(fleet.by_hand(steps), work)}
    for threads in range(2, cores + 1):
        contenders[f"{YARDSTICK}, {threads} threads"] = Contender(fleet.by_hand(steps, threads), work)
    names = [f"native, {threads} thread{'s' * (threads > 1)}" for threads in range(1, cores + 1)]
    for threads, name in enumerate(names, 1):
        contenders[name] = Contender(lambda threads=threads: fleet.native(steps, threads), work)
    contenders["XLA vmap"] = Contender(lambda: fleet.by_xla(few), float(fleet.count * few))
    timings = interleaved(contenders, repetitions, time.process_time if cores == 1 else time.perf_counter)
    found = {
        "rows": table_of(timings, YARDSTICK),
        "xla_over_native": timings["XLA vmap"].ratio(timings[names[-1]]),
    }
    if cores > 1:
        found["speed_up"] = timings[names[0]].ratio(timings[names[1]])
        # What the second core is worth at all while others use the machine.
        found["speed_up_by_hand"] = timings[YARDSTICK].ratio(timings[f"{YARDSTICK}, 2 threads"])
    return found
