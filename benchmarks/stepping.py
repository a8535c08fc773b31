"""One control period at a time: co.Stepper, the hand-written vehicle of the paper, MuJoCo, PythonVehicleSimulator."""

from __future__ import annotations

import importlib.util
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

import coadjoint as co
import coadjoint_vehicles as vehicles
from benchmarks.clock import Contender, interleaved, table_of
from coadjoint_vehicles import Craft

DT, PERIOD = 0.05, 2
"""s, and steps of a control period."""
COMMANDS = {"stern_planes": 0.0, "rudder": 0.0, "propeller": 15.0}
YARDSTICK = "co.Stepper, REMUS 100"
SEED = 20

FREE_BODY = f"""<mujoco><option timestep="{DT}" integrator="{{integrator}}" density="1026" viscosity="0.00109">
<flag contact="disable"/></option><worldbody><body gravcomp="1"><freejoint/>
<geom type="ellipsoid" size="0.8 0.095 0.095" density="1026" fluidshape="ellipsoid"/><site name="tail" pos="-0.8 0 0"/>
</body></worldbody><actuator><motor site="tail" gear="1 0 0 0 0 0"/><motor site="tail" gear="0 1 0 0 0 0"/>
<motor site="tail" gear="0 0 1 0 0 0"/></actuator></mujoco>"""
"""An ellipsoid of the size of REMUS 100 with MuJoCo's own model of a fluid, and three forces at its tail."""

CHILD = """import time
import coadjoint as co
stepper = co.load_stepper({path!r})
stepper.step({{"rudder": 0.1}}, n=2)
print(time.process_time())"""


def remus(members: int | None = None) -> co.Stepper:
    """REMUS 100 with its fins and propeller as commands."""
    craft = Craft(vehicles.load("remus_100"))
    start = craft.start(speed=1.5, actuators={"propeller": 15.0})
    observe = {"q": lambda s: s.q, "nu": lambda s: s.nu, "xi": lambda s: s.xi, "down": lambda s: s.named.a.down}
    return co.Stepper(craft.system, start, dt=DT, inputs=COMMANDS, observe=observe, members=members)


def measure(quick: bool) -> dict[str, Any]:
    """Processor time of a control period: of one vehicle, of many, and of a saved stepper from its file on."""
    times, missing = (3, []) if quick else (9, [])
    calls, counts = (2000, (64,)) if quick else (20_000, (64, 2048, 16384))
    return {
        "one": table_of(interleaved(_singles(calls, missing), times), YARDSTICK),
        "many": {str(count): _many(count, 3 if quick else 5, missing) for count in counts},
        "saved": statistics.median(_saved(remus()) for _ in range(3)),
        "missing": sorted(set(missing)),
    }


def _moving(random: np.random.Generator, count: int) -> np.ndarray:
    """Fins (rad) and propeller (rev/s) of `count` vehicles."""
    return random.uniform(-0.1, 0.1, (count, 3)) + np.array([0.0, 0.0, 15.0])


def _called(period: Callable[[int], object], calls: int) -> Contender:
    def run() -> None:
        for i in range(calls):
            period(i)

    return Contender(run, calls)


def _singles(calls: int, missing: list[str]) -> dict[str, Contender]:
    body, rows = remus(), _moving(np.random.default_rng(SEED), 64)
    given = [tuple(map(float, row)) for row in rows]
    named = [dict(zip(COMMANDS, row, strict=True)) for row in given]
    found = {
        YARDSTICK: _called(lambda i: body.step(given[i & 63], PERIOD), calls),
        f"{YARDSTICK}, commands by names": _called(lambda i: body.step(named[i & 63], PERIOD), calls),
        f"{YARDSTICK}, observations copied": _called(lambda i: body.step(given[i & 63], PERIOD, copy=True), calls),
        **_papers_vehicle(calls),
    }
    if _installed("mujoco", "MuJoCo", missing):
        for integrator in ("Euler", "RK4"):
            found[f"mj_step, {integrator}, a free ellipsoid"] = _called(_by_mujoco(integrator, rows), calls)
    if _installed("python_vehicle_simulator", "PythonVehicleSimulator", missing):
        found["PythonVehicleSimulator, remus100"] = _called(_by_python_vehicle_simulator(), max(calls // 20, 10))
    return found


def _papers_vehicle(calls: int) -> dict[str, Contender]:
    """The paper's vehicle without commands, by the stepper and by the hand-written loop called from Python."""
    from benchmarks import kernels_yardstick
    from benchmarks.one import PAPER, H
    from benchmarks.problems import vehicle

    problem = vehicle()
    ours = co.Stepper(problem.system, problem.start, dt=H, method=PAPER, observe={"n": lambda s: s.n})
    s = PAPER.begin(problem.system, problem.start, H)
    parts = [np.ravel(x) for x in (s.t, s.g, s.n, s.a, s.mu, s.pi, s.xi, s.nu)]
    state, out, numbers = np.concatenate(parts), np.empty((1, 28)), problem.body.numbers

    def by_hand(_: int) -> None:
        kernels_yardstick.run(numbers, H, state, 1, PERIOD, out)

    return {
        "co.Stepper, the paper's vehicle": _called(lambda _: ours.step(None, PERIOD), calls),
        "hand-written, numba, the paper's vehicle": _called(by_hand, calls),
    }


def _many(count: int, times: int, missing: list[str]) -> dict[str, Any]:
    """Control periods with commands that move: seconds of each member's."""
    fleet, random = remus(count), np.random.default_rng(SEED)
    commands = [_moving(random, count) for _ in range(16)]
    calls = max(1, 60_000 // count)

    def ours() -> None:
        for i in range(calls):
            fleet.step(commands[i & 15], PERIOD)

    contenders = {YARDSTICK: Contender(ours, calls * count)}
    if _installed("mujoco", "MuJoCo", missing):
        contenders["mujoco.rollout, Euler, a free ellipsoid"] = Contender(_rollout(count, commands), count)
    return table_of(interleaved(contenders, times), YARDSTICK)


def _by_mujoco(integrator: str, commands: np.ndarray) -> Callable[[int], object]:
    mujoco: Any = import_module("mujoco")
    mujoco.set_mju_user_warning(lambda message: None)
    model = mujoco.MjModel.from_xml_string(FREE_BODY.format(integrator=integrator))
    data = mujoco.MjData(model)

    def period(i: int) -> object:
        data.ctrl[:] = commands[i & 63]
        mujoco.mj_step(model, data, nstep=PERIOD)
        return data.qpos

    return period


def _rollout(count: int, commands: list[np.ndarray]) -> Callable[[], object]:
    mujoco, rollout = import_module("mujoco"), import_module("mujoco.rollout")
    mujoco.set_mju_user_warning(lambda message: None)
    model = mujoco.MjModel.from_xml_string(FREE_BODY.format(integrator="Euler"))
    data = mujoco.MjData(model)
    states = np.zeros((count, mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)))
    mujoco.mj_getState(model, data, states[0], mujoco.mjtState.mjSTATE_FULLPHYSICS)
    states[:] = states[0]
    control = np.repeat(commands[0][:, None], PERIOD, axis=1)
    return lambda: rollout.rollout(model, [data], states, control, nstep=PERIOD)


def _by_python_vehicle_simulator() -> Callable[[int], object]:
    simulator = import_module("python_vehicle_simulator.vehicles.remus100").remus100("stepInput", 30, 0, 1525, 0, 0)
    eta, nu, u = np.zeros(6), np.array([1.5, 0, 0, 0, 0, 0]), np.array([0.0, 0.0, 1525.0])

    def period(_: int) -> object:
        found, actual = nu, np.zeros(3)
        for _ in range(PERIOD):
            found, actual = simulator.dynamics(eta, found, actual, u, DT)
        return found

    return period


def _saved(stepper: co.Stepper) -> float:
    """Seconds of processor time from the start of a process to the first step of a saved stepper."""
    with tempfile.TemporaryDirectory() as folder:
        path = stepper.save(Path(folder) / "remus.step")
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        command = [sys.executable, "-c", CHILD.format(path=str(path))]
        done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    return float(done.stdout)


def _installed(module: str, name: str, missing: list[str]) -> bool:
    if importlib.util.find_spec(module) is None:
        missing.append(name)
        return False
    return True
