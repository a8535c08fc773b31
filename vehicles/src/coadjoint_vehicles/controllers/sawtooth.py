"""A glider's sawtooth: down and up between two depths, by ballast and a moving mass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp

from coadjoint import units as u
from coadjoint.arrays import PyTree
from coadjoint.models.quantities import positive, vector
from coadjoint.spaces import Named
from coadjoint_vehicles.controllers.pid import pid
from coadjoint_vehicles.model.controller import Controller, Feedback
from coadjoint_vehicles.model.vehicle import Vehicle
from coadjoint_vehicles.parts.measured import Measured, acute, measured, not_negative


@dataclass(frozen=True, eq=False, kw_only=True)
class Sawtooth(Controller):
    """Dives until the depth is `deep`, climbs until it is `shallow`, and so on; both are inputs, m.

    Diving, the ballast is at V₀ − ΔV and the moving mass holds a pitch of −θ; climbing, at V₀ + ΔV, and +θ. The mass is
    at x = x₀ ± x₁ − PID(pitch error), + diving; x counts forward.

    volume: ΔV, m³; neutral: V₀, m³. pitch: θ, rad. middle, shift: x₀ and x₁, m, those of the trim. gains: (k_p, k_i,
    k_d), m/rad, m/(rad s), m s/rad; reach: the largest part of the PID, m. ballast, moving_mass: the names of the
    parts. Raises ArgumentError.
    """

    kind: ClassVar[str] = "sawtooth"
    volume: Measured = measured(u.VOLUME, positive)
    pitch: Measured = measured(u.ANGLE, acute)
    neutral: Measured = measured(u.VOLUME, default=0.0)
    middle: Measured = measured(u.LENGTH, default=0.0)
    shift: Measured = measured(u.LENGTH, default=0.0)
    gains: Measured = measured(None, vector, default=(0.0, 0.0, 0.0))
    reach: Measured = measured(u.LENGTH, not_negative, default=0.0)
    ballast: str = "ballast"
    moving_mass: str = "moving_mass"

    @property
    def inputs(self) -> dict[str, str]:
        return {"shallow": "m", "deep": "m"}

    def memory(self) -> dict[str, PyTree]:
        return {"diving": 1.0, "integral": 0.0}

    def steer(
        self, feedback: Feedback, memory: Named, own: Named, vehicle: Vehicle
    ) -> tuple[dict[str, PyTree], dict[str, PyTree]]:
        turned = jnp.where(feedback.depth <= feedback.inputs.shallow, 1.0, memory.diving)
        diving = jnp.where(feedback.depth >= feedback.inputs.deep, -1.0, turned)
        integral = jnp.where(diving == memory.diving, memory.integral, 0.0)
        error = -diving * own.pitch - feedback.pitch
        pull, integral = pid(own.gains, error, feedback.omega[1], integral, own.period, own.reach)
        commands = {
            self.ballast: own.neutral - diving * own.volume,
            self.moving_mass: own.middle + diving * own.shift - pull,
        }
        return commands, {"diving": diving, "integral": integral}
