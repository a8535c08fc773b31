"""Optimal motion: the steps of a variational integrator as constraints, solved by the solvers of CasADi.

problem = co.control.Problem(system, start, dt=0.05, duration=5.0, inputs={...}, cost=..., end=co.control.End(...))
print(problem.solve())
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.lazy import lazy

if TYPE_CHECKING:
    from coadjoint.control.exported import ExportedStep as ExportedStep
    from coadjoint.control.exported import step_function as step_function
    from coadjoint.control.functions import casadi_function as casadi_function
    from coadjoint.control.inputs_between import Profile as Profile
    from coadjoint.control.least_squares_cost import squares as squares
    from coadjoint.control.measured import Measured as Measured
    from coadjoint.control.moving_horizon import Estimator as Estimator
    from coadjoint.control.moving_horizon import StateEstimate as StateEstimate
    from coadjoint.control.mpc_solution import MpcSolution as MpcSolution
    from coadjoint.control.optimum import Optimum as Optimum
    from coadjoint.control.penalty import Penalty as Penalty
    from coadjoint.control.phased_optimum import PhasedOptimum as PhasedOptimum
    from coadjoint.control.phases import Phases as Phases
    from coadjoint.control.predictive import Controller as Controller
    from coadjoint.control.problem import Problem as Problem
    from coadjoint.control.problem_parts import Bounds as Bounds
    from coadjoint.control.problem_parts import End as End
    from coadjoint.control.problem_parts import Input as Input
    from coadjoint.control.regulator import Regulator as Regulator
    from coadjoint.control.sensitivity import Sensitivity as Sensitivity

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
