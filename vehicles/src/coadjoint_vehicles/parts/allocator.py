"""The share of each thruster in a wrench: the axes that thrusters control, and the thrusts within their limits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array
from coadjoint_vehicles.parts.bounded_thrusts import bounded, independent
from coadjoint_vehicles.parts.dead_bands import outside

AXES = ("surge", "sway", "heave", "roll", "pitch", "yaw")
LEAST_AUTHORITY = 5e-3
"""The part of the largest singular value below which a direction is uncontrollable: data have three digits."""
ATTITUDE_FIRST = (1.0, 1.0, 1.0, 100.0, 100.0, 100.0)
"""The weights of the axes by default: at limits, force gives way before torque."""


@dataclass(frozen=True, eq=False)
class Allocator:
    """Thrusts f with B f = W along the controllable axes, of those the least Σ_i (v_i f_i)², within l ≤ f ≤ u.

    matrix: B, (6, n). low, high: l ≤ 0 ≤ u, (n,) N, infinite without limits. With S = diag(1, 1, 1, 1/L, 1/L, 1/L), L
    the root mean square arm of the thrusters, and F = diag(max(−l, u)), a left singular vector of S B F whose singular
    value is below `least_authority` of the largest is an uncontrollable direction. For each of them the axis of its
    largest entry is left out. The others get what they ask for, and what comes with it along that axis, such as the
    pitch of thrusters below the centre of mass, is left to the vehicle.

    weights: w, (6,) of the axes, torques divided by L: where a limit is in the way, the thrusts within the limits have
    least Σ_j (w_j (B f − W)_j)² over the controllable axes. thruster_weights: v, (n,), all alike by default.
    coupling: (3, 3), m: of the torque, for which attitude comes before position, the part C F that goes with the force
    F, so that of a force that limits take away C goes with it.
    edges: the thrusts at both edges of each dead band, (2, n) N, None without bands: f is 0, an edge, or beyond it.
    """

    matrix: np.ndarray
    low: np.ndarray
    high: np.ndarray
    least_authority: float = LEAST_AUTHORITY
    weights: Sequence[float] | np.ndarray = ATTITUDE_FIRST
    thruster_weights: np.ndarray | None = None
    edges: np.ndarray | None = None
    coupling: np.ndarray | None = None

    @cached_property
    def units(self) -> np.ndarray:
        """(1, 1, 1, L, L, L); L is 1 m where no thruster has an arm."""
        force, torque = (float(np.linalg.norm(rows * self._largest)) for rows in (self.matrix[:3], self.matrix[3:]))
        return np.repeat([1.0, torque / force if force > 0 and torque > 0 else 1.0], 3)

    @cached_property
    def _largest(self) -> np.ndarray:
        found = np.maximum(-self.low, self.high)
        return np.where(np.isfinite(found), found, 1.0)

    @cached_property
    def left_out(self) -> dict[int, float]:
        """The axes (0 surge … 5 yaw) that thrusters do not control, each with its part of the largest authority."""
        vectors, values, _ = np.linalg.svd(self.matrix * self._largest / self.units[:, None])
        shares = np.zeros(6)
        shares[: len(values)] = values / max(values[0], 1e-300)
        found: dict[int, float] = {}
        rest = vectors[:, shares < self.least_authority]
        for share in shares[shares < self.least_authority]:
            sizes = np.round(np.linalg.norm(rest, axis=1), 6)
            axis = max((axis for axis in range(6) if axis not in found), key=lambda axis: (sizes[axis], axis))
            found[axis] = float(share)
            along = rest[axis] / max(float(np.linalg.norm(rest[axis])), 1e-300)
            rest = rest - np.outer(rest @ along, along)
        return found

    @property
    def kept(self) -> np.ndarray:
        """The controllable axes, 0 to 5."""
        return np.array([axis for axis in range(6) if axis not in self.left_out], dtype=int)

    @cached_property
    def inverse(self) -> np.ndarray:
        """B⁺ of the controllable axes, (n, 6), with zeros for the others."""
        found = np.zeros(self.matrix.T.shape)
        working = np.any(self.matrix != 0, axis=0)
        scaled = (self.matrix / self._weighed)[np.ix_(self.kept, working)]
        found[np.ix_(working, self.kept)] = np.linalg.pinv(scaled) / self._weighed[working, None]
        return found

    @property
    def _apart(self) -> np.ndarray:
        """(1, 0; −C, 1), (6, 6), without the axes that thrusters do not control."""
        found = np.eye(6)
        if self.coupling is not None:
            controlled = np.isin(np.arange(6), self.kept)
            found[3:, :3] = np.where(np.outer(controlled[3:], controlled[:3]), -self.coupling, 0.0)
        return found

    @property
    def _weighed(self) -> np.ndarray:
        return np.ones(len(self.low)) if self.thruster_weights is None else self.thruster_weights

    def thrusts(self, wrench: Array) -> Array:
        """f, (n,) N, for a wrench (6,), N and N m; beyond the limits attitude comes before position."""
        return self._traced_once(wrench)

    @cached_property
    def _traced_once(self) -> Callable[[Array], Array]:
        """`_thrusts`, which JAX traces once for the check of a run and its steps."""
        return jax.jit(self._thrusts)

    def _thrusts(self, wrench: Array) -> Array:
        free = jnp.asarray(self.inverse) @ wrench
        limited = np.isfinite(self.low) | np.isfinite(self.high)
        scaled = (self._apart @ self.matrix)[self.kept] / self.units[self.kept, None] / self._weighed
        A = np.asarray(self.weights)[self.kept, None] * scaled / max(np.linalg.norm(scaled, 2), 1e-300)
        found = jnp.zeros(len(self.low))
        for axes, some in independent(A):
            v, f = self._weighed[some], free[some]
            rows, wanted, low, high = A[np.ix_(axes, some)], v * f, v * self.low[some], v * self.high[some]
            if np.any(limited[some]):
                f = bounded(rows, wanted, low, high) / v
            if self.edges is not None:
                f = outside(rows, wanted, v * f, low, high, v * self.edges[:, some]) / v
            found = found.at[some].set(f)
        return found

    def lost(self, wrench: Array, thrusts: Array) -> Array:
        """W − B f, (6,), less the torque that goes with its force, along the controllable axes; 0 along the others."""
        controlled = np.isin(np.arange(6), self.kept)
        return jnp.asarray(self._apart) @ jnp.where(controlled, wrench - jnp.asarray(self.matrix) @ thrusts, 0.0)
