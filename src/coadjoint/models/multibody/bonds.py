"""The equations of a joint in body variables: its constraint, its coordinates, and what acts at them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError, warn
from coadjoint.mechanics.state import Force, Motion, State
from coadjoint.models.multibody.joints import KINDS
from coadjoint.portable import Portable

ORIGIN = np.zeros(3)


@dataclass(frozen=True)
class Bond(Portable):
    """A joint of a mechanism, with the links i and j of the group that it connects; −1 is the ground.

    With E = R_iᵀR_j from `a.pose`, and the joint's points r_i, r_j and axes A_i, A_j on both bodies,

        d = A_iᵀ(E(n_j + r_j) − n_i − r_i),   C = A_iᵀ E A_j

    are the second joint frame in the first. pair: the place of (i, j) in `a.pose`. axes: A_i and A_j by rows. wheels:
    of a gear, the two joints; teeth: its numbers. ball: whether what rolls has no axis.
    """

    name: str
    kind: str
    first: int
    second: int
    pair: int
    axes: tuple[tuple[tuple[float, ...], ...], ...] = ()
    wheels: tuple[Bond, ...] = ()
    teeth: tuple[int, int] = (1, 1)
    ball: bool = False

    def _relative(self, n: Array, a: PyTree, p: PyTree) -> tuple[Array, Array]:
        """d (3,) and C (3, 3)."""
        A, B = (np.array(one) for one in self.axes)
        own, E = getattr(p, self.name), a.pose[self.pair]
        apart = E @ (_of(n, self.second) + own.second) - _of(n, self.first) - own.first
        return A.T @ apart, A.T @ E @ B

    def gap(self, n: Array, a: PyTree, p: PyTree) -> Array:
        """φ (m,): what vanishes of d and C, and the row of its own."""
        kind = KINDS[self.kind]
        if kind.ratio == "gear":
            return self._gear(n, a, p)[None]
        d, C = self._relative(n, a, p)
        rows = [*(d[k] for k in kind.points), *(C[k, m] for k, m in kind.entries)]
        if kind.ratio:
            rows.append(getattr(self, f"_{kind.ratio}")(d, C, getattr(p, self.name)))
        return jnp.stack(rows)

    def _gear(self, n: Array, a: PyTree, p: PyTree) -> Array:
        """sin(z₁θ₁ + z₂θ₂)/z₁, smooth where an angle jumps by a turn; of distances x₁ + (z₂/z₁)x₂."""
        one, other = (wheel.coordinates(n, a, p)[0] for wheel in self.wheels)
        if KINDS[self.wheels[0].kind].coordinates[0] == "distance":
            return one + self.teeth[1] / self.teeth[0] * other
        return jnp.sin(self.teeth[0] * one + self.teeth[1] * other) / self.teeth[0]

    def _distance(self, d: Array, C: Array, own: PyTree) -> Array:
        """(|d|² − l²)/2l, whose multiplier is the force along the line."""
        return 0.5 * (d @ d / own.length - own.length)

    def _screw(self, d: Array, C: Array, own: PyTree) -> Array:
        """c sin(θ − d₃/c) with c = pitch/2π: any number of turns."""
        c = own.pitch / (2 * np.pi)
        return c * (C[1, 0] * jnp.cos(d[2] / c) - C[0, 0] * jnp.sin(d[2] / c))

    def _contact(self, d: Array, C: Array, own: PyTree) -> Array:
        """The height of the lowest point of the wheel over the plane."""
        return d[2] - own.radius * self._lean(C)

    def _lean(self, C: Array) -> Scalar:
        """The sine of the angle between the axis of a disk and the normal; 1 of a ball."""
        return 1.0 if self.ball else jnp.sqrt(C[0, 2] ** 2 + C[1, 2] ** 2)

    def slip(self, xi: Array, nu: Array, n: Array, a: PyTree, p: PyTree) -> Array:
        """The velocity of the wheel's lowest point relative to the plane, along it, (2,)."""
        C = self._relative(n, a, p)[1]
        e = np.eye(3)[2]
        tilt = 0.0 if self.ball else C[2, 2] * C[:, 2]
        under = -getattr(p, self.name).radius * (e - tilt) / self._lean(C)
        spin, drift = self._twist(xi, nu, n, a, p)
        return (drift + jnp.cross(spin, under))[:2]

    def rolling(self, n: Array, a: PyTree, p: PyTree) -> Array:
        """The rows (2, 6N) of the velocities (ξ, ν) that hold the wheel without slip."""
        return _rows(self.slip, n, a, p)

    def _twist(self, xi: Array, nu: Array, n: Array, a: PyTree, p: PyTree) -> tuple[Array, Array]:
        """The angular velocity of the second body relative to the first, and ḋ, (3,) each, along the first frame."""
        A, E, own = np.array(self.axes[0]), a.pose[self.pair], getattr(p, self.name)
        omega = _of(xi, self.first)
        there = E @ (_of(n, self.second) + own.second) - _of(n, self.first)
        moving = E @ (_of(nu, self.second) + jnp.cross(_of(xi, self.second), own.second))
        drift = moving - _of(nu, self.first) - jnp.cross(omega, there)
        return A.T @ (E @ _of(xi, self.second) - omega), A.T @ drift

    def coordinates(self, n: Array, a: PyTree, p: PyTree) -> Array:
        """The joint's coordinates, (k,): an angle, rad, from −π to π, a distance, m."""
        d, C = self._relative(n, a, p)
        found = {"angle": jnp.arctan2(C[1, 0], C[0, 0]), "distance": d[2], "length": jnp.sqrt(d @ d)}
        return jnp.stack([found[name] for name in KINDS[self.kind].coordinates])

    def speeds(self, xi: Array, nu: Array, n: Array, a: PyTree, p: PyTree) -> Array:
        """The rates of the coordinates, (k,), rad/s and m/s."""
        (spin, drift), d = self._twist(xi, nu, n, a, p), self._relative(n, a, p)[0]
        found = {"angle": spin[2], "distance": drift[2], "length": d @ drift / jnp.sqrt(d @ d)}
        return jnp.stack([found[name] for name in KINDS[self.kind].coordinates])

    def spring(self, n: Array, a: PyTree, p: PyTree) -> Scalar:
        """½k(x − x₀)², one number, J, with the difference of angles within half a turn. n: (3N,)."""
        own, x = getattr(p, self.name), self.coordinates(n, a, p)[0]
        off = x - own.rest
        if KINDS[self.kind].coordinates[0] == "angle":
            off = jnp.arctan2(jnp.sin(off), jnp.cos(off))
        return 0.5 * own.stiffness * off**2

    def warn_of_turns(self, angles: np.ndarray, own: PyTree) -> None:
        """Warn where a torsion spring is more than half a turn from its rest, so that it pulls the other way.

        angles: (n,), rad, with turns counted. own: the joint's parameters.
        """
        if not hasattr(own, "rest") or KINDS[self.kind].coordinates[0] != "angle":
            return
        far = float(np.ravel(angles)[np.argmax(np.abs(angles - own.rest))])
        if abs(far - own.rest) > np.pi:
            near = own.rest + (far - own.rest + np.pi) % (2 * np.pi) - np.pi
            warn(
                f"The spring of the joint `{self.name}` acts within half a turn of its rest, {own.rest:.6g} rad: at "
                f"{far:.4g} rad it acts as at {near:.4g} rad.",
                stacklevel=4,
            )

    def acting(self, strength: Scalar, motion: Motion, p: PyTree) -> Force:
        """The force of a torque, N m, or a force, N, at the joint's coordinate, by its virtual work."""
        along = jax.grad(lambda xi, nu: self.speeds(xi, nu, motion.n, motion.a, p)[0], (0, 1))
        torque, force = along(motion.xi, motion.nu)
        return Force(torque=strength * torque, force=jnp.reshape(strength * force, -1))

    def damper(self, motion: Motion, p: PyTree) -> Force:
        """−c times the rate of the coordinate, there."""
        rate = self.speeds(motion.xi, motion.nu, motion.n, motion.a, p)[0]
        return self.acting(-getattr(p, self.name).damping * rate, motion, p)

    def motor(self, motion: Motion, p: PyTree) -> Force:
        """The input of the joint's name at its coordinate; raises ArgumentError where there is none."""
        if getattr(motion.inputs, self.name, None) is None:
            raise ArgumentError(
                f'The motor of the joint `{self.name}` needs an input: give inputs={{"{self.name}": …}}, a number or '
                "a signal, to co.simulate or co.trajectory."
            )
        return self.acting(getattr(motion.inputs, self.name), motion, p)


@dataclass(frozen=True, eq=False)
class Coordinate(Portable):
    """A joint's coordinate as a function of a state, or of the motion in a cost: JAX differentiates it.

        angle = linkage.coordinate("hinge")
        run = co.simulate(…, until=co.Event(lambda state: jnp.sin(angle(state) - 0.7), direction="rising"))

    One number, of joints with two coordinates (2,): rad, from −π to π, or m. An event takes the sine of an angle less
    its value, because the angle jumps by a turn at π. p: the parameters, by default those of the system that made the
    record, or else of the mechanism; needed where `replace` changed points of joints.
    """

    bond: Bond
    parameters: PyTree

    def __call__(self, state: State | Motion, p: PyTree = None) -> Array:
        with jax.enable_x64(True):
            _, _, n, a, p = self._at(state, p)
            return self._single(self.bond.coordinates(n, a, p))

    def speed(self, state: State | Motion, p: PyTree = None) -> Array:
        """Its rate, one number, rad/s or m/s."""
        with jax.enable_x64(True):
            xi, nu, n, a, p = self._at(state, p)
            return self._single(self.bond.speeds(xi, nu, n, a, p))

    def _at(self, state: State | Motion, p: PyTree) -> tuple[Array, Array, Array, PyTree, PyTree]:
        """ξ, ν, n by links, a by names, and the parameters."""
        a = state.a
        if isinstance(state, State):
            of = state.origin.system
            p = of.parameters if p is None and of is not None else p
            a = state.places.advected.view(state.places.group, state.a)
        xi, nu, n = (jnp.reshape(one, (-1, 3)) for one in (state.xi, state.nu, state.n))
        return xi, nu, n, a, self.parameters if p is None else p

    def _single(self, found: Array) -> Array:
        return found[0] if len(found) == 1 else found


@dataclass(frozen=True)
class HeldCoordinates(Portable):
    """A constraint that keeps the coordinates of a joint at x₀ + vt, by which a state is found; shown: x₀ and v."""

    bond: Bond
    shown: tuple[tuple[float, ...], tuple[float, ...]]

    def gap(self, n: Array, a: PyTree, p: PyTree, *, t: Scalar) -> Array:
        """sin of the difference of angles, the difference of distances, (k,)."""
        off = self.bond.coordinates(n, a, p) - np.array(self.shown[0]) - np.array(self.shown[1]) * t
        names = KINDS[self.bond.kind].coordinates
        return jnp.stack([jnp.sin(x) if name == "angle" else x for x, name in zip(off, names, strict=True)])


@dataclass(frozen=True)
class HeldSpeeds(Portable):
    """Rows on the velocities that keep the rates of a joint's coordinates, by which a state is found; shown: rates."""

    bond: Bond
    shown: tuple[float, ...]

    def rows(self, n: Array, a: PyTree, p: PyTree) -> Array:
        """(k, 6N)."""
        return _rows(self.bond.speeds, n, a, p)

    def right(self, n: Array, a: PyTree, p: PyTree) -> Array:
        """(k,)."""
        return jnp.array(self.shown)


@dataclass(frozen=True)
class Energy(Portable):
    """ℓ = ½ Σ ω·Jω + ½ Σ m|ν|² + Σ m n·γ − Σ ½k(x − x₀)², with gravity γ and the springs of joints."""

    springs: tuple[Bond, ...]

    def lagrangian(self, xi: Array, n: Array, nu: Array, a: PyTree, p: PyTree) -> Scalar:
        """ℓ, one number, J."""
        turning = 0.5 * jnp.sum(xi * jnp.einsum("nij,nj->ni", p.inertia, xi))
        moving = jnp.sum(p.mass[:, None] * (0.5 * nu**2 + n * a.gravity))
        return turning + moving - sum(bond.spring(n, a, p) for bond in self.springs)


def _rows(speeds: Callable[..., Array], n: Array, a: PyTree, p: PyTree) -> Array:
    """The rows (k, 6N) of k speeds of (ξ, ν)."""
    still = jnp.zeros_like(n)
    slopes = jax.jacfwd(speeds, (0, 1))(still, still, n, a, p)
    return jnp.concatenate([jnp.reshape(slope, (len(slope), -1)) for slope in slopes], axis=1)


def _of(rows: Array, link: int) -> Array:
    """The row of a link; of the ground, zero."""
    return rows[link] if link >= 0 else ORIGIN
