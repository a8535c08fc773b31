"""Checks of backward steps and substeps, which amplify motions that forces or the method damp."""

from __future__ import annotations

import numpy as np
from jax import hessian, jacfwd
from jax import numpy as jnp

from coadjoint.arrays import Scalar
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import tabulate
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.method import Method

SAFE = 1.0
"""λ|γ|h up to which a substep γh < 0 is safe: on v̇ = −λv the midpoint rule amplifies by (1 + ½λ|γ|h)/(1 − ½λ|γ|h),
which has its pole at 2. The compositions of orders 4 to 8 follow exp(−λh) to 10 % up to λ|γ|h = 1.4 and more, and
become unstable between 1.9 and 2.0 (measured)."""


AMPLIFIED = 1e8
"""By how much steps back in time may amplify round-off: then half of the digits are left."""


ALLOW, REFUSE = "allow", "refuse"


def require_forward(system: System, method: Method, state: State, h: Scalar) -> list[str]:
    """Raise ArgumentError if substeps go backwards and something damps; a warning where it is allowed but unsafe.

    A method allows it by `negative_substeps="allow"`. Steps may damp by themselves (`Step.damping_rate`). Forces
    dissipate where their fastest rate λ, the largest real part of an eigenvalue of −M⁻¹ ∂F/∂v with v = (ξ, ν),
    M = ∂²ℓ/∂v², is positive at the start or at random velocities of that size.
    """
    backwards = -h * min(fraction for _, fraction in method.stages)
    if h <= 0 or backwards <= 0:
        return []
    of_steps = max(step.damping_rate(system) for step, _ in method.stages)
    rate = max(of_steps, 0.0 if system.forces is None else damping_rate(system, state))
    if rate <= 0:
        return []
    who, what = ("it damps", f"{method.title} damps") if rate == of_steps else ("the forces dissipate", "Forces damp")
    if getattr(method, "negative_substeps", REFUSE) != ALLOW:
        raise ArgumentError(
            f"{method.title} has substeps that go backwards, by {backwards:.3g} s, and {who}, at rates "
            f"up to {rate:.3g}/s, which such substeps amplify: take a method without them, such as co.Galerkin(), or "
            f'pass it negative_substeps="allow" if rate times substep, here {rate * backwards:.2g}, stays below '
            f"{SAFE:g}."
        )
    if rate * backwards < SAFE:
        return []
    return [
        f"{what} at rates up to {rate:.3g}/s, too fast for substeps that go backwards by {backwards:.3g} s: "
        f"take dt < {h * SAFE / (rate * backwards):.3g}."
    ]


def require_reversible(system: System, method: Method, h: float, steps: int) -> None:
    """Raise ArgumentError if steps h < 0 of a damping method amplify round-off excessively, by exp(λ|h| steps)."""
    rate = max(step.damping_rate(system) for step, _ in method.stages)
    if h >= 0 or rate * -h * steps <= np.log(AMPLIFIED):
        return
    most = int(np.log(AMPLIFIED) / (rate * -h))
    remedy = f"take at most {most} steps of this `dt`" if most else f"take |dt| < {np.log(AMPLIFIED) / rate:.3g} s"
    raise ArgumentError(
        f"{method.title} damps at rates up to {rate:.3g}/s, so that {steps} steps of {h:g} s back in time amplify "
        f"round-off by 1e{rate * -h * steps / np.log(10):.0f}: {remedy}, or begin earlier and go forward."
    )


def damping_rate(system: System, state: State) -> float:
    """max Re eig(−M⁻¹ ∂F/∂v), 1/s, at the start and at random velocities of its size; 0 if nothing is damped."""
    group, Q, _ = system.places
    size = group.dim + Q.dim(group)

    def slopes(state, parameters, v):
        here = replace_parameters(system, parameters)

        def split(v):
            return v[: group.dim], Q.tangent(group, state.n, v[group.dim :])

        def force(v):
            xi, nu = split(v)
            motion = here.motion(xi, state.n, nu, state.a, state.t, state.inputs, state.internal)
            torque, along_q = here.body_force(motion)
            return jnp.concatenate([torque, Q.coordinates(group, state.n, along_q)])

        def lagrangian(v):
            xi, nu = split(v)
            return here.reduced_lagrangian(xi, state.n, nu, state.a, state.t, state.inputs, state.internal)

        mass = jnp.eye(size) if here.lagrangian is None else hessian(lagrangian)(v)
        return jacfwd(force)(v), mass

    at_start = np.concatenate([state.xi, state.nu if Q.flat else np.zeros(Q.dim(group))])
    scale = float(np.max(np.abs(at_start))) or 1.0
    others = scale * np.random.default_rng(5).normal(size=(4, size))
    at = tabulate(slopes, state, system.parameters, at_start)
    return max(_rate(*at(state, system.parameters, v)) for v in (at_start, *others))


def _rate(slope: np.ndarray, mass: np.ndarray) -> float:
    """The fastest rate of decay; 0 if it is round-off, or if it cannot be computed at these velocities."""
    if not (np.all(np.isfinite(slope)) and np.all(np.isfinite(mass))) or np.linalg.cond(mass) > 1e15:
        return 0.0
    rates = np.linalg.eigvals(-np.linalg.solve(mass, slope))
    fastest = float(np.max(rates.real, initial=0.0))
    return fastest if fastest > 1e-9 * float(np.max(np.abs(rates), initial=0.0)) else 0.0
