"""The arguments of `co.System`, checked: spaces, parameters, texts, and how its functions are called."""

from __future__ import annotations

from collections.abc import Mapping

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import LagrangianError
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.reduced_functions import TRIVIAL, ReducedFunctions
from coadjoint.mechanics.signatures import require_signature
from coadjoint.spaces import Several, Space
from coadjoint.spaces.named import require_names


def space_from(space: Space | Mapping[str, Space] | None, name: str) -> Space:
    """The space given by a space, a dictionary of spaces or None; raises ArgumentError."""
    if space is None:
        return TRIVIAL
    if isinstance(space, Mapping):
        return Several(space)
    checks.instance(space, name, Space, "a space such as co.Defining(), or a dictionary of them")
    return space


def parameters_from(parameters: Parameters | Mapping[str, PyTree] | None) -> Parameters | None:
    """Parameters, also from a dictionary of values; raises ArgumentError."""
    if isinstance(parameters, Mapping):
        require_names(parameters)
        parameters = Parameters(**parameters)
    if parameters is not None:
        checks.instance(parameters, "parameters", Parameters, "co.Parameters(…)")
    return parameters


def require_plain(name: object, units: object, verify: object) -> None:
    """Raise ArgumentError unless the name is a text, units are texts by name, and `verify` is True or False."""
    checks.instance(name, "name", str, "a text")
    fits = units is None or (isinstance(units, Mapping) and all(isinstance(u, str) for u in units.values()))
    checks.expect(fits, units, "units", 'a dictionary of texts such as {"energy": "J"}')
    checks.instance(verify, "verify", bool, "True or False")


def require_functions(system: ReducedFunctions) -> None:
    """Raise LagrangianError unless a system has ℓ, ℋ or Λ, and its functions take what they are called with."""
    if not system.continuous and system.discrete_lagrangian is None and system.group_lagrangian is None:
        raise LagrangianError(
            "A system needs a `lagrangian`, a `hamiltonian`, a `discrete_lagrangian` or a `group_lagrangian`."
        )
    if system.lagrangian is not None and system.hamiltonian is not None:
        raise LagrangianError("A system is given by its `lagrangian` or by its `hamiltonian`, not by both.")
    dynamic = system.additional != TRIVIAL
    last = (["a"] if system.advected != TRIVIAL else []) + (["p"] if system.parameters is not None else [])
    if system.lagrangian is not None:
        require_signature(system.lagrangian, "The Lagrangian", ["xi", *(["n", "nu"] if dynamic else []), *last])
    if system.hamiltonian is not None:
        require_signature(system.hamiltonian, "The Hamiltonian", ["mu", *(["n", "pi"] if dynamic else []), *last])
    last = [*(["n", "s"] if dynamic else []), *last, "h"]
    if system.discrete_lagrangian is not None:
        require_signature(system.discrete_lagrangian, "The discrete Lagrangian", ["xi", *last])
    if system.group_lagrangian is not None:
        require_signature(system.group_lagrangian, "The discrete Lagrangian in group form", ["F", *last])
    if system.internal is not None:
        own = ["motion", "h", *(["p"] if system.parameters is not None else [])]
        require_signature(system.internal, "The rule `internal`", own)
