"""A vector environment whose rows follow a script, in place of those of machine code."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from coadjoint_vehicles.environments.many import VehicleVectorEnv

PENALTY, MOST, WIDTH = 10.0, 3, 2


class Scripted:
    """Three members with two observations; every period takes the next rows: observations, reward, arrived, far.

    A member that begins is at (−1, the number of its episode). begun, commands: what was asked for.
    """

    def __init__(self, *script: list[list[float]], failing: dict[int, dict[int, str]] | None = None):
        self.script, self.failing, self.count = [np.array(rows) for rows in script], failing or {}, 0
        self.members, self.width, self.most, self.fields = 3, WIDTH, MOST, {"down": slice(0, 1)}
        self.actions = SimpleNamespace(size=4)
        self.ends, self.successes = {"arrived": None, "far": None}, np.array([True, False])
        self.task = SimpleNamespace(penalty=PENALTY)
        self.stepper = SimpleNamespace(failed=np.zeros(3, bool), failures={})
        self.rows = np.zeros((3, WIDTH + 3))
        self.random: list[Any] = [None] * 3
        self.begun: list[list[int]] = []
        self.commands: list[object] = []

    def command(self, actions: object) -> None:
        self.commands.append(actions)

    def step(self) -> None:
        self.rows = self.script[self.count].copy()
        self.count += 1
        self.stepper.failures = self.failing.get(self.count, {})
        self.stepper.failed = np.isin(np.arange(3), list(self.stepper.failures))

    def seed(self, member: int, random: Any, varying: Any) -> None:
        self.random[member] = random, varying

    def begin(self, members: np.ndarray) -> None:
        self.begun.append(members.tolist())
        self.rows[members] = 0.0
        self.rows[members, :WIDTH] = np.column_stack([-np.ones(len(members)), np.full(len(members), len(self.begun))])

    def begin_at(self, members: np.ndarray, given: Any) -> None:
        self.begin(members)
        self.rows[members, 0] = given

    def envs(self, mode: str, own_seed: int | None = None) -> VehicleVectorEnv:
        return VehicleVectorEnv(cast(Any, self), cast(Any, self), own_seed, mode)


GOES = [[1, 1, 0.1, 0, 0], [2, 2, 0.2, 0, 0], [3, 3, 0.3, 0, 0]]
MIDDLE_ENDS = [[4, 4, 0.4, 0, 0], [5, 5, 0.5, 1, 1], [6, 6, 0.6, 0, 0]]
LATE = [[7, 7, 0.7, 0, 0], [8, 8, 0.8, 0, 0], [9, 9, 0.9, 0, 1]]
