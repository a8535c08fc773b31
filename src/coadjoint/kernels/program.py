"""The program of a kernel: pure functions of arrays, independent of groups and Lagrangians.

A step from t to t + h solves, stage by stage, residual(z) = 0 for the unknowns z of the stage and is then
explicit; a composition runs the stages over each of its substeps in turn. A `Program` is a static, hashable object;
every function of it is pure and traceable by JAX and works on PyTrees of float64 arrays. `parameters`, `state` and
`h` are arguments, never constants. Both backends run these same functions.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from contextlib import AbstractContextManager
from typing import Any, Protocol

from coadjoint.arrays import PyTree

State = PyTree
Parameters = PyTree
Unknowns = PyTree
Scalar = Any

TOLERANCE = 1e-7
"""Newton stops after an increment δ with |δ_b|∞ ≤ TOLERANCE·|z_b|∞ + FLOOR/|h| for every block b of unknowns:
convergence is quadratic, so the increment that would follow is under round-off. Groups have units of their own, and
one never sets the scale of another; but one at rest may be moved by the round-off of the others. So where the
unknowns together have met |δ|∞ ≤ TOLERANCE·|z|∞ + FLOOR/|h| twice in turn, a block whose increment did not shrink to
STALLED of the one before is at round-off and has settled too."""

STALLED = 0.5
"""See TOLERANCE."""

FLOOR = 1e-15
"""See TOLERANCE; the absolute part is an angle or a length per step."""

REMAINDER = 1e-15
"""Native code keeps the matrix of an iteration for the next ones, as a chord. Their increments δ₁, δ₂, … shrink by a
nearly constant factor, so that the one that would follow is δ₂²/δ₁: a chord stops where |δ₂|²/|δ₁| ≤ REMAINDER·|z_b|∞ +
1e-3·FLOOR/|h| in every block."""

CONTRACTION = 1 / 256
"""After a chord whose increment is larger than this part of the one before, the stage renews its matrix. One that did
not shrink to STALLED of it is dropped, without being counted, and the stage continues by Newton alone."""

MAX_ITERATIONS = 25

FORM = 2
"""The version of the form that native code gives to the equations; another form rounds differently."""

NEWTON = (TOLERANCE, FLOOR, STALLED, REMAINDER, CONTRACTION, MAX_ITERATIONS, FORM)
"""They decide the last digits of results, and are part of the identity of runs and kernels."""

MAX_UNKNOWNS = 60
"""The most unknowns of a stage that native code takes: their elimination is unrolled, and for more unknowns XLA is as
fast."""


class Code(enum.IntEnum):
    """How a step ended. A failed step leaves the state at the last good node."""

    CONVERGED = 0
    NOT_CONVERGED = 1
    NOT_FINITE = 2
    BEYOND_CHART = 3
    STOPPED = 4
    """The step is good, but an event happens in it: it is not taken."""
    OFF_CONSTRAINTS = 5
    """The start of a trajectory inside JAX's transformations does not satisfy the constraints."""
    ABSENT = -1
    """Of a lane without a member: no step is taken."""


class StatusFlag(enum.IntFlag):
    """What a stepper's call finds: some member has stopped; some observation is not finite; some command lies beyond
    its limits; the count of steps has come to 8192, 16384, … 131072 or to a multiple of 262144."""

    FAILED = 1
    NOT_FINITE = 2
    CLIPPED = 4
    DUE = 8


class Structure(Protocol):
    """The solver of the equations of a stage: a static, hashable object."""

    @property
    def native(self) -> bool:
        """Whether Newton's method of native code, which is dense, serves these equations too.

        Up to MAX_UNKNOWNS unknowns: tracing raises Untraceable for a dense stage of more.
        """
        ...

    @property
    def limit(self) -> str:
        """The most iterations of a stage, in words."""
        ...

    @property
    def words(self) -> str:
        """The description of the solver by XLA, for certificates and messages."""
        ...

    @property
    def many_small(self) -> bool:
        """Whether XLA makes of them hundreds of small loops, so that compiling them takes longest."""
        ...

    def root(self, residual: Any, guess: Unknowns, h: Scalar, blocks: tuple[int, ...], carried: PyTree = ()) -> Any:
        """`newton.solver.Root` of residual(z) = 0 from `guess` (m,), differentiable by the implicit function theorem.

        residual: `Stage.equations`.

        h: the length of the stage. blocks: as in `Stage`. carried: what the last step left in its `Root.carried`, a
        PyTree of fixed shapes, () where nothing is carried over.
        """
        ...


class Stage(Protocol):
    """One implicit stage of a substep; `h` is the stage's own step, `fraction` times the substep."""

    @property
    def fraction(self) -> float: ...

    @property
    def tolerant(self) -> bool:
        """Whether the step continues if this stage fails: then `advance` gets its guess and `sound` = 0."""
        ...

    @property
    def blocks(self) -> tuple[int, ...]:
        """How many unknowns, in their order, are of one kind and unit: sizes that add up to m, or () if all are."""
        ...

    @property
    def structure(self) -> Structure:
        """How its equations are solved."""
        ...

    def carried(self, state: State) -> PyTree:
        """The data that the solution of the last step left in the state for this one; () where nothing is carried
        over."""
        ...

    def carry(self, after: State, carried: PyTree) -> State:
        """The state after a step with the data that its solution leaves for the next one; with None, the form in
        records."""
        ...

    def guess(self, parameters: Parameters, state: State, h: Scalar) -> Unknowns:
        """Where Newton starts: z, shape (m,)."""
        ...

    def residual(self, parameters: Parameters, state: State, h: Scalar, z: Unknowns) -> Unknowns:
        """The equations of the stage, shape (m,), zero at the solution."""
        ...

    def equations(self, parameters: Parameters, state: State, h: Scalar) -> Any:
        """The function of z that `structure` solves: the residual, or more where it asks for more."""
        ...

    def solved(self, state: State, found: PyTree) -> State:
        """The state with the further results of its solution, `Root.found`: `advance` starts from it."""
        ...

    def chart(self, parameters: Parameters, state: State, h: Scalar, z: Unknowns) -> Scalar:
        """How far into its chart the difference map is used; the step fails with BEYOND_CHART unless < 1."""
        ...

    def record(self, parameters: Parameters, state: State, h: Scalar, z: Unknowns) -> State:
        """`state` with the unknowns of the stage that starts at it."""
        ...

    def advance(self, parameters: Parameters, state: State, h: Scalar, z: Unknowns, sound: Scalar) -> State:
        """The next state, explicit in the solution z; `sound` is 0 where a tolerant stage failed, 1 otherwise."""
        ...

    def certificate(
        self, parameters: Parameters, before: State, h: Scalar, z: Unknowns, after: State
    ) -> Mapping[str, Scalar]:
        """Residuals that certify the stage, non-negative scalars; over the stages of a step the maximum counts."""
        ...


class LinkedStage(Protocol):
    """The parts of a stage of N links whose equations hold those of a link and its neighbours, for loops over links.

    Functions take parameters, a state, h and unknowns as those of `Stage`. One of joints is a `JointedStage`.
    """

    @property
    def count(self) -> int:
        """N."""
        ...

    @property
    def blocks(self) -> tuple[int, ...]:
        """How many unknowns are of one kind and unit, those of multipliers last."""
        ...

    @property
    def structure(self) -> Any:
        """Its `by_links` gives unknowns or equations (N·b,) as (N, b); `multipliers`: whether some of them are those of
        joints; `looped`: whether loops are to be preferred."""
        ...

    def shortened(self, count: int) -> LinkedStage:
        """The same stage of `count` links, whose functions may fail where they are those of N alone."""
        ...

    def per_link(self, parameters: Parameters) -> list[bool]:
        """Of which leaves of the parameters every link has a row."""
        ...

    def short(self, parameters: Parameters, count: int) -> Parameters:
        """The parameters of `count` links."""
        ...

    def short_state(self, state: State, count: int) -> State:
        """A state with the shapes of one of `count` links."""
        ...

    def nearby(self, state: State, random: Any, size: float, later: float) -> State:
        """A random state near another one, `later` s after it; size: of the changes, relative to 1 plus the number."""
        ...

    def rows(self, state: State) -> tuple[PyTree, PyTree]:
        """The numbers of a state that belong to links, as arrays (N, …), and those that belong to none.

        A number is negative where a link has no such place in a row of numbers.
        """
        ...

    def prepare(self, parameters: Parameters, state: State, h: Scalar) -> State: ...

    def guess(self, parameters: Parameters, state: State, h: Scalar) -> Unknowns: ...

    def residual(self, parameters: Parameters, state: State, h: Scalar, z: Unknowns) -> Unknowns: ...

    def chart(self, parameters: Parameters, state: State, h: Scalar, z: Unknowns) -> Scalar: ...

    def record(self, parameters: Parameters, state: State, h: Scalar, z: Unknowns) -> State: ...

    def advanced(self, parameters: Parameters, state: State, h: Scalar, z: Unknowns) -> State: ...

    def certificate(self, parameters: Parameters, record: State, h: Scalar, after: State) -> Mapping[str, Scalar]: ...

    def observing(self) -> AbstractContextManager[None]:
        """The context in which monitors and certificates are traced: the momenta of links are known to be apart."""
        ...

    def accounted(self, parameters: Parameters, start: State, nodes: State, lengths: Any) -> State:
        """Records, and the node at the end, with the account of energy that they lead from a start; steps leave it."""
        ...


class JointedStage(LinkedStage, Protocol):
    """A stage of links on joints, with a step as in `methods.rattle`.

    Its unknowns are those of bodies, then the multipliers of joints, m a link: the state `free` after the step of the
    bodies gets the impulse of other multipliers, for which `rate` = 0 at the `velocities` of its momenta; `momenta`
    gives a state those of other velocities.
    """

    def free(self, parameters: Parameters, state: State, h: Scalar, z: Unknowns) -> State: ...

    def velocities(self, parameters: Parameters, free: State, impulse: Unknowns) -> State: ...

    def momenta(self, parameters: Parameters, state: State, moving: State) -> State: ...

    def rate(self, parameters: Parameters, state: State) -> Unknowns: ...

    def ended(self, parameters: Parameters, free: State, h: Scalar, impulse: Unknowns) -> State: ...


class Program(Protocol):
    """A complete step: `prepare`, then over every substep every stage in turn.

    The record of a step is that of the first stage, in the first substep, that is not tolerant.
    """

    @property
    def stages(self) -> tuple[Stage, ...]:
        """The stages of one substep."""
        ...

    @property
    def substeps(self) -> tuple[float, ...]:
        """The substeps as parts of h, which may be negative; (1.0,) for a method that is not composed."""
        ...

    def linked(self, state: State) -> LinkedStage | None:
        """The only stage, where its equations are those of links and their neighbours; else None."""
        ...

    def prepare(self, parameters: Parameters, state: State, h: Scalar) -> State:
        """The state with its inputs and internal states for the step of h that starts."""
        ...

    def monitors(self, parameters: Parameters, record: State, h: Scalar) -> Mapping[str, Scalar]:
        """The observations at every record, scalars or arrays; a step where one is not finite fails."""
        ...

    @property
    def stops(self) -> bool:
        """Whether `stop` may end a run."""
        ...

    def stop(self, parameters: Parameters, before: State, after: State) -> Scalar:
        """Positive where an event between two nodes ends the run at the first of them; not finite: the step fails."""
        ...
