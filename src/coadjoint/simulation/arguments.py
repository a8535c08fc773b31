"""The arguments of `simulate`, `trajectory` and `Stepper`, checked before anything runs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from jax import numpy as jnp

from coadjoint import checks
from coadjoint.arrays import PyTree, Scalar
from coadjoint.checks import MOST, array, positive, uneven, whole
from coadjoint.checks import steps as whole_steps
from coadjoint.errors import ArgumentError, LagrangianError
from coadjoint.kernels.trace.evaluate import evaluate, tabulate, traced
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.jumping_inputs import require_smooth_place
from coadjoint.mechanics.members import Each, member_of
from coadjoint.mechanics.signals import Held, Linear, Signal
from coadjoint.mechanics.start import with_own_momenta
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.mechanics.trace_checks import in_words, require_float64
from coadjoint.methods.method import Method


def read_of(read: Callable[[State], PyTree], what: str, state: State) -> PyTree:
    """read(state); passes its errors on, or raises ArgumentError if `what` can be read only from a state with g."""
    try:
        return read(state)
    except (LagrangianError, AttributeError) as error:
        if state.g is None and _can_be_read(read, state.replace(g=evaluate(state.places.group.identity))):
            raise needs_g(what) from error
        raise


def needs_g(what: str, verb: str = "needs") -> ArgumentError:
    """The error for something that cannot be read without g."""
    return ArgumentError(f"{what} {verb} g, which this method does not compute: see its carry_g.")


def _can_be_read(read: Callable[[State], PyTree], state: State) -> bool:
    try:
        read(state)
    except (LagrangianError, AttributeError):
        return False
    return True


def require_places(state: State, places: object, name: str) -> None:
    """Raise ArgumentError for the state of a system with another group or other spaces."""
    if state.places != places:
        raise ArgumentError(f"Argument `{name}` belongs to a system with another group or other spaces.")


def require_kinds(system: Any, start: PyTree, method: Any) -> None:
    """Raise ArgumentError unless these are a system, a start of it and a method."""
    checks.instance(system, "system", System, "a co.System")
    if not isinstance(start, State) and isinstance(getattr(start, "final", None), State):
        raise ArgumentError(
            f"Argument `start` must be a state, but is a {type(start).__name__}: give its last record, `run.final`."
        )
    checks.instance(start, "start", State, "a state, system.state(…)")
    require_places(start, system.places, "start")
    checks.expect(isinstance(method, Method), method, "method", "a method such as co.Midpoint()")


def step_size(dt: Scalar) -> Scalar:
    """A step of a trajectory: one number, traced or finite, not zero; negative ones go back in time."""
    h = array(dt, "dt", ())
    if not traced(h) and h == 0:
        raise ArgumentError("Argument `dt` must not be zero: the steps would go nowhere.")
    return h


def grid(dt: Scalar, duration: Any, steps: Any) -> tuple[float, int]:
    """The step size and the number of steps of a run; raises ArgumentError."""
    h = positive(dt, "dt")
    if (duration is None) == (steps is None):
        raise ArgumentError("Give either `duration` or `steps`, one of them.")
    if steps is not None:
        return h, whole(steps, "steps")
    duration = positive(duration, "duration")
    count = whole_steps(duration, h)
    if count is None:
        raise ArgumentError(
            f"Argument `duration` must be a whole number of steps, but {uneven(duration, h)}; give "
            f"duration={max(round(duration / h), 1) * h:.12g}."
        )
    if count > MOST:
        raise ArgumentError(f"Argument `duration` must be at most 2⁵³ steps, but {duration} s is {count:.3g} of {h} s.")
    return h, count


def with_inputs(system: System, start: State, inputs: PyTree, by_velocities: bool = False) -> tuple[System, State]:
    """The system driven by `inputs`, and the start with the inputs held over its first step.

    The start keeps the momenta that it has with its own inputs, whatever drives the run; with `by_velocities` it keeps
    ξ₀, ν₀. In an ensemble the held inputs are those of the first member: each member takes its own when it starts.
    Raises ArgumentError and LagrangianError for values that cannot be inputs.
    """
    if isinstance(inputs, Each):
        raise ArgumentError("Argument `inputs` must be the same for all members: let it depend on their parameters.")
    own, system = system, system.driven(inputs)
    if system.inputs is None:
        return system, start
    reading = [one for one in system.constraints if one.takes_inputs]
    if not (system.forces or system.internal or system.quantities or reading or system.takes("inputs")):
        raise ArgumentError(
            "Nothing takes these inputs: this system has no forces and no rule, and its functions do not take `inputs`."
        )
    for source in system.inputs.sources:
        if isinstance(source, Signal):
            _check_signal(source, start)
    if not by_velocities:
        start = with_own_momenta(own, start)
    many = np.ndim(start.t) > 0
    first = jax.tree.map(lambda leaf: leaf[0], start) if many else start
    held = held_at(replace_parameters(system, member_of(system.parameters, 0)), first) if system.inputs.holds else None
    for one in reading:
        if one.holonomic:
            require_smooth_place(one, replace_parameters(system, member_of(system.parameters, 0)), first, held)
    if many:
        held = jax.tree.map(lambda leaf: np.broadcast_to(leaf, (len(start.t), *np.shape(leaf))), held)
    return system, start.replace(inputs=held)


def held_at(system: System, state: State) -> PyTree:
    """The inputs held over the step that starts at a state."""

    def first(state):
        return inputs_held(system, state)

    try:
        require_float64(first, "The function `inputs`", (state,))
        with in_words("The function `inputs`"):
            found = evaluate(first, state)
    except LagrangianError as error:
        if "functools.partial" not in str(error):  # the motion, taken for a number
            raise
        raise LagrangianError(
            "The function `inputs` is given the motion at a node, not the time: read motion.t there, or give "
            "co.mechanics.Signal(function) of a function of the time."
        ) from error
    return found if traced(found) else jax.tree.map(lambda leaf: np.asarray(leaf, dtype=float), found)


def inputs_held(system: System, s: State) -> Any:
    """The held inputs as a function of the state, for tracing."""
    assert system.inputs is not None
    return system.inputs.held(system.motion_at(s), s.inputs)


def _check_signal(source: Signal, start: State) -> None:
    """Raise unless a signal is finite and float64 at the start."""
    if traced(getattr(source, "values", None), getattr(source, "times", None)):
        raise ArgumentError(
            "Argument `inputs` cannot hold numbers that are being differentiated or mapped: make them parameters, and "
            "use co.Linear(times, p.values) inside the forces."
        )
    if isinstance(source, (Held, Linear)) and all(np.all(np.isfinite(x)) for x in (source.times, source.values)):
        return
    t = np.float64(0.0) if traced(start.t) else np.ravel(start.t)[0]
    require_float64(getattr(source, "function", source), "The signal", (t,))
    with in_words("The signal"):
        value = evaluate(source, t)
    checks.expect(np.all(np.isfinite(value)), value, "A signal", f"finite at the start, t = {t:g} s")


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

        mass = jnp.eye(size) if here.lagrangian is None else jax.hessian(lagrangian)(v)
        return jax.jacfwd(force)(v), mass

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
