"""Large problems where JAX runs, on a GPU if it sees one, next to native code or to XLA on the CPU of the same machine.

Run as: python -m benchmarks.gpu [--small]; it prints a line of JSON for each part, goes on after a part that fails, and
begins no part after LIMIT seconds. `--small` takes sizes that a CPU does in two minutes. Times are of the wall, without
compilation.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import jax
import numpy as np

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint.models import catalogue, fluids, rods

LIMIT = 400.0
"""Seconds after which no part begins, so that all end within eight minutes."""
SEED = 20
SIZES = {
    "ensemble": ([10**3, 10**4, 10**5, 10**6], [10**2, 10**3]),
    "fluid": ([64, 128, 256, 512, 1024], [16, 32]),
    "rod": ([50, 200, 1000], [20]),
    "gradient": ([10_000], [500]),
}
"""Kind of part → sizes, and small ones."""

Part = Callable[[], dict[str, Any]]


def main(small: bool) -> None:
    """Every part, as a line each."""
    began = time.perf_counter()
    for name, size, part in _parts(small):
        row: dict[str, Any] = {"part": name, "size": size, "device": str(jax.devices()[0])}
        if time.perf_counter() - began > LIMIT:
            row["left_out"] = f"after {LIMIT:g} s"
        else:
            try:
                row |= part()
            except Exception as error:
                row["failed"] = f"{type(error).__name__}: {str(error)[:200]}"
        print(json.dumps(row), flush=True)


def _parts(small: bool) -> Iterator[tuple[str, int, Part]]:
    kinds: dict[str, tuple[str, Callable[[int], dict[str, Any]]]] = {
        "the paper's vehicle": ("ensemble", partial(_fleet, _papers_vehicle)),
        "BlueROV2 Heavy": ("ensemble", partial(_fleet, _bluerov)),
        "fluid, su(N)": ("fluid", partial(_alone, _fluid)),
        "rod, sections": ("rod", partial(_alone, _rod)),
        "gradient of a trajectory, steps": ("gradient", _gradient),
    }
    for name, (kind, part) in kinds.items():
        for size in SIZES[kind][small]:
            yield name, size, partial(part, size)


def _mass(system: co.System) -> float:
    parameters: Any = system.parameters
    return float(parameters.mass)


def _papers_vehicle() -> tuple[co.System, co.State, float]:
    entry = catalogue["underwater_vehicle"]
    system = entry.make()
    return system, entry.start(system), 0.01


def _bluerov() -> tuple[co.System, co.State, float]:
    craft = vehicles.Craft(vehicles.load("bluerov2_heavy_von_benzon"))
    return craft.system, craft.start(position=(0.0, 0.0, 5.0), speed=0.3), 0.05


def _fleet(made: Callable[[], tuple[co.System, co.State, float]], count: int) -> dict[str, Any]:
    """Seconds of a member's step, of members of different masses."""
    system, start, dt = made()
    fleet = system.replace(mass=co.each(_mass(system) * np.random.default_rng(SEED).uniform(0.99, 1.01, count)))
    steps = 100

    def spent(backend: Any) -> float:
        options: dict[str, Any] = {"save_every": steps, "monitors": False, "accuracy": False, "progress": False}
        run = co.simulate(fleet, start, dt=dt, steps=steps, backend=backend, **options)
        return run.seconds / (steps * count)

    return _compared(spent("xla"), spent("native"), "native, all cores")


def _fluid(size: int) -> tuple[co.System, co.State, float, co.methods.Method]:
    random, c = np.random.default_rng(SEED), np.zeros((11, 11), complex)
    for degree in range(1, 11):
        c[degree, : degree + 1] = 0.1 * random.normal(size=degree + 1)
    fluid = fluids.euler(size)
    return fluid, fluids.start(fluid, c), 0.64 / size, co.IsospectralMidpoint()


def _rod(sections: int) -> tuple[co.System, co.State, float, co.methods.Method]:
    stiffness: dict[str, Any] = {"EI": 1.0, "GJ": 0.8, "EA": 100.0, "GA": 100.0}
    rod = rods.cosserat(elements=sections - 1, length=1.0, mass=1.0, inertia=(0.02, 0.01, 0.01), **stiffness)
    start = rods.start(rod, curvature=(0.0, 0.3, 0.2), angular_velocity=(0.2, 0.3, 0.1))
    return rod, start, 0.1 / (sections - 1), co.Midpoint()


def _alone(made: Callable[[int], tuple[co.System, co.State, float, co.methods.Method]], size: int) -> dict[str, Any]:
    """Seconds of a step of one large system; the other device is the CPU."""
    system, start, dt, method = made(size)
    steps = 50

    def spent(device: object) -> float:
        with jax.default_device(device):
            options: dict[str, Any] = {"save_every": steps, "monitors": False, "accuracy": False, "progress": False}
            return co.simulate(system, start, dt=dt, steps=steps, method=method, **options).seconds / steps

    here, cpu = jax.devices()[0], jax.devices("cpu")[0]
    return _compared(spent(here), None if here == cpu else spent(cpu), "XLA on the CPU")


def _gradient(steps: int) -> dict[str, Any]:
    """Seconds of the gradient of the final depth by the parameters."""
    system, start, dt = _papers_vehicle()

    def depth(parameters: Any, backend: Any) -> Any:
        every = 100 if backend == "xla" else steps
        path = co.trajectory(system.replace(**parameters), start, dt=dt, steps=steps, save_every=every, backend=backend)
        return path.final.q[2]

    given = {"mass": _mass(system)}

    def spent(backend: Any) -> float:
        with co.float64():
            slope = jax.jit(jax.grad(partial(depth, backend=backend)))
            jax.block_until_ready(slope(given))
            began = time.perf_counter()
            jax.block_until_ready(slope(given))
            return time.perf_counter() - began

    return _compared(spent("xla"), spent("native"), "native, one core")


def _compared(seconds: float, other: float | None, what: str) -> dict[str, Any]:
    found: dict[str, Any] = {"seconds": seconds}
    return found if other is None else {**found, "next_to": what, "other_seconds": other, "ratio": seconds / other}


if __name__ == "__main__":
    main("--small" in sys.argv[1:])
