"""Environments of Gymnasium: one vehicle and thousands, beside the steppers beneath them."""

from __future__ import annotations

import socket
import struct
from collections.abc import Callable
from threading import Thread
from typing import Any

import numpy as np

import coadjoint_vehicles as vehicles
from benchmarks.clock import Contender, interleaved, table_of
from coadjoint_vehicles import Craft
from coadjoint_vehicles.serving import Lockstep, Loop, Served, motors

NAME, SEED = "bluerov2_heavy_von_benzon", 20
YARDSTICK = "co.Stepper, commands in, the same observations out"
UNCERTAIN = {"mass": "2 %", "added_mass": "10 %", "damping.linear": "20 %", "damping.quadratic": "20 %"}


def measure(quick: bool) -> dict[str, Any]:
    """Processor time of a period of BlueROV2 Heavy, two steps of 0.05 s, with actions that jump: one, and many."""
    times, counts = (3, (64,)) if quick else (7, (64, 2048))
    return {
        "one": table_of(interleaved(_one(500 if quick else 5000), times), YARDSTICK),
        "many": {str(count): _many(count, times, 20_000 if quick else 400_000) for count in counts},
    }


def _one(calls: int) -> dict[str, Contender]:
    env = vehicles.environment(NAME)
    given = np.random.default_rng(SEED).uniform(-1.0, 1.0, (64, env.actions.size))
    commands = [env.actions.commands(action, ()) for action in given]
    stepper = env.stepper.clone()

    def alone() -> None:
        stepper.reset()
        for i in range(calls):
            stepper.step(commands[i & 63], env.simulated.steps)

    def through_gymnasium() -> None:
        env.reset(seed=SEED)
        for i in range(calls):
            _, _, terminated, truncated, _ = env.step(given[i & 63])
            if terminated or truncated:
                env.reset()

    craft = Craft(vehicles.load(NAME))
    served = Served(craft, craft.start(position=(0, 0, 5.0)), 1 / 400)
    return {
        YARDSTICK: Contender(alone, calls),
        "Env.step": Contender(through_gymnasium, calls),
        "ArduPilot over UDP, a frame of one step, both ends": Contender(lambda: _frames(served, calls), calls),
    }


def _frames(served: Served, calls: int) -> None:
    """Frames of ArduPilot's protocol from one thread to another and back."""
    served.reset()
    thrusters: Any = served.craft.vehicle.part("thrusters")
    loop = Loop("127.0.0.1", 0)
    lockstep = Lockstep(lambda rate: served, thrusters, motors("vectored_6dof", thrusters))
    address = loop.address
    server = Thread(target=loop.run, args=(lockstep, calls, 20.0))
    server.start()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
        own.settimeout(20.0)
        for frame in range(calls):
            own.sendto(struct.pack("<HHI16H", 18458, 400, frame, *[1500 + frame % 3] * 8, *[0] * 8), address)
            own.recv(65_536)
    server.join()


def _many(count: int, times: int, periods: int) -> dict[str, Any]:
    """Periods of `count` vehicles: seconds of each one's."""
    calls = max(1, periods // count)
    plain = vehicles.vector_environment(NAME, num_envs=count)
    random = np.random.default_rng(SEED)
    given = [random.uniform(-1.0, 1.0, plain.action_space.shape) for _ in range(16)]
    commands = [plain.actions.commands(actions, (count,)) for actions in given]
    stepper = plain.stepper.clone()

    def alone() -> None:
        stepper.reset()
        for i in range(calls):
            stepper.step(commands[i & 15], plain.simulated.steps)

    def through(envs: Any) -> Callable[[], None]:
        envs.reset(seed=SEED)

        def run() -> None:
            for i in range(calls):
                envs.step(given[i & 15])

        return run

    others = {
        "VectorEnv, next step": plain,
        "VectorEnv, same step": vehicles.vector_environment(NAME, num_envs=count, autoreset="same_step"),
        "VectorEnv, uncertain vehicles": vehicles.vector_environment(NAME, num_envs=count, randomise=UNCERTAIN),
    }
    contenders = {YARDSTICK: Contender(alone, calls * count)}
    contenders |= {name: Contender(through(envs), calls * count) for name, envs in others.items()}
    return table_of(interleaved(contenders, times), YARDSTICK)
