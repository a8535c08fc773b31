"""Variational integrators on Lie groups from a reduced Lagrangian written in Python.

    import coadjoint as co

Names are loaded when first used, so that `import coadjoint` costs little.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.lazy import lazy

if TYPE_CHECKING:
    from coadjoint import control as control
    from coadjoint import estimation as estimation
    from coadjoint import identification as identification
    from coadjoint import models as models
    from coadjoint import stability as stability
    from coadjoint import theory as theory
    from coadjoint import vehicles as vehicles
    from coadjoint.difference_maps import Cayley as Cayley
    from coadjoint.difference_maps import DifferenceMap as DifferenceMap
    from coadjoint.difference_maps import Exponential as Exponential
    from coadjoint.difference_maps import Pade as Pade
    from coadjoint.difference_maps import SecondKind as SecondKind
    from coadjoint.difference_maps import Squared as Squared
    from coadjoint.errors import ArgumentError as ArgumentError
    from coadjoint.errors import CoadjointError as CoadjointError
    from coadjoint.errors import FileError as FileError
    from coadjoint.errors import GroupError as GroupError
    from coadjoint.errors import Interrupted as Interrupted
    from coadjoint.errors import LagrangianError as LagrangianError
    from coadjoint.errors import OptimumError as OptimumError
    from coadjoint.errors import StepError as StepError
    from coadjoint.groups import SE2 as SE2
    from coadjoint.groups import SE3 as SE3
    from coadjoint.groups import SO2 as SO2
    from coadjoint.groups import SO3 as SO3
    from coadjoint.groups import SU2 as SU2
    from coadjoint.groups import DirectProduct as DirectProduct
    from coadjoint.groups import GLn as GLn
    from coadjoint.groups import Heisenberg as Heisenberg
    from coadjoint.groups import LieGroup as LieGroup
    from coadjoint.groups import MatrixGroup as MatrixGroup
    from coadjoint.groups import Opposite as Opposite
    from coadjoint.groups import Power as Power
    from coadjoint.groups import SemidirectProduct as SemidirectProduct
    from coadjoint.groups import SLn as SLn
    from coadjoint.groups import SOn as SOn
    from coadjoint.groups import Sp as Sp
    from coadjoint.groups import SUn as SUn
    from coadjoint.groups import Translation as Translation
    from coadjoint.groups import Un as Un
    from coadjoint.groups import UnitQuaternion as UnitQuaternion
    from coadjoint.groups import attitude as attitude
    from coadjoint.groups import complex_form as complex_form
    from coadjoint.groups import real_form as real_form
    from coadjoint.kernels.float64 import float64 as float64
    from coadjoint.mechanics.bundle import holonomy as holonomy
    from coadjoint.mechanics.bundle import horizontal_lift as horizontal_lift
    from coadjoint.mechanics.casimirs import casimirs as casimirs
    from coadjoint.mechanics.connection import Connection as Connection
    from coadjoint.mechanics.damping import quadratic_drag as quadratic_drag
    from coadjoint.mechanics.damping import rayleigh as rayleigh
    from coadjoint.mechanics.discrete_connection import DiscreteConnection as DiscreteConnection
    from coadjoint.mechanics.internal import sampled as sampled
    from coadjoint.mechanics.internal import sampling as sampling
    from coadjoint.mechanics.internal_rule import InternalRule as InternalRule
    from coadjoint.mechanics.internal_state import Course as Course
    from coadjoint.mechanics.internal_state import jumped as jumped
    from coadjoint.mechanics.mechanical_connection import mechanical_connection as mechanical_connection
    from coadjoint.mechanics.members import each as each
    from coadjoint.mechanics.noether import KelvinNoether as KelvinNoether
    from coadjoint.mechanics.parameters import Parameters as Parameters
    from coadjoint.mechanics.poisson import poisson_bracket as poisson_bracket
    from coadjoint.mechanics.signals import Held as Held
    from coadjoint.mechanics.signals import Linear as Linear
    from coadjoint.mechanics.signals import Signal as Signal
    from coadjoint.mechanics.state import Force as Force
    from coadjoint.mechanics.state import Motion as Motion
    from coadjoint.mechanics.state import NodeMotion as NodeMotion
    from coadjoint.mechanics.state import State as State
    from coadjoint.mechanics.system import System as System
    from coadjoint.mechanics.trace_casimirs import trace_casimirs as trace_casimirs
    from coadjoint.methods import AdjointVariational as AdjointVariational
    from coadjoint.methods import Composition as Composition
    from coadjoint.methods import EnergyMomentum as EnergyMomentum
    from coadjoint.methods import Galerkin as Galerkin
    from coadjoint.methods import GroupVariational as GroupVariational
    from coadjoint.methods import HamiltonianMidpoint as HamiltonianMidpoint
    from coadjoint.methods import IsospectralMidpoint as IsospectralMidpoint
    from coadjoint.methods import KahanLi6 as KahanLi6
    from coadjoint.methods import KahanLi8 as KahanLi8
    from coadjoint.methods import LeftRectangle as LeftRectangle
    from coadjoint.methods import LeftRight as LeftRight
    from coadjoint.methods import Method as Method
    from coadjoint.methods import Midpoint as Midpoint
    from coadjoint.methods import RightRectangle as RightRectangle
    from coadjoint.methods import Simpson as Simpson
    from coadjoint.methods import SofroniouSpaletta6 as SofroniouSpaletta6
    from coadjoint.methods import SofroniouSpaletta8 as SofroniouSpaletta8
    from coadjoint.methods import SofroniouSpaletta10 as SofroniouSpaletta10
    from coadjoint.methods import Suzuki4 as Suzuki4
    from coadjoint.methods import Symmetrised as Symmetrised
    from coadjoint.methods import Trapezoidal as Trapezoidal
    from coadjoint.methods import VariableStep as VariableStep
    from coadjoint.methods import Variational as Variational
    from coadjoint.methods import Yoshida4 as Yoshida4
    from coadjoint.simulation.events import Event as Event
    from coadjoint.simulation.resume import resume as resume
    from coadjoint.simulation.saved import load as load
    from coadjoint.simulation.simulate import simulate as simulate
    from coadjoint.simulation.steppers.fmu import save_fmu as save_fmu
    from coadjoint.simulation.steppers.stepper import Stepper as Stepper
    from coadjoint.simulation.steppers.stepping import load_stepper as load_stepper
    from coadjoint.simulation.trajectory import trajectory as trajectory
    from coadjoint.spaces import Adjoint as Adjoint
    from coadjoint.spaces import Coadjoint as Coadjoint
    from coadjoint.spaces import Defining as Defining
    from coadjoint.spaces import Dual as Dual
    from coadjoint.spaces import GroupItself as GroupItself
    from coadjoint.spaces import Points as Points
    from coadjoint.spaces import RelativePoses as RelativePoses
    from coadjoint.spaces import Several as Several
    from coadjoint.spaces import Space as Space
    from coadjoint.spaces import Sphere as Sphere
    from coadjoint.spaces import Submanifold as Submanifold
    from coadjoint.spaces import Trivial as Trivial
    from coadjoint.sweeps.call import sweep as sweep
    from coadjoint.sweeps.results import SweepResults as SweepResults
    from coadjoint.sweeps.results import load_sweep as load_sweep
    from coadjoint.theory.discrete_mechanical_connection import (
        discrete_mechanical_connection as discrete_mechanical_connection,
    )
    from coadjoint.theory.lagrange_poincare import lagrange_poincare as lagrange_poincare
    from coadjoint.theory.lagrange_poincare import lagrange_poincare_residual as lagrange_poincare_residual

__version__ = "0.1.0"
EXTENSIONS = ["coadjoint.vehicles.extension"]
"""Modules that add to the packages below them, see `coadjoint.extensions`."""

__getattr__, __dir__, __all__ = lazy(__name__)  # pyright: ignore[reportUnsupportedDunderAll]
