"""The quadratic program of a horizon between the bounds of its inputs and of its path."""

from __future__ import annotations

from typing import Any

import numpy as np

from coadjoint.control.arrival_cost import Quadratic
from coadjoint.control.library import casadi
from coadjoint.control.linearised import Tables, with_jacobian
from coadjoint.control.window import HorizonMotion, Window
from coadjoint.errors import OptimumError

ROUND_OFF = 1e-9
"""By how much the least of a program may leave its bounds, so that they need no other solver."""

BLIND = 1e-6
"""Curvature, of 1, of a program along directions that its cost does not determine, so that only bounds move it
there."""


class HorizonLimits:
    """Bounds of the inputs that are not known, and of the path, at every node of a horizon."""

    def __init__(self, window: Window):
        self._window, transcription = window, window.transcription
        sides = []
        for side in ("lower", "upper"):
            found = np.zeros(window.nu)
            for one in transcription.columns:
                found[one.begin] = np.ravel(getattr(one.given, side))
            sides.append(found[window.free])
        self._inputs = sides
        path = transcription.path
        self._path = [np.concatenate([getattr(rows, side) for rows in path] or [[]]) for side in ("lower", "upper")]
        self._values = (
            Tables(with_jacobian(transcription.functions.path, "path", None), window.most + 1) if path else None
        )
        self._solvers: dict[tuple[int, int], Any] = {}

    def solved(self, cost: Quadratic, nodes: list[tuple[np.ndarray, np.ndarray]], motion: HorizonMotion) -> np.ndarray:
        """v of the least cost between the bounds; raises OptimumError where nothing lies between them."""
        v = cost.least()
        rows, lower, upper, names = self._rows(nodes, motion, len(v))
        inside = rows @ v
        if np.all(inside >= lower - ROUND_OFF) and np.all(inside <= upper + ROUND_OFF):
            return v
        ca = casadi()
        key = rows.shape
        if key not in self._solvers:
            shapes = {"h": ca.Sparsity.dense(key[1], key[1]), "a": ca.Sparsity.dense(*key)}
            options = {"error_on_fail": False, "print_time": False, "printLevel": "none"}
            self._solvers[key] = ca.conic("horizon", "qpoases", shapes, options)
        _, blind, units = cost.spread()
        units, seen = 1.0 / units, np.eye(len(v)) - blind @ blind.T
        H = seen @ (cost.H * units * units[:, None]) @ seen + BLIND * blind @ blind.T
        solver = self._solvers[key]
        found = solver(h=H, g=seen @ (cost.g * units), a=rows * units, lba=lower, uba=upper)
        if not solver.stats()["success"]:
            excess = np.maximum(lower - inside, inside - upper)
            raise OptimumError(
                "No motion of the horizon lies between all bounds: the measurements violate most "
                f"{names[int(np.argmax(excess))]}, by {np.max(excess):.3g}."
            )
        return found["x"].full().ravel() * units

    def _rows(
        self, nodes: list[tuple[np.ndarray, np.ndarray]], motion: HorizonMotion, size: int
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[str]]:
        """C, lower and upper of lower ≤ C v ≤ upper, and what each row is."""
        w, n, nf = self._window, motion.steps, len(self._window.free)
        m = size - n * nf
        held = np.tile(np.any(np.isfinite(self._inputs), axis=0), n)
        rows = np.eye(size)[m:][held]
        u = motion.u[:, w.free].ravel()
        limits = [(np.tile(side, n) - u)[held] for side in self._inputs]
        of_inputs = [one.name for one in w.transcription.columns for _ in range(one.begin.start, one.begin.stop)]
        names = [f"the bounds of input `{one}`" for one in np.tile(np.array(of_inputs, object)[w.free], n)[held]]
        if self._values is None:
            return rows, limits[0], limits[1], names
        x, u, _ = w.padded(motion)
        values, slopes = self._values(x, np.concatenate([u, u[-1:]]), w.p, w.h)
        slopes = slopes.reshape(w.most + 1, values.shape[1], w.nx + w.nu)
        T, _ = w.directions(x, u)
        found, sides = [rows], [[limits[0]], [limits[1]]]
        for k, (a, G) in enumerate(nodes):
            C = slopes[k, :, : w.nx] @ T[k]
            own = C @ G
            if n:
                own[:, m + min(k, n - 1) * nf + np.arange(nf)] += slopes[k][:, w.nx + w.free]
            found.append(own)
            names += [one.what for one in w.transcription.path for _ in one.lower]
            for parts, side in zip(sides, self._path, strict=True):
                parts.append(side - values[k] - C @ a)
        return np.concatenate(found), np.concatenate(sides[0]), np.concatenate(sides[1]), names
