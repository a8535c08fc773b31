"""The stability of a steady motion: its modes, and what the spectrum and the energy say."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.stability.second_variation import EnergyCasimir, energy_casimir
from coadjoint.stability.spectrum import Linearisation, Mode, linearised, velocity_names
from coadjoint.stability.steady import SteadyMotion


@dataclass(frozen=True)
class Stability:
    """The stability of a steady motion; `print` shows a summary."""

    motion: SteadyMotion
    linear: Linearisation
    energy: EnergyCasimir

    @property
    def modes(self) -> tuple[Mode, ...]:
        """Growing ones first; of a pair with λ and its conjugate one."""
        return self.linear.modes

    @property
    def growth_rate(self) -> float:
        """The largest Re λ, 1/s."""
        return max((mode.rate for mode in self.modes), default=0.0)

    @property
    def spectral(self) -> str:
        """By the linear equations: "unstable" where a mode grows, "stable" where all decay, else "neutral"."""
        growths = [mode.growth for mode in self.modes]
        if 1 in growths:
            return "unstable"
        return "stable" if set(growths) == {-1} and not self.linear.zero_modes else "neutral"

    @property
    def verdict(self) -> str:
        """Of the nonlinear motion: "unstable" or "stable" by the spectrum, "stable" by the energy, or "undecided"."""
        return self.energy.verdict if self.spectral == "neutral" else self.spectral

    def summary(self) -> dict[str, PyTree]:
        """Plain numbers and words, for JSON."""
        state = self.motion.state
        return {
            "system": self.motion.system.name,
            "xi": state.xi.tolist(),
            "n": state.n.tolist(),
            "nu": state.nu.tolist(),
            "a": state.a.tolist(),
            "free": {name: np.asarray(value).tolist() for name, value in self.motion.free.items()},
            "residual": self.motion.residual,
            "modes": [_numbers(mode) for mode in self.modes],
            "zero_modes": self.linear.zero_modes,
            "spectral": self.spectral,
            "energy_casimir": {"verdict": self.energy.verdict, "reason": self.energy.reason},
            "verdict": self.verdict,
        }

    def __str__(self) -> str:
        state, names = self.motion.state, velocity_names(self.motion.system)
        values = [*state.xi, *state.nu]
        largest = max(map(abs, values), default=0.0)
        moving = [
            f"{name} {v:.4g}" for name, v in zip(names, values, strict=True) if abs(v) > 1e-9 * max(largest, 1e-3)
        ]
        rows = [("motion", f"{self.motion.system.name}: {', '.join(moving) or 'at rest'}")]
        rows += [("free", f"{name} = {np.array2string(v, precision=4)}") for name, v in self.motion.free.items()]
        rows += [("mode", str(mode)) for mode in self.modes]
        if self.linear.zero_modes:
            rows.append(("zero modes", f"{self.linear.zero_modes}: neighbours with other momenta, and symmetries"))
        rows.append(("spectrum", self.spectral))
        if self.motion.system.forces is None:
            rows.append(("energy–Casimir", f"{self.energy.verdict}: {self.energy.reason}"))
        rows.append(("verdict", self.verdict))
        return "\n".join(f"{name:<15} {text}" for name, text in rows)


def stability(motion: SteadyMotion, integrals: Sequence[Callable] = ()) -> Stability:
    """The modes of a steady motion and whether it is stable, by the spectrum and by the energy–Casimir test.

    motion: of co.stability.steady_motion. integrals: conserved functions of a state beyond Casimir functions and the
    system's own `quantities`, such as the axial momentum of a symmetric top, by default none. Raises ArgumentError for
    one that the motion does not conserve.
    """
    linear = linearised(motion)
    return Stability(motion, linear, energy_casimir(motion, linear, integrals))


def _numbers(mode: Mode) -> dict[str, PyTree]:
    return {
        "name": mode.name,
        "real": mode.rate,
        "imaginary": mode.frequency,
        "damping_ratio": mode.damping_ratio,
        "shares": mode.shares,
        "words": str(mode),
    }
