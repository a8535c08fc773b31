"""Zeitlin's model of an ideal fluid on the sphere, which may rotate: Euler's equations on U(N)."""

from __future__ import annotations

from functools import partial
from typing import Any, cast

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, shown
from coadjoint.groups import Un
from coadjoint.mechanics.members import Each
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.models.fluids.harmonics import REAL, Coefficients, coefficients_of, from_coefficients
from coadjoint.models.fluids.laplacian import dirichlet
from coadjoint.models.memory import ARRAYS, require_room_at
from coadjoint.models.quantities import checked, number

UNITS = {
    "mu": "1/s",
    "xi": "1/s",
    "energy": "1/s^2",
    "discrete_energy": "1/s^2",
    "kinetic_energy": "1/s^2",
    "enstrophy": "1/s^2",
}
"""With the radius of the sphere as the unit of length."""


def hbar(size: int) -> float:
    """ħ = 2/√(N² − 1), with which [F, G]/ħ stands for i{f, g}."""
    return 2 / np.sqrt(size**2 - 1)


def euler(size: int, rotation: float = 0.0) -> System:
    """The Euler equations of a fluid on the unit sphere by Zeitlin's matrices of size N, on U(N).

        Ẇ = [P, W]/ħ,   Δ_N P = W − F,   ħ = 2/√(N² − 1),

    W = i times the matrix of the absolute vorticity ω + 2Ω cos θ, F that of 2Ω cos θ, P that of the stream function ψ,
    Δψ = ω. In the library's form ℋ(μ) = −½⟨μ − f, Δ_N⁻¹(μ − f)⟩/ħ, μ the coordinates of W: so N/(4πħ) times the
    kinetic energy. All tr Wᵏ are Casimirs, for ∫(ω + 2Ω cos θ)ᵏ; runs by `co.IsospectralMidpoint()` keep them to
    round-off. Runs observe `kinetic_energy` and `enstrophy`, ½∫ω².

    size: N, from 2. rotation: Ω, rad/s, by default 0; the radius is 1. Parameters: rotation.
    Raises ArgumentError for others, and for an N whose steps do not fit in memory.
    Source: Zeitlin, Self-consistent finite-mode approximations for the hydrodynamics of an incompressible fluid on
    nonrotating and rotating spheres, Phys. Rev. Lett. 93 (2004); Modin and Viviani, A Casimir preserving scheme for
    long-time simulation of spherical ideal hydrodynamics, J. Fluid Mech. 884 (2020).
    """
    size = checks.whole(size, "size", 2)
    require_room_at("A fluid on the sphere", size, 8.0 * ARRAYS * size**2, 2)
    checks.number(rotation, "rotation")
    turning = axial(size, 2.0)

    def hamiltonian(mu, p):
        return dirichlet(mu - p.rotation * turning) / hbar(size)

    def kinetic_energy(state, p):
        return 4 * jnp.pi / size * dirichlet(state.mu - p.rotation * turning)

    def enstrophy(state, p):
        omega = state.mu - p.rotation * turning
        return 2 * jnp.pi / size * omega @ omega

    return System(
        Un(size),
        hamiltonian=hamiltonian,
        parameters={"rotation": float(rotation)},
        checks=partial(checked, {"rotation": number}),
        units=UNITS,
        quantities={"kinetic_energy": kinetic_energy, "enstrophy": enstrophy},
        name="ideal fluid on a sphere" if not rotation else "ideal fluid on a rotating sphere",
    )


def start(fluid: System, vorticity: Coefficients) -> State:
    """The state of a fluid with the relative vorticity ω = Σ c_lm Y_lm.

    vorticity: c (L, L) as `harmonics.from_coefficients` takes them, 1/s; c_00 must be 0.
    Raises ArgumentError for others, and for a fluid that carries a function, which starts by `carrying_start`.
    """
    omega = absolute(fluid, vorticity)
    if fluid.advected.ambient(fluid.group):
        raise ArgumentError(
            f"A {fluid.name} carries a function: start it by fluids.carrying_start(fluid, vorticity, carried)."
        )
    return fluid.state(mu=omega)


def absolute(fluid: System, vorticity: Coefficients) -> np.ndarray:
    """The coordinates (N²,), 1/s, of ω + 2Ω cos θ of a relative vorticity; raises ArgumentError where c_00 is not 0."""
    omega, c = from_coefficients(size_of(fluid), vorticity), np.asarray(vorticity)
    if abs(c[0, 0]) > REAL * np.max(np.abs(c)):
        raise ArgumentError(f"The vorticity of a fluid on a sphere must have mean 0, but c_00 is {c[0, 0]}.")
    return omega + planetary(fluid)


def vorticity(fluid: System, records: PyTree) -> Coefficients:
    """c_lm (…, N, N), complex, 1/s, of the relative vorticity of a state or of records with leading axes.

    fluid: the system, with the rotation that the run has: of an ensemble in `rotation` each member with its own,
    `fluid.replace(rotation=…)`. records: a state, or states with leading axes, as `run.final` and `run.records`.
    Raises ArgumentError unless `fluid` is a fluid and `records` are states of its size.
    """
    require_states(fluid, records)
    return coefficients_of(size_of(fluid), np.asarray(records.mu) - planetary(fluid))


def require_states(fluid: System, records: PyTree) -> None:
    """Raise ArgumentError unless `records` are states of a fluid of this size."""
    count = size_of(fluid) ** 2
    expected = "a state of this fluid, or states with leading axes, as run.final and run.records"
    checks.instance(records, "records", State, expected)
    if np.shape(records.mu)[-1:] != (count,):
        raise ArgumentError(
            f"Argument `records` must be {expected}, μ with {count} numbers, but μ has shape {np.shape(records.mu)}."
        )


def axial(size: int, amplitude: float) -> np.ndarray:
    """The coordinates (N²,) of amplitude · cos θ."""
    return from_coefficients(size, np.array([[0, 0], [amplitude * np.sqrt(4 * np.pi / 3), 0]], complex))


def planetary(fluid: System) -> np.ndarray:
    """The coordinates (N²,) of 2Ω cos θ; raises ArgumentError for an ensemble of rotations."""
    size, parameters = size_of(fluid), cast(Any, fluid.parameters)
    if isinstance(parameters.rotation, Each):
        raise ArgumentError(
            "This fluid has several rotations: take one member, fluid.replace(rotation=…), or give a start to each "
            "by co.each of its μ."
        )
    return axial(size, 2.0) * parameters.rotation


def size_of(fluid: System) -> int:
    """N of a fluid; raises ArgumentError for another system."""
    if not isinstance(fluid.group, Un) or fluid.parameters is None or not hasattr(fluid.parameters, "rotation"):
        raise ArgumentError(f"Argument `fluid` must be a fluid of co.models.fluids, but is {shown(fluid.name)}.")
    return fluid.group.size
