"""Errors of the states of a system that are invariant under its group, as the coordinates of a filter's process."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError, GroupError
from coadjoint.estimation.process import Process
from coadjoint.groups.element_statistics import logarithms
from coadjoint.kernels.packing import Layout, flattened
from coadjoint.kernels.run.function import RowFunction
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System


class InvariantErrors(Process):
    """Rows of a state of a system with numbers θ behind it, and errors e = (η, δq, δμ, δπ, δθ) about them.

    error: "left", in body axes, or "right", in those of space; see `ModelProcess`.
    """

    error: str
    _system: System
    _layout: Layout
    _first: np.ndarray

    def _unpacked(self, row: Array) -> tuple[State, PyTree]:
        size = self._layout.size
        return self._layout.views(row[:size]), row[size:]

    def _split(self, e: Array) -> list[PyTree]:
        group, Q, _ = self._system.places
        d, q = group.dim, Q.ambient(group)
        ends = np.cumsum([0, d, q, d, q])
        return [e[a:b] for a, b in zip(ends, [*ends[1:], self.width], strict=True)]

    def retract(self, row: Array, e: Array) -> Array:
        (group, Q, V), (state, theta) = self._system.places, self._unpacked(row)
        eta, dq, dmu, dpi, dtheta = self._split(e)
        turn = group.exp(eta)
        if self.error == "left":
            g, back = group.compose(state.g, turn), group.inverse(turn)
            n, mu, pi = Q.act(group, back, state.n + dq), state.mu + dmu, state.pi + dpi
        else:
            g = group.compose(turn, state.g)
            back = group.compose(group.inverse(g), state.g)
            n = state.n + Q.push(group, group.inverse(g), state.n, dq)
            mu, pi = state.mu + group.Ad_dual(g, dmu), state.pi + Q.pull(group, g, state.n, dpi)
        moved = state.replace(g=g, n=n, a=V.act(group, back, state.a), mu=mu, pi=pi)
        return jnp.concatenate([flattened(moved), theta + dtheta])

    def differ(self, row: Array, other: Any) -> Array:
        """e with other = retract(row, e), (n,): η to first order, the others exactly."""
        (group, Q, _), (a, theta), (b, later) = self._system.places, self._unpacked(row), self._unpacked(other)
        if self.error == "left":
            turn = group.compose(group.inverse(a.g), b.g)
            dq, dmu, dpi = Q.act(group, turn, b.n) - a.n, b.mu - a.mu, b.pi - a.pi
        else:
            turn, back = group.compose(b.g, group.inverse(a.g)), group.inverse(b.g)
            dq = Q.push(group, b.g, a.n, b.n - a.n)
            dmu, dpi = group.Ad_dual(back, b.mu - a.mu), Q.pull(group, back, a.n, b.pi - a.pi)
        eta = group.vee(group.matrix(turn) - jnp.eye(group.matrix_size))
        return jnp.concatenate([eta, dq, dmu, dpi, later - theta])

    def errors(self, rows: np.ndarray, others: np.ndarray) -> np.ndarray:
        e, group = super().errors(rows, others), self._system.group
        both = np.concatenate([rows, others], axis=-1).reshape(-1, 2 * rows.shape[-1])
        turns, _ = self._turning(np.zeros((len(both), 0)), both)
        size = group.matrix_size
        e[..., : group.dim] = self._apart(turns.reshape(-1, size, size)).reshape(*e.shape[:-1], group.dim)
        return e

    def _apart(self, turns: np.ndarray) -> np.ndarray:
        """η, (count, dim G), with exp(η) = turns, matrices (count, k, k); raises ArgumentError if there is none."""
        group = self._system.group
        try:
            return logarithms(group, evaluate(jax.vmap(group.from_matrix), turns))
        except GroupError as error:
            raise ArgumentError(
                "An estimate and the truth differ by an element of the group that is not an exponential, such as half "
                f"a turn, so that their error has no coordinates. {error}"
            ) from error

    @cached_property
    def _turning(self) -> RowFunction:
        """(), (x, y) ↦ ĝ⁻¹g, or gĝ⁻¹ of right errors, as a matrix."""
        group, size = self._system.group, len(self._first)

        def turning(x: Array, y: Array) -> Array:
            a, b = self._unpacked(y[:size])[0].g, self._unpacked(y[size:])[0].g
            pair = (group.inverse(a), b) if self.error == "left" else (b, group.inverse(a))
            return jnp.ravel(group.matrix(group.compose(*pair)))

        return RowFunction(turning, np.zeros(0), np.concatenate([self._first, self._first]))
