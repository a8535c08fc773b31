"""Rigid bodies and joints in maximal coordinates: linkages, trees and loops alike."""

from __future__ import annotations

from coadjoint.models.multibody.bodies import Body
from coadjoint.models.multibody.joints import Joint
from coadjoint.models.multibody.mechanism import Mechanism
from coadjoint.models.multibody.reading import ReadMechanism, read

__all__ = ["Body", "Joint", "Mechanism", "ReadMechanism", "read"]
