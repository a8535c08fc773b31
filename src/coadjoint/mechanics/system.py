"""A mechanical system with symmetry: a group, the spaces it acts on, and a reduced Lagrangian."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.errors import ArgumentError, GroupError, LagrangianError
from coadjoint.groups import LieGroup
from coadjoint.groups.group import Array
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.state import Force, Motion, Places, State
from coadjoint.spaces import Several, Space, Trivial
from coadjoint.spaces.named import Named

_NOWHERE = Trivial(0)


@jax.tree_util.register_dataclass
@dataclass(frozen=True, init=False)
class System:
    """ℓ(ξ, n, ν, a) on 𝔤 × TQ × V* with its group, spaces and parameters (P17).

    `lagrangian`: a function of xi [, n, nu] [, a] [, p] that returns a number in terms of jax.numpy; n, ν come with
    `additional`, a with `advected`, p with `parameters`; it may take keyword-only `t` and `inputs`.
    `discrete_lagrangian`: Λ(ξ, n, s, a, p, h) with s = g_k⁻¹q_{k+1} instead of or beside ℓ (the papers' h·ℓᵈ).
    `additional`, `advected`: a space, or a dictionary of spaces that reach ℓ as n.name, a.name.
    `forces`: a function (motion, p) → Force(torque, force), body frame.
    `name`, `units`: for cards, files and figures; units of dataset variables, as in {"q": "m", "energy": "J"}.
    Raises LagrangianError or GroupError for functions and spaces that do not fit.
    """

    group: LieGroup = field(metadata={"static": True})
    lagrangian: Callable[..., Any] | None = field(metadata={"static": True})
    additional: Space = field(metadata={"static": True})
    advected: Space = field(metadata={"static": True})
    forces: Callable[..., Force] | None = field(metadata={"static": True})
    discrete_lagrangian: Callable[..., Any] | None = field(metadata={"static": True})
    name: str = field(metadata={"static": True})
    units: tuple[tuple[str, str], ...] = field(metadata={"static": True})
    parameters: Parameters | None

    def __init__(
        self,
        group: LieGroup,
        lagrangian: Callable[..., Any] | None = None,
        *,
        additional: Space | Mapping[str, Space] | None = None,
        advected: Space | Mapping[str, Space] | None = None,
        parameters: Parameters | Mapping[str, Any] | None = None,
        forces: Callable[..., Force] | None = None,
        discrete_lagrangian: Callable[..., Any] | None = None,
        name: str = "",
        units: Mapping[str, str] | None = None,
    ):
        if not isinstance(group, LieGroup):
            raise GroupError(f"Argument `group` must be a Lie group such as co.SO3(), but is {group!r}.")
        if isinstance(parameters, Mapping):
            parameters = Parameters(**parameters)
        if parameters is not None and not isinstance(parameters, Parameters):
            raise ArgumentError(f"Argument `parameters` must be co.Parameters(…), but is {parameters!r}.")
        values = {
            "group": group,
            "lagrangian": lagrangian,
            "additional": _space(additional, "additional"),
            "advected": _space(advected, "advected"),
            "forces": forces,
            "discrete_lagrangian": discrete_lagrangian,
            "name": name or getattr(lagrangian or discrete_lagrangian, "__name__", "system"),
            "units": tuple(dict(units or {}).items()),
            "parameters": parameters,
        }
        for key, value in values.items():
            object.__setattr__(self, key, value)
        for space in (self.additional, self.advected):
            space.require_fit(group)
        self._check_signatures()

    @property
    def places(self) -> Places:
        """G, Q and V*."""
        return Places(self.group, self.additional, self.advected)

    @property
    def unknowns(self) -> int:
        """dim G + dim Q, the number of equations of a step."""
        return self.group.dim + self.additional.dim(self.group)

    def replace(self, **values: Any) -> System:
        """A copy with some parameters replaced: `vehicle.replace(mass=130.0)`."""
        if self.parameters is None:
            raise ArgumentError("This system has no parameters to replace.")
        return replace_parameters(self, self.parameters.replace(**values))

    def reduced_lagrangian(self, xi, n, nu, a, t=0.0, inputs=None) -> Array:
        """ℓ(ξ, n, ν, a) with this system's parameters."""
        if self.lagrangian is None:
            raise LagrangianError(
                "This system has a discrete Lagrangian only; use the method co.Variational(difference_map)."
            )
        arguments = self._views(xi, (n, nu), a)
        return self.lagrangian(*arguments, **self._keywords(self.lagrangian, t, inputs))

    def reduced_discrete_lagrangian(self, xi, n, s, a, h, t=0.0, inputs=None) -> Array:
        """Λ(ξ, n, s, a; h) with this system's parameters."""
        if self.discrete_lagrangian is None:
            raise LagrangianError("This system has no discrete Lagrangian; pass `discrete_lagrangian` to co.System.")
        arguments = self._views(xi, (n, s), a)
        return self.discrete_lagrangian(*arguments, h, **self._keywords(self.discrete_lagrangian, t, inputs))

    def _views(self, xi, pair: tuple[Array, Array], a) -> list[Any]:
        """xi [, n, nu] [, a] [, p]: what this system's functions take."""
        arguments = [xi]
        if self.additional != _NOWHERE:
            arguments += [self.additional.view(self.group, x) for x in pair]
        if self.advected != _NOWHERE:
            arguments.append(self.advected.view(self.group, a))
        return arguments if self.parameters is None else [*arguments, self.parameters]

    def takes(self, key: str) -> bool:
        """Whether ℓ or Λ takes the keyword `t` or `inputs`."""
        functions = (self.lagrangian, self.discrete_lagrangian)
        return any(f is not None and _keyword_only(inspect.signature(f).parameters, key) for f in functions)

    @staticmethod
    def _keywords(function: Callable[..., Any], t, inputs) -> dict[str, Any]:
        known = inspect.signature(function).parameters
        return {key: value for key, value in (("t", t), ("inputs", inputs)) if _keyword_only(known, key)}

    def motion(self, xi, n, nu, a, t, inputs=None, internal=None) -> Motion:
        """What forces and inputs see."""
        view = self.additional.view
        return Motion(
            xi, view(self.group, n), view(self.group, nu), self.advected.view(self.group, a), t, inputs, internal
        )

    def body_force(self, motion: Motion) -> tuple[Array, Array]:
        """(T, f), zero where the system has no forces."""
        dims = (self.group.dim, self.additional.ambient(self.group))
        if self.forces is None:
            return jnp.zeros(dims[0]), jnp.zeros(dims[1])
        force = self.forces(motion, self.parameters) if self.parameters is not None else self.forces(motion)
        if not isinstance(force, Force):
            raise LagrangianError(
                f"`forces` must return co.Force(torque=…, force=…), but returned {type(force).__name__}."
            )
        torque = _covector(self.group, "torque", force.torque, dims[0], None)
        return torque, _covector(self.group, "force", force.force, dims[1], self.additional)

    def state(
        self, *, g=None, q=None, xi=None, qdot=None, a0=None, t: float = 0.0, inputs=None, internal=None
    ) -> State:
        """The state at configuration (g, q) with body velocity ξ (dim,), space-frame velocity q̇ and advected a₀.

        n = g⁻¹q, ν = g⁻¹q̇, a = g⁻¹a₀ (P17); μ, π by the continuous Legendre transform. g defaults to e, ξ to rest.
        Raises ArgumentError for wrong shapes and for g outside G.
        """
        from coadjoint.mechanics.start import starting_state

        return starting_state(self, g, q, xi, qdot, a0, t, inputs, internal)

    def check(self, start: State) -> list[str]:
        """Raise where ℓ cannot be integrated from `start`; return warnings: what is unusual, a sentence each."""
        from coadjoint.mechanics.check import check

        return check(self, start)

    def _check_signatures(self) -> None:
        if self.lagrangian is None and self.discrete_lagrangian is None:
            raise LagrangianError("A system needs a `lagrangian` or a `discrete_lagrangian`.")
        middle = ["n", "nu"] if self.additional != _NOWHERE else []
        last = (["a"] if self.advected != _NOWHERE else []) + (["p"] if self.parameters is not None else [])
        if self.lagrangian is not None:
            _check_signature(self.lagrangian, "The Lagrangian", ["xi", *middle, *last])
        if self.discrete_lagrangian is not None:
            middle = [name.replace("nu", "s") for name in middle]
            _check_signature(self.discrete_lagrangian, "The discrete Lagrangian", ["xi", *middle, *last, "h"])
        if self.forces is not None:
            _check_signature(self.forces, "The forces", ["motion", *(["p"] if self.parameters is not None else [])])


def replace_parameters(system: System, parameters: Parameters | None) -> System:
    """A copy of the system with these parameters; with None, its static skeleton."""
    leaves = {name: getattr(system, name) for name in System.__dataclass_fields__}
    made = object.__new__(System)
    for name, value in {**leaves, "parameters": parameters}.items():
        object.__setattr__(made, name, value)
    return made


def _space(space: Space | Mapping[str, Space] | None, name: str) -> Space:
    if space is None:
        return _NOWHERE
    if isinstance(space, Mapping):
        return Several(space)
    if not isinstance(space, Space):
        raise ArgumentError(
            f"Argument `{name}` must be a space such as co.Defining(), or a dictionary of spaces, but is {space!r}."
        )
    return space


def _keyword_only(known: Mapping[str, inspect.Parameter], key: str) -> bool:
    return key in known and known[key].kind is inspect.Parameter.KEYWORD_ONLY


def _check_signature(function: Callable[..., Any], what: str, expected: list[str]) -> None:
    """Raise LagrangianError unless the function can be called with the expected positional arguments."""
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError) as error:
        raise LagrangianError(f"{what} must be a Python function, but is {function!r}.") from error
    kinds = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    takes = [p.name for p in signature.parameters.values() if p.kind in kinds]
    extra = [
        p.name
        for p in signature.parameters.values()
        if p.kind is inspect.Parameter.KEYWORD_ONLY and p.name not in ("t", "inputs") and p.default is p.empty
    ]
    moved = [name for name, place in zip(takes, expected, strict=False) if name in expected and name != place]
    if moved:
        raise LagrangianError(
            f"{what} must take ({', '.join(expected)}) in this order, but takes ({', '.join(takes)}): "
            "arguments are passed by position."
        )
    open_ended = any(p.kind is inspect.Parameter.VAR_POSITIONAL for p in signature.parameters.values())
    if extra or (len(takes) != len(expected) and not open_ended):
        raise LagrangianError(
            f"{what} of this system must take ({', '.join(expected)}), but takes ({', '.join(takes + extra)}): "
            "n and nu come with `additional`, a with `advected`, p with `parameters`."
        )


def _covector(group: LieGroup, name: str, value: Any, size: int, space: Space | None) -> Array:
    """A torque, or a force on a space, as a flat array; on several spaces from the parts by their names."""
    if value is None:
        return jnp.zeros(size)
    if isinstance(value, (Named, Mapping)):
        parts = value.asdict() if isinstance(value, Named) else value
        spaces = dict(zip(space.names, space.factors, strict=True)) if isinstance(space, Several) else {}
        if set(parts) != set(spaces):
            expected = f"the parts {', '.join(spaces)}" if spaces else f"one array of shape ({size},)"
            raise LagrangianError(f"The {name} of co.Force must have {expected}, but has the parts {', '.join(parts)}.")
        return jnp.concatenate(
            [_covector(group, f"{name}.{key}", parts[key], s.ambient(group), s) for key, s in spaces.items()]
        )
    if isinstance(value, (list, tuple)):
        value = jnp.stack([jnp.asarray(part) for part in value])
    if np.shape(value) != (size,):
        raise LagrangianError(f"The {name} of co.Force must have shape ({size},), but has shape {np.shape(value)}.")
    return jnp.asarray(value)
