"""The identity of a system apart from its numbers, equal in every process, and the version of the user's functions."""

from __future__ import annotations

from collections.abc import Callable

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import LagrangianError
from coadjoint.groups.group import Element
from coadjoint.kernels.trace.digest import digest, opaque
from coadjoint.kernels.trace.identity import Traced
from coadjoint.kernels.trace.jaxprs import jaxpr_of
from coadjoint.mechanics.constraints import Site
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.inputs import Inputs
from coadjoint.mechanics.internal_rule import InternalRule
from coadjoint.mechanics.internal_state import applied
from coadjoint.mechanics.signals import Signal
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.mechanics.trace_checks import IMPURE, in_words

OPAQUE = " opaque"

_UNREAD = {
    "forces": "The forces",
    "discrete_lagrangian": "The discrete Lagrangian",
    "group_lagrangian": "The discrete Lagrangian in group form",
}
"""Functions that `system.state` has not read."""


def version(system: System, state: State, *more: Callable[[State], PyTree], pure: bool = True) -> str:
    """A digest of what the user's functions compute now, including `more` functions of a state.

    A function that reads a global number is another function when that number has changed: what has been traced and
    compiled for it must not be used again. Unless they are known to be `pure`, forces and Λ are read twice: raises
    LagrangianError where the readings differ. It ends in OPAQUE where a function holds another one, such as a custom
    derivative, that tracing does not see.
    """
    s = state
    arguments = (s.g, s.xi, s.n, s.nu, s.a, s.t, s.inputs, s.internal, system.parameters)

    def at(name: str) -> Callable[..., PyTree]:
        def function(
            g: Element,
            xi: Array,
            n: Array,
            nu: Array,
            a: Array,
            t: Scalar,
            inputs: PyTree,
            internal: PyTree,
            parameters: PyTree,
        ) -> PyTree:
            here = replace_parameters(system, parameters)
            if name == "forces":
                return here.body_forces(here.motion(xi, n, nu, a, t, inputs, internal))
            if name == "constraints":
                at = Site(n, a, t, inputs)
                return [one.value(here, at) if one.holonomic else one.rows(here, at) for one in here.constraints]
            if name == "internal":
                there = state.replace(g=g, xi=xi, n=n, nu=nu, a=a, t=t, inputs=inputs, internal=internal)
                return tuple(applied(here, there, t))
            if name == "hamiltonian":
                return here.reduced_hamiltonian(xi, n, nu, a, t, inputs, internal)
            if name == "lagrangian":
                return here.reduced_lagrangian(xi, n, nu, a, t, inputs, internal)
            if name == "group_lagrangian":
                return here.reduced_group_lagrangian(g, n, nu, a, t, t, inputs, internal)
            return here.reduced_discrete_lagrangian(xi, n, nu, a, t, t, inputs, internal)

        return function

    # A new function each time: JAX caches traces by function, and a function may have changed.
    others = [jaxpr_of(lambda at, function=function: function(at), state)[0] for function in more]
    functions = ("lagrangian", "hamiltonian", "discrete_lagrangian", "group_lagrangian", "forces", "internal")
    given = [name for name in functions if getattr(system, name) is not None]
    given += ["constraints"] if system.constraints else []
    for name in () if pure else filter(_UNREAD.get, given):
        with in_words(_UNREAD[name]):
            readings = [digest(jaxpr_of(at(name), *arguments)[0]) for _ in range(2)]
        if readings[0] != readings[1]:
            raise LagrangianError(IMPURE.format(_UNREAD[name]))
    read = [*(jaxpr_of(at(name), *arguments)[0] for name in given), *others]
    return digest(*read) + (OPAQUE if any(map(opaque, read)) else "")


NUMBERS = ("parameters", "checks")
"""The fields of a system on which its functions do not depend."""
FUNCTIONS = ("lagrangian", "discrete_lagrangian", "group_lagrangian", "hamiltonian")


def parts(system: System) -> dict[str, PyTree]:
    """The parts of a system for `kernels.trace.identity`; functions that `version` traces may be the user's.

    Quantities may not: they are functions of a state, which has other fields at the start than in a record.
    """
    found = {name: getattr(system, name) for name in system.__dataclass_fields__ if name not in NUMBERS}
    if not found["constraints"]:
        del found["constraints"]  # a system without any is known by the name that it had before
    else:
        found["constraints"] = [
            (one.name, one.size, one.holonomic, one.moving, *map(Traced, one.functions)) for one in system.constraints
        ]
    for name in FUNCTIONS:
        if found[name] is not None:
            found[name] = Traced(found[name])
    if system.forces is not None:
        found["forces"] = system.forces.names, tuple(map(Traced, system.forces.functions))
    if system.internal is not None and not isinstance(system.internal, InternalRule):
        found["internal"] = Traced(system.internal)
    if system.inputs is not None:
        found["inputs"] = _sources(system.inputs)
    return found


def _sources(inputs: Inputs) -> tuple[object, ...]:
    """Signals by their functions, and functions of the motion, under their names."""

    def part(source: object) -> object:
        if type(source) is Signal:
            return "signal", Traced(source.function)
        return source if isinstance(source, Signal) or not callable(source) else Traced(source)

    return inputs.names, tuple(map(part, inputs.sources))
