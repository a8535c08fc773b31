"""Added mass: of ellipsoids and slender bodies by formulas, and from the files of panel codes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.extending import lazy

if TYPE_CHECKING:
    from coadjoint_vehicles.hydrodynamics.added_mass import added_mass_about as added_mass_about
    from coadjoint_vehicles.hydrodynamics.added_mass import added_mass_in_axes as added_mass_in_axes
    from coadjoint_vehicles.hydrodynamics.capytaine import capytaine_added_mass as capytaine_added_mass
    from coadjoint_vehicles.hydrodynamics.ellipsoids import displaced_mass as displaced_mass
    from coadjoint_vehicles.hydrodynamics.ellipsoids import ellipsoid as ellipsoid
    from coadjoint_vehicles.hydrodynamics.ellipsoids import ellipsoid_added_mass as ellipsoid_added_mass
    from coadjoint_vehicles.hydrodynamics.slender_bodies import slender_body_added_mass as slender_body_added_mass
    from coadjoint_vehicles.hydrodynamics.wamit import wamit_added_mass as wamit_added_mass

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
