"""Group difference maps τ: 𝔤 → G and their tangents (mathematics: section 3)."""

from coadjoint.difference_maps.cayley import Cayley
from coadjoint.difference_maps.difference_map import DifferenceMap
from coadjoint.difference_maps.exponential import Exponential
from coadjoint.difference_maps.pade import Pade
from coadjoint.difference_maps.second_kind import SecondKind
from coadjoint.difference_maps.squared import Squared

__all__ = ["Cayley", "DifferenceMap", "Exponential", "Pade", "SecondKind", "Squared"]
