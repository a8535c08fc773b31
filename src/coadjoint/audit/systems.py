"""Nonlinear systems on which claims are measured: three groups, flat and curved Q, forces, constraints.

In units in which turning takes a few seconds. None of them is linear, and none is a harmonic oscillator.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, Scalar
from coadjoint.audit.constrained import pinned_body, pinned_exactly, suslov, suslov_exactly
from coadjoint.audit.steered_top import steered_exactly, steered_top
from coadjoint.groups import SE2, SE3, SO3, Translation, attitude
from coadjoint.mechanics.continuous import reference
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.state import Force, State
from coadjoint.mechanics.system import System
from coadjoint.spaces import Adjoint, Defining, Sphere, Trivial


@dataclass(frozen=True)
class AuditSystem:
    """A system with a start; `duration` (s) is that of the runs for the order.

    Unless `conservative`, forces act, and order and symmetry alone are measured. `quadratic`: ℋ is quadratic in
    (μ, π, n, a). `of_velocity`: ℓ depends on ξ alone. Every quadrature rule is then its own adjoint,
    Λ*(ξ; h) = −Λ(ξ; −h) = hℓ(ξ), and an odd order comes out one higher. `highest`:
    the order up to which there is room for one to show between coarse steps and round-off; over 8 with the Cayley map.
    exact: the motion at a time, by default steps of a method of high order. `internal`: a rule has an internal state,
    so that the order with one is measured, over the Cayley map. `first_order`: ℓ is linear in the velocities, for
    methods that are for these alone.
    """

    name: str
    make: Callable[[], tuple[System, State]]
    duration: float
    conservative: bool = True
    quadratic: bool = False
    of_velocity: bool = False
    highest: int = 8
    exact: Callable[[float], State] | None = None
    first_order: bool = False

    @property
    def internal(self) -> bool:
        return self.system.internal is not None

    @property
    def constrained(self) -> bool:
        return bool(self.system.constraints)

    @property
    def holonomic(self) -> bool:
        """Whether no constraint is one on velocities alone: steps are then variational, with reactions in ℓ."""
        return all(one.holonomic for one in self.system.constraints)

    @property
    def system(self) -> System:
        return _made(self.make)[0]

    @property
    def start(self) -> State:
        return _made(self.make)[1]


@lru_cache(maxsize=64)
def _made(make: Callable[[], tuple[System, State]]) -> tuple[System, State]:
    return make()


def free_rigid_body() -> tuple[System, State]:
    """ℓ = ½ ω·Jω on SO(3): Euler's equations and the attitude, near the unstable axis."""

    def free_body(xi, p):
        return 0.5 * xi @ p.inertia @ xi

    body = System(SO3(), free_body, parameters={"inertia": np.diag([1.0, 2.0, 3.0])})
    return body, body.state(g=attitude.zyx(0.3, -0.2, 0.5), xi=[0.3, 1.0, 0.4])


def heavy_top(forces: Callable[..., Force] | None = None) -> tuple[System, State]:
    """ℓ = ½ ω·Jω − mg r·a on SO(3), three different moments of inertia, a = R⁻¹e_z."""

    def top(xi, a, p):
        return 0.5 * xi @ p.inertia @ xi - p.weight * p.center @ a

    parameters = {"inertia": np.diag([1.0, 1.3, 0.8]), "weight": 1.0, "center": [0.1, 0.2, 0.7], "damping": 0.15}
    top_ = System(SO3(), top, advected=Defining(), parameters=parameters, forces=forces)
    return top_, top_.state(g=attitude.zyx(0.3, 0.5, -0.4), xi=[0.5, -0.3, 2.5], a0=[0, 0, 1])


def driven_top() -> tuple[System, State]:
    """The heavy top with damping and a torque that turns: T = −d ω − d |ω| ω + ½ sin(t) a.

    With twice this d the transients are so fast that order 8 shows as 7.7 at steps whose errors are above round-off.
    """

    def forces(motion, p):
        speed = jnp.sqrt(motion.xi @ motion.xi)
        return Force(torque=-p.damping * (1 + speed) * motion.xi + 0.5 * jnp.sin(motion.t) * motion.a)

    return heavy_top(forces)


def body_in_fluid() -> tuple[System, State]:
    """A neutrally buoyant body with added mass and a righting moment, on SO(3) with its place in Q = ℝ³."""

    def vehicle(xi, n, nu, a, p):
        return 0.5 * nu @ p.mass @ nu + 0.5 * xi @ p.inertia @ xi - p.righting @ a

    parameters = {
        "mass": np.diag([1.5, 2.4, 3.0]), "inertia": np.diag([0.8, 1.1, 1.4]), "righting": [0.0, 0.1, -0.6],
    }  # fmt: skip
    body = System(SO3(), vehicle, additional=Defining(), advected=Defining(), parameters=parameters)
    g = attitude.zyx(0.2, 0.3, -0.3)
    return body, body.state(g=g, q=[1, -2, 0.5], xi=[0.4, -0.6, 0.9], qdot=[0.5, 0.2, -0.3], a0=[0, 0, 1])


def rigid_motion() -> tuple[System, State]:
    """A body on SE(3), held to a point fixed in space by a spring at its edge: a = g⁻¹(p, 1)."""

    def tethered(xi, a, p):
        stretch = a[:3] - p.edge
        return 0.5 * xi @ p.inertia @ xi - 0.5 * p.stiffness * stretch @ stretch * (1 + 0.2 * stretch @ stretch)

    inertia = np.diag([0.8, 1.1, 1.4, 1.5, 2.0, 2.4])
    inertia[0, 4] = inertia[4, 0] = 0.3
    parameters = {"inertia": inertia, "stiffness": 0.8, "edge": [0.4, 0.1, -0.2]}
    body = System(SE3(), tethered, advected=Defining(), parameters=parameters)
    g = (np.asarray(attitude.zyx(0.2, 0.3, -0.3)), np.array([0.6, -0.3, 0.2]))
    return body, body.state(g=g, xi=[0.4, -0.6, 0.7, 0.3, 0.2, -0.4], a0=[0.2, 0.1, -0.1, 1])


def plane_motion() -> tuple[System, State]:
    """A body on SE(2) tied to a point p, whose mass lies off its origin; a₀ holds p and the rotation about p."""

    def tied(xi, a, p):
        stretch = a.point[:2] - p.edge
        return 0.5 * xi @ p.inertia @ xi - 0.5 * p.stiffness * stretch @ stretch - 0.6 * jnp.sin(a.turning[1])

    inertia = np.array([[0.9, 0.1, 0.3], [0.1, 1.2, 0.0], [0.3, 0.0, 2.0]])
    parameters = {"inertia": inertia, "stiffness": 1.1, "edge": [0.5, 0.2]}
    body = System(SE2(), tied, advected={"point": Defining(), "turning": Adjoint()}, parameters=parameters)
    turn = np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
    a0 = {"point": [0.1, 0.2, 1], "turning": [1, 0.2, -0.1]}
    return body, body.state(g=(turn, np.array([0.3, -0.5])), xi=[1.1, 0.4, -0.3], a0=a0)


def pendulum_on_body() -> tuple[System, State]:
    """A bob on the unit sphere with an anisotropic mass in the frame of a free body: SO(3) with Q = S²."""

    def pendulum(xi, n, nu, a, p):
        kinetic = 0.5 * xi @ p.inertia @ xi + 0.5 * nu @ (p.mass * nu)
        return kinetic - p.weight * n @ a + p.coupling * jnp.sin(n[2]) * (1 + 0.3 * xi @ nu)

    parameters = {
        "inertia": np.diag([2.0, 1.5, 1.2]), "mass": [0.8, 1.1, 0.6], "weight": 1.0, "coupling": 0.25,
    }  # fmt: skip
    body = System(SO3(), pendulum, additional=Sphere(), advected=Defining(), parameters=parameters)
    q, push = np.array([0.6, 0.0, -0.8]), np.array([0.1, 0.4, 0.1])
    qdot = push - (push @ q) * q
    return body, body.state(g=attitude.zyx(0.3, -0.2, 0.5), q=q, qdot=qdot, xi=[0.4, -0.3, 0.7], a0=[0, 0, 1])


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


PROBLEMS: dict[str, AuditSystem] = {
    problem.name: problem
    for problem in (
        AuditSystem("heavy top", heavy_top, 2.0, quadratic=True, highest=10),
        AuditSystem("body in fluid", body_in_fluid, 4.0, quadratic=True, highest=10),
        AuditSystem("free rigid body", free_rigid_body, 3.0, quadratic=True, of_velocity=True, highest=10),
        AuditSystem("rigid motion", rigid_motion, 2.0),
        AuditSystem("plane motion", plane_motion, 4.0, highest=10),
        AuditSystem("pendulum on body", pendulum_on_body, 2.0, highest=4),
        AuditSystem("driven top", driven_top, 2.0, conservative=False),
        AuditSystem("steered top", steered_top, 2.0, conservative=False, exact=steered_exactly),
        AuditSystem("pinned body", pinned_body, 2.0, exact=pinned_exactly),
        AuditSystem("Suslov's body", suslov, 3.0, of_velocity=True, exact=suslov_exactly),
        AuditSystem("predators", predators, 4.0, exact=predators_exactly, first_order=True),
        AuditSystem("guiding centre", guiding_centre, 8.0, exact=guiding_centre_exactly, first_order=True),
    )
}

QUICK = ("heavy top", "body in fluid", "plane motion", "pendulum on body")
"""The systems of a quick audit."""
