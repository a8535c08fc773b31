"""Rigid bodies and joints in maximal coordinates: linkages, trees and loops alike."""

from __future__ import annotations

from coadjoint.models.multibody.bodies import Body
from coadjoint.models.multibody.joints import Joint
from coadjoint.models.multibody.mechanism import Mechanism

__all__ = ["Body", "Joint", "Mechanism"]
