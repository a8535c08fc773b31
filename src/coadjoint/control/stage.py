"""A step of a run as scalar expressions: x_{k+1} = Φ(x_k, u_k, z_k) with r(x_k, u_k, z_k) = 0."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import PyTree, Scalar
from coadjoint.control.functions import reader, traced
from coadjoint.control.inputs_between import symbolic
from coadjoint.errors import ArgumentError
from coadjoint.kernels.expressions.expression import Expr, reachable
from coadjoint.kernels.expressions.graph import Graph
from coadjoint.kernels.packing import pack
from coadjoint.kernels.trace.tracer import Tracer, flat
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.inputs import Command
from coadjoint.mechanics.internal_state import at_node
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.method import Method
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.methods.renewal import RENEWED


class FiniteGraph(Graph):
    """Expressions of finite numbers: a solver steps back by itself from others."""

    def _is_finite(self, a: Expr) -> Expr:
        return self.true


VARIED = ("t", "g", "n", "a", "mu", "pi", "inputs", "internal")
"""The parts of a state that are symbols; all others are numbers that a step does not read or sets by itself."""


PARTS = tuple(part for part in VARIED if part != "inputs")
"""Those that are numbers of the state."""


class Begun(NamedTuple):
    """A system with commands as inputs, a method, the step h (s), and a state that the method has begun from."""

    system: System
    method: Method
    h: float
    state: State


class Symbols(NamedTuple):
    """The expressions of one step that are free: those of a state with its commands, of z, parameters and h.

    The numbers of profiles precede the parameters of the system.
    """

    state: list[Expr]
    commands: list[Expr]
    unknowns: list[Expr]
    parameters: list[Expr]
    h: Expr


@dataclass
class StepGraph:
    """A step as expressions.

    state, after: the state at both ends, as trees. residual: the equations. constants: the system with the parameters,
    some of which are symbols.
    """

    tracer: Tracer
    beginning: Begun
    symbols: Symbols
    constants: Constants
    state: State
    after: State
    residual: list[Expr]

    def at_node(self, function: Callable[..., object], what: str, *more: object) -> list[Expr]:
        """function(system, state, *more) at the node where the step starts, with ξ and ν of the momenta."""
        return flat(self._at_node(lambda *given: jnp.asarray(function(*given)), what, *more))

    @cached_property
    def _node(self) -> State:
        """The state at the node where the step starts, with ξ and ν of the momenta."""
        skeleton = replace_parameters(self.beginning.system, None)

        def velocities(constants: Constants, state: State) -> PyTree:
            found = at_node(replace_parameters(skeleton, constants.system), state)
            return found.xi, found.nu

        xi, nu = traced(self.tracer, "The velocities of the momenta", velocities, self.constants, self.state)
        return self.state.replace(xi=xi, nu=nu)

    def of_place(self, function: Callable[..., object], what: str, *more: object) -> list[Expr]:
        """function(system, state, *more) where the step starts, without velocities of the momenta."""
        of_state = self._of_state(lambda *given: jnp.asarray(function(*given)))
        return flat(traced(self.tracer, what, of_state, self.constants, self.state, *more))

    def _at_node(self, function: Callable[..., object], what: str, *more: object) -> PyTree:
        """The velocities of the momenta, which take long to trace, only where the function reads them."""
        of_state = reader(self.tracer, what, self._of_state(function), self.constants, self._unmoved, *more)
        found = of_state(self.constants, self._unmoved, *more)
        symbols = {*flat(self._unmoved.xi), *flat(self._unmoved.nu)}
        return found if symbols.isdisjoint(reachable(flat(found))) else of_state(self.constants, self._node, *more)

    @cached_property
    def _unmoved(self) -> State:
        """The state at the node with symbols for ξ and ν."""
        given = self.beginning.state
        xi, nu = (self.tracer.symbols(f"{name} ", getattr(given, name)) for name in ("xi", "nu"))
        return self.state.replace(xi=xi, nu=nu)

    def _of_state(self, function: Callable[..., object]) -> Callable[..., object]:
        skeleton = replace_parameters(self.beginning.system, None)

        def of_state(constants: Constants, state: State, *more: object) -> PyTree:
            return function(replace_parameters(skeleton, constants.system), state, *more)

        return of_state

    def of_motion(self, function: Callable[..., PyTree], what: str) -> list[Expr]:
        """function(motion [, p]) of the `co.mechanics.NodeMotion` at the node where the step starts."""
        return flat(self.array_of_motion(lambda *given: jnp.asarray(function(*given)), what))

    def array_of_motion(self, function: Callable[..., object], what: str) -> PyTree:
        """`of_motion` as an array, or arrays, of expressions."""

        def given(system: System, state: State) -> PyTree:
            arguments = () if system.parameters is None else (system.parameters,)
            return function(system.motion_at(state, state.inputs), *arguments)

        return self._at_node(given, what)

    def needed(self, roots: Iterable[Expr]) -> list[int]:
        """The numbers of the state on which the roots depend, directly or through later steps."""
        places = {node: place for place, node in enumerate(self.symbols.state)}
        after = flat(parts_of(self.after))
        found: set[int] = set()
        new = {places[node] for node in reachable([*roots, *self.residual]) if node in places}
        while new:
            found |= new
            ahead = reachable(after[place] for place in new)
            new = {places[node] for node in ahead if node in places} - found
        return sorted(found)

    def next(self) -> list[Expr]:
        """The numbers of the state after the step, in the order of `symbols.state`."""
        return flat(parts_of(self.after))

    def names(self) -> list[str]:
        """The names of the numbers of the state, as in "mu[0]" and "g.R[1,2]", in the order of `symbols.state`."""
        found = []
        for part, tree in zip(PARTS, parts_of(self.beginning.state), strict=True):
            for path, leaf in jax.tree_util.tree_leaves_with_path(tree):
                name = part + jax.tree_util.keystr(path)
                found += [f"{name}{list(place)}" if place else name for place in np.ndindex(np.shape(leaf))]
        return found

    def numbers(self, states: State) -> np.ndarray:
        """States with leading axes as rows of the numbers that are symbols."""
        lead = np.shape(states.t)
        return np.concatenate([np.asarray(leaf, float).reshape(*lead, -1) for leaf in self.leaves(states)], axis=-1)

    def filled(self, state: State, numbers: np.ndarray) -> State:
        """The state with these numbers in place of those that are symbols."""
        leaves, structure = jax.tree_util.tree_flatten(parts_of(state))
        found, begin = [], 0
        for leaf in leaves:
            size = int(np.size(leaf))
            found.append(np.reshape(numbers[begin : begin + size], np.shape(leaf)))
            begin += size
        return state.replace(**dict(zip(PARTS, jax.tree_util.tree_unflatten(structure, found), strict=True)))

    def leaves(self, state: State) -> list[PyTree]:
        """The arrays of a state of which the numbers are symbols."""
        return jax.tree_util.tree_leaves(parts_of(state))


def parts_of(state: State) -> tuple[PyTree, ...]:
    """The parts of a state whose numbers are symbols, in their order."""
    return tuple(getattr(state, part) for part in PARTS)


def step_graph(beginning: Begun, free: tuple[str, ...] = ()) -> StepGraph:
    """The step of `beginning` as expressions; `free`: names of parameters that are symbols.

    Raises ArgumentError for methods whose steps are not equations alone, LagrangianError for functions that JAX cannot
    trace.
    """
    system, method, _, state = beginning
    if method.variable or any(step.tolerant for step, _ in method.pattern):
        raise ArgumentError(
            f"{method.title} chooses its steps by itself, so that they cannot be constraints of an optimum: use a "
            "method "
            "with fixed steps, such as co.Midpoint()."
        )
    tracer = Tracer(FiniteGraph())
    free_symbols, parameters = _parameters(tracer, system, free)
    h = tracer.graph.symbol("h")
    holds = system.internal is not None or (system.inputs is not None and system.inputs.holds)
    constants = Constants(parameters, {}, RENEWED if holds else None)
    symbols = {part: tracer.symbols(f"{part} ", getattr(state, part)) for part in VARIED}
    symbols["inputs"], commands, profiles = _commands(tracer, system, state, symbols["t"], h)
    rest = {"t_rest": np.zeros(()), "xi": np.zeros_like(state.xi), "nu": np.zeros_like(state.nu)}
    begun = state.replace(**symbols, **rest)
    if state.internal_due is not None:
        begun = begun.with_course(symbols["internal"], state.internal_mean, state.internal_end, np.ones(()))
    program = StepProgram(replace_parameters(system, None), method)
    node = traced(tracer, "The step", program.prepare, constants, begun, np.asarray(h))
    held = node.inputs
    unknowns: list[Expr] = []
    residual: list[Expr] = []
    for part in program.substeps:
        length = np.asarray(tracer.graph.mul(h, tracer.graph.constant(part)))
        z = tracer.symbols(f"z{len(unknowns)} ", np.zeros(program.unknowns))
        found, node = traced(tracer, "The step", program.substep, constants, node, length, z)
        unknowns += flat(z)
        residual += flat(found)
    named = Symbols(flat(parts_of(begun)), commands, unknowns, [*profiles, *free_symbols], h)
    begun = begun.replace(inputs=held)
    return StepGraph(tracer, beginning, named, constants, begun, node, residual)


def _commands(tracer: Tracer, system: System, state: State, t: Scalar, h: Expr) -> tuple[Any, list[Expr], list[Expr]]:
    """The inputs held over the step, with symbols for chosen ones, and these symbols, of the step and of all steps;
    functions are evaluated there."""
    inputs = system.inputs
    if inputs is None or inputs.names is None or state.inputs is None:
        return state.inputs, [], []
    held, of_step, of_all = state.inputs.asdict(), [], []
    for name, source in zip(inputs.names, inputs.sources, strict=True):
        if isinstance(source, Command):
            one = symbolic(tracer, name, source, held[name], t, h)
            held[name] = one.held
            of_step += one.of_step
            of_all += one.of_all
    return type(state.inputs)(**held), of_step, of_all


def _parameters(tracer: Tracer, system: System, free: tuple[str, ...]) -> tuple[list[Expr], Any]:
    """The symbols of the free parameters, and the parameters with these in place of numbers."""
    if not free:
        return [], system.parameters
    parameters = system.parameters
    symbols: list[Expr] = []
    for name in free:
        value = getattr(parameters, name)
        tree = tracer.symbols(f"p {name} ", value)
        symbols += flat(tree)
        parameters = _with(parameters, name, tree)
    return symbols, parameters


def _with(parameters: PyTree, name: str, tree: PyTree) -> PyTree:
    leaves, structure = jax.tree_util.tree_flatten(parameters)
    places = jax.tree_util.tree_leaves(jax.tree_util.tree_unflatten(structure, range(len(leaves))))
    owners = jax.tree_util.tree_leaves(getattr(jax.tree_util.tree_unflatten(structure, places), name))
    for place, leaf in zip(owners, jax.tree_util.tree_leaves(tree), strict=True):
        leaves[place] = leaf
    return jax.tree_util.tree_unflatten(structure, leaves)


def numbers_of(tree: PyTree) -> np.ndarray:
    """The numbers of a tree in the order of its leaves."""
    return pack(tree)[1]
