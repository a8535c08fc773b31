"""Variational methods, a class a file; the default is `Midpoint(Cayley())` (mathematics: sections 6 and 7)."""

from coadjoint.methods.adjoint_variational import AdjointVariational
from coadjoint.methods.composition import Composition, LeftRight, Symmetrised
from coadjoint.methods.energy_momentum import EnergyMomentum
from coadjoint.methods.galerkin import Galerkin
from coadjoint.methods.group_variational import GroupVariational
from coadjoint.methods.hamiltonian_midpoint import HamiltonianMidpoint
from coadjoint.methods.isospectral_midpoint import IsospectralMidpoint
from coadjoint.methods.left_rectangle import LeftRectangle
from coadjoint.methods.method import Claims, Method
from coadjoint.methods.midpoint import Midpoint
from coadjoint.methods.projected_midpoint import ProjectedMidpoint
from coadjoint.methods.right_rectangle import RightRectangle
from coadjoint.methods.runge_kutta import CommutatorFree, CrouchGrossman, MuntheKaas
from coadjoint.methods.schemes import (
    KahanLi6,
    KahanLi8,
    SofroniouSpaletta6,
    SofroniouSpaletta8,
    SofroniouSpaletta10,
    Suzuki4,
    Yoshida4,
)
from coadjoint.methods.simpson import Simpson
from coadjoint.methods.step import Step
from coadjoint.methods.trapezoidal import Trapezoidal
from coadjoint.methods.variable_step import VariableStep
from coadjoint.methods.variational import Variational

__all__ = [
    "AdjointVariational",
    "Claims",
    "CommutatorFree",
    "Composition",
    "CrouchGrossman",
    "EnergyMomentum",
    "Galerkin",
    "GroupVariational",
    "HamiltonianMidpoint",
    "IsospectralMidpoint",
    "KahanLi6",
    "KahanLi8",
    "LeftRectangle",
    "LeftRight",
    "Method",
    "Midpoint",
    "MuntheKaas",
    "ProjectedMidpoint",
    "RightRectangle",
    "Simpson",
    "SofroniouSpaletta6",
    "SofroniouSpaletta8",
    "SofroniouSpaletta10",
    "Step",
    "Suzuki4",
    "Symmetrised",
    "Trapezoidal",
    "VariableStep",
    "Variational",
    "Yoshida4",
]
