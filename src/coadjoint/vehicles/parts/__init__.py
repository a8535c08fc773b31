"""Parts of underwater vehicles: each pushes, may be commanded, and is a line of the energy budget."""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.extending import lazy

if TYPE_CHECKING:
    from coadjoint.vehicles.parts.airfoil import Airfoil as Airfoil
    from coadjoint.vehicles.parts.ballast import Ballast as Ballast
    from coadjoint.vehicles.parts.damping import Damping as Damping
    from coadjoint.vehicles.parts.derivatives import Derivatives as Derivatives
    from coadjoint.vehicles.parts.fin import Fin as Fin
    from coadjoint.vehicles.parts.hull import Hull as Hull
    from coadjoint.vehicles.parts.lifting_body import LiftingBody as LiftingBody
    from coadjoint.vehicles.parts.moving_mass import MovingMass as MovingMass
    from coadjoint.vehicles.parts.part import Command as Command
    from coadjoint.vehicles.parts.part import Flow as Flow
    from coadjoint.vehicles.parts.part import Part as Part
    from coadjoint.vehicles.parts.part import Passing as Passing
    from coadjoint.vehicles.parts.payload import Payload as Payload
    from coadjoint.vehicles.parts.propeller import Propeller as Propeller
    from coadjoint.vehicles.parts.published_curves import T200 as T200
    from coadjoint.vehicles.parts.thrusters import Thrusters as Thrusters

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
