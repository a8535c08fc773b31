"""Systems in a time of their own, for close encounters: dt = σ ds with the same orbits."""

from __future__ import annotations

import inspect
from collections.abc import Callable

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.reduced_functions import TRIVIAL
from coadjoint.mechanics.signatures import keyword_only, require_signature
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.spaces import Several, Trivial
from coadjoint.spaces.named import Named


def in_own_time(system: System, start: State, pace: Callable[..., PyTree]) -> tuple[System, State]:
    """The system of σ(ℋ − E) and its start: the same orbits over s with dt = σ ds, for steps of equal ds.

        kepler = co.System(co.Translation(0), hamiltonian=energy, additional=co.Trivial(2))
        far = kepler.state(q=[1.99, 0], pi=[0, 0.07])
        orbit, begun = co.mechanics.in_own_time(kepler, far, lambda mu, n, pi: jnp.sqrt(n @ n))
        run = co.simulate(orbit, begun, dt=0.006, steps=1000, method=co.Suzuki4(co.HamiltonianMidpoint()))

    The time t is a further additional variable with the momentum −E, E = ℋ at the start, so that σ(ℋ − E) = 0 along
    the motion: symplectic methods are symplectic in the extended phase space, and symmetric ones reversible. The
    variables of `run.dataset` are `q_q`, or `q_` with the names of the spaces, and `q_time`; `t` there is s. Momenta of
    the group stay conserved. The Lagrangian of σ(ℋ − E) is singular: use co.HamiltonianMidpoint and its compositions.

    Arguments:
        system: a system given by its `hamiltonian`, with or without explicit time.
        start: one of its states.
        pace: σ, a positive function of the arguments of ℋ by position, mu [, n, pi] [, a] [, p], that returns one
            number: small where the motion is fast, such as a distance or a product of distances. It must be positive
            along the orbit: t stops at σ = 0, and near it σ(ℋ − E) = 0 no longer holds ℋ = E.

    Raises ArgumentError for a system without ℋ, with forces, inputs, an internal state, constraints or a space named
    `time`, for a start of several members, and where σ is not positive at the start; LagrangianError for a σ with other
    arguments. Source: Hairer, Lubich, Wanner, Geometric Numerical Integration (2006), VIII.2.
    """
    _require(system, start)
    moves = system.additional != TRIVIAL
    last = (["a"] if system.advected != TRIVIAL else []) + (["p"] if system.parameters is not None else [])
    require_signature(pace, "The pace", ["mu", *(["n", "pi"] if moves else []), *last])
    spaces = _named(system)
    made = System(
        system.group,
        hamiltonian=_extended(system, pace),
        additional={**spaces, "time": Trivial(1)},
        advected=None if system.advected == TRIVIAL else system.advected,
        parameters=system.parameters,
        name=f"{system.name} in its own time",
        verify=system.verify,
        checks=system.checks,
    )
    return made, _begun(system, start, made, pace)


def _require(system: System, start: State) -> None:
    checks.instance(system, "system", System, "a system with a `hamiltonian`")
    if system.hamiltonian is None:
        raise ArgumentError("A system in its own time is made of ℋ: give co.System `hamiltonian` instead of ℓ.")
    driven = system.forces, system.internal, system.inputs
    if any(part is not None for part in driven) or system.constraints or system.takes("inputs"):
        raise ArgumentError(
            "A system in its own time has ℋ alone, but this one has forces, inputs, an internal state or constraints: "
            "leave these out, or take a smaller dt."
        )
    checks.expect("time" not in _named(system), "time", "The name of a space", "another one: `time` holds t")
    fits = isinstance(start, State) and start.places == system.places and np.ndim(start.t) == 0
    checks.expect(fits, start, "start", f"one state of `{system.name}`")


def _named(system: System) -> dict[str, PyTree]:
    """The spaces of q by their names in the extended system."""
    space = system.additional
    if space == TRIVIAL:
        return {}
    return dict(zip(space.names, space.factors, strict=True)) if isinstance(space, Several) else {"q": space}


def _extended(system: System, pace: Callable[..., PyTree]) -> Callable[..., PyTree]:
    """σ(ℋ − E) of the extended arguments."""
    energy, space = system.hamiltonian, system.additional
    assert energy is not None
    timed = keyword_only(inspect.signature(energy).parameters, "t")

    def without_time(x: Named) -> list[PyTree]:
        if space == TRIVIAL:
            return []
        parts = {name: part for name, part in x.asdict().items() if name != "time"}
        return [Named(**parts) if isinstance(space, Several) else parts["q"]]

    def in_own_time(mu: PyTree, n: Named, pi: Named, *more: PyTree):
        arguments = (mu, *without_time(n), *without_time(pi), *more)
        value = energy(*arguments, t=n.time[0]) if timed else energy(*arguments)
        return jnp.asarray(pace(*arguments)) * (value + pi.time[0])

    return in_own_time


def _begun(system: System, start: State, made: System, pace: Callable[..., PyTree]) -> State:
    """The start of the extended system at s = 0."""
    group, Q, V = system.places

    def values(s: State):
        E = system.reduced_hamiltonian(s.mu, s.n, s.pi, s.a, s.t)
        sigma = jnp.asarray(pace(*system._views(group.view(s.mu), (s.n, s.pi), s.a)))
        return E, sigma, Q.act(group, s.g, s.n), V.act(group, s.g, s.a)

    E, sigma, q, a0 = evaluate(values, start)
    checks.expect(np.shape(sigma) == () and sigma > 0, sigma, "pace", "a function to one positive number at the start")
    q = Q.given(group, q)
    places = q if isinstance(Q, Several) else ({} if Q == TRIVIAL else {"q": q})
    return made.state(
        g=start.g,
        q={**places, "time": [float(start.t)]},
        mu=start.mu,
        pi=np.concatenate([start.pi, [-float(E)]]),
        a0=None if V == TRIVIAL else V.given(group, a0),
    )
