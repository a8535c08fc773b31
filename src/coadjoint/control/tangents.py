"""Changes of a state in coordinates of its directions: δx = T y, and the resulting state.

A group element is in x with all entries of its matrix, and the advected directions are fixed by it. So a node changes
by ξ and by the other numbers of x: g ← g exp(ξ), a ← exp(−ξ)·a, which stay on the group, with δg = g ξ̂, δa = −ξ·a to
first order.
"""

from __future__ import annotations

import jax
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.control.library import casadi
from coadjoint.control.linearised import Tables
from coadjoint.control.step_functions import StepColumns
from coadjoint.control.transcription import Transcription
from coadjoint.kernels.packing import flattened
from coadjoint.kernels.trace.tracer import flat
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System


class Tangents:
    """The directions of a transcription's states, y = (ξ, the numbers of x that do not change with ξ).

    If the motion does not depend on all of g, every number of x is a separate direction.
    """

    def __init__(self, transcription: Transcription):
        self.nx, self.nu, _, count = transcription.sizes
        self._np = count + len(transcription.given)
        graph, names = transcription.graph, transcription.graph.names()
        self.dim = transcription.problem.system.group.dim
        of_group = [i for i, name in enumerate(names) if name.startswith(("g[", "g."))]
        given = [i for i, name in enumerate(names) if name.startswith(("g[", "g.", "a[", "a."))]
        live = {place: x for x, place in enumerate(transcription.live)}
        self.moved = np.array([live[i] for i in given if i in live], int)
        if not of_group or any(i not in live for i in of_group) or len(self.moved) <= self.dim:
            self.moved, self.dim = self.moved[:0], 0
        self.rest = np.setdiff1d(np.arange(self.nx), self.moved)
        self.width = len(self.rest) + self.dim
        if self.dim:
            xi = graph.tracer.symbols("direction ", np.zeros(self.dim))
            slopes, ahead = graph.of_place(_slopes, "A direction"), graph.of_place(_numbers, "A direction", xi)
            places = [k for k, i in enumerate(given) if i in live]
            chosen = [slopes[k * self.dim + j] for k in places for j in range(self.dim)]
            x = transcription.live
            self._of_slopes = StepColumns(graph, [], x).of_node("slopes", chosen)
            of_moves = StepColumns(graph, flat(xi), x).of_node("moves", [ahead[k] for k in places])
            count = transcription.problem.count + 1
            self._slopes, self._moves = Tables(self._of_slopes, count), Tables(of_moves, count)

    def inverses(self, x: np.ndarray, u: np.ndarray, p: np.ndarray, h: float) -> np.ndarray:
        """(N + 1, dim G, moved): the pseudo-inverses of ∂x/∂ξ at the nodes of a plan, of the x that change with ξ."""
        if not self.dim:
            return np.zeros((len(x), 0, 0))
        S = self._slopes(x, np.concatenate([u, u[-1:]]), p, h)[0].reshape(len(x), -1, self.dim)
        across = S.transpose(0, 2, 1)
        return np.linalg.solve(across @ S, across)

    def matrices(self, x: np.ndarray, u: np.ndarray, p: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
        """T (N + 1, nx, width) of the nodes of a plan, and its pseudo-inverse (N + 1, width, nx)."""
        count, rest = len(x), np.arange(self.width)[self.dim :]
        T, inverse = np.zeros((count, self.nx, self.width)), np.zeros((count, self.width, self.nx))
        T[:, self.rest, rest], inverse[:, rest, self.rest] = 1.0, 1.0
        if self.dim:
            inverse[:, : self.dim, self.moved] = self.inverses(x, u, p, h)
            S = self._slopes(x, np.concatenate([u, u[-1:]]), p, h)[0]
            T[:, self.moved, : self.dim] = S.reshape(count, -1, self.dim)
        return T, inverse

    def columns(self, scale: np.ndarray) -> PyTree:
        """∂(x, u)/∂w of w = (y, u/scale), (nx + nu, width + nu), as a function of CasADi of (x, u, p, h)."""
        ca, width, sizes = casadi(), self.width, (self.nx, self.nu, self._np, 1)
        x, u, p, h = symbols = [ca.SX.sym(key, size) for key, size in zip("xuph", sizes, strict=True)]
        W = ca.SX(self.nx + self.nu, width + self.nu)
        if self.dim:
            slopes = ca.reshape(self._of_slopes(x, u, p, h), self.dim, len(self.moved)).T
            for row, place in enumerate(self.moved):
                W[int(place), : self.dim] = slopes[row, :]
        for k, place in enumerate(self.rest):
            W[int(place), self.dim + k] = 1.0
        for k, size in enumerate(scale):
            W[self.nx + k, width + k] = float(size)
        return ca.Function("columns", symbols, [ca.sparsify(W)], list("xuph"), ["W"])

    def rows(self, values: np.ndarray, inverse: np.ndarray) -> np.ndarray:
        """y of values (N, nx, n), changes of x at the nodes whose pseudo-inverses (N, dim, moved) are given."""
        if not self.dim:
            return values
        found = np.empty((len(values), self.width, values.shape[2]))
        np.matmul(inverse, values[:, self.moved], out=found[:, : self.dim])
        found[:, self.dim :] = values[:, self.rest]
        return found

    def first(self, change: np.ndarray, inverses: np.ndarray) -> np.ndarray:
        """y_0 of a change of the first node, (nx,)."""
        return self.rows(change[None, :, None], inverses[:1])[0, :, 0]

    def moved_by(self, x: np.ndarray, y: np.ndarray, u: np.ndarray, p: np.ndarray, h: float) -> np.ndarray:
        """The nodes (N + 1, nx) that y leads to, on the group."""
        if not self.dim:
            return x + y
        found, p = x.copy(), np.concatenate([np.broadcast_to(p, (len(x), len(p))), y[:, : self.dim]], axis=1)
        found[:, self.moved] = self._moves(x, np.concatenate([u, u[-1:]]), p, h)[0]
        found[:, self.rest] += y[:, self.dim :]
        return found


def _numbers(system: System, state: State, xi: Array) -> PyTree:
    """The numbers of g exp(ξ) and exp(−ξ)·a."""
    group, _, V = system.places
    parts = [group.compose(state.g, group.exp(xi))]
    if V.dim(group):
        parts.append(V.act(group, group.exp(-xi), state.a))
    return flattened(parts)


def _slopes(system: System, state: State) -> PyTree:
    """Their derivatives by ξ at 0, (rows, dim G)."""
    return jax.jacfwd(lambda xi: _numbers(system, state, xi))(np.zeros(system.group.dim))
