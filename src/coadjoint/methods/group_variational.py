"""The method of a discrete Lagrangian in group form, Λ(F, n, s, a; h) (mathematics: section 5)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError, LagrangianError
from coadjoint.groups.derivative import right_derivative
from coadjoint.groups.group import Element
from coadjoint.kernels.trace.evaluate import evaluate, traced
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.method import Method
from coadjoint.methods.step import Step
from coadjoint.methods.variational import LagrangianSlopes, Variational

SINGULAR = 1e-10
"""The smallest singular value of the Legendre transform's derivative, relative to the largest, that counts as one."""


class LastIncrement(NamedTuple):
    """The memory of the method: F of the last step, χ with F = F_before τ(χ), and the step h that it was for.

    change: (dim G,). h: one number.
    """

    F: Element
    change: Array
    h: Array


@dataclass(frozen=True)
class GroupVariational(Variational):
    """Λ(F, n, s, a; h) of `System(group_lagrangian=…)`, differentiated on the group; τ is only Newton's chart.

    μ_k = D^R_FΛ − ∂_aΛ⋄a − ∂_nΛ⋄n − ∂_sΛ⋄s − T⁻ with ⟨D^R_FΛ, χ⟩ = d/dε Λ(e^{εχ}F), μ_{k+1} = D^L_FΛ; the rest as in
    `Variational`. Newton's unknown is ξ with F = F_last τ(h(ξ − ξ_last)): the chart is centred at the last increment,
    so that relative motions may be as large as the group has them, and of several solutions the one next to the last
    is taken. A step whose increment differs from the last by more than the chart fails with BEYOND_CHART.
    The records' ξ is (F − F⁻¹)ᵛ/2h. The first increment is τ(hξ₀) of the start, which `start="velocity"` keeps;
    with momenta it is Newton's first guess.
    Raises LagrangianError if F ↦ D^R_FΛ is not invertible at the first increment.
    """

    constrainable = False

    @property
    def adjoint(self) -> Method:
        raise ArgumentError(f"The adjoint of {self.title} is not known: compose Λ in algebra form by co.Variational.")

    @property
    def remedies(self) -> tuple[str, str]:
        unsolved = (
            "the increment F has come to where the Legendre transform F ↦ D^R_FΛ is not invertible, or is too large: "
            "take a smaller dt or a slower start"
        )
        return unsolved, "F differs too much from the last increment; take a smaller dt or a slower start"

    def begin(self, system: System, state: State, h: Scalar) -> State:
        self.require_fit(system)
        first = self._first(system, state, h)
        begun = super().begin(system, state.replace(memory=first), h).replace(memory=first)
        if not traced(begun, system.parameters, h):
            _require_regular(self, system, begun, h)
        return begun

    def _first(self, system: System, state: State, h: Scalar) -> LastIncrement:
        """F₀ = τ(hξ₀), or the last increment if a run of this method continues with the same step."""
        last = state.memory
        if isinstance(last, LastIncrement) and not state.from_velocities and not traced(last.h, h) and last.h == h:
            return last
        group, tau = system.group, self.difference_map

        def first(xi: Array, h: Scalar):
            return tau.tau(group, h * xi), tau.chart(group, h * xi)

        F, reach = evaluate(first, state.xi, h)
        if not traced(reach) and reach >= 1:
            raise ArgumentError(
                f"The first increment τ(hξ₀) must lie inside the chart of {tau!r}, but leaves it by a factor "
                f"{float(reach):.3g}: take a smaller dt or ξ₀, or co.Exponential()."
            )
        return LastIncrement(F, evaluate(jnp.zeros_like, state.xi), evaluate(jnp.asarray, h))

    def relative(self, system: System, record: State, h: Scalar) -> Element:
        return record.memory.F

    def record(self, system: System, state: State, h: Scalar, z: Array) -> State:
        group = system.group
        xi, y = z[: group.dim], z[group.dim :]
        change = h * (xi - state.xi)
        F = group.compose(state.memory.F, self.difference_map.tau(group, change))
        return state.replace(
            xi=_velocity(system, F, h),
            nu=self.velocity(system, state, h, xi, y),
            memory=LastIncrement(F, change, jnp.asarray(h)),
        )

    def chart(self, system: System, record: State, h: Scalar) -> Array | float:
        return self.difference_map.chart(system.group, record.memory.change)

    def _slopes(self, system: System, record: State, h: Scalar) -> LagrangianSlopes:
        s, F = record.n + h * record.nu, record.memory.F

        def discrete(F: Element, n: Array, s: Array, a: Array):
            return system.reduced_group_lagrangian(F, n, s, a, h, record.t, record.inputs, record.over_step)

        momentum = right_derivative(system.group, lambda F: discrete(F, record.n, s, record.a), F)
        along_n, along_s, along_a = jax.grad(discrete, argnums=(1, 2, 3))(F, record.n, s, record.a)
        return LagrangianSlopes(momentum, s, along_n, along_s, along_a, *self._impulse(system, record, h))

    def advance(self, system: System, record: State, h: Scalar) -> State:
        after, group = super().advance(system, record, h), system.group
        F = group.project(record.memory.F) if group.constrained else record.memory.F
        return after.replace(memory=record.memory._replace(F=F))

    def _value(self, system: System, record: State, h: Scalar, t: Scalar) -> Array:
        s = record.n + h * record.nu
        return system.reduced_group_lagrangian(
            record.memory.F, record.n, s, record.a, h, t, record.inputs, record.over_step
        )

    def energy(self, system: System, record: State, h: Scalar) -> Array:
        """E_k = −∂_hΛ at fixed F and s."""
        s = record.n + h * record.nu

        def discrete(h: Scalar):
            return system.reduced_group_lagrangian(
                record.memory.F, record.n, s, record.a, h, record.t, record.inputs, record.over_step
            )

        return -jax.grad(discrete)(h)


def _velocity(system: System, F: Element, h: Scalar) -> Array:
    """(F − F⁻¹)ᵛ/2h, the velocity of an increment without a logarithm: ξ + O(h²)."""
    group = system.group
    return group.vee(group.matrix(F) - group.matrix(group.inverse(F))) / (2 * h)


def _require_regular(step: Step, system: System, state: State, h: Scalar) -> None:
    """Raise LagrangianError if the derivative of (ξ, y) ↦ (μ_k, π_k) is singular at the first increment."""

    def derivative(state: State, parameters: PyTree, h: Scalar) -> Array:
        z = step.guess(system, state, h)
        return jax.jacfwd(lambda z: step.residual(system, state, h, z))(z)

    jacobian = np.asarray(evaluate(derivative, state, system.parameters, np.float64(h)))
    rows = np.max(np.abs(jacobian), axis=1, keepdims=True)
    scaled = jacobian / np.where(rows > 0, rows, 1.0)
    scaled /= np.where((columns := np.max(np.abs(scaled), axis=0)) > 0, columns, 1.0)
    singular = np.linalg.svd(scaled, compute_uv=False)
    if not singular[-1] > SINGULAR * singular[0]:
        raise LagrangianError(
            "The discrete Legendre transform (F, s) ↦ (μ, π) must be invertible, but is singular at the first "
            "increment: start from another relative motion, or add what is missing to Λ."
        )
