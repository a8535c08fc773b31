"""Parts of underwater vehicles: each pushes, may be commanded, and is a line of the energy budget."""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.extending import lazy

if TYPE_CHECKING:
    from coadjoint_vehicles.parts.airfoil import Airfoil as Airfoil
    from coadjoint_vehicles.parts.ballast import Ballast as Ballast
    from coadjoint_vehicles.parts.damping import Damping as Damping
    from coadjoint_vehicles.parts.derivatives import Derivatives as Derivatives
    from coadjoint_vehicles.parts.fin import Fin as Fin
    from coadjoint_vehicles.parts.hull import Hull as Hull
    from coadjoint_vehicles.parts.lifting_body import LiftingBody as LiftingBody
    from coadjoint_vehicles.parts.mmg import Mmg as Mmg
    from coadjoint_vehicles.parts.moving_mass import MovingMass as MovingMass
    from coadjoint_vehicles.parts.part import Command as Command
    from coadjoint_vehicles.parts.part import Flow as Flow
    from coadjoint_vehicles.parts.part import Part as Part
    from coadjoint_vehicles.parts.part import Passing as Passing
    from coadjoint_vehicles.parts.payload import Payload as Payload
    from coadjoint_vehicles.parts.propeller import Propeller as Propeller
    from coadjoint_vehicles.parts.published_curves import T200 as T200
    from coadjoint_vehicles.parts.thrusters import Thrusters as Thrusters

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
