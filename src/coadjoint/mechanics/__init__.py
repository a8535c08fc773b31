"""Systems with symmetry, their continuous and discrete equations, and what they conserve."""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.lazy import lazy

if TYPE_CHECKING:
    from coadjoint.mechanics.bundle import holonomy as holonomy
    from coadjoint.mechanics.bundle import horizontal_lift as horizontal_lift
    from coadjoint.mechanics.casimir_functions import casimirs as casimirs
    from coadjoint.mechanics.connection import Connection as Connection
    from coadjoint.mechanics.constraints import Holonomic as Holonomic
    from coadjoint.mechanics.constraints import Nonholonomic as Nonholonomic
    from coadjoint.mechanics.damping import quadratic_drag as quadratic_drag
    from coadjoint.mechanics.damping import rayleigh as rayleigh
    from coadjoint.mechanics.discrete_connection import DiscreteConnection as DiscreteConnection
    from coadjoint.mechanics.internal import sampled as sampled
    from coadjoint.mechanics.internal import sampling as sampling
    from coadjoint.mechanics.internal_rule import InternalRule as InternalRule
    from coadjoint.mechanics.internal_state import Course as Course
    from coadjoint.mechanics.internal_state import jumped as jumped
    from coadjoint.mechanics.locked_inertia import mechanical_connection as mechanical_connection
    from coadjoint.mechanics.members import each as each
    from coadjoint.mechanics.multipliers import reactions_at as reactions_at
    from coadjoint.mechanics.noether import KelvinNoether as KelvinNoether
    from coadjoint.mechanics.own_time import in_own_time as in_own_time
    from coadjoint.mechanics.parameters import Parameters as Parameters
    from coadjoint.mechanics.poisson import poisson_bracket as poisson_bracket
    from coadjoint.mechanics.principal_bundle import PrincipalBundle as PrincipalBundle
    from coadjoint.mechanics.principal_bundle import Section as Section
    from coadjoint.mechanics.signals import Held as Held
    from coadjoint.mechanics.signals import Linear as Linear
    from coadjoint.mechanics.signals import Signal as Signal
    from coadjoint.mechanics.state import Force as Force
    from coadjoint.mechanics.state import Motion as Motion
    from coadjoint.mechanics.state import NodeMotion as NodeMotion
    from coadjoint.mechanics.state import State as State
    from coadjoint.mechanics.system import System as System
    from coadjoint.mechanics.trace_functions import trace_casimirs as trace_casimirs

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
