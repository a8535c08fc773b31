"""Whatever is done to a stepper in whatever order, it stands somewhere on its own long run, in memory that stays."""

from __future__ import annotations

import gc
import sys
from typing import Any

import jax
import numpy as np
import pytest

import coadjoint as co
from driven_body import BODY, OBSERVE, REST, SEED, H, stepper

LENGTH = 30
"""Steps of the long run."""


def numbers(state: co.State) -> np.ndarray:
    """All numbers of a state of many members, (members, size)."""
    return np.concatenate([np.reshape(leaf, (len(state.t), -1)) for leaf in jax.tree.leaves(state)], axis=1)


class Walker:
    """Members that step, are reset, saved and restored, with their places on the long run."""

    def __init__(self, folder: Any):
        random = np.random.default_rng(SEED)
        start = BODY.state(xi=co.each(random.normal(size=(11, 3))), inputs=REST, internal={"brake": 0.1})
        self.body, self.path = co.Stepper(BODY, start, dt=H, inputs=REST, observe=OBSERVE), folder / "saved.step"
        self.members = np.arange(self.body.face.count)
        spins = random.normal(size=(LENGTH, len(self.members)))
        torques = random.normal(size=(LENGTH, len(self.members), 3))
        self.commands = [{"spin": spin, "torque": torque} for spin, torque in zip(spins, torques, strict=True)]
        self.place, self.course = np.zeros(len(self.members), int), [numbers(self.body.state)]
        for command in self.commands:
            self.body.step(command)
            self.course.append(numbers(self.body.state))
        self.course = np.array(self.course)
        self.kept: Any = None
        self.reset(None)

    def reset(self, mask: Any) -> None:
        self.body.reset(mask=mask)
        self.place[slice(None) if mask is None else mask] = 0

    def step(self, _: Any) -> None:
        if np.any(self.place == LENGTH):
            self.reset(self.place == LENGTH)
        mine = {name: np.stack([self.commands[k][name][m] for m, k in enumerate(self.place)]) for name in REST}
        self.body.step(mine)
        self.place += 1

    def save(self, _: Any) -> None:
        self.kept = self.body.state, self.place.copy()

    def clone(self, _: Any) -> None:
        self.kept = self.body.clone(), self.place.copy()

    def write(self, _: Any) -> None:
        self.kept = co.load_stepper(self.body.save(self.path, overwrite=True)), self.place.copy()

    def restore(self, mask: Any) -> None:
        if self.kept is not None:
            self.body.restore(self.kept[0], mask=mask)
            self.place[mask] = self.kept[1][mask]

    def go_on_in_a_copy(self, _: Any) -> None:
        self.body = self.body.clone()

    def stands_on_its_run(self) -> bool:
        return np.array_equal(numbers(self.body.state), self.course[self.place, self.members])


@pytest.mark.long
@pytest.mark.parametrize("count", [300, pytest.param(10_000, marks=pytest.mark.long)])
def test_random_sequences_of_reset_step_mask_save_and_restore_equal_one_long_run_to_the_bit(count, tmp_path):
    walker, random = Walker(tmp_path), np.random.default_rng(SEED)
    often: list[Any] = [walker.step] * 8 + [walker.reset, walker.restore, walker.restore, walker.save, walker.clone]
    seldom: list[Any] = [*often, walker.write, walker.go_on_in_a_copy]
    for sequence in range(count):
        for _ in range(random.integers(1, 20)):
            mask = random.random(len(walker.members)) < random.choice([0.1, 0.5, 0.9])
            what = random.choice(seldom if sequence % 10 == 0 else often)
            what(mask)
        assert walker.stands_on_its_run(), f"sequence {sequence} of seed {SEED}"


@pytest.mark.parametrize(("calls", "n"), [(500, 5), pytest.param(100_000, 1000, marks=pytest.mark.long)])
def test_no_step_leaves_an_object_behind(calls, n):
    body = stepper()
    many = stepper(members=11)
    command = {"spin": 0.01, "torque": [0.0, 0.0, 0.0]}

    def go(count):
        for k in range(count):
            body.step(command, n)
            if k % 100 == 0:
                many.step(command, copy=True)
                here = many.clone()
                here.reset(mask=np.arange(11) < 5)
                many.restore(here)

    def growth():
        gc.collect()
        before = sys.getallocatedblocks()
        go(calls)
        gc.collect()
        return sys.getallocatedblocks() - before

    gc.freeze()  # what other tests have left takes a second to look through
    go(max(300, calls))  # until the free lists of Python and NumPy are as long as they get
    # Threads that other tests have left allocate now and then; steps that leave objects do so each time.
    assert growth() < 100 or growth() < 100
    assert body.steps in [(goes * calls + max(300, calls)) * n for goes in (1, 2)]
