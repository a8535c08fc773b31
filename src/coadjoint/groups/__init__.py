"""Matrix Lie groups: elements, algebra coordinates, Ad, ad and their duals (mathematics: section 1)."""

from coadjoint.groups.direct_product import DirectProduct
from coadjoint.groups.group import LieGroup
from coadjoint.groups.matrix_group import MatrixGroup
from coadjoint.groups.rigid_motions import SE2, SE3
from coadjoint.groups.rotations import SO2, SO3
from coadjoint.groups.semidirect_product import SemidirectProduct
from coadjoint.groups.translation import Translation

__all__ = ["SE2", "SE3", "SO2", "SO3", "DirectProduct", "LieGroup", "MatrixGroup", "SemidirectProduct", "Translation"]
