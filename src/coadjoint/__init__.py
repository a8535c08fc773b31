"""Variational integrators on Lie groups from a reduced Lagrangian written in Python.

    import coadjoint as co

Here are the names of daily use: systems, states, groups, spaces, methods, runs and steppers. All others are in the
packages, as `co.groups.SLn`. Names are loaded when first used, so that `import coadjoint` costs little.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.earlier_names import install
from coadjoint.extensions import added
from coadjoint.lazy import lazy

if TYPE_CHECKING:
    import coadjoint_vehicles as vehicles  # of the distribution coadjoint-vehicles

    __all__ = ["vehicles"]  # as the others are by the form of their imports

    from coadjoint import control as control
    from coadjoint import difference_maps as difference_maps
    from coadjoint import errors as errors
    from coadjoint import estimation as estimation
    from coadjoint import groups as groups
    from coadjoint import identification as identification
    from coadjoint import losses as losses
    from coadjoint import mechanics as mechanics
    from coadjoint import methods as methods
    from coadjoint import models as models
    from coadjoint import simulation as simulation
    from coadjoint import spaces as spaces
    from coadjoint import stability as stability
    from coadjoint import sweeps as sweeps
    from coadjoint import theory as theory
    from coadjoint.difference_maps import Cayley as Cayley
    from coadjoint.difference_maps import Exponential as Exponential
    from coadjoint.groups import SE2 as SE2
    from coadjoint.groups import SE3 as SE3
    from coadjoint.groups import SO2 as SO2
    from coadjoint.groups import SO3 as SO3
    from coadjoint.groups import DirectProduct as DirectProduct
    from coadjoint.groups import MatrixGroup as MatrixGroup
    from coadjoint.groups import Power as Power
    from coadjoint.groups import SemidirectProduct as SemidirectProduct
    from coadjoint.groups import SOn as SOn
    from coadjoint.groups import SUn as SUn
    from coadjoint.groups import Translation as Translation
    from coadjoint.groups import Un as Un
    from coadjoint.groups import attitude as attitude
    from coadjoint.kernels.float64 import float64 as float64
    from coadjoint.mechanics.constraints import Holonomic as Holonomic
    from coadjoint.mechanics.constraints import Nonholonomic as Nonholonomic
    from coadjoint.mechanics.members import each as each
    from coadjoint.mechanics.parameters import Parameters as Parameters
    from coadjoint.mechanics.signals import Held as Held
    from coadjoint.mechanics.signals import Linear as Linear
    from coadjoint.mechanics.state import Force as Force
    from coadjoint.mechanics.state import State as State
    from coadjoint.mechanics.system import System as System
    from coadjoint.methods import EnergyMomentum as EnergyMomentum
    from coadjoint.methods import Galerkin as Galerkin
    from coadjoint.methods import HamiltonianMidpoint as HamiltonianMidpoint
    from coadjoint.methods import IsospectralMidpoint as IsospectralMidpoint
    from coadjoint.methods import LeftRectangle as LeftRectangle
    from coadjoint.methods import Midpoint as Midpoint
    from coadjoint.methods import RightRectangle as RightRectangle
    from coadjoint.methods import Simpson as Simpson
    from coadjoint.methods import Suzuki4 as Suzuki4
    from coadjoint.methods import Trapezoidal as Trapezoidal
    from coadjoint.methods import Variational as Variational
    from coadjoint.simulation.events import Event as Event
    from coadjoint.simulation.outputs import Output as Output
    from coadjoint.simulation.resume import resume as resume
    from coadjoint.simulation.saved import load as load
    from coadjoint.simulation.simulate import simulate as simulate
    from coadjoint.simulation.steppers.stepper import Stepper as Stepper
    from coadjoint.simulation.steppers.stepping import load_stepper as load_stepper
    from coadjoint.simulation.trajectory import trajectory as trajectory
    from coadjoint.spaces import Coadjoint as Coadjoint
    from coadjoint.spaces import Defining as Defining
    from coadjoint.spaces import Sphere as Sphere
    from coadjoint.spaces import Trivial as Trivial
    from coadjoint.sweeps.call import sweep as sweep

__version__ = "0.2.0"
EXTENSIONS: list[str] = []
"""Modules that add to the packages below them, see `coadjoint.extensions`."""
MOVED = {
    "difference_maps": "DifferenceMap Pade SecondKind Squared",
    "errors": "ArgumentError CoadjointError FileError GroupError Interrupted LagrangianError OptimumError StepError",
    "groups": "GLn Heisenberg LieGroup Opposite SLn SU2 Sp UnitQuaternion complex_form real_form",
    "mechanics": "Connection Course DiscreteConnection InternalRule KelvinNoether Motion NodeMotion Signal casimirs "
    "holonomy horizontal_lift jumped mechanical_connection poisson_bracket quadratic_drag rayleigh "
    "sampled sampling trace_casimirs",
    "methods": "AdjointVariational Composition GroupVariational KahanLi6 KahanLi8 LeftRight Method "
    "SofroniouSpaletta6 SofroniouSpaletta8 SofroniouSpaletta10 Symmetrised VariableStep Yoshida4",
    "simulation": "save_fmu",
    "spaces": "Adjoint Dual GroupItself Points RelativePoses Several Space Submanifold",
    "sweeps": "SweepResults load_sweep",
    "theory": "discrete_mechanical_connection lagrange_poincare lagrange_poincare_residual",
}
"""Names that have their home in a package, and that `coadjoint` gives with a warning until version 0.3."""

install()

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__, MOVED, added)
