"""Bitwise fingerprints of some sixty computations, to show that a change of structure changes no result.

    python tests/same_results.py record before.json     # before the change
    python tests/same_results.py compare before.json    # after it, on the same machine

Each computation gives named arrays, and each array the SHA-256 of its shape and of its bytes. `compare` lists what
differs by computation and array, and its exit status is 1 if anything does. Recorded values belong to a processor and
to versions of the dependencies, so that no record is part of the repository.
"""

from __future__ import annotations

import hashlib
import json
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

import coadjoint as co

Arrays = Mapping[str, object]
COMPUTATIONS: dict[str, Callable[[], Arrays]] = {}

NODES = ("t", "g", "n", "q", "a", "mu", "pi")
"""The arrays of a run that are compared: those that determine all others."""


def vehicle() -> tuple[co.System, co.State]:
    """The underwater vehicle of Ono, Fiori and Peng (2025), Table 1 and Table 2."""

    def lagrangian(xi, n, nu, a, p):
        kinetic = 0.5 * nu @ (p.mass * nu + p.added_mass @ nu) + 0.5 * xi @ p.inertia @ xi
        return kinetic + p.net_weight * n @ a - p.buoyancy * p.center @ a

    parameters = co.Parameters(
        mass=123.8,
        added_mass=np.diag([65.0, 70.0, 75.0]),
        inertia=np.diag([5.46, 5.29, 5.72]),
        net_weight=123.8 * 9.81 - 1215.8,
        buoyancy=1215.8,
        center=[0.0, 0.0, -0.007],
    )
    system = co.System(co.SO3(), lagrangian, additional=co.Defining(), advected=co.Defining(), parameters=parameters)
    rates = np.deg2rad([10.0, 0.0, 20.0])
    return system, system.state(g=np.eye(3), q=[0, 0, 1], xi=rates, qdot=[0.1, 0.1, 0.8], a0=[0, 0, 1])


def top() -> tuple[co.System, co.State]:
    """A symmetric heavy top."""
    parameters = co.Parameters(inertia=np.diag([5.0, 5.0, 1.0]), weight=20.0, center=[0.0, 0.0, 1.0])
    system = co.System(
        co.SO3(),
        lambda xi, a, p: 0.5 * xi @ p.inertia @ xi - p.weight * p.center @ a,
        advected=co.Defining(),
        parameters=parameters,
    )
    return system, system.state(g=co.attitude.zyx(0, 0, 0.3), xi=[0, 0.1, 20], a0=[0, 0, 1])


def pendulum() -> tuple[co.System, co.State]:
    """A spherical pendulum on S² under SO(3)."""
    system = co.System(
        co.SO3(),
        lambda xi, n, nu, a: 0.5 * nu @ nu + 0.5 * xi @ xi - n @ a,
        additional=co.Sphere(),
        advected=co.Defining(),
    )
    return system, system.state(q=[1, 0, 0], xi=[0.1, 0.2, 0.3], qdot=[0, 0.4, 0.1], a0=[0, 0, 1])


def chain() -> tuple[co.System, co.State]:
    """Free bodies as a chain, SO(3)⁵."""
    system = co.System(co.Power(co.SO3(), 5), lambda xi: 0.5 * (xi**2).sum() + 0.1 * (xi[1:] * xi[:-1]).sum())
    return system, system.state(xi=0.1 * np.arange(15.0).reshape(5, 3))


def braked() -> tuple[co.System, co.State]:
    """A body under a torque that it is given and a linear drag."""
    system = co.System(
        co.SO3(),
        lambda xi, p: 0.5 * xi @ p.inertia @ xi,
        parameters={"inertia": np.diag([1.0, 2.0, 3.0]), "drag": 0.1},
        forces=lambda motion, p: co.Force(torque=motion.inputs.torque - p.drag * motion.xi),
    )
    return system, system.state(xi=[0.3, -0.2, 0.5])


def nodes(run) -> dict[str, object]:
    """The arrays of all nodes of a run."""
    return {name: value for name in NODES if (value := getattr(run.records, name, None)) is not None}


def computation(function: Callable[[], Arrays]) -> Callable[[], Arrays]:
    """Register a computation under the name of its function."""
    COMPUTATIONS[function.__name__] = function
    return function


RULES = {
    "left": lambda: co.LeftRectangle(co.Cayley(), start="velocity"),
    "right": lambda: co.RightRectangle(co.Exponential()),
    "trapezoidal": lambda: co.Trapezoidal(co.Cayley()),
    "midpoint": lambda: co.Midpoint(co.Cayley()),
    "midpoint_exponential": lambda: co.Midpoint(co.Exponential()),
    "simpson": co.Simpson,
    "left_right": co.methods.LeftRight,
    "suzuki": lambda: co.Suzuki4(co.Midpoint(co.Cayley())),
    "kahan_li": lambda: co.methods.KahanLi6(co.Trapezoidal(co.Exponential())),
    "galerkin": co.Galerkin,
}
SYSTEMS = {"vehicle": vehicle, "top": top, "pendulum": pendulum}


def _register_runs() -> None:
    for name, system in SYSTEMS.items():
        for rule, method in RULES.items():
            if (name, rule) in {("pendulum", "galerkin")}:  # Galerkin's rule takes linear Q alone
                continue

            def run(system=system, method=method) -> Arrays:
                return nodes(co.simulate(*system(), dt=0.01, steps=60, method=method()))

            COMPUTATIONS[f"{name}_{rule}"] = run
        for rule in ("left", "midpoint", "suzuki"):

            def by_xla(system=system, method=RULES[rule]) -> Arrays:
                return nodes(co.simulate(*system(), dt=0.01, steps=30, method=method(), backend="xla"))

            COMPUTATIONS[f"{name}_{rule}_by_xla"] = by_xla


_register_runs()


@computation
def ensemble() -> Arrays:
    system, start = top()
    rates = np.outer(np.linspace(0.5, 1.5, 11), [0.0, 0.1, 20.0])
    start = system.state(g=start.g, xi=co.each(rates), a0=[0, 0, 1])
    return nodes(co.simulate(system, start, dt=0.01, steps=50))


@computation
def ensemble_by_xla() -> Arrays:
    system, start = top()
    start = system.state(g=start.g, xi=co.each(np.outer([0.5, 1.0], [0.0, 0.1, 20.0])), a0=[0, 0, 1])
    return nodes(co.simulate(system, start, dt=0.01, steps=20, backend="xla"))


@computation
def events() -> Arrays:
    run = co.simulate(*top(), dt=0.01, duration=3.0, events={"section": co.Event(lambda s: s.mu[1], "rising")})
    found = run.events["section"]
    return {**nodes(run), "times": found.t, "momenta": found.mu}


@computation
def stopped_by_an_event() -> Arrays:
    return nodes(co.simulate(*vehicle(), dt=0.01, duration=20.0, until=lambda s: s.q[2] - 2.0))


@computation
def events_of_an_ensemble() -> Arrays:
    system, start = top()
    start = system.state(g=start.g, xi=co.each(np.outer([0.5, 1.0, 1.5], [0.0, 0.1, 20.0])), a0=[0, 0, 1])
    run = co.simulate(system, start, dt=0.01, duration=2.0, until=co.Event(lambda s: s.mu[1], "rising"))
    return nodes(run)


@computation
def inputs_held_and_linear() -> Arrays:
    system, start = braked()
    times = np.linspace(0.0, 1.0, 6)
    table = np.sin(np.outer(times, [1.0, 2.0, 3.0]))
    held = co.simulate(system, start, dt=0.02, steps=50, inputs={"torque": co.Held(times, table)})
    linear = co.simulate(
        system, start, dt=0.02, steps=50, inputs={"torque": co.Linear(times, table)}, method=co.Trapezoidal()
    )
    return {"held": held.records.mu, "linear": linear.records.mu}


@computation
def every_tenth_node() -> Arrays:
    run = co.simulate(*vehicle(), dt=0.01, steps=100, save_every=10)
    return nodes(run)


@computation
def monitors() -> Arrays:
    run = co.simulate(*vehicle(), dt=0.01, steps=50)
    return {name: run.dataset[name].values for name in ("energy", "discrete_energy", "kelvin_noether", "group_defect")}


@computation
def stored_and_resumed() -> Arrays:
    with tempfile.TemporaryDirectory() as folder:
        store = Path(folder) / "store"
        system, start = top()
        co.simulate(system, start, dt=0.01, steps=40, store=store)
        stored = co.resume(store, system, start=start)
        later = co.simulate(system, stored.final, dt=0.01, steps=40)
        return {"mu": co.load(store).dataset["mu"].values, "mu later": later.records.mu}


@computation
def saved_and_loaded() -> Arrays:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "run.nc"
        co.simulate(*vehicle(), dt=0.01, steps=40).save(file)
        return {"mu": co.load(file).dataset["mu"].values, "g": co.load(file).dataset["R"].values}


@computation
def chain_of_bodies() -> Arrays:
    return nodes(co.simulate(*chain(), dt=0.01, steps=40))


@computation
def stepper() -> Arrays:
    system, start = braked()
    one = co.Stepper(system, start, dt=0.02, inputs={"torque": np.zeros(3)}, observe={"mu": lambda s: s.mu})
    seen = [one.step({"torque": [0.1 * k, 0.0, -0.1]}, n=3)["mu"].copy() for k in range(8)]
    copied = one.clone()
    return {"mu": np.array(seen), "clone": copied.step(n=5)["mu"].copy()}


@computation
def fleet_of_steppers() -> Arrays:
    system, start = braked()
    fleet = co.Stepper(
        system, start, dt=0.02, members=13, inputs={"torque": np.zeros(3)}, observe={"mu": lambda s: s.mu}
    )
    torques = np.linspace(-1.0, 1.0, 39).reshape(13, 3)
    return {"mu": np.array([fleet.step({"torque": torques}, n=4)["mu"].copy() for _ in range(4)])}


@computation
def trajectory_and_its_gradient() -> Arrays:
    import jax

    with co.float64():
        system, start = top()

        def end(scale):
            begun = system.state(g=start.g, mu=scale * start.mu, a0=[0, 0, 1])
            return co.trajectory(system, begun, dt=0.01, steps=20).final.mu[0]

        value, slope = jax.value_and_grad(end)(1.0)
        return {"value": np.asarray(value), "slope": np.asarray(slope)}


@computation
def filter_on_a_group() -> Arrays:
    system, start = braked()
    process = co.estimation.ModelProcess(system, start, inputs={"torque": np.zeros(3)}, noise={"torque": 0.1})
    observed = co.estimation.Filter(
        process,
        start,
        measurements={"rate": co.estimation.Measurement(lambda motion: motion.xi, 0.01**2)},
        deviations={"g": 0.1, "xi": 0.1},
    )
    seen = []
    for k in range(5):
        observed.predict(0.1, {"torque": [0.1, 0.0, -0.1 * k]})
        observed.update({"rate": [0.3, -0.2, 0.5]})
        seen.append(np.array(list(observed.deviations.values())))
    return {"deviations": np.array(seen)}


@computation
def sweep() -> Arrays:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "top.toml"
        file.write_text(
            '[system]\nmodel = "simo_wong_top"\n[initial]\neuler_zyx_deg = [0, 10, 0]\n'
            "angular_velocity_rpm = [0, 0, 400]\n[run]\ndt = 0.001\nsteps = 100\n"
        )
        masses = co.each(np.linspace(4, 6, 5))
        table = co.sweep(str(file), mass=masses, variables=["mu"], store=str(Path(folder) / "sweep"))
        return {str(name): table.dataset[name].values for name in table.dataset.data_vars if "final" in str(name)}


@computation
def optimum() -> Arrays:
    system, _ = braked()
    problem = co.control.Problem(
        system,
        system.state(),
        dt=0.1,
        steps=20,
        inputs={"torque": co.control.Input((3,), lower=-2.0, upper=2.0)},
        cost=lambda motion, p: 0.5 * motion.inputs.torque @ motion.inputs.torque,
        end=co.control.End(g=co.attitude.zyx(0.5, 0.0, 0.0), xi=np.zeros(3)),
    )
    return nodes(problem.solve().run)


@computation
def underwater_vehicle_with_parts() -> Arrays:
    craft = co.vehicles.Craft(co.vehicles.load("remus_100"))
    start = craft.start(speed=1.5, actuators={"propeller": 15.0})
    commands = {"rudder": 0.05, "stern_planes": 0.02, "propeller": 15.0}
    return nodes(co.simulate(craft.system, start, dt=0.05, steps=40, inputs=commands))


def fingerprint(value: object) -> str:
    """SHA-256 of the shape and the bytes of an array, or of the leaves of a PyTree."""
    import jax

    digest = hashlib.sha256()
    for leaf in jax.tree.leaves(value):
        array = np.ascontiguousarray(leaf)
        digest.update(repr((array.shape, array.dtype.str)).encode() + array.tobytes())
    return digest.hexdigest()


def fingerprints(names: list[str]) -> dict[str, dict[str, str]]:
    """The fingerprints of each computation whose name begins with one of `names`, of all without names."""
    chosen = [name for name in COMPUTATIONS if not names or any(name.startswith(part) for part in names)]
    found = {}
    for name in chosen:
        found[name] = {key: fingerprint(value) for key, value in COMPUTATIONS[name]().items()}
        print(f"{len(found)}/{len(chosen)} {name}: {', '.join(found[name])}", flush=True)
    return found


def main(command: str, file: str, *names: str) -> int:
    """Record fingerprints in a file, or compare with it."""
    found = fingerprints(list(names))
    if command == "record":
        Path(file).write_text(json.dumps(found, indent=1))
        return 0
    known = json.loads(Path(file).read_text())
    differing = [
        f"{name}.{key}"
        for name, arrays in known.items()
        if not names or name in found
        for key, digest in arrays.items()
        if found.get(name, {}).get(key) != digest
    ]
    print("\n".join(f"differs: {line}" for line in differing) or f"{len(found)} computations are bitwise identical")
    return 1 if differing else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
