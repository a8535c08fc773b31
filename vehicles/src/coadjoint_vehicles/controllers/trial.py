"""Standard manoeuvres of sea trials: turning circle, zigzag, spiral, stop and pull-out."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from coadjoint import units as u
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.checks import whole
from coadjoint.errors import ArgumentError
from coadjoint.extending import traced
from coadjoint.models.quantities import positive
from coadjoint.spaces import Named
from coadjoint_vehicles.controllers.cruise import Cruise
from coadjoint_vehicles.controllers.manoeuvres import MANOEUVRES, TRIAL
from coadjoint_vehicles.controllers.pid import nearest_turn
from coadjoint_vehicles.model.controller import Feedback
from coadjoint_vehicles.model.vehicle import Vehicle
from coadjoint_vehicles.parts.measured import Measured, measured, not_negative


@dataclass(frozen=True, eq=False, kw_only=True)
class Trial(Cruise):
    """A standard manoeuvre with rudder orders δ_R from the time `begin` on; depth is held throughout as by `Cruise`.

        turning_circle    δ_R = δ
        zigzag            δ_R = ±δ, reversed whenever the heading is `deviation` off its course on the side of the order
        spiral            δ_R = δ, δ − δ/n, …, −δ, and back to δ in the same steps, each held for `hold`
        stop              δ_R = 0, propulsion at `astern` until the vehicle goes ahead no more, then all commands 0
        pull_out          δ_R = δ for `hold`, then 0

    Until `begin` heading and speed are held; then the command of the propulsion stays, but for "stop". A positive order
    turns to starboard: it is δ_heading of `Cruise`, which all fins that turn share. The course is the heading at
    `begin`.

    manoeuvre: one of the five. rudder: δ, rad, negative to port; by default 10° for a zigzag and the limit of the fins
    otherwise. deviation: rad, |δ| unless given. begin: the time of the first order, s. hold: s, by default the time of
    20 lengths at `speed`. steps: n. astern: the command of the propulsion, by default full astern. length: L of the
    figures of merit, m, by default that of the vehicle. The other fields and the set points are those of `Cruise`.
    Raises ArgumentError for an order beyond the limit of the fins. Source: IMO resolution MSC.137(76) (2002); ITTC
    7.5-04-02-01.
    """

    kind: ClassVar[str] = "trial"
    manoeuvre: str = measured(None, None, words=MANOEUVRES, default="turning_circle")
    rudder: Measured = measured(u.ANGLE, default=None)
    deviation: Measured = measured(u.ANGLE, positive, default=None)
    begin: Measured = measured(u.TIME, not_negative, default=10.0)
    hold: Measured = measured(u.TIME, positive, default=None)
    steps: int = measured(None, whole, default=4)
    astern: Measured = measured(None, default=None)
    length: Measured = measured(u.LENGTH, positive, default=None)

    def fitted(self, vehicle: PyTree) -> Trial:
        """The controller for a vehicle, with the rudder order and the times that were left out."""
        made = super().fitted(vehicle)
        assert isinstance(made, Trial) and made.allocation is not None
        limit = made.fin_limit
        if self.manoeuvre == "stop" and not made.allocation.matrix[:, 3].any():
            raise ArgumentError(
                f"The manoeuvre 'stop' needs propulsion that takes commands, and {vehicle.name} has none."
            )
        order = made.rudder
        if order is None:
            order = min(np.radians(10.0), float(limit)) if self.manoeuvre == "zigzag" else limit
        if not traced(order, limit) and (abs(order) > limit * (1 + 1e-9) or order == 0):
            raise ArgumentError(
                f"Argument `rudder` of a trial must be an order within ±{np.degrees(limit):g}°, the limit of the fins "
                f"of {vehicle.name}, and not 0, but is {np.degrees(order):g}°."
            )
        length = vehicle.length if vehicle.length is not None else 10 * np.cbrt(vehicle.volume)
        return replace(
            made,
            rudder=order,
            deviation=abs(order) if made.deviation is None else made.deviation,
            hold=20 * length / made.speed if made.hold is None else made.hold,
            astern=-made.thrust_limit if made.astern is None else made.astern,
            length=vehicle.length if made.length is None else made.length,
        )

    def memory(self) -> dict[str, PyTree]:
        return {**super().memory(), "stage": -1.0, "since": 0.0, "course": 0.0, "order": 0.0, "ahead": 0.0}

    def parameters(self) -> dict[str, PyTree]:
        fixed = ("steps", "length")
        return {name: value for name, value in super().parameters().items() if name not in fixed}

    @property
    def ordered_to_limits(self) -> tuple[str, ...]:
        """The fins that turn, or of a stop the propulsion."""
        assert self.allocation is not None
        column = 3 if self.manoeuvre == "stop" else 2
        shares = np.asarray(self.allocation.matrix)[:, column]
        return tuple(name for name, share in zip(self.allocation.names, shares, strict=True) if share)

    def attributes(self) -> dict[str, str]:
        """The manoeuvre and the share of each fin in turning, from which `trials.analyse` reads a run."""
        assert self.allocation is not None
        shares = np.asarray(self.allocation.matrix)[:, 2].tolist()
        length = None if self.length is None else float(self.length)
        told = {"manoeuvre": self.manoeuvre, "fins": list(self.allocation.names), "shares": shares, "length": length}
        return {TRIAL: json.dumps(told)}

    def steer(
        self, feedback: Feedback, memory: Named, own: Named, vehicle: Vehicle
    ) -> tuple[dict[str, PyTree], dict[str, PyTree]]:
        mixed, integrals = self.turns_and_thrust(feedback, memory, own)
        running = memory.stage >= 0
        starts = ~running & (feedback.t >= own.begin - 1e-9)
        begun = running | starts
        course = jnp.where(running, memory.course, feedback.heading)
        onwards = running & self._done(feedback, memory, own)
        stage = jnp.where(starts, 0.0, memory.stage + jnp.where(onwards, 1.0, 0.0))
        since = jnp.where(starts | onwards, feedback.t, memory.since)
        order = jnp.where(begun, self._order(stage, own), 0.0)
        held = own.astern if self.manoeuvre == "stop" else jnp.where(running, memory.ahead, mixed[3])
        ahead = jnp.where(begun, held, mixed[3])
        wanted = jnp.stack([mixed[0], mixed[1], jnp.where(begun, order, mixed[2]), ahead])
        if self.manoeuvre == "stop":
            wanted = jnp.where(stage > 0, 0.0, wanted)
        remembered = {"stage": stage, "since": since, "course": course, "order": order, "ahead": ahead}
        return self.shared(wanted, own, vehicle), {**integrals, **remembered}

    def _done(self, feedback: Feedback, memory: Named, own: Named) -> Array:
        """Whether the order in force has lasted long enough."""
        if self.manoeuvre == "zigzag":
            return jnp.sign(memory.order) * nearest_turn(feedback.heading - memory.course) >= own.deviation
        if self.manoeuvre in ("spiral", "pull_out"):
            return feedback.t - memory.since >= own.hold - 1e-9
        if self.manoeuvre == "stop":
            return (memory.stage == 0) & (feedback.velocity[0] <= 0)
        return jnp.asarray(False)

    def _order(self, stage: Scalar, own: Named) -> Array:
        """δ_R of a stage, counted from 0."""
        n = self.steps
        factors = {
            "turning_circle": 1.0,
            "zigzag": 1.0 - 2.0 * (stage - 2.0 * jnp.floor(0.5 * stage)),
            "spiral": (jnp.abs(jnp.minimum(stage, 4 * n) - 2 * n) - n) / n,
            "stop": 0.0,
            "pull_out": jnp.where(stage == 0, 1.0, 0.0),
        }
        return factors[self.manoeuvre] * own.rudder
