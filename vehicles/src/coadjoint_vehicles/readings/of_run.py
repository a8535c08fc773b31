"""The readings of the sensors of a vehicle in a run, each at its own rate."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import jax
import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, warn
from coadjoint.extending import Origin, StreamedRun, tabulate, with_ledger
from coadjoint.extending import kernel_backend as kernels
from coadjoint.mechanics import State
from coadjoint.models.quantities import not_negative
from coadjoint.simulation import Run
from coadjoint.spaces import Named
from coadjoint_vehicles.model.craft import Craft, craft_of
from coadjoint_vehicles.readings.craft_kinematics import between, kinematics
from coadjoint_vehicles.readings.taken import Readings, SensorReading
from coadjoint_vehicles.sensors.kinematics import Kinematics
from coadjoint_vehicles.sensors.noise import Noise
from coadjoint_vehicles.sensors.sensor import Sensor, different

BLOCK = 512
"""Nodes, and readings, that are computed together: a fixed number, so that each is bitwise identical in any run."""
OF_A_NUMBER, LARGEST = 64.0, 8e9
"""Bytes that a number of a reading takes, and that all readings of a sensor may take."""
SLACK = 1e-9
"""The part of a period by which a reading may come after the end."""


def readings(
    run: Run,
    *,
    seed: int = 0,
    sensors: Sequence[Sensor | str] | None = None,
    bottom: float | Callable[[PyTree, PyTree], PyTree] | None = None,
    craft: Craft | None = None,
) -> Readings:
    """The readings of a vehicle's sensors in a run of it, each at its own rate from the start of the run on.

        read = readings(run, seed=1)
        read["imu"].time, read["imu"].values, read.dataset

    A reading between two nodes is of the cubics through both (`between`); where a run saved fewer nodes than steps, or
    its records are on disk, its steps are taken again. The errors are drawn from the seed, for each sensor by its name,
    so that they depend neither on the other sensors nor on how long the run is, or whether it was resumed. Sensors are
    read after the run: they do not act on it. If a mission loses sensors, `run.dataset` has the readings outside the
    losses; this function returns all.

    run: of `co.simulate`, of a single craft. seed: an integer ≥ 0. sensors: names, or a user's own sensors; by default
    all of the vehicle. bottom: the depth of a level bottom, one number in m, or a function (north, east) ↦ depth, m,
    such as a `Bottom`, which is level below each reading; None without a bottom.
    craft: the one of the run; by default it is found by its system. Raises ArgumentError for a run of no craft and
    for sensors that there are not; warns of a sensor whose latency is longer than
    the run.
    """
    checks.instance(run, "run", Run, "a run of co.simulate, of a single craft")
    if bottom is not None and not callable(bottom):
        bottom = float(not_negative(bottom, "bottom"))
    craft = craft_of(run.system) if craft is None else craft
    chosen = chosen_sensors(craft, sensors)
    noises = [Noise(one, seed) for one in chosen]
    moving = moved(run, craft, bottom)
    found = {one.name: _read(one, noise, moving) for one, noise in zip(chosen, noises, strict=True)}
    late = _never_there(found.values(), float(moving.t[-1]))
    for sentence in late:
        warn(sentence, stacklevel=2)
    return Readings(found, int(seed), late)


def _never_there(read: Iterable[SensorReading], end: float) -> tuple[str, ...]:
    """A sentence for each sensor of which no reading arrives by the end of the run, s."""
    return tuple(
        f"No reading of `{one.sensor.name}` arrives by the end of the run at {end:g} s, because its latency is "
        f"{float(one.sensor.latency):g} s: is that in seconds?"
        for one in read
        if len(one) and one.arrival[0] > end
    )


def chosen_sensors(craft: Craft, asked: Sequence[Sensor | str] | None) -> tuple[Sensor, ...]:
    """Sensors of a craft by name, or others; by default all. Raises ArgumentError."""
    if asked is None:
        return craft.vehicle.sensors
    fits = not isinstance(asked, (str, Sensor)) and isinstance(asked, Sequence)
    checks.expect(fits, asked, "sensors", "a row of names or sensors")
    return different([craft.vehicle.sensor(one) if isinstance(one, str) else one for one in asked])


def moved(run: Run, craft: Craft, bottom: float | Callable[[PyTree, PyTree], PyTree] | None) -> Kinematics:
    """The kinematics of a craft at every node of a run, with leading axes, (nodes, …), the last node among them."""
    at, p = kinematics(craft, bottom=bottom, system=run.system), run.system.parameters
    made, found = None, []
    for block, count in _blocks(run):
        made = tabulate(jax.vmap(at, in_axes=(0, None)), block, p) if made is None else made
        found.append(_rows(made(block, p), slice(0, count)))
    return jax.tree.map(lambda *leaves: np.concatenate(leaves), *found)


def _blocks(run: Run) -> Iterator[tuple[State, int]]:
    """The records at every step, `BLOCK` at a time, and how many of them count."""
    if not isinstance(run, StreamedRun) and np.all(np.diff(run.steps_saved) <= 1):
        count = len(run.steps_saved)
        for begin in range(0, count, BLOCK):
            index = np.minimum(np.arange(begin, begin + BLOCK), count - 1)
            yield _rows(run.records, index), min(BLOCK, count - begin)
        return
    plan, left = run.plan, run.good_steps
    state = with_ledger(run.system, run.method.begin(run.system, run.start, run.dt), plan.monitors)
    plain = replace(run.last_record, origin=Origin())
    while left >= 0:
        count = min(BLOCK, left)
        parts: list[PyTree] = []
        if count:
            chunk = kernels.run(plan.backend, plan.program, plan.constants, state, plan.h, count, 1, plan.watches)
            state, parts = chunk.final, [chunk.records]
        if count < BLOCK:
            parts += [jax.tree.map(lambda leaf: np.asarray(leaf)[None], plain)] * (BLOCK - count)
        yield jax.tree.map(lambda *leaves: np.concatenate(leaves), *parts), min(count + 1, BLOCK)
        left = left - count if count == BLOCK else -1


def in_blocks(function: Callable[..., object], rows: object) -> PyTree:
    """function(rows) of trees with a leading axis, `BLOCK` rows at a time, the last block filled up."""
    count = len(jax.tree.leaves(rows)[0])
    made, found = None, []
    for begin in range(0, count, BLOCK):
        block = _rows(rows, np.minimum(np.arange(begin, begin + BLOCK), count - 1))
        made = tabulate(function, block) if made is None else made
        found.append(made(block))
    return jax.tree.map(lambda *leaves: np.concatenate(leaves)[:count], *found)


def _rows(tree: PyTree, index: Any) -> PyTree:
    return jax.tree.map(lambda leaf: np.asarray(leaf)[index], tree)


def _read(sensor: Sensor, noise: Noise, moving: Kinematics) -> SensorReading:
    """All readings of one sensor."""
    nodes = np.asarray(moving.t)
    times = reading_times(sensor, float(nodes[0]), float(nodes[-1]))
    exact, there = at_times(sensor, moving, times)
    drawn = noise.read(np.where(there[:, None], exact, 0.0))  # values out of limits may be NaN
    kept = there & ~drawn.lost
    number = np.flatnonzero(kept)
    taken = times[kept]
    return SensorReading(
        sensor, taken, taken + float(sensor.latency), drawn.values[kept], exact[kept], number, tried=len(times)
    )


def reading_times(sensor: Sensor, since: float, until: float) -> np.ndarray:
    """since + k/rate up to `until`, (k,) s."""
    rate = float(sensor.rate)
    count = (until - since) * rate
    if not OF_A_NUMBER * sensor.size * count <= LARGEST:
        raise ArgumentError(
            f"The sensor `{sensor.name}` would read {count:.3g} times in {until - since:.6g} s, at {rate:g} readings "
            "in a second, for which there is no memory: give it a smaller `rate`, in Hz."
        )
    return since + np.arange(int(np.floor((until - since) * rate + SLACK)) + 1) / rate


def at_times(sensor: Sensor, moving: Kinematics, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The error-free readings of a sensor, (k, m), and whether it reads, (k,), between nodes with leading axes."""
    own = Named(**sensor.parameters())
    before = np.clip(np.searchsorted(moving.t, times, side="right") - 1, 0, max(len(moving.t) - 2, 0))
    after = np.minimum(before + 1, len(moving.t) - 1)
    rows = [_rows(moving, index) for index in (before, after)]

    def one(ends: tuple[Kinematics, Kinematics, Any]) -> tuple[PyTree, PyTree]:
        there = between(*ends)
        return sensor.reading(there, own), sensor.within(there, own)

    exact, within = in_blocks(jax.vmap(one), (*rows, times))
    return exact, np.asarray(within, dtype=bool)
