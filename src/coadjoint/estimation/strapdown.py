"""The process of a filter with an inertial unit alone: its readings, integrated on SE₂(3).

Sources: A. Barrau, S. Bonnabel, *The invariant extended Kalman filter as a stable observer*, IEEE Trans. Automat.
Control 62 (2017), section IV-B; *Linear observed systems on groups*, Systems & Control Letters 129 (2019), for the
exact discrete step; D. H. Titterton, J. L. Weston, *Strapdown Inertial Navigation Technology*, 2nd ed. (2004), 3.5.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError
from coadjoint.estimation.augmented_state import Drifting
from coadjoint.estimation.drifts import Drift, RandomWalk, not_negative, require_drift
from coadjoint.estimation.extended_poses import (
    ExtendedPose,
    exponential,
    gammas,
    inverse,
    logarithm,
    product,
    small_turn,
)
from coadjoint.estimation.inertial_state import InertialState, one_by_one, parts_of, vector
from coadjoint.estimation.process import Process, spread
from coadjoint.groups import attitude
from coadjoint.kernels.run.function import RowFunction
from coadjoint.kernels.run.kalman import Model
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.state import NodeMotion
from coadjoint.spaces.named import Named

WHOSE = "co.estimation.StrapdownProcess"
BIASES = ("gyroscope_bias", "accelerometer_bias")
DRIFTING = (*BIASES, "current")

AT_FIRST = 1.0
"""s at the start of a log over which the mean of the specific force is checked."""

DOUBTED = 0.7
"""The part of g by which it may differ from that at rest."""

MOVING = ("t", "rotation", "velocity", "position")
"""The first numbers of a row."""


class StrapdownProcess(Process):
    """An inertial unit as a filter's process, without a model of the vehicle: strapdown mechanisation on SE₂(3).

        Ṙ = R ω̂,  v̇ = R f + g e_z,  q̇ = v,  ω = M(y_g − b_g − w_g),  f = M(y_a − b_a − w_a)

    over a flat Earth that does not turn: the rotation of the Earth, 15 °/h, and Coriolis' acceleration, 1.5·10⁻⁴ of the
    speed per second, are neglected. With ω and f constant over a step, the step is exact, with φ = ωh:

        R⁺ = R Γ₀(φ),  v⁺ = v + g h e_z + R Γ₁(φ) f h,  q⁺ = q + v h + ½ g h² e_z + R Γ₂(φ) f h²

    The error e = (η, ξ_v, ξ_q, δb_g, δb_a, δc) is invariant: χ = χ̂ exp(η, ξ_v, ξ_q) with error="left", in body axes,
    and χ = exp(η, ξ_v, ξ_q) χ̂ with error="right", in those of space, χ = (R, v, q). Without biases the error
    propagates by a linear map that does not depend on the estimate, however large it is (Barrau and Bonnabel 2017,
    theorem 7).

    Its input is `imu`, y = (y_g, y_a), (6,): a reading, held over the next step; there is no step before the first
    one. Readings at both ends of a step give second order by their mean. Measurements refer to the body origin O, with
    ν and ω from the last reading; `InertialState` is that of the unit, with q_O = q − Rr.

    Arguments:
        gravity: g, m/s², one number, by default 9.81.
        error: "left" (the default) or "right".
        noise: {"gyroscope": N_g, "accelerometer": N_a}, noise densities of a data sheet, rad/s/√Hz and m/s²/√Hz, one
            number or (3,); by default 0. Over a step of h they add N²h to the covariances of η and ξ_v.
        drifting: how gyroscope_bias, accelerometer_bias (rad/s, m/s²) and current (m/s) drift, name → `RandomWalk` or
            `GaussMarkov`; by default both biases are unknown constants, and there is no current.
        position: r of the unit in the body, (3,) m, by default 0.
        euler_zyx: yaw, pitch and roll of its axes M in those of the body, (3,) rad, by default 0.

    States are `InertialState`. Raises ArgumentError for other names and shapes.
    """

    def __init__(
        self,
        *,
        gravity: float = 9.81,
        error: str = "left",
        noise: Mapping[str, object] | None = None,
        drifting: Mapping[str, Drift] | None = None,
        position: PyTree = (0.0, 0.0, 0.0),
        euler_zyx: object = (0.0, 0.0, 0.0),
    ):
        checks.choice(error, f"Argument `error` of {WHOSE}", ("left", "right"))
        self.error, self.gravity = (
            error,
            checks.not_negative(gravity, f"`gravity` of {WHOSE}, whose third axis is down,"),
        )
        angles = vector(euler_zyx, "euler_zyx", (3,), WHOSE)
        fits = not np.any(np.abs(angles) > 2 * np.pi)
        checks.expect(fits, euler_zyx, f"`euler_zyx` of {WHOSE}", "angles in rad, up to 2π")
        self._lever, self._mount = vector(position, "position", (3,), WHOSE), attitude.zyx(*angles)
        drifts = _drifts(drifting)
        self._drifts = Drifting(dict.fromkeys(drifts, 3), drifts)
        self.densities = _noise(noise)
        self.error_sizes = dict.fromkeys(("attitude", "velocity", "position", *drifts), 3)
        self.input_sizes, self.drifting, self.awaited = {"imu": 6}, self._drifts.count, ("imu",)
        self.commanded = np.arange(16, 22)
        self._first = self.row(InertialState())

    @property
    def example(self) -> np.ndarray:
        return self._first

    @property
    def row_shapes(self) -> dict[str, tuple[int, ...]]:
        moving = {"t": (), "rotation": (3, 3), "velocity": (3,), "position": (3,), "imu": (6,)}
        return {**moving, **dict.fromkeys(self._drifts.sizes, (3,))}

    # Rows, t, R, v, q, y, θ, and states.

    def row(self, state: PyTree) -> np.ndarray:
        size = 22 + self._drifts.count
        if isinstance(state, np.ndarray) and state.shape == (size,):
            return state
        parts = parts_of(checks.instance(state, f"The `state` of a {WHOSE}", InertialState, "an InertialState"))
        for name in DRIFTING:
            if name not in self._drifts.sizes and np.any(parts[name]):
                raise ArgumentError(f"The process has no `{name}`: give its drift in `drifting`.")
        theta = [parts[name] for name in self._drifts.sizes]
        moving = [np.ravel(parts[name]) for name in MOVING]
        found = np.concatenate([*moving, self._still(parts["rotation"]), *theta])
        self._drifts.require_near(found[22:])
        return found

    truths = "an InertialState with an axis of nodes, or "

    def rows_of(self, states: PyTree, times: np.ndarray, known: Mapping[str, object] | None = None) -> np.ndarray:
        if known or not isinstance(states, InertialState):
            return super().rows_of(states, times, known)
        each, nodes = one_by_one(states)
        return np.reshape([self.row(one) for one in each], (*nodes, len(self._first)))

    def doubt(self, row: np.ndarray, inputs: Mapping[str, PyTree]) -> str:
        if "imu" not in inputs or not len(inputs["imu"].times):
            return ""
        times, values = inputs["imu"]
        R, f = row[1:10].reshape(3, 3), np.mean(values[times < times[0] + AT_FIRST].reshape(-1, 6)[:, 3:], axis=0)
        if np.linalg.norm(R @ self._mount @ f + [0.0, 0.0, self.gravity]) <= DOUBTED * self.gravity:
            return ""
        return (
            f"The specific force of `imu` begins with {np.round(f, 3).tolist()} m/s², but of a unit at rest in the "
            f"attitude of the start it is {np.round(self._still(R)[3:], 3).tolist()}: check its unit, its axes "
            "(z down) and `euler_zyx`."
        )

    def _still(self, R: np.ndarray) -> np.ndarray:
        """The reading of the unit at rest, before the first input."""
        return np.concatenate([np.zeros(3), self._mount.T @ R.T @ [0.0, 0.0, -self.gravity]])

    def state(self, row: np.ndarray) -> InertialState:
        named = {name: row[..., 22:][..., here] for name, here in self._drifts.slices.items()}
        R = row[..., 1:10].reshape(*row.shape[:-1], 3, 3)
        zero = np.zeros((*row.shape[:-1], 3))
        return InertialState(row[..., 0], R, row[..., 10:13], row[..., 13:16], *(named.get(n, zero) for n in DRIFTING))

    def time(self, rows: np.ndarray) -> np.ndarray:
        return rows[..., 0]

    def motion(self, row: Array) -> tuple[PyTree, ...]:
        x, theta = _pose(row), self._drifts.named(row[22:])
        omega = self._mount @ (row[16:19] - _of(theta, "gyroscope_bias"))
        q, north = x.q - x.R @ self._lever, x.R[0]
        nu = x.R.T @ x.v - jnp.cross(omega, self._lever)
        a = Named(down=x.R[2], north=north)
        motion = NodeMotion(omega, x.R.T @ q, nu, a, row[0], None, None, g=x.R, q=q)
        water = Named(velocity=theta.current) if "current" in theta else Named()
        return motion, Named(gravity=self.gravity, water=water), Named()

    # Errors.

    def retract(self, row: Array, e: Array) -> Array:
        x, turn = _pose(row), exponential(e[:9])
        x = product(x, turn) if self.error == "left" else product(turn, x)
        return jnp.concatenate([row[:1], _flat(x), row[16:22], row[22:] + e[9:]])

    def _between(self, row: Array, other: Array) -> ExtendedPose:
        x, y = _pose(row), _pose(other)
        return product(inverse(x), y) if self.error == "left" else product(y, inverse(x))

    def differ(self, row: Array, other: Any) -> Array:
        """e with other = retract(row, e), (n,), to second order."""
        turn = self._between(row, other)
        return jnp.concatenate([logarithm(turn, small_turn(turn.R)), other[22:] - row[22:]])

    def errors(self, rows: np.ndarray, others: np.ndarray) -> np.ndarray:
        size = rows.shape[-1]
        A, B = (one.reshape(-1, size)[:, 1:10].reshape(-1, 3, 3) for one in (rows, others))
        eta = attitude.rotation_vector(np.swapaxes(A, 1, 2) @ B if self.error == "left" else B @ np.swapaxes(A, 1, 2))
        both = np.concatenate([rows.reshape(-1, size), others.reshape(-1, size), eta], axis=1)
        found, _ = self._differing(np.zeros((len(both), 0)), both)
        return found.reshape(*rows.shape[:-1], self.width)

    @cached_property
    def _differing(self) -> RowFunction:
        """(), (x, y, η) ↦ e, where η is known."""
        size = len(self._first)

        def differing(_: object, y: Array) -> Array:
            row, other = y[:size], y[size : 2 * size]
            return jnp.concatenate([logarithm(self._between(row, other), y[2 * size :]), other[22:] - row[22:]])

        return RowFunction(differing, np.zeros(0), np.concatenate([self._first, self._first, np.zeros(3)]))

    # Steps.

    def _after(self, row: Array, h: Scalar, w: Array) -> Array:
        """The row after a step of h, with the integrals w = (w_g, w_a) of the white noises over it."""
        x, theta = _pose(row), self._drifts.named(row[22:])
        phi = self._mount @ ((row[16:19] - _of(theta, "gyroscope_bias")) * h - w[:3])
        push = self._mount @ ((row[19:22] - _of(theta, "accelerometer_bias")) * h - w[3:])
        turn, once, twice = gammas(phi)
        down = jnp.array([0.0, 0.0, self.gravity])
        v = x.v + down * h + x.R @ (once @ push)
        q = x.q + x.v * h + 0.5 * down * h**2 + x.R @ (twice @ push) * h
        moved = _flat(ExtendedPose(x.R @ turn, v, q))
        return jnp.concatenate([row[:1] + h, moved, row[16:22], self._drifts.moved(row[22:], h)])

    @cached_property
    def _step(self) -> RowFunction:
        """(), (row, h) ↦ the row after a step."""
        size = len(self._first)
        given = np.concatenate([self._first, [0.1]])
        return RowFunction(lambda _, y: self._after(y[:size], y[size], jnp.zeros(6)), np.zeros(0), given)

    def stepped(self, rows: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
        length, none = np.full((len(rows), 1), float(h)), np.zeros((len(rows), 0))
        return self._step(none, np.concatenate([rows, length], axis=1))[0], none[:, None]

    @property
    def tangent(self) -> RowFunction:
        return self._tangent

    @cached_property
    def _tangent(self) -> RowFunction:
        n, size = self.width, len(self._first)

        def error_after(x: Array, y: Array) -> Array:
            row, after, h = y[:size], y[size : 2 * size], y[2 * size]
            there = self._after(self.retract(row, x[:n]), h, x[n:])
            return jnp.concatenate([self.differ(after, there), there[22:], self._drifts.variances(h)])

        given = np.concatenate([self._first, self._first, [0.1]])
        return RowFunction(error_after, np.zeros(n + 6), given)

    def native(self) -> Model | None:
        parts = self._step.native, self.tangent.native, self.moving.native, self.carrying.native
        if parts[0] is None or parts[1] is None or parts[2] is None or parts[3] is None:
            return None
        return Model(
            len(self._first), 22, np.ones(1), 0, 0, np.zeros(0), np.zeros(self.drifting, int), parts[0].code, 0,
            self.width, parts[1], self.densities, parts[2], parts[3], self.commanded, self.width,
            parts[0].assembly,
        )  # fmt: skip

    def first_covariance(self, row: np.ndarray, deviations: Mapping[str, PyTree]) -> np.ndarray:
        """P (n, n) of independent errors: attitude about the body axes, velocity and position along those of space."""
        root = np.eye(self.width)
        R, v, q = (np.asarray(part) for part in evaluate(_pose, row))
        if self.error == "left":
            root[3:6, 3:6] = root[6:9, 6:9] = R.T
        else:
            root[:3, :3] = R
            root[3:6, :3], root[6:9, :3] = (np.cross(part, R, axisb=0, axisc=0) for part in (v, q))
        root = root * spread(deviations, self.error_sizes)
        return root @ root.T


def _pose(row: Array) -> ExtendedPose:
    return ExtendedPose(row[1:10].reshape(3, 3), row[10:13], row[13:16])


def _flat(x: ExtendedPose) -> PyTree:
    return jnp.concatenate([x.R.reshape(9), x.v, x.q])


def _of(theta: Named, name: str) -> Any:
    return getattr(theta, name) if name in theta else jnp.zeros(3)


def _drifts(given: Mapping[str, Drift] | None) -> dict[str, Drift]:
    _require_names(given, "drifting", "drift")
    found = {**dict.fromkeys(BIASES, RandomWalk()), **dict(given or {})}
    for name, drift in found.items():
        checks.known(name, DRIFTING, "part", f"`drifting` of {WHOSE}")
        require_drift(drift, name)
    return {name: found[name] for name in DRIFTING if name in found}


def _require_names(given: object, argument: str, of: str) -> None:
    if given is not None:
        checks.instance(given, f"`{argument}` of {WHOSE}", Mapping, f"name → {of}")


def _noise(given: Mapping[str, object] | None) -> np.ndarray:
    _require_names(given, "noise", "number")
    given, found = given or {}, []
    checks.all_known(given, ("gyroscope", "accelerometer"), "part", f"`noise` of {WHOSE}")
    for name in ("gyroscope", "accelerometer"):
        value = not_negative(given.get(name, 0.0), name, "`noise`")
        checks.shape(value, f"`{name}` of `noise`", (), (3,))
        found.append(np.broadcast_to(value, (3,)))
    return np.concatenate(found)
