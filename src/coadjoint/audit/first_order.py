"""Systems whose Lagrangian is linear in the velocities, and their motions by DOP853."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, Scalar
from coadjoint.groups import Translation
from coadjoint.mechanics.continuous import reference
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.spaces import Trivial


def predators() -> tuple[System, State]:
    """Lotka and Volterra's equations, ẋ = x(y − 1), ẏ = y(2 − x): ϑ = (ln y/x + y, x), without a symmetry in time."""

    def lotka_volterra(xi: Array, n: Array, nu: Array) -> Scalar:
        x, y = n
        return (jnp.log(y) / x + y) * nu[0] + x * nu[1] - (x + y - 2 * jnp.log(x) - jnp.log(y))

    system = System(Translation(0), lotka_volterra, additional=Trivial(2))
    return system, system.state(q=[1.0, 1.0])


def guiding_centre() -> tuple[System, State]:
    """The guiding centre of a trapped ion in a tokamak, g the toroidal angle and n = (R, Z, u), u along the field.

    A = (−r²/2q, 0, −ln R)/ρ and b = (R, −Z/q, (R − 1)/q)/S in (φ, R, Z), with r² = (R − 1)² + Z² and
    S² = 1 + r²/q²: |B| = S/R, ϑ = A + u b, and H = ½u² + m|B|. All components of ϑ depend on the place.
    """

    def tokamak(xi: Array, n: Array, nu: Array, p: Parameters) -> Scalar:
        R, Z, u = n
        r2 = (R - 1) ** 2 + Z**2
        S = jnp.sqrt(1 + r2 / p.q**2)
        toroidal = -r2 / (2 * p.q * p.rho) + u * R / S
        poloidal = jnp.stack([-u * Z / (p.q * S), -jnp.log(R) / p.rho + u * (R - 1) / (p.q * S)])
        return toroidal * xi[0] + poloidal @ nu[:2] - 0.5 * u**2 - p.moment * S / R

    parameters = {"q": 2.0, "rho": 2e-3, "moment": 1.2}
    system = System(Translation(1), tokamak, additional=Trivial(3), parameters=parameters)
    return system, system.state(q=[1.2, 0.0, 0.4])


def predators_exactly(t: float) -> State:
    return _at(*predators(), t)


def guiding_centre_exactly(t: float) -> State:
    return _at(*guiding_centre(), t)


def _at(system: System, start: State, t: float) -> State:
    found = reference(system, start, np.array([t]))
    leaf = {name: getattr(found, name)[0] for name in ("t", "n", "a", "mu", "pi", "xi", "nu")}
    return start.replace(g=found.g[0], **leaf)
