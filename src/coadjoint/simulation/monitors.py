"""The monitors of every step: energies, Kelvin–Noether quantities, budgets and the distance from the group."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import jax.numpy as jnp

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.extensions import import_string
from coadjoint.mechanics import continuous, inverse_legendre, reactions, symmetries
from coadjoint.mechanics.internal_state import at_node
from coadjoint.mechanics.noether import KelvinNoether, spatial_momentum
from coadjoint.mechanics.quantities import value
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.mechanics.work_balance import energy_lines, energy_put_in, momentum_put_in
from coadjoint.methods.method import Method
from coadjoint.methods.step import Step


@dataclass(frozen=True)
class Watched:
    """A variable that a monitor gives, or several with a common beginning of their names, as `work` for `work_drag`.

    meaning: its description in datasets. unit: a unit, or with `like` that of another variable of the system. line: the
    kind of line in the certificate under its `title`: its change, the gap of a budget, or its largest value, described
    by `largest`; empty without a line. axis: the dimension of its components in datasets.
    """

    name: str
    meaning: str
    unit: str = ""
    like: str = ""
    line: Literal["", "change", "budget", "residual"] = ""
    title: str = ""
    largest: str = ""
    axis: str = "quantity"


@dataclass(frozen=True)
class Monitor:
    """A function (system, step, record, h, constants) → {name: value} of every step, and the variables that it gives.

    when: (system, method, state) → whether runs of this system by this method observe it.
    """

    observe: Callable[..., PyTree]
    watched: tuple[Watched, ...]
    when: Callable[..., bool]

    def __call__(self, system: object, step: Any, record: Any, h: object, constants: PyTree) -> Any:
        return self.observe(system, step, record, h, constants)

    def __reduce__(self) -> tuple[object, ...]:
        """By name if the monitor replaces its function in the module of that function; otherwise by its fields."""
        module, name = self.observe.__module__, getattr(self.observe, "__name__", "")
        if getattr(sys.modules.get(module), name, None) is self:
            return import_string, (f"{module}:{name}",)
        return Monitor, (self.observe, self.watched, self.when)


def monitor(*watched: Watched, when: Callable[..., bool]) -> Callable[[Callable[..., PyTree]], Monitor]:
    """Make a function a monitor of these variables."""
    return lambda function: Monitor(function, watched, when)


def _always(system: System, method: Method, state: State) -> bool:
    return True


@monitor(
    Watched(
        "discrete_energy",
        "E = −∂Λ/∂h of the first stage of the step, with the discrete velocities",
        line="change",
        title="energy, discrete",
    ),
    when=_always,
)
def discrete_energy(system: System, step: Step, record: State, h: Scalar, constants: PyTree) -> dict[str, Array]:
    """E_k = −∂_hΛ with the discrete velocities: the paper's K_k + U_k for the left rule (P68, P69)."""
    return {"discrete_energy": step.energy(system, record, h)}


@monitor(
    Watched("energy", "Legendre energy of (μ, π)", line="change", title="energy"),
    Watched(
        "legendre_residual",
        "residual of ∂ℓ = (μ, π) of the velocities at the node, relative to μ and π or, where ξ and ν cancel in them, "
        "to what either alone gives; what is round-off of these counts as 16 ε at most",
        line="residual",
        title="Legendre",
        largest="∂ℓ = (μ, π) at the nodes, largest residual, relative",
    ),
    when=lambda system, method, state: system.continuous,
)
def legendre_energy(system: System, step: Step, record: State, h: Scalar, constants: PyTree) -> dict[str, Array]:
    """The Legendre energy of (μ_k, π_k), at the node itself, and how well the velocities of these were found."""
    if system.hamiltonian is not None:
        return {"energy": continuous.energy(system, record)}
    xi, nu, residual = inverse_legendre.velocities(system, record)
    found = {} if residual is None else {"legendre_residual": residual}
    return {"energy": continuous.energy_at(system, record, xi, nu), **found}


@monitor(
    Watched("work", "energy that this has put in since the start", like="energy"),
    Watched(
        "energy_budget", "Legendre energy less what was put in", like="energy", line="budget", title="energy budget"
    ),
    when=lambda system, method, state: state.ledger is not None and bool(energy_lines(system)),
)
def energy_budget(system: System, step: Step, record: State, h: Scalar, constants: PyTree) -> dict[str, Array]:
    """The work W of each force, and E − ΣW, which is constant to the method's order."""
    put_in = energy_put_in(system, record)
    now = step.energy(system, record, h) if not system.continuous else continuous.energy(system, record)
    return {**{f"work_{name}": work for name, work in put_in.items()}, "energy_budget": now - sum(put_in.values())}


_NOETHER = (
    Watched("kelvin_noether", "Kelvin–Noether quantities", line="change", title="Kelvin–Noether"),
    Watched(
        "kelvin_noether_budget",
        "Kelvin–Noether quantities less the momentum that was put in",
        line="budget",
        title="momentum budget",
        largest="Kelvin–Noether less what was put in, largest change",
    ),
)


@monitor(*_NOETHER, when=_always)
def kelvin_noether(system: System, step: Step, record: State, h: Scalar, constants: PyTree) -> dict[str, Array]:
    """⟨Ad_{g⁻¹}c₀, m⟩ for every row c₀ of constants["c0"]: conserved where c₀·a₀ = 0 and nothing forces."""
    c0 = constants["c0"]
    return _with_budget(system, record, c0 @ spatial_momentum(system, record), c0)


@monitor(when=lambda system, method, state: bool(system.quantities))
def quantities(system: System, step: Step, record: State, h: Scalar, constants: PyTree) -> dict[str, Array]:
    """The system's own scalars, of the node: ξ and ν are those of its momenta."""
    node = at_node(system, record)
    return {name: jnp.asarray(value(system, function, node)) for name, function in system.quantities}


@dataclass(frozen=True)
class _Chosen:
    quantities: tuple[KelvinNoether, ...]

    def __call__(self, system: System, step: Step, record: State, h: Scalar, constants: PyTree) -> dict[str, Array]:
        now = jnp.stack([quantity.quantity(system, record) for quantity in self.quantities])
        c0 = [system.group.Ad(record.g, quantity.momentum_map(system, record)) for quantity in self.quantities]
        return _with_budget(system, record, now, jnp.stack(c0))


def chosen(quantities: Sequence[KelvinNoether]) -> Monitor:
    """I = ⟨𝒦(c, a), m⟩ of quantities that the user chose."""
    return Monitor(_Chosen(tuple(quantities)), _NOETHER, _always)


def _with_budget(system: System, record: State, now: Array, c0: Array) -> dict[str, Array]:
    """I, and with a ledger I − Σ⟨c₀, Ad*_{g⁻¹}Δ⟩ with the rows c₀ = Ad_g 𝒦, which is constant to round-off."""
    if record.ledger is None:
        return {"kelvin_noether": now}
    return {"kelvin_noether": now, "kelvin_noether_budget": now - c0 @ momentum_put_in(system, record)}


@monitor(
    Watched("step_size", "h of the step that starts at the node", unit="s"),
    when=lambda system, method, state: method.variable,
)
def step_size(system: System, step: Step, record: State, h: Scalar, constants: PyTree) -> dict[str, Scalar]:
    """h of the step, s."""
    return {"step_size": step.size(record, h)}


@monitor(
    Watched(
        "group_defect",
        "distance of g from its group",
        line="residual",
        title="group defect",
        largest="largest distance from the group",
    ),
    when=lambda system, method, state: system.group.constrained and state.g is not None,
)
def group_defect(system: System, step: Step, record: State, h: Scalar, constants: PyTree) -> dict[str, Array]:
    """How far g is from its group."""
    return {"group_defect": jnp.asarray(system.group.defect(record.g))}


@monitor(
    Watched(
        "constraint_gap",
        "largest |φ| of the holonomic constraints, at the node",
        line="residual",
        title="constraints",
        largest="largest |φ| at the nodes",
    ),
    when=lambda system, method, state: any(one.holonomic for one in system.constraints),
)
def constraint_gap(system: System, step: Step, record: State, h: Scalar, constants: PyTree) -> dict[str, Array]:
    """max |φ(n, a)|, one number."""
    values = [one.value(system, reactions.site(record)) for one in system.constraints if one.holonomic]
    return {"constraint_gap": jnp.max(jnp.abs(jnp.concatenate(values)))}


@monitor(
    Watched(
        "constraint_rate",
        "largest |φ̇| and |A·(ξ, ν) − b| of the constraints, at the node",
        line="residual",
        title="constraint rates",
        largest="largest |φ̇| or |A·(ξ, ν) − b| at the nodes",
    ),
    when=lambda system, method, state: bool(system.constraints),
)
def constraint_rate(system: System, step: Step, record: State, h: Scalar, constants: PyTree) -> dict[str, Array]:
    """max |φ̇| and |A·(ξ, ν) − b| with the velocities that belong to (μ, π), one number."""
    return {"constraint_rate": jnp.max(jnp.abs(reactions.node_rate(system, record)))}


@monitor(
    Watched(
        "symmetry_momentum",
        "momenta of motions of space that leave ℓ and the constraints unchanged, as the turn about a pin's vertical",
        line="change",
        title="symmetry",
    ),
    when=_always,
)
def symmetry_momentum(system: System, step: Step, record: State, h: Scalar, constants: PyTree) -> dict[str, Array]:
    """⟨Ad*_{g⁻¹}m, η⟩ + ⟨π, g⁻¹u⟩ for every row (η, u) of constants["symmetries"]."""
    return {"symmetry_momentum": symmetries.symmetry_momentum(system, record, constants["symmetries"])}


BEFORE = (legendre_energy, discrete_energy)
"""Monitors of a step that precede its Kelvin–Noether quantities in datasets, in their order there."""


AFTER = (energy_budget, step_size, group_defect, constraint_rate, constraint_gap, quantities)
"""Monitors that follow the Kelvin–Noether quantities."""


SOLVED = (
    Watched(
        "balance",
        "residual of the Kelvin–Noether balance of a step, relative",
        line="residual",
        title="balance",
        largest="Kelvin–Noether balance, largest residual, relative",
    ),
    Watched(
        "newton_residual",
        "residual of the equations of a step, relative to the momentum; what is below the momentum of a velocity of "
        "1e-15/h, with which Newton's iteration stops, is round-off and counts as 16 ε at most",
        line="residual",
        title="Newton",
        largest="largest residual, relative",
    ),
)
"""Values that every step reports about its solution; only the largest is kept."""


def watched() -> list[Watched]:
    """All variables that monitors give, except the system's own quantities."""
    return [one for made in (*BEFORE, kelvin_noether, symmetry_momentum, *AFTER) for one in made.watched]


def watching(system: System, method: Method, state: State, noether: Sequence[Monitor]) -> tuple[Monitor, ...]:
    """The monitors of a run, with those of its momenta, if it has any."""
    before, after = ([one for one in made if one.when(system, method, state)] for made in (BEFORE, AFTER))
    return (*before, *noether, *after)


def changing(system: System) -> list[tuple[str, str]]:
    """Names and titles of variables whose change the certificate shows, the system's own quantities last."""
    named = {one.name: one.title for one in watched() if one.line == "change"}
    return [*named.items(), *((name, name.replace("_", " ")) for name, _ in system.quantities)]


def budgets() -> list[Watched]:
    """The variables that the certificate shows as budgets."""
    return [one for one in watched() if one.line == "budget"]


def residuals() -> list[Watched]:
    """The variables whose largest value the certificate shows."""
    return [*SOLVED, *(one for one in reversed(watched()) if one.line == "residual")]
