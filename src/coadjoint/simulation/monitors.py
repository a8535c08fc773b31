"""What is observed at every step: energies, Kelvin–Noether quantities, group defect."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp

from coadjoint.groups.group import Array
from coadjoint.mechanics import continuous
from coadjoint.mechanics.noether import KelvinNoether, total_momentum
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.method import Step


def discrete_energy(system: System, step: Step, record: State, h: Array, constants: Any) -> dict[str, Array]:
    """E_k = −∂_hΛ with the discrete velocities: the paper's K_k + U_k for the left rule (P68, P69)."""
    return {"discrete_energy": step.energy(system, record, h)}


def legendre_energy(system: System, step: Step, record: State, h: Array, constants: Any) -> dict[str, Array]:
    """The Legendre energy of (μ_k, π_k), at the node itself."""
    return {"energy": continuous.energy(system, record)}


def kelvin_noether(system: System, step: Step, record: State, h: Array, constants: Any) -> dict[str, Array]:
    """⟨Ad_{g⁻¹}c₀, m⟩ for every row c₀ of constants["c0"]: conserved where c₀·a₀ = 0 and nothing forces."""
    group = system.group
    spatial = group.Ad_dual(group.inverse(record.g), total_momentum(system, record))
    return {"kelvin_noether": constants["c0"] @ spatial}


@dataclass(frozen=True)
class Chosen:
    """I = ⟨𝒦(c, a), m⟩ of quantities that the user chose."""

    quantities: tuple[KelvinNoether, ...]

    def __call__(self, system: System, step: Step, record: State, h: Array, constants: Any) -> dict[str, Array]:
        return {"kelvin_noether": jnp.stack([quantity.quantity(system, record) for quantity in self.quantities])}


def group_defect(system: System, step: Step, record: State, h: Array, constants: Any) -> dict[str, Array]:
    """How far g is from its group."""
    return {"group_defect": jnp.asarray(system.group.defect(record.g))}
