"""What is observed at every step: energies, Kelvin–Noether quantities, group defect."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp

from coadjoint.groups import SO3
from coadjoint.groups.group import Array
from coadjoint.mechanics import continuous
from coadjoint.mechanics.ledger import energy_put_in, momentum_put_in
from coadjoint.mechanics.noether import KelvinNoether, spatial_momentum
from coadjoint.mechanics.quantities import value
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.method import Step
from coadjoint.spaces import Defining


def discrete_energy(system: System, step: Step, record: State, h: Array, constants: Any) -> dict[str, Array]:
    """E_k = −∂_hΛ with the discrete velocities: the paper's K_k + U_k for the left rule (P68, P69)."""
    return {"discrete_energy": step.energy(system, record, h)}


def legendre_energy(system: System, step: Step, record: State, h: Array, constants: Any) -> dict[str, Array]:
    """The Legendre energy of (μ_k, π_k), at the node itself."""
    return {"energy": continuous.energy(system, record)}


def node_velocities(system: System, step: Step, record: State, h: Array, constants: Any) -> dict[str, Array]:
    """(ξ, ν) at the node itself, of its momenta: ∂_ξℓ = μ_k, ∂_νℓ = π_k; the discrete ones belong to the step."""
    xi, nu = continuous.velocities(system, record)
    return {"node_xi": xi, "node_nu": nu}


def has_directions(system: System) -> bool:
    """Whether a system is a body in space that sees `down` and `north`, of which a vehicle's log can be written."""
    group, Q, V = system.places
    return (
        system.continuous
        and isinstance(group, SO3)
        and Defining() == Q
        and {"a_down", "a_north"} <= V.components(group, "a").keys()
    )


def energy_budget(system: System, step: Step, record: State, h: Array, constants: Any) -> dict[str, Array]:
    """The energy that each force has put in, W, and E − ΣW, which is constant to the method's order."""
    put_in = energy_put_in(system, record)
    now = step.energy(system, record, h) if not system.continuous else continuous.energy(system, record)
    return {**{f"work_{name}": work for name, work in put_in.items()}, "energy_budget": now - sum(put_in.values())}


def kelvin_noether(system: System, step: Step, record: State, h: Array, constants: Any) -> dict[str, Array]:
    """⟨Ad_{g⁻¹}c₀, m⟩ for every row c₀ of constants["c0"]: conserved where c₀·a₀ = 0 and nothing forces."""
    c0 = constants["c0"]
    return _with_budget(system, record, c0 @ spatial_momentum(system, record), c0)


def quantities(system: System, step: Step, record: State, h: Array, constants: Any) -> dict[str, Array]:
    """The system's own scalars."""
    return {name: jnp.asarray(value(system, function, record)) for name, function in system.quantities}


@dataclass(frozen=True)
class Chosen:
    """I = ⟨𝒦(c, a), m⟩ of quantities that the user chose."""

    quantities: tuple[KelvinNoether, ...]

    def __call__(self, system: System, step: Step, record: State, h: Array, constants: Any) -> dict[str, Array]:
        now = jnp.stack([quantity.quantity(system, record) for quantity in self.quantities])
        c0 = [system.group.Ad(record.g, quantity.momentum_map(system, record)) for quantity in self.quantities]
        return _with_budget(system, record, now, jnp.stack(c0))


def _with_budget(system: System, record: State, now: Array, c0: Array) -> dict[str, Array]:
    """I, and with a ledger I − Σ⟨c₀, Ad*_{g⁻¹}Δ⟩ with the rows c₀ = Ad_g 𝒦, which is constant to round-off."""
    if record.ledger is None:
        return {"kelvin_noether": now}
    return {"kelvin_noether": now, "kelvin_noether_budget": now - c0 @ momentum_put_in(system, record)}


def step_size(system: System, step: Step, record: State, h: Array, constants: Any) -> dict[str, Array]:
    """h of the step, s."""
    return {"step_size": step.size(record, h)}


def group_defect(system: System, step: Step, record: State, h: Array, constants: Any) -> dict[str, Array]:
    """How far g is from its group."""
    return {"group_defect": jnp.asarray(system.group.defect(record.g))}
