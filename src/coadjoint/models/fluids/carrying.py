"""Fluids on the sphere that carry a function with them: magnetic fluids and buoyant ones, on u(N) ⋉ u(N)*."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError, shown
from coadjoint.groups import Un
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.models.fluids.euler import absolute, axial, euler, hbar, require_states, size_of
from coadjoint.models.fluids.harmonics import Coefficients, coefficients_of, from_coefficients
from coadjoint.models.fluids.laplacian import dirichlet, laplacian
from coadjoint.spaces import Coadjoint


def magnetohydrodynamics(size: int, rotation: float = 0.0) -> System:
    """Ideal magnetohydrodynamics on the unit sphere by matrices of size N, on u(N) ⋉ u(N)*.

        ∂ω/∂t = −{ψ, ω + 2Ω cos ϑ} − {Δθ, θ},   ∂θ/∂t = −{ψ, θ},   Δψ = ω
        Ẇ = ([P, W] + [B, Θ])/ħ,   Θ̇ = [P, Θ]/ħ,   Δ_N P = W − F,   B = Δ_N Θ,   ħ = 2/√(N² − 1)

    with the magnetic potential θ: the field is ∇⊥θ in units of velocity, as u = ∇⊥ψ. In the library's form
    ℋ(μ, a) = (−½⟨μ − f, Δ_N⁻¹(μ − f)⟩ − ½⟨a, Δ_N a⟩)/ħ, N/(4πħ) times the energy. Runs by `co.IsospectralMidpoint()`
    keep the spectrum of Θ, for ∫θᵏ, and tr Wf(Θ), for ∫(ω + 2Ω cos ϑ)f(θ), to round-off. Runs observe
    `kinetic_energy`, `magnetic_energy`, `cross_helicity`, −∫(ω + 2Ω cos ϑ)θ, which is ∫u·B where Ω = 0, and
    `mean_square_potential`, ½∫θ².

    size: N ≥ 2, an integer. rotation: Ω, rad/s, by default 0; the radius is 1, θ in 1/s. Parameters: rotation.
    Raises ArgumentError for others. Source: Modin and Roop, Spatio-temporal Lie–Poisson discretization for
    incompressible magnetohydrodynamics on the sphere, arXiv:2311.16045.
    """
    fluid = euler(size, rotation)

    def magnetic_energy(state):
        """½∫|∇θ|²."""
        return 4 * jnp.pi / size * dirichlet_of_potential(state.a)

    def cross_helicity(state):
        """−∫(ω + 2Ω cos ϑ)θ, which is ∫u·B on a sphere at rest."""
        return -4 * jnp.pi / size * state.mu @ state.a

    def mean_square_potential(state):
        """½∫θ²."""
        return 2 * jnp.pi / size * state.a @ state.a

    watched = {
        "magnetic_energy": magnetic_energy,
        "cross_helicity": cross_helicity,
        "mean_square_potential": mean_square_potential,
    }
    units = {"a": "1/s", **dict.fromkeys(watched, "1/s^2")}
    return _carrying(fluid, dirichlet_of_potential, watched, units, "magnetic fluid on a sphere")


def boussinesq(size: int, rotation: float = 0.0) -> System:
    """A fluid of buoyancy b on the unit sphere, gravity along the axis, by matrices of size N, on u(N) ⋉ u(N)*.

        ∂ω/∂t = −{ψ, ω + 2Ω cos ϑ} − {z, b},   ∂b/∂t = −{ψ, b},   Δψ = ω,   z = cos ϑ
        Ẇ = ([P, W] + [Z, Θ])/ħ,   Θ̇ = [P, Θ]/ħ,   Δ_N P = W − F,   Z the matrix of z,   ħ = 2/√(N² − 1)

    A force b∇z along the sphere, as in a soap bubble; the energy is ½∫|u|² − ∫bz, and
    ℋ(μ, a) = (−½⟨μ − f, Δ_N⁻¹(μ − f)⟩ − ⟨a, z⟩)/ħ is N/(4πħ) times it. Runs by `co.IsospectralMidpoint()` keep the
    spectrum of Θ and tr Wf(Θ) to round-off. Runs observe `kinetic_energy` and `potential_energy`, −∫bz. Over b = n²z
    small waves of degree l and order m have the frequency mn/√(l(l + 1)), rad/s.

    size: N ≥ 2, an integer. rotation: Ω, rad/s, by default 0; the radius is 1, b in 1/s². Parameters: rotation.
    Raises ArgumentError for others. Source: Holm, Marsden and Ratiu, The Euler–Poincaré equations and semidirect
    products with applications to continuum theories, Adv. Math. 137 (1998), of stratified fluids; of bubbles
    Seychelles, Amarouchene, Bessafi and Kellay, Phys. Rev. Lett. 100, 144501 (2008).
    """
    fluid = euler(size, rotation)
    height = axial(size, 1.0)

    def potential(a):
        return -a @ height

    def potential_energy(state):
        """−∫bz."""
        return 4 * jnp.pi / size * potential(state.a)

    units = {"a": "1/s^2", "potential_energy": "1/s^2"}
    return _carrying(fluid, potential, {"potential_energy": potential_energy}, units, "buoyant fluid on a sphere")


def carrying_start(fluid: System, vorticity: Coefficients, carried: Coefficients) -> State:
    """The state of a fluid with the relative vorticity ω and the carried function, θ or b.

    vorticity: c_lm, (L, L) as `from_coefficients` takes them, 1/s; c_00 must be 0. carried: c_lm of θ, 1/s, or of b,
    1/s², (L, L). Raises ArgumentError for others.
    """
    size = _size(fluid)
    return fluid.state(mu=absolute(fluid, vorticity), a0=from_coefficients(size, carried))


def carried(fluid: System, records: PyTree) -> Coefficients:
    """c_lm (…, N, N), complex, of the carried function, θ in 1/s or b in 1/s², of a state or of records.

    records: a state, or states with leading axes, as `run.final` and `run.records`. Raises ArgumentError for a fluid
    that carries nothing, and unless `records` are states of its size.
    """
    size = _size(fluid)
    require_states(fluid, records)
    return coefficients_of(size, np.asarray(records.a))


def _carrying(fluid: System, energy: PyTree, watched: dict[str, PyTree], units: dict[str, str], name: str) -> System:
    """The fluid with a carried function, whose energy is that of the fluid and `energy(a)`, both times N/4π."""
    size = size_of(fluid)
    planetary = axial(size, 2.0)

    def hamiltonian(mu, a, p):
        return (dirichlet(mu - p.rotation * planetary) + energy(a)) / hbar(size)

    of_fluid = {name: function for name, function in fluid.quantities if name == "kinetic_energy"}
    return System(
        fluid.group,
        hamiltonian=hamiltonian,
        advected=Coadjoint(),
        parameters=fluid.parameters,
        checks=fluid.checks,
        units={**dict.fromkeys(("mu", "xi"), "1/s"), **dict.fromkeys(("energy", "kinetic_energy"), "1/s^2"), **units},
        quantities={**of_fluid, **watched},
        name=name,
    )


@jax.custom_jvp
def dirichlet_of_potential(a: Array) -> Array:
    """−½⟨a, Δ_N a⟩, one number, of coordinates (N²,), ½∫|∇θ|² times N/4π; its gradient is −Δ_N a."""
    return -0.5 * a @ laplacian(round(np.sqrt(a.shape[0])), a)


@dirichlet_of_potential.defjvp
def _slope(primals, tangents):
    (a,), (along,) = primals, tangents
    current = laplacian(round(np.sqrt(a.shape[0])), a)
    return -0.5 * a @ current, -current @ along


def _size(fluid: System) -> int:
    """N of a fluid that carries a function; raises ArgumentError for another."""
    if not isinstance(fluid.group, Un) or not isinstance(fluid.advected, Coadjoint):
        raise ArgumentError(
            "Argument `fluid` must be a fluid that carries a function, fluids.magnetohydrodynamics(N) or "
            f"fluids.boussinesq(N), but is {shown(fluid.name)}."
        )
    return fluid.group.size
