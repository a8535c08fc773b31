"""Runs that dt resolves, and runs that it does not: for the accuracy of the certificate."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

import coadjoint as co
from coadjoint.models import catalogue


class Case(NamedTuple):
    """A run: what makes system, start and the arguments of co.simulate."""

    name: str
    make: Callable[[], tuple[co.System, Any, dict[str, Any]]]

    def simulate(self, **more: Any) -> co.Run:
        system, start, arguments = self.make()
        return co.simulate(system, start, progress=False, **{**arguments, **more})


def spring(rates, inertia=(1.0, 2.0, 3.0), excited=1.0, dt=0.01, steps=300, method=None, additional=None):
    """ℓ = ½ξ·Jξ + ½|ν|² − ½ Σ ω_i² n_i², on SO(3) × ℝᵏ with a trivial action."""
    rates = np.asarray(rates, float)

    def make():
        def lagrangian(xi, n, nu):
            return 0.5 * xi @ np.diag(inertia) @ xi + 0.5 * nu @ nu - 0.5 * (rates**2 * n) @ n

        system = co.System(co.SO3(), lagrangian, additional=co.Trivial(len(rates)))
        start = system.state(q=np.broadcast_to(excited, rates.shape), xi=[0.1, 0.2, 0.1])
        return system, start, {"dt": dt, "steps": steps, "method": method}

    return make


def drag(law, coefficient, speed=1.0, dt=0.05, steps=200, push=0.0, method=None):
    """A body with mass 1 and drag c|ν|^{law−1}ν, pushed by a constant force along its own axis."""

    def make():
        def forces(motion, p):
            size = jnp.sqrt(motion.nu @ motion.nu + 1e-12)
            return co.Force(force=-p.drag * size ** (law - 1) * motion.nu + p.push * np.array([1.0, 0.0, 0.0]))

        def lagrangian(xi, n, nu, p):
            return 0.5 * xi @ np.diag([1.0, 2.0, 3.0]) @ xi + 0.5 * nu @ nu

        system = co.System(
            co.SO3(),
            lagrangian,
            additional=co.Defining(),
            forces=forces,
            parameters={"drag": coefficient, "push": push},
        )
        start = system.state(q=[0, 0, 0], qdot=[speed, 0, 0], xi=[0, 0, 0])
        return system, start, {"dt": dt, "steps": steps, "method": method}

    return make


def top(turn, dt=0.05, steps=200, inertia=(5.0, 5.0, 1.0), method=None, weight=1.0):
    """A heavy top that spins by `turn` rad a step about its axis."""

    def make():
        def lagrangian(xi, a):
            return 0.5 * xi @ np.diag(inertia) @ xi - weight * a[2]

        system = co.System(co.SO3(), lagrangian, advected=co.Defining())
        start = system.state(g=co.attitude.zyx(0, 0.1, 0.3), xi=[0.0, 0.01, turn / dt], a0=[0, 0, 1])
        return system, start, {"dt": dt, "steps": steps, "method": method}

    return make


def body(xi, inertia=(1.0, 2.0, 3.0), dt=0.1, steps=200, method=None):
    """A free rigid body."""

    def make():
        system = co.System(co.SO3(), lambda xi: 0.5 * xi @ np.diag(inertia) @ xi)
        return system, system.state(xi=xi), {"dt": dt, "steps": steps, "method": method}

    return make


def driven(rate, dt=0.05, steps=400, held=False, explicit=False, method=None):
    """A mass pushed by sin(rate·t): by a signal, by a function held over each step, or by a force of time."""

    def make():
        def lagrangian(xi, n, nu):
            return 0.5 * xi @ np.diag([1.0, 2.0, 3.0]) @ xi + 0.5 * nu @ nu - 0.5 * n @ n

        def forces(motion):
            size = jnp.sin(rate * motion.t) if explicit else motion.inputs
            return co.Force(force=size * np.array([1.0]))

        system = co.System(co.SO3(), lagrangian, additional=co.Trivial(1), forces=forces)
        given = (lambda motion: jnp.sin(rate * motion.t)) if held else co.mechanics.Signal(lambda t: jnp.sin(rate * t))
        start = system.state(q=[0.3], inputs=None if explicit else 0.0)
        arguments = {"dt": dt, "steps": steps, "method": method}
        return system, start, arguments if explicit else {**arguments, "inputs": given}

    return make


def pushed(force, dt=0.1, steps=200, **arguments):
    """A mass that moves freely, pushed by a function of time and by an input."""

    def make():
        def forces(motion):
            given = 0.0 if motion.inputs is None else motion.inputs
            return co.Force(force=(force(motion.t) + given) * np.array([1.0]) - 0.2 * motion.nu)

        system = co.System(
            co.SO2(), lambda xi, n, nu: 0.5 * xi @ xi + 0.5 * nu @ nu, additional=co.Trivial(1), forces=forces
        )
        return system, system.state(q=[0.0], qdot=[0.1], xi=[0.01]), {"dt": dt, "steps": steps, **arguments}

    return make


def still(t):
    """No force."""
    return 0.0


def vehicle(dt, steps=100, method=None, name="underwater_vehicle"):
    def make():
        entry = catalogue[name]
        system = entry.make()
        return system, entry.start(system), {"dt": dt, "steps": steps, "method": method}

    return make


def pendulum(dt, length=1.0, steps=300, method=None):
    """A spherical pendulum on the sphere."""

    def make():
        entry = catalogue["spherical_pendulum"]
        system = entry.make()
        return system, entry.start(system), {"dt": dt, "steps": steps, "method": method}

    return make


def lag(time_constant, dt=0.05, steps=200, rate=0.3):
    """A body pushed by an actuator with a lag τ towards a command sin(rate·t): u ← u + (1 − e^{−h/τ})(command − u)."""

    def make():
        def rule(motion, h):
            command = jnp.sin(rate * motion.t)
            return {
                "thrust": motion.internal.thrust
                + (1 - jnp.exp(-h / time_constant)) * (command - motion.internal.thrust)
            }

        def lagrangian(xi, n, nu):
            return 0.5 * xi @ xi + 0.5 * nu @ nu - 0.5 * n @ n

        def forces(motion):
            return co.Force(force=motion.internal.thrust * np.array([1.0]) - 0.5 * motion.nu)

        system = co.System(co.SO3(), lagrangian, additional=co.Trivial(1), forces=forces, internal=rule)
        return system, system.state(q=[0.2], internal={"thrust": 0.0}), {"dt": dt, "steps": steps}

    return make


def near_collision(dt, steps=400, core=0.0):
    """A planet on a long ellipse: slow for most of the time, fast where it passes a sun with a core of this radius."""

    def make():
        def lagrangian(xi, n, nu):
            return 0.5 * xi @ xi + 0.5 * nu @ nu + 1.0 / jnp.sqrt(n @ n + core**2)

        system = co.System(co.SO3(), lagrangian, additional=co.Defining())
        return system, system.state(q=[1.0, 0, 0], qdot=[0, 0.25, 0]), {"dt": dt, "steps": steps}

    return make


def wall(stiffness, dt, begin=0.0, speed=1.0, steps=40):
    """A free mass that meets an exponential wall at 1 m."""

    def make():
        def lagrangian(xi, n, nu):
            return 0.5 * xi @ xi + 0.5 * nu @ nu - jnp.sum(jnp.exp(stiffness * (n - 1.0)))

        system = co.System(co.SO2(), lagrangian, additional=co.Trivial(1))
        return system, system.state(q=[begin], qdot=[speed], xi=[0.0]), {"dt": dt, "steps": steps}

    return make


def constrained(off, dt=0.01, steps=500):
    """A slow spring along x and a spring of 10⁴ rad/s that holds y at sin x, from y = sin x + off."""

    def make():
        def lagrangian(xi, n, nu):
            return 0.5 * xi @ xi + 0.5 * nu @ nu - 0.5 * n[0] ** 2 - 0.5e8 * (n[1] - jnp.sin(n[0])) ** 2

        system = co.System(co.SO2(), lagrangian, additional=co.Trivial(2))
        return system, system.state(q=[0.3, np.sin(0.3) + off], xi=[0.0]), {"dt": dt, "steps": steps}

    return make


GRID = np.linspace(0.0, 20.0, 1001)

UNRESOLVED = [
    *(Case(f"spring, hω = {w}", spring([w / 0.01])) for w in (2.0, 6.0, 30.0, 100.0, 1e3)),
    Case("two springs, slow and hω = 100", spring([1.0, 1e4], excited=[1.0, 0.01])),
    Case("spring, hω = 100, order 4", spring([1e4], method=co.Suzuki4(co.Midpoint()))),
    Case("spring, hω = 100, energy–momentum", spring([1e4], method=co.EnergyMomentum())),
    Case("spring, hω = 1.5, left rectangle", spring([150.0], method=co.LeftRectangle())),
    *(Case(f"linear drag, hc = {0.05 * c:g}", drag(1, c)) for c in (40.0, 200.0, 2e3, 1e5)),
    *(Case(f"quadratic drag, hcv = {0.05 * c:g}", drag(2, c)) for c in (100.0, 2e3)),
    *(Case(f"cubic drag, hcv² = {0.05 * c:g}", drag(3, c)) for c in (100.0, 2e3)),
    Case("linear drag, hc = 10, trapezoidal", drag(1, 200.0, method=co.Trapezoidal())),
    *(Case(f"top, h|ω| = {turn}", top(turn)) for turn in (1.0, 1.5, 2.0, 3.0, 4.0, 6.0)),
    *(
        Case(f"heavy top, h|ω| = {turn}, exponential", top(turn, weight=20.0, method=co.Midpoint(co.Exponential())))
        for turn in (1.2, 2.0, 4.0)
    ),
    Case("top, h|ω| = 2, order 4", top(2.0, method=co.Suzuki4(co.Midpoint()))),
    Case("body, 2 rad a step", body([20.0, 0.1, 0.1])),
    Case("body, 2 rad a step about no axis", body([8.0, 16.0, 8.0])),
    Case("body, 2 rad a step, exponential", body([8.0, 16.0, 8.0], method=co.Midpoint(co.Exponential()))),
    *(Case(f"signal at {rate} rad/s", driven(rate)) for rate in (1000.0, 40 * np.pi, 80 * np.pi, 130.0)),
    Case("held input at 1000 rad/s", driven(1000.0, held=True)),
    Case("held input at 2π/h", driven(40 * np.pi, held=True)),
    Case("force of time at 1000 rad/s", driven(1000.0, explicit=True)),
    Case("force of time at 2π/h", driven(40 * np.pi, explicit=True)),
    Case("body, inertia 1e-6 about one axis", body([0.3, 0.4, 2.0], inertia=(1.0, 2.0, 1e-6))),
    Case("body, inertia 1e-3 about one axis", body([0.5, 1.0, 0.0], inertia=(1.0, 1.5, 1e-3))),
    Case("pendulum, 0.4 s", pendulum(0.4)),
    Case("stiff wall, met once", wall(300.0, 0.1)),
    Case("stiff wall, met once in 4000 steps", wall(300.0, 0.05, begin=-99.0, steps=4000)),
    Case("stiff spring for a constraint, excited", constrained(1e-2)),
    Case("actuator whose command is at 1000 rad/s", lag(0.01, rate=1000.0)),
    Case("actuator with a lag of 0.5 s, 2 s", lag(0.5, dt=2.0)),
    Case("vehicle, dt = 2", vehicle(2.0)),
    Case("remus, dt = 2", vehicle(2.0, name="remus_100")),
    *(
        Case(f"force of time at {turns} · 2π/h on a free mass", pushed(lambda t, w=20 * np.pi * turns: jnp.cos(w * t)))
        for turns in (1, 2, 4)
    ),
    Case("held pulse within a step", pushed(still, inputs=co.Held([0.0, 10.06, 10.09], [0.0, 30.0, 0.0]))),
    Case("triangle within a step", pushed(still, inputs=co.Linear([0, 10.02, 10.05, 10.08], [0.0, 0.0, 40.0, 0.0]))),
]

RESOLVED = [
    *(Case(f"spring, hω = {w}", spring([w / 0.01])) for w in (0.01, 0.1, 0.3)),
    Case("spring, hω = 0.1, left rectangle", spring([10.0], method=co.LeftRectangle())),
    Case("spring, hω = 0.5, order 4", spring([50.0], method=co.Suzuki4(co.Midpoint()))),
    Case("slow spring beside one of hω = 100 at rest", spring([1.0, 1e4], excited=[1.0, 0.0])),
    Case("slow spring beside one of hω = 1e4 at rest", spring([1.0, 1e6], excited=[1.0, 0.0])),
    Case("slow spring beside one of hω = 100 that hardly moves", spring([1.0, 1e4], excited=[1.0, 1e-7])),
    *(Case(f"linear drag, hc = {0.05 * c:g}", drag(1, c)) for c in (0.1, 2.0, 6.0)),
    *(
        Case(f"stiff drag {law}, at its final speed", drag(law, 2e3, speed=(1.0 / 2e3) ** (1 / law), push=1.0))
        for law in (1, 2, 3)
    ),
    Case("quadratic drag, hcv = 0.1", drag(2, 2.0)),
    Case("cubic drag, hcv² = 0.1", drag(3, 2.0)),
    Case("at rest", drag(1, 1.0, speed=0.0)),
    *(Case(f"top, h|ω| = {turn}", top(turn)) for turn in (0.02, 0.1, 0.3)),
    Case("top, h|ω| = 0.5, exponential", top(0.5, method=co.Midpoint(co.Exponential()))),
    Case("light top, h|ω| = 2, exponential", top(2.0, method=co.Midpoint(co.Exponential()))),
    Case("body, 0.2 rad a step", body([0.8, 1.6, 0.8])),
    Case("body, 0.2 rad a step, order 6", body([0.8, 1.6, 0.8], method=co.methods.KahanLi6(co.Midpoint()))),
    Case("body, 0.2 rad a step, variable step", body([0.8, 1.6, 0.8], method=co.methods.VariableStep())),
    Case("body that does not turn", body([0.0, 0.0, 0.0])),
    Case("body, inertia 1e-3, about its long axis", body([0.0, 0.0, 1.0], inertia=(1.0, 1.0, 1e-3))),
    Case("signal at 2 rad/s", driven(2.0)),
    Case("held input at 2 rad/s", driven(2.0, held=True)),
    Case("force of time at 2 rad/s", driven(2.0, explicit=True)),
    *(Case(f"actuator with a lag of {tau} s", lag(tau)) for tau in (0.5, 1e-3)),
    *(Case(f"vehicle, dt = {dt}", vehicle(dt)) for dt in (0.01, 0.05)),
    Case("vehicle, left rectangle", vehicle(0.01, method=co.LeftRectangle())),
    Case("vehicle, Galerkin", vehicle(0.05, method=co.Galerkin())),
    Case("remus", vehicle(0.02, name="remus_100")),
    Case("ellipsoid", vehicle(0.02, name="kirchhoff_ellipsoid")),
    Case("cat", vehicle(0.01, name="falling_cat")),
    Case("swimmer", vehicle(0.01, name="three_link_swimmer")),
    Case("beanie", vehicle(0.01, name="elroys_beanie")),
    Case("pendulum, 0.05 s", pendulum(0.05)),
    Case("soft wall", wall(5.0, 0.01, speed=0.5, steps=400)),
    Case("stiff spring for a constraint, slaved", constrained(0.0)),
    Case("ripple on a constant force", pushed(lambda t: 1.0 + 1e-4 * jnp.cos(1000 * t))),
    Case(
        "dither on a constant input",
        pushed(still, dt=0.05, inputs=co.mechanics.Signal(lambda t: 1 + 0.05 * jnp.sin(101 * t))),
    ),
    Case("table of many values a step", pushed(still, inputs=co.Linear(GRID, np.sin(GRID)))),
    Case("held command that jumps within a step", pushed(still, dt=0.05, inputs=co.Held([0.0, 5.03], [0.0, 1.0]))),
    Case(
        "body about a principal axis, 2 rad a step, exponential",
        body([0, 0, 2.0], (1, 1, 1.5), 1.0, 60, co.Midpoint(co.Exponential())),
    ),
    Case(
        "body, 1.2 rad a step, order 8",
        body([0.96, 0.36, 0.6], dt=1.0, steps=60, method=co.methods.KahanLi8(co.Midpoint(co.Exponential()))),
    ),
    Case("long ellipse, short steps", near_collision(0.001, steps=4000)),
]
