"""The memory of a stepper, allocated once: parameters, states, commands and their limits, observations, status."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from coadjoint.kernels.program import Code


class Buffers(NamedTuple):
    """Arrays that machine code reads and writes; lanes beyond the last member repeat it and wait.

    parameters (groups or 1, size, lanes), h (lanes,), state (groups, size, lanes), status (groups, 4, lanes): steps
    done since the last reset, code, Newton's iterations and the most of one step; commands and observations
    (groups · lanes, size); limits (2, commands, lanes): the lowest and highest commands, infinite where there are none.
    """

    parameters: np.ndarray
    h: np.ndarray
    state: np.ndarray
    status: np.ndarray
    commands: np.ndarray
    observations: np.ndarray
    limits: np.ndarray

    @classmethod
    def filled(cls, parameters: np.ndarray, h: float, state: np.ndarray, sizes: tuple[int, int], lanes: int) -> Buffers:
        """From parameters (members or 1, size) and states (members, size); sizes of commands and observations.

        Commands are without limits.
        """
        members = len(state)
        groups = -(-members // lanes)
        status, idle = np.zeros((groups, 4, lanes), np.int64), np.arange(members, groups * lanes)
        status[idle // lanes, 1, idle % lanes] = Code.ABSENT
        return cls(
            parameters=_grouped(parameters, 1 if len(parameters) == 1 else groups, lanes),
            h=np.full(lanes, float(h)),
            state=_grouped(state, groups, lanes),
            status=status,
            commands=np.zeros((groups * lanes, sizes[0])),
            observations=np.zeros((groups * lanes, sizes[1])),
            limits=unlimited(sizes[0], lanes),
        )

    def with_limits(self, ends: np.ndarray) -> Buffers:
        """The same memory with lowest and highest commands (2, commands)."""
        return self._replace(limits=np.repeat(ends[..., None], len(self.h), axis=2))

    def with_parameters(self, rows: np.ndarray, shared: bool | None = None) -> Buffers:
        """The same memory with parameters (members, size); shared where all are the same, if not said otherwise."""
        groups, _, lanes = self.state.shape
        shared = bool(np.all(rows == rows[0])) if shared is None else shared
        return self._replace(parameters=_grouped(rows[:1] if shared else rows, 1 if shared else groups, lanes))

    def copy(self) -> Buffers:
        """The same numbers in memory of their own."""
        return Buffers(*(array.copy() for array in self))

    def context(self) -> np.ndarray:
        """What machine code is given: `kernels.emit.online.CONTEXT`."""
        p = self.parameters
        stride = 0 if len(p) == 1 else p.shape[1] * p.shape[2]
        arrays = (self.h, self.state, self.status, self.commands, self.observations, self.limits)
        return np.array([p.ctypes.data, stride, *(array.ctypes.data for array in arrays)], np.int64)


def unlimited(commands: int, lanes: int) -> np.ndarray:
    """Limits (2, commands, lanes) that no command goes beyond."""
    return np.broadcast_to(np.array([-np.inf, np.inf])[:, None, None], (2, commands, lanes)).copy()


def by_member(grouped: np.ndarray) -> np.ndarray:
    """A copy (groups · lanes, size) of an array (groups, size, lanes)."""
    groups, size, lanes = grouped.shape
    return grouped.swapaxes(1, 2).reshape(groups * lanes, size).copy()


def put(grouped: np.ndarray, members: np.ndarray, rows: np.ndarray) -> None:
    """Write rows (k, size) of these members (k,) into an array (groups, size, lanes)."""
    lanes = grouped.shape[2]
    grouped[members // lanes, :, members % lanes] = rows


def _grouped(rows: np.ndarray, groups: int, lanes: int) -> np.ndarray:
    index = np.minimum(np.arange(groups * lanes), len(rows) - 1).reshape(groups, lanes)
    return np.ascontiguousarray(rows[index].swapaxes(1, 2))
