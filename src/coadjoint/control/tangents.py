"""Changes of a state by as many numbers as it has directions: δx = T y, and the state that they lead to.

A group element is in x with all entries of its matrix, and the advected directions are fixed by it. So a node changes
by ξ and by the other numbers of x: g ← g exp(ξ), a ← exp(−ξ)·a, which stay on the group, with δg = g ξ̂, δa = −ξ·a to
first order.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.control.linearised import Tables
from coadjoint.control.quadratic import Stages
from coadjoint.control.transcription import Transcription, functions_of
from coadjoint.kernels.trace.tracer import flat
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System


class Directions(NamedTuple):
    """Of N + 1 nodes: the columns of T with ξ, S (N + 1, moved, dim G), and its pseudo-inverse."""

    S: np.ndarray
    inverse: np.ndarray


class Tangents:
    """The directions of a transcription's states. moved: which x change with ξ; kept: those that stay as they are.

    Where the motion does not ask for the whole of g, every number of x is a direction of its own.
    """

    def __init__(self, transcription: Transcription):
        self.nx, self.nu = transcription.sizes[:2]
        graph, names = transcription.graph, transcription.graph.names()
        self.dim = transcription.problem.system.group.dim
        of_group = [i for i, name in enumerate(names) if name.startswith(("g[", "g."))]
        given = [i for i, name in enumerate(names) if name.startswith(("g[", "g.", "a[", "a."))]
        live = {place: x for x, place in enumerate(transcription.live)}
        self.moved = np.array([live[i] for i in given if i in live], int)
        if not of_group or any(i not in live for i in of_group) or len(self.moved) <= self.dim:
            self.moved, self.dim = self.moved[:0], 0
        self._kept = np.setdiff1d(np.arange(self.nx + self.nu), self.moved)
        self._rest = self._kept[self._kept < self.nx]
        self.width = len(self._rest) + self.dim
        if self.dim:
            xi = graph.tracer.symbols("direction ", np.zeros(self.dim))
            slopes, ahead = graph.at_node(_slopes, "A direction"), graph.at_node(_numbers, "A direction", xi)
            places = [k for k, i in enumerate(given) if i in live]
            chosen = [slopes[k * self.dim + j] for k in places for j in range(self.dim)]
            x = transcription.live
            of_slopes = functions_of(graph, [], x, chosen, [], [], [], [], {}).cost
            of_moves = functions_of(graph, flat(xi), x, [ahead[k] for k in places], [], [], [], [], {}).cost
            count = transcription.problem.count + 1
            self._slopes, self._moves = Tables(of_slopes, count), Tables(of_moves, count)

    def directions(self, x: np.ndarray, u: np.ndarray, p: np.ndarray, h: float) -> Directions:
        """T about the nodes of a plan."""
        if not self.dim:
            return Directions(np.zeros((len(x), 0, 0)), np.zeros((len(x), 0, 0)))
        S = self._slopes(x, np.concatenate([u, u[-1:]]), p, h)[0].reshape(len(x), -1, self.dim).copy()
        return Directions(S, np.linalg.solve(S.transpose(0, 2, 1) @ S, S.transpose(0, 2, 1)))

    def reduced(self, s: Stages, directions: Directions) -> Stages:
        """The program of y and u."""
        if not self.dim:
            return s
        here, last, inverse = directions.S[:-1], directions.S[-1], directions.inverse[1:]
        H = self._columns(self._columns(s.H, here).transpose(0, 2, 1), here)
        last_H = self._columns(self._columns(s.last_H, last).T, last)
        return s._replace(
            H=H, g=self._columns(s.g[:, None], here)[:, 0], M=self._rows(self._columns(s.M, here), inverse),
            c=self._rows(s.c[:, :, None], inverse)[:, :, 0], C=self._columns(s.C, here), last_H=last_H,
            last_g=self._columns(s.last_g[None], last)[0], last_C=self._columns(s.last_C, last),
        )  # fmt: skip

    def first(self, change: np.ndarray, directions: Directions) -> np.ndarray:
        """y_0 of a change of the first node, (nx,)."""
        return self._rows(change[:, None], directions.inverse[0])[:, 0] if self.dim else change

    def linear(self, y: np.ndarray, directions: Directions) -> np.ndarray:
        """δx = T y, (N + 1, nx), of y (N + 1, width)."""
        if not self.dim:
            return y
        found = np.zeros((len(y), self.nx))
        found[:, self.moved] = (directions.S @ y[:, : self.dim, None])[:, :, 0]
        found[:, self._rest] = y[:, self.dim :]
        return found

    def moved_by(self, x: np.ndarray, y: np.ndarray, u: np.ndarray, p: np.ndarray, h: float) -> np.ndarray:
        """The nodes (N + 1, nx) that y leads to, on the group."""
        if not self.dim:
            return x + y
        found, p = x.copy(), np.concatenate([np.broadcast_to(p, (len(x), len(p))), y[:, : self.dim]], axis=1)
        found[:, self.moved] = self._moves(x, np.concatenate([u, u[-1:]]), p, h)[0]
        found[:, self._rest] += y[:, self.dim :]
        return found

    def _columns(self, values: np.ndarray, S: np.ndarray) -> np.ndarray:
        """values (…, nx) or (…, nx + nu) by y, and u."""
        kept = self._rest if values.shape[-1] == self.nx else self._kept
        return np.concatenate([values[..., self.moved] @ S, values[..., kept]], axis=-1)

    def _rows(self, values: np.ndarray, inverse: np.ndarray) -> np.ndarray:
        """y of values (…, nx, n)."""
        return np.concatenate([inverse @ values[..., self.moved, :], values[..., self._rest, :]], axis=-2)


def _numbers(system: System, state: State, xi: Any) -> Any:
    """The numbers of g exp(ξ) and exp(−ξ)·a."""
    group, _, V = system.places
    parts = [group.compose(state.g, group.exp(xi))]
    if V.dim(group):
        parts.append(V.act(group, group.exp(-xi), state.a))
    return jnp.concatenate([jnp.ravel(leaf) for leaf in jax.tree_util.tree_leaves(parts)])


def _slopes(system: System, state: State) -> Any:
    """Their derivatives by ξ at 0, (rows, dim G)."""
    return jax.jacfwd(lambda xi: _numbers(system, state, xi))(np.zeros(system.group.dim))
