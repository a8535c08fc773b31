"""Matrix Lie groups: elements, algebra coordinates, Ad, ad and their duals (mathematics: section 1)."""

from coadjoint.groups.classical import GLn, SLn, SOn, Sp
from coadjoint.groups.complex_form import complex_form, real_form
from coadjoint.groups.direct_product import DirectProduct
from coadjoint.groups.element_statistics import mean
from coadjoint.groups.group import LieGroup
from coadjoint.groups.heisenberg import Heisenberg
from coadjoint.groups.interpolation import Spline, geodesic
from coadjoint.groups.matrix_group import MatrixGroup
from coadjoint.groups.opposite import Opposite
from coadjoint.groups.power import Power
from coadjoint.groups.quaternions import SU2, UnitQuaternion
from coadjoint.groups.rigid_motions import SE2, SE3
from coadjoint.groups.rotations import SO2, SO3
from coadjoint.groups.semidirect_product import SemidirectProduct
from coadjoint.groups.translation import Translation
from coadjoint.groups.unitary import SUn, Un

__all__ = [
    "SE2",
    "SE3",
    "SO2",
    "SO3",
    "SU2",
    "DirectProduct",
    "GLn",
    "Heisenberg",
    "LieGroup",
    "MatrixGroup",
    "Opposite",
    "Power",
    "SLn",
    "SOn",
    "SUn",
    "SemidirectProduct",
    "Sp",
    "Spline",
    "Translation",
    "Un",
    "UnitQuaternion",
    "complex_form",
    "geodesic",
    "mean",
    "real_form",
]
