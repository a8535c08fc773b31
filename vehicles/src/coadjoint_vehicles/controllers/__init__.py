"""Controllers: from the feedback of a craft, at sample times, to commands of its actuators."""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.extending import lazy

if TYPE_CHECKING:
    from coadjoint_vehicles.controllers.attitude import Attitude as Attitude
    from coadjoint_vehicles.controllers.cruise import Cruise as Cruise
    from coadjoint_vehicles.controllers.hover import Hover as Hover
    from coadjoint_vehicles.controllers.hover import Manoeuvre as Manoeuvre
    from coadjoint_vehicles.controllers.hover import Pose as Pose
    from coadjoint_vehicles.controllers.line_of_sight import LineOfSight as LineOfSight
    from coadjoint_vehicles.controllers.proposed import proposed_controller as proposed_controller
    from coadjoint_vehicles.controllers.sawtooth import Sawtooth as Sawtooth
    from coadjoint_vehicles.controllers.trial import Trial as Trial
    from coadjoint_vehicles.model.controller import Controller as Controller
    from coadjoint_vehicles.model.controller import Feedback as Feedback
    from coadjoint_vehicles.model.function_controller import FunctionController as FunctionController

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
