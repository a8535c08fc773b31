"""Explicit Runge–Kutta methods on Lie groups: yardsticks that keep the group and claim nothing else.

They integrate the continuous equations (P20)–(P22) for (F, w, ξ, ν) over a step, with g = g_kF, n = F⁻¹(n_k + w),
a = F⁻¹a_k:

    Ḟ = Fξ,   ẇ = F·ν,   d/dt ∂_ξℓ = ad*_ξ ∂_ξℓ + torque,   d/dt ∂_νℓ = L*_ξ ∂_νℓ + force,

from the (ξ, ν) that belong to the momenta of the node, which are the unknowns of the only implicit equations.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, Scalar
from coadjoint.difference_maps import DifferenceMap, Exponential
from coadjoint.errors import ArgumentError, shown
from coadjoint.groups.group import Element, LieGroup
from coadjoint.mechanics.continuous import vector_field
from coadjoint.mechanics.discrete import Node, Point, node
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.method import Claims, Method
from coadjoint.methods.step import Step
from coadjoint.spaces.space import require_flat

Row = Sequence[float]

CLASSICAL: dict[int, list[Row]] = {
    1: [[], [1]],
    2: [[], [1 / 2], [0, 1]],
    3: [[], [1 / 2], [-1, 2], [1 / 6, 2 / 3, 1 / 6]],
    4: [[], [1 / 2], [0, 1 / 2], [0, 0, 1], [1 / 6, 1 / 3, 1 / 3, 1 / 6]],
    5: [
        [],
        [1 / 5],
        [3 / 40, 9 / 40],
        [44 / 45, -56 / 15, 32 / 9],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
        [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ],
}
"""Coefficients of the stages by order, and of the end: Euler, midpoint, Kutta, Runge and Kutta, Dormand and Prince."""

COMMUTATOR_FREE: dict[int, list[list[Row]]] = {
    3: [[[]], [[1 / 3]], [[0, 2 / 3]], [[1 / 3], [-1 / 12, 0, 3 / 4]]],
    4: [
        [[]],
        [[1 / 2]],
        [[0, 1 / 2]],
        [[1 / 2], [-1 / 2, 0, 1]],
        [[1 / 4, 1 / 6, 1 / 6, -1 / 12], [-1 / 12, 1 / 6, 1 / 6, 1 / 4]],
    ],
}
"""Celledoni, Marthinsen and Owren (2003): each stage is a product of exponentials, the first factor first."""

CROUCH_GROSSMAN: dict[int, list[Row]] = {
    3: [[], [3 / 4], [119 / 216, 17 / 108], [13 / 51, -2 / 3, 24 / 17]],
    4: [
        [],
        [0.8177227988124852],
        [0.3199876375476427, 0.0659864263556022],
        [0.9214417194464946, 0.4997857776773573, -1.0969984448371582],
        [0.3552358559023322, 0.2390958372307326, 1.3918565724203246, -1.1092979392113465],
        [0.1370831520630755, -0.0183698531564020, 0.7397813985370780, -0.1907142565505889, 0.3322195591068374],
    ],
}
"""Crouch and Grossman (1993), Owren and Marthinsen (1999): a factor for every coefficient."""


class Slope(NamedTuple):
    """The rates of a stage: of the argument of τ, of the place F·ν, and ξ̇ and ν̇.

    turn, xi: (dim G,). shift, nu: (ambient,).
    """

    turn: Array
    shift: Array
    xi: Array
    nu: Array


@dataclass(frozen=True)
class RungeKutta(Method, Step):
    """An explicit method: the base of `MuntheKaas`, `CommutatorFree` and `CrouchGrossman`.

    degree: the order. Raises ArgumentError for an order that the class lacks, for start="velocity", and on a curved
    space of additional dynamics.
    """

    degree: int = 4

    constrainable = False
    takes_smooth_actions = True
    degrees: ClassVar[tuple[int, ...]] = ()
    """The orders that there are."""

    def __post_init__(self):
        super().__post_init__()
        checks.choice(self.degree, f"Argument `degree` of {type(self).__name__}", self.degrees)
        self._start_from_momenta()

    @property
    def order(self) -> int:
        return self.degree

    @property
    def claims(self) -> Claims:
        return Claims(self.order, False, symplectic=False, momentum=False, energy="changed")

    @property
    def title(self) -> str:
        return f"{type(self).__name__}({shown(self.difference_map)}, degree={self.degree})"

    @property
    def stages(self) -> tuple[tuple[Step, float], ...]:
        return ((self, 1.0),)

    @property
    @abstractmethod
    def rows(self) -> Sequence[Sequence[Row]]:
        """The coefficients of the factors of F at every stage and at the end, the first factor first."""

    @property
    def tables(self) -> list[np.ndarray]:
        """`rows` as arrays of shape (factors, stages before)."""
        return [np.array([[*row, *[0.0] * (i - len(row))] for row in rows], float) for i, rows in enumerate(self.rows)]

    def rate(self, group: LieGroup, argument: Array, xi: Array) -> Array:
        """The rate of the argument of τ at a stage, (dim G,): ξ itself where stages are products of τ."""
        return xi

    def require_fit(self, system: System) -> None:
        super().require_fit(system)
        require_flat(system.additional, type(self).__name__, "use co.Midpoint()")

    def course(self, system: System, record: State, h: Scalar) -> list[tuple[Element, State]]:
        """F and the state at every stage, and at the end."""
        group, Q, V = system.places
        held, found = record.holding(record.over_step), []
        slopes = Slope(*(jnp.zeros((0, len(x))) for x in (record.xi, record.nu, record.xi, record.nu)))
        for rows in self.tables:
            F, argument = group.identity(), jnp.zeros_like(record.xi)
            for row in rows[np.any(rows != 0, axis=1)]:
                argument = h * (row @ slopes.turn)
                F = group.compose(F, self.difference_map.tau(group, argument))
            back, weights = group.inverse(F), rows.sum(axis=0)
            at = held.replace(
                t=record.t + h * weights.sum(),
                n=Q.act(group, back, record.n + h * (weights @ slopes.shift)),
                a=V.act(group, back, record.a),
                xi=record.xi + h * (weights @ slopes.xi),
                nu=record.nu + h * (weights @ slopes.nu),
            )
            found.append((F, at))
            if len(found) < len(self.tables):
                moving = vector_field(system, at)
                turn = self.rate(group, argument, at.xi)
                here = Slope(turn, Q.push(group, F, at.n, at.nu), moving.xi, moving.nu)
                slopes = Slope(*(jnp.vstack(pair) for pair in zip(slopes, here, strict=True)))
        return found

    def relative(self, system: System, record: State, h: Scalar) -> Element:
        return self.course(system, record, h)[-1][0]

    def _at_stages(self, system: System, record: State, h: Scalar) -> list[tuple[float, Element, Node]]:
        """The weight of every stage in the end, F, and the values of ℓ there."""
        weights = self.tables[-1].sum(axis=0)
        stages = self.course(system, record, h)[:-1]
        points = [(F, Point(at.xi, at.n, at.nu, at.a, at.t)) for F, at in stages]
        return [(w, F, node(system, record, point)) for w, (F, point) in zip(weights, points, strict=True)]

    def nodes(self, system: System, record: State, h: Scalar) -> list[tuple[float, Node]]:
        return [(weight, at) for weight, _, at in self._at_stages(system, record, h)]

    def equations(self, system: System, record: State, h: Scalar) -> Array:
        """(∂_ξℓ, ∂_νℓ) − (μ, π) at the node."""
        at = node(system, record, Point(record.xi, record.n, record.nu, record.a, record.t))
        return jnp.concatenate([at.mu - record.mu, at.pi - record.pi])

    def advance(self, system: System, record: State, h: Scalar) -> State:
        F, end = self.course(system, record, h)[-1]
        at = node(system, record, Point(end.xi, end.n, end.nu, end.a, end.t))
        return record.later(h, g=system.group.compose(record.g, F), n=end.n, a=end.a, mu=at.mu, pi=at.pi)

    def sources(self, system: System, record: State, h: Scalar) -> tuple[Array, Array]:
        """h Σ b Ad*_{F⁻¹} source of the stages: the balance of momentum then shows the error of the method."""
        group, none = system.group, jnp.zeros_like(record.mu)
        stages = self._at_stages(system, record, h)
        return h * sum((w * group.Ad_dual(group.inverse(F), at.source) for w, F, at in stages), none), none


@dataclass(frozen=True)
class MuntheKaas(RungeKutta):
    """Runge–Kutta–Munthe-Kaas of order 1 to 5: F = τ(θ), θ̇ = dτ⁻¹_{−θ} ξ, θ by a classical method.

    With `co.Cayley()` or `co.Exponential()`, whose dτ⁻¹ is exact. It keeps the group and the orbit of a; it claims no
    momentum and no bound on the energy. For comparisons: see the page "When RK4 is enough".
    Source: Munthe-Kaas, High order Runge–Kutta methods on manifolds, Appl. Numer. Math. 29 (1999).
    """

    degrees = (1, 2, 3, 4, 5)

    @property
    def rows(self) -> Sequence[Sequence[Row]]:
        return [[row] for row in CLASSICAL[self.degree]]

    def rate(self, group: LieGroup, argument: Array, xi: Array) -> Array:
        return self.difference_map.dtau_inverse(group, -argument, xi)


@dataclass(frozen=True)
class _OfExponentials(RungeKutta):
    """A method whose stages are products of exponentials, and whose order holds with no other map."""

    difference_map: DifferenceMap = field(default_factory=Exponential)

    def require_fit(self, system: System) -> None:
        super().require_fit(system)
        if not isinstance(self.difference_map, Exponential):
            raise ArgumentError(
                f"{type(self).__name__} needs co.Exponential(), with which it has its order, "
                f"but got {shown(self.difference_map)}."
            )


@dataclass(frozen=True)
class CommutatorFree(_OfExponentials):
    """Commutator-free method of order 3 or 4: stages are products of τ of combinations of velocities.

    It keeps the group and the orbit of a, and claims no more.
    Source: Celledoni, Marthinsen and Owren, Commutator-free Lie group methods, Future Gener. Comput. Syst. 19 (2003).
    """

    degrees = (3, 4)

    @property
    def rows(self) -> Sequence[Sequence[Row]]:
        return COMMUTATOR_FREE[self.degree]


@dataclass(frozen=True)
class CrouchGrossman(_OfExponentials):
    """Crouch and Grossman's method of order 3 or 4: a factor exp(h c ξ) for every coefficient c.

    It keeps the group and the orbit of a, and claims no more.
    Source: Crouch and Grossman, J. Nonlinear Sci. 3 (1993); order 4: Owren and Marthinsen, BIT 39 (1999).
    """

    degrees = (3, 4)

    @property
    def rows(self) -> Sequence[Sequence[Row]]:
        return [[[0.0] * i + [c] for i, c in enumerate(row)] or [[]] for row in CROUCH_GROSSMAN[self.degree]]
