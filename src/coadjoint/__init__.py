"""Variational integrators on Lie groups from a reduced Lagrangian written in Python.

    import coadjoint as co

Names are loaded when first used, so that `import coadjoint` costs little.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

_HOMES = {
    "coadjoint.difference_maps": ("Cayley", "DifferenceMap", "Exponential", "Pade", "SecondKind", "Squared"),
    "coadjoint.errors": (
        "ArgumentError",
        "CoadjointError",
        "FileError",
        "GroupError",
        "LagrangianError",
        "StepError",
    ),
    "coadjoint.groups": (
        "SE2",
        "SE3",
        "SO2",
        "SO3",
        "SU2",
        "DirectProduct",
        "Heisenberg",
        "LieGroup",
        "MatrixGroup",
        "SLn",
        "SOn",
        "SemidirectProduct",
        "Sp",
        "Translation",
        "UnitQuaternion",
        "complex_form",
        "real_form",
    ),
    "coadjoint.kernels.float64": ("float64",),
    "coadjoint.mechanics.casimirs": ("casimirs",),
    "coadjoint.mechanics.bundle": ("holonomy", "horizontal_lift"),
    "coadjoint.mechanics.connection": ("Connection",),
    "coadjoint.mechanics.discrete_connection": ("DiscreteConnection",),
    "coadjoint.mechanics.damping": ("quadratic_drag", "rayleigh"),
    "coadjoint.mechanics.each": ("each",),
    "coadjoint.mechanics.internal": ("sampled", "sampling"),
    "coadjoint.mechanics.internal_rule": ("InternalRule",),
    "coadjoint.mechanics.mechanical_connection": ("mechanical_connection",),
    "coadjoint.mechanics.noether": ("KelvinNoether",),
    "coadjoint.mechanics.parameters": ("Parameters",),
    "coadjoint.mechanics.poisson": ("poisson_bracket",),
    "coadjoint.mechanics.signals": ("Held", "Linear", "Signal"),
    "coadjoint.mechanics.state": ("Force", "Motion", "State"),
    "coadjoint.mechanics.system": ("System",),
    "coadjoint.methods": (
        "EnergyMomentum",
        "Galerkin",
        "GroupVariational",
        "AdjointVariational",
        "Composition",
        "KahanLi6",
        "KahanLi8",
        "LeftRectangle",
        "LeftRight",
        "Method",
        "Midpoint",
        "RightRectangle",
        "Simpson",
        "SofroniouSpaletta10",
        "SofroniouSpaletta6",
        "SofroniouSpaletta8",
        "Suzuki4",
        "Symmetrised",
        "Trapezoidal",
        "VariableStep",
        "Variational",
        "Yoshida4",
    ),
    "coadjoint.methods.hamiltonian_midpoint": ("HamiltonianMidpoint",),
    "coadjoint.simulation.events": ("Event",),
    "coadjoint.simulation.recording": ("load",),
    "coadjoint.simulation.resume": ("resume",),
    "coadjoint.simulation.simulate": ("simulate",),
    "coadjoint.simulation.steppers.load": ("load_stepper",),
    "coadjoint.simulation.steppers.stepper": ("Stepper",),
    "coadjoint.simulation.trajectory": ("trajectory",),
    "coadjoint.spaces": (
        "Adjoint",
        "Coadjoint",
        "Defining",
        "Dual",
        "GroupItself",
        "Points",
        "Several",
        "Space",
        "Sphere",
        "Submanifold",
        "Trivial",
    ),
    "coadjoint.theory.discrete_mechanical_connection": ("discrete_mechanical_connection",),
    "coadjoint.theory.lagrange_poincare": ("lagrange_poincare", "lagrange_poincare_residual"),
}
EXTENSIONS = ["coadjoint.vehicles.extension"]
"""Modules that add to the rooms below them, see `coadjoint.extensions`."""
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}
_MODULES = {
    "attitude": "coadjoint.groups.attitude",
    "identification": "coadjoint.identification",
    "models": "coadjoint.models",
    "stability": "coadjoint.stability",
    "theory": "coadjoint.theory",
    "vehicles": "coadjoint.vehicles",
}

__version__ = "0.1.0"
__all__ = [*_HOME_OF, *_MODULES]  # pyright: ignore[reportUnsupportedDunderAll]

if TYPE_CHECKING:
    from coadjoint import identification as identification
    from coadjoint import models as models
    from coadjoint import stability as stability
    from coadjoint import theory as theory
    from coadjoint import vehicles as vehicles
    from coadjoint.difference_maps import *  # noqa: F403
    from coadjoint.errors import *  # noqa: F403
    from coadjoint.groups import *  # noqa: F403
    from coadjoint.groups import attitude as attitude
    from coadjoint.kernels.float64 import float64 as float64
    from coadjoint.mechanics.bundle import holonomy as holonomy
    from coadjoint.mechanics.bundle import horizontal_lift as horizontal_lift
    from coadjoint.mechanics.casimirs import casimirs as casimirs
    from coadjoint.mechanics.connection import Connection as Connection
    from coadjoint.mechanics.damping import quadratic_drag as quadratic_drag
    from coadjoint.mechanics.damping import rayleigh as rayleigh
    from coadjoint.mechanics.discrete_connection import DiscreteConnection as DiscreteConnection
    from coadjoint.mechanics.each import each as each
    from coadjoint.mechanics.internal import sampled as sampled
    from coadjoint.mechanics.internal import sampling as sampling
    from coadjoint.mechanics.internal_rule import InternalRule as InternalRule
    from coadjoint.mechanics.mechanical_connection import mechanical_connection as mechanical_connection
    from coadjoint.mechanics.noether import KelvinNoether as KelvinNoether
    from coadjoint.mechanics.parameters import Parameters as Parameters
    from coadjoint.mechanics.poisson import poisson_bracket as poisson_bracket
    from coadjoint.mechanics.signals import Held as Held
    from coadjoint.mechanics.signals import Linear as Linear
    from coadjoint.mechanics.signals import Signal as Signal
    from coadjoint.mechanics.state import Force as Force
    from coadjoint.mechanics.state import Motion as Motion
    from coadjoint.mechanics.state import State as State
    from coadjoint.mechanics.system import System as System
    from coadjoint.methods import *  # noqa: F403
    from coadjoint.methods.hamiltonian_midpoint import HamiltonianMidpoint as HamiltonianMidpoint
    from coadjoint.simulation.events import Event as Event
    from coadjoint.simulation.recording import load as load
    from coadjoint.simulation.resume import resume as resume
    from coadjoint.simulation.simulate import simulate as simulate
    from coadjoint.simulation.steppers.load import load_stepper as load_stepper
    from coadjoint.simulation.steppers.stepper import Stepper as Stepper
    from coadjoint.simulation.trajectory import trajectory as trajectory
    from coadjoint.spaces import *  # noqa: F403
    from coadjoint.theory.discrete_mechanical_connection import (
        discrete_mechanical_connection as discrete_mechanical_connection,
    )
    from coadjoint.theory.lagrange_poincare import lagrange_poincare as lagrange_poincare
    from coadjoint.theory.lagrange_poincare import lagrange_poincare_residual as lagrange_poincare_residual


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return import_module(_MODULES[name])
    if name not in _HOME_OF:
        raise AttributeError(f"coadjoint has no `{name}`; it has: {', '.join(sorted(__all__))}.")
    value = getattr(import_module(_HOME_OF[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
