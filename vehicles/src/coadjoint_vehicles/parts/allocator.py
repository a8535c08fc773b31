"""The share of each thruster in a wrench: the axes that thrusters control, and the least thrusts along them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array
from coadjoint_vehicles.parts.bounded_thrusts import bounded, independent

AXES = ("surge", "sway", "heave", "roll", "pitch", "yaw")
LEAST_AUTHORITY = 5e-3
"""The part of the largest singular value below which a direction is uncontrollable: data have three digits."""
SHARES = (1.0, 0.5, 0.0)
"""The parts of the allowed force with which the torque is tried."""


@dataclass(frozen=True, eq=False)
class Allocator:
    """Thrusts f with B f = W along the controllable axes, of those the least |f|, within l ≤ f ≤ u.

    matrix: B, (6, n). low, high: l ≤ 0 ≤ u, (n,) N, infinite without limits. With S = diag(1, 1, 1, 1/L, 1/L, 1/L), L
    the root mean square arm of the thrusters, and F = diag(max(−l, u)), a left singular vector of S B F whose singular
    value is below `least_authority` of the largest is an uncontrollable direction. For each of them the axis of its
    largest entry is left out. The others get what they ask for, and what comes with it along that axis, such as the
    pitch of thrusters below the centre of mass, is left to the vehicle.

    weights: (6,) of the axes, torques divided by L: within the limits the thrusts have least Σ_j (w_j (B f − W)_j)²
    over the controllable axes, of several the least |f|. None: force gives way before torque, each along its direction.
    """

    matrix: np.ndarray
    low: np.ndarray
    high: np.ndarray
    least_authority: float = LEAST_AUTHORITY
    weights: np.ndarray | None = None

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
        found[np.ix_(working, self.kept)] = np.linalg.pinv(self.matrix[np.ix_(self.kept, working)])
        return found

    def thrusts(self, wrench: Array) -> Array:
        """f, (n,) N, for a wrench (6,), N and N m; beyond the limits attitude comes before position.

        f = s f_T + r f_F, with f_T the thrusts for the torque and f_F those for the force. From a common scale of both,
        or from all, half or none of the force that the limits allow by itself, s grows as far as they allow, to 1; the
        largest s counts, and then r grows, to 1. So torque and force keep their directions, and thrusters that push
        one way turn by what they push together.
        """
        turn, push = (jnp.asarray(self.inverse[:, axes]) @ wrench[axes] for axes in (slice(3, 6), slice(3)))
        if not np.all(np.isfinite(self.low) & np.isfinite(self.high)):
            return turn + push
        if self.weights is not None:
            return self._least_squares(turn + push, self.weights)
        none = jnp.zeros(len(self.low))
        both, allowed = self._most(turn + push, none), self._most(push, none)
        s = r = jnp.zeros(())
        for begin, share in ((both, both), *((0.0, part * allowed) for part in SHARES)):
            found = jnp.minimum(1.0, begin + self._most(turn, begin * turn + share * push))
            s, r = jnp.where(found > s, found, s), jnp.where(found > s, share, r)
        r = jnp.minimum(1.0, r + self._most(push, s * turn + r * push))
        return s * turn + r * push

    def _least_squares(self, free: Array, weights: np.ndarray) -> Array:
        """The thrusts within the limits whose wrench is nearest to that of the free ones."""
        scaled = self.matrix[self.kept] / self.units[self.kept, None]
        A = weights[self.kept, None] * scaled / np.linalg.norm(scaled, 2)
        found = jnp.zeros(len(self.low))
        for axes, thrusters in independent(A):
            f = bounded(A[np.ix_(axes, thrusters)], free[thrusters], self.low[thrusters], self.high[thrusters])
            found = found.at[thrusters].set(f)
        return found

    def _most(self, along: Array, base: Array) -> Array:
        """The largest s ≤ 1 with base + s along within the limits, for a base that is within them."""
        end = jnp.where(along > 0, self.high, self.low)
        room = jnp.where(along == 0, 1.0, (end - base) / jnp.where(along == 0, 1.0, along))
        return jnp.clip(jnp.min(room), 0.0, 1.0)

    def lost(self, wrench: Array, thrusts: Array) -> Array:
        """W − B f, (6,), along the controllable axes, and 0 along the others."""
        controlled = np.isin(np.arange(6), self.kept)
        return jnp.where(controlled, wrench - jnp.asarray(self.matrix) @ thrusts, 0.0)
