"""Joints of phases: the state is continuous, on the group, and so are the momenta or the velocities."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.control.boundary_conditions import place_of
from coadjoint.control.inputs_between import at_end
from coadjoint.control.library import casadi
from coadjoint.control.program import Block, NonlinearProgram, nonlinear_program
from coadjoint.control.stage import StepGraph
from coadjoint.control.step_functions import StepColumns
from coadjoint.control.transcription import Rows, Transcription
from coadjoint.errors import ArgumentError
from coadjoint.kernels.expressions.expression import Expr
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.internal_state import at_node
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System

KEPT = ("momentum", "velocity")
"""The quantities that may be continuous at a joint."""


@dataclass(frozen=True)
class PhaseJoint:
    """The end of phase `before` is the beginning of phase `after`; keep: the continuous quantity, momenta or
    velocities."""

    before: str
    after: str
    keep: str

    @property
    def what(self) -> str:
        """Its name in sentences."""
        return f"the joint of `{self.before}` and `{self.after}`"

    def velocities(self, graph: StepGraph) -> list[Expr]:
        """ξ and ν of the momenta at a node, if these are continuous."""
        return graph.at_node(_velocities, "The velocities") if self.keep == "velocity" else []

    def places(self, after: Transcription) -> list[int]:
        """The numbers of the state that are the same on both sides."""
        names, keep = after.graph.names(), self.keep == "momentum"
        return [i for i in after.live if keep or not names[i].startswith(("mu", "pi"))]

    def linear(self, graph: StepGraph, after: Transcription) -> list[Expr]:
        """The numbers of the phase before that the phase after needs."""
        if graph.names() != after.graph.names():
            raise ArgumentError(
                f"Phases `{self.before}` and `{self.after}` have different internal states, so that one cannot begin "
                "where the other ends: give both systems the same rule."
            )
        return [graph.symbols.state[i] for i in self.places(after)]

    def rows(self, before: Transcription, after: Transcription, ends: Sides, begins: Sides) -> Any:
        """The residual at the joint, as CasADi's expression."""
        ca, places = casadi(), self.places(after)
        there, here = ({place: k for k, place in enumerate(one.live)} for one in (before, after))
        gap = begins.x[[here[i] for i in places]] - ends.x[[there[i] for i in places]]
        if self.keep == "momentum":
            return gap
        speeds = []
        for one, side in ((before, ends), (after, begins)):
            found = self.velocities(one.graph)
            function = StepColumns(one.graph, one.eta, one.live).of_node("velocities", found)
            speeds.append(function(side.x, side.u, side.p, side.h))
        return ca.vertcat(gap, speeds[1] - speeds[0])


def _velocities(system: System, state: State) -> Any:
    return jnp.concatenate([state.xi, state.nu])


class Sides(NamedTuple):
    """A node of a phase: x, u, parameters and h."""

    x: Any
    u: Any
    p: PyTree
    h: Any


class PhasedProgram(NamedTuple):
    """The program of all phases, and that of each by its name."""

    joined: NonlinearProgram
    each: dict[str, NonlinearProgram]

    def split(self, w: np.ndarray) -> dict[str, np.ndarray]:
        """The variables of each phase."""
        sizes = [program.w.numel() for program in self.each.values()]
        return dict(zip(self.each, np.split(w, np.cumsum(sizes)[:-1]), strict=True))


def phased_program(
    parts: dict[str, Transcription],
    joints: tuple[PhaseJoint, ...],
    shared: tuple[str, ...],
    total: tuple[float, float] | None,
) -> PhasedProgram:
    """The programs of all phases as one, with their joints, shared parameters and total duration."""
    ca = casadi()
    each = {name: nonlinear_program(transcription) for name, transcription in parts.items()}
    sides = {name: _sides(parts[name], program.w) for name, program in each.items()}
    g, blocks = [], []
    for name, program in each.items():
        g.append(program.g)
        blocks += [Block(b.rows._replace(what=f"{b.rows.what} of phase `{name}`"), b.nodes) for b in program.blocks]

    def zero(what: str, values: PyTree) -> None:
        g.append(values)
        blocks.append(Block(Rows(what, np.zeros(values.numel()), np.zeros(values.numel())), 1))

    for joint in joints:
        ends, begins = sides[joint.before][1], sides[joint.after][0]
        zero(joint.what, joint.rows(parts[joint.before], parts[joint.after], ends, begins))
    for name in shared:
        own = [sides[one][0].p[_place(part, name)] for one, part in parts.items() if name in part.problem.parameters]
        for other in own[1:]:
            zero(f"the shared parameter `{name}`", other - own[0])
    if total is not None:
        g.append(sum(parts[name].problem.count * sides[name][0].h for name in parts))
        blocks.append(Block(Rows("the total duration", np.array([total[0]]), np.array([total[1]])), 1))
    lower, upper = zip(*(program.bounds for program in each.values()), strict=True)
    w = ca.vertcat(*(program.w for program in each.values()))
    f = sum(program.f for program in each.values())
    return PhasedProgram(
        NonlinearProgram(w, f, ca.vertcat(*g), blocks, (np.concatenate(lower), np.concatenate(upper))), each
    )


def _sides(transcription: Transcription, w: Array) -> tuple[Sides, Sides]:
    """The first and the last node of a phase in its variables."""
    nx, nu, nz, count = transcription.sizes
    problem, block = transcription.problem, nx + nu + nz
    end = problem.count * block
    p = transcription.expressions(w[end + nx : end + nx + count])
    h = w[end + nx + count] if problem.free_duration is not None else casadi().MX(problem.dt)
    u = w[end - block + nx : end - nz]
    first = Sides(w[:nx], w[nx : nx + nu], p, h)
    return first, Sides(w[end : end + nx], u[at_end(transcription.inputs)], p, h)


def _place(transcription: Transcription, name: str) -> slice:
    """The place of a parameter of the system among the parameters."""
    begin = sum(profile.size for profile in transcription.profiles.values())
    known: Any = transcription.problem.system.parameters
    for one in transcription.problem.parameters:
        size = int(np.prod(np.shape(getattr(known, one))))
        if one == name:
            return slice(begin, begin + size)
        begin += size
    raise AssertionError("a fixed parameter")


def carried(system: System, states: State, into: System, keep: str) -> State:
    """The last of some states, as the start of a phase of another system."""
    last = jax.tree.map(lambda leaf: np.asarray(leaf)[-1], states) if np.ndim(states.t) else states
    last = evaluate(lambda state: at_node(system, state), last)
    group, Q, _ = system.places
    turning, drifting = ("mu", "pi") if keep == "momentum" else ("xi", "qdot")
    moving = {turning: getattr(last, turning)}
    if Q.dim(group):
        moving[drifting] = Q.given(group, getattr(last, drifting))
    return into.state(**place_of(system, last), **moving)
