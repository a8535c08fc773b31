"""The linear equations at a steady motion, their spectrum, and modes in words."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from coadjoint.groups import SE3, SO3
from coadjoint.mechanics.system import System
from coadjoint.spaces import Defining
from coadjoint.stability.steady import SteadyMotion

ZERO = 1e-9
"""A singular value up to this fraction of the largest belongs to a zero mode."""

MARGINAL = 1e-6
"""A growth rate up to this fraction of the largest eigenvalue counts as zero: round-off splits double ones so far."""

TURNING = 1e-3
"""Eigenvalues are compared with this fraction of the motion's natural rate at least: terms may cancel to round-off."""

SHARE = 0.05
"""A velocity with less than this share of a mode's kinetic energy is not named."""


@dataclass(frozen=True)
class Mode:
    """An eigenvalue λ with Im λ ≥ 0 and its direction.

    `velocities`: (δξ, δν), complex. `shares`: how the kinetic energy ½ M_ii|z_i|² is spread over the velocities.

    velocities: shape (dim G + ambient,).
    """

    eigenvalue: complex
    velocities: np.ndarray
    shares: dict[str, float]
    growth: int
    """1: grows; 0: neither grows nor decays; −1: decays."""

    @property
    def rate(self) -> float:
        """Re λ, 1/s."""
        return float(self.eigenvalue.real)

    @property
    def frequency(self) -> float:
        """|Im λ|, rad/s."""
        return float(abs(self.eigenvalue.imag))

    @property
    def damping_ratio(self) -> float:
        """−Re λ/|λ|."""
        return -self.rate / abs(self.eigenvalue)

    @property
    def name(self) -> str:
        """The velocities with the largest shares, `yaw-sway`."""
        named = [name for name, share in self.shares.items() if share >= SHARE]
        return "-".join(named[:3]) or "attitude"

    def __str__(self) -> str:
        if self.frequency == 0:
            does = {1: "grows", 0: "stays", -1: "decays"}[self.growth]
            return f"{self.name}: {does}" + (f", time constant {1 / abs(self.rate):.3g} s" if self.growth else "")
        period = f"period {2 * np.pi / self.frequency:.3g} s"
        if self.growth == 0:
            return f"{self.name}: oscillates, {period}, neither damped nor excited"
        does = "oscillates and grows" if self.growth > 0 else "oscillates and decays"
        time = f"time constant {1 / abs(self.rate):.3g} s"
        damping = f", damping ratio {self.damping_ratio:.3g}" if self.growth < 0 else ""
        return f"{self.name}: {does}, {period}, {time}{damping}"


@dataclass(frozen=True)
class Linearisation:
    """ẋ = Lx for perturbations of a steady motion, in coordinates x of the reduced space: δy = `directions` x.

    `zero_modes`: how many zero eigenvalues L has, counted with their multiplicity and left out of `modes`: a steady
    motion changes into its neighbours with other momenta, or along a symmetry. `charts`: z = `charts` x, and
    x = `rows` δy.

    matrix: L, (size, size). directions: (y, size). rows: (size, y). charts: (z, size). eigenvalues: complex numbers,
    1/s.
    """

    matrix: np.ndarray
    directions: np.ndarray
    rows: np.ndarray
    charts: np.ndarray
    eigenvalues: np.ndarray
    zero_modes: int
    modes: tuple[Mode, ...]

    @property
    def symmetry_defect(self) -> float:
        """How far the spectrum is from a Hamiltonian one, which with λ has −λ, relative to the largest |λ|."""
        found = self.eigenvalues
        if not len(found):
            return 0.0
        return float(np.max(np.min(np.abs(found[:, None] + found[None, :]), axis=1)) / np.max(np.abs(found)))


def linearised(motion: SteadyMotion) -> Linearisation:
    """The linearisation L = DY of the reduced equations at a steady motion, with inputs and internal state held.

    motion: of co.stability.steady_motion. Perturbations keep a on its orbit, δa = −η·a, and ignorable variables are
    left out. Derivatives are exact.
    """
    reduced = motion.reduced
    slopes = reduced.slopes(motion.state)
    scales = reduced.scales
    C = reduced.essential / (np.abs(reduced.essential) @ scales.y)[:, None]
    moved, moving = C @ slopes.y_z * scales.z, C @ slopes.rate_z
    U, singular, Vt = np.linalg.svd(moved, full_matrices=False)
    rank = int(np.sum(singular > 1e-10 * singular[0]))
    charts = scales.z[:, None] * Vt[:rank].T / singular[:rank]
    L = U[:, :rank].T @ moving @ charts
    turning = TURNING * scales.rate
    eigenvalues, zeros = _without_zeros(L, turning)
    modes = _modes(motion.system, L, charts, eigenvalues, slopes.y_z, turning)
    rows = U[:, :rank].T @ C
    return Linearisation(L, np.linalg.pinv(C) @ U[:, :rank], rows, charts, eigenvalues, zeros, modes)


def velocity_names(system: System) -> list[str]:
    """What (ξ, ν) are called: roll, pitch, yaw, surge, sway, heave of a body in space, else ξ1, …, ν1, …"""
    dim, ambient = system.group.dim, system.additional.ambient(system.group)
    turning, going = ["roll", "pitch", "yaw"], ["surge", "sway", "heave"]
    if isinstance(system.group, SE3):
        first = turning + going
    elif isinstance(system.group, SO3):
        first = turning
    else:
        first = [f"ξ{i + 1}" for i in range(dim)]
    last = [f"ν{i + 1}" for i in range(ambient)]
    return first + (going if isinstance(system.additional, Defining) and first == turning else last)


def _mass(y_z: np.ndarray, dim: int, ambient: int) -> np.ndarray:
    """M = ∂(μ, π)/∂(ξ, ν)."""
    rows = [*range(dim), *range(dim + ambient, dim + 2 * ambient)]
    return y_z[np.ix_(rows, rows)]


def _without_zeros(L: np.ndarray, least: float) -> tuple[np.ndarray, int]:
    """The eigenvalues of L but zero ones, and how many these are: those of L on the space modulo its kernel, again.

    Round-off splits a double zero into ±1e-8; the kernel of a matrix is known to all digits.
    """
    zeros, scale = 0, max(float(np.linalg.norm(L, 2)), least) if L.size else 0.0
    while L.size:
        _, singular, rows = np.linalg.svd(L)
        rank = int(np.sum(singular > ZERO * scale))
        if rank == len(L):
            break
        zeros, L = zeros + len(L) - rank, rows[:rank] @ L @ rows[:rank].T
    found = np.linalg.eigvals(L) if L.size else np.zeros(0)
    # The real parts of neutral ones are round-off: these go by their frequency, the fastest first.
    grows = np.where(np.abs(found.real) > MARGINAL * max(scale, least), found.real, 0.0)
    return found[np.lexsort((found.imag, -np.abs(found.imag), -grows))], zeros


def _modes(
    system: System, L: np.ndarray, charts: np.ndarray, eigenvalues: np.ndarray, y_z: np.ndarray, least: float
) -> tuple[Mode, ...]:
    dim, ambient = system.group.dim, system.additional.ambient(system.group)
    moving = [*range(dim), *range(dim + ambient, dim + 2 * ambient)]
    inertia, names = np.abs(_mass(y_z, dim, ambient).diagonal()), velocity_names(system)
    largest = float(np.max(np.abs(eigenvalues), initial=least))
    found = []
    for value in eigenvalues:
        if value.imag < 0:
            continue
        direction = np.linalg.svd(L - value * np.eye(len(L)))[2][-1].conj()
        z = (charts @ direction)[moving]
        energies = inertia * np.abs(z) ** 2
        spread = energies / max(float(np.sum(energies)), 1e-300)
        shares = {names[i]: float(spread[i]) for i in np.argsort(-spread, kind="stable")}
        growth = 0 if abs(value.real) <= MARGINAL * largest else int(np.sign(value.real))
        found.append(Mode(complex(value), z, shares, growth))
    return tuple(found)
