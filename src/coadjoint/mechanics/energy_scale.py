"""The scale to which changes of an energy are relative.

An energy is known but for a constant: |E₀| depends on the zero of the potential, and a pendulum that is released level
with its pivot has E₀ = 0. The scale is |E₀|, unless the largest kinetic energy T of the motion is more than 20|E₀|.
"""

from __future__ import annotations

import numpy as np

from coadjoint.arrays import Array
from coadjoint.mechanics.state import State

ENERGIES = ("energy", "discrete_energy")
"""The monitored energies."""


def near_zero(size: np.ndarray | float, kinetic: np.ndarray | float) -> np.ndarray:
    """Whether |E₀| is too small, against the largest kinetic energy, to be the scale of changes; of any shape."""
    return np.asarray(kinetic) > 20.0 * np.asarray(size)


def largest_kinetic(*parts: State) -> np.ndarray:
    """The largest ½|⟨μ, ξ⟩ + ⟨π, ν⟩| of records with axes (node, [member,] …): that of ½⟨ξ, Jξ⟩, whatever V is.

    Returns one number, or shape (members,) for records of members.
    """
    powers = (paired(x.mu, x.xi) + paired(x.pi, x.nu) for x in parts)
    return np.fmax.reduce([np.fmax.reduce(np.abs(one) / 2, axis=0) for one in powers])


def paired(momenta: Array, velocities: Array) -> np.ndarray:
    """⟨μ, ξ⟩ of rows (…, k), shape (…): of fewer than eight numbers by columns, as NumPy is slow along short rows."""
    if momenta.shape[-1] >= 8:
        return np.asarray(momenta * velocities).sum(axis=-1)
    total = np.zeros(momenta.shape[:-1])
    for i in range(momenta.shape[-1]):
        total += momenta[..., i] * velocities[..., i]
    return total
