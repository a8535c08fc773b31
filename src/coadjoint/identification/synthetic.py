"""A synthetic log of a run, with the noise of sensors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import jax
import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.identification.channels import UNITS, VEHICLE, is_vehicle, seen
from coadjoint.identification.log import Log
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.simulation.run import Run
from coadjoint.spaces.named import Named


def synthetic_log(
    run: Run, *, noise: Mapping[str, float] | None = None, seed: int = 0, columns: Sequence[str] = VEHICLE
) -> Log:
    """The records of a run of a vehicle as a log: `columns` with normal noise, and the inputs of the run.

    noise: standard deviations by column, SI units; 0 for those not given. Raises ArgumentError for systems other than
    vehicles and for columns that no vehicle has.
    """
    if not is_vehicle(run.system):
        raise ArgumentError(f"{run.system.name} is not a vehicle on SO(3) × ℝ³ or SE(3): make a Log of its records.")
    checks.all_known([*columns, *(noise or {})], VEHICLE, "column", "A vehicle")
    for name, size in (noise or {}).items():
        checks.not_negative(size, f"The noise of `{name}`, a standard deviation,")
    checks.whole(seed, "seed", 0)
    random = np.random.default_rng(seed)
    exact = seen(run.system, run.records, tuple(columns))
    noisy = {n: values + (noise or {}).get(n, 0.0) * random.normal(size=len(values)) for n, values in exact.items()}
    records = run.records
    held = evaluate(jax.vmap(run.system.inputs_at), records.t, records.inputs) if run.system.inputs else records.inputs
    inputs = {name: np.asarray(value) for name, value in held.asdict().items()} if isinstance(held, Named) else {}
    units = {name: unit for name in inputs if (unit := dict(run.system.units).get(f"inputs_{name}"))}
    return Log(
        np.asarray(records.t),
        noisy,
        inputs,
        {**{name: UNITS[name] for name in columns}, **units},
        step=run.dt,
        actual=_actual(records.internal, inputs),
    )


def _actual(internal: PyTree, inputs: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """What actuators did whose commands are inputs."""
    found = internal.asdict() if isinstance(internal, Named) else {}
    return {name: value for name, value in found.items() if name in inputs and isinstance(value, np.ndarray)}
