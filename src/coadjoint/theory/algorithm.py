"""The common form of the discrete algorithms of the papers: a map of pairs to pairs, solved for the next increment."""

from __future__ import annotations

from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.difference_maps import DifferenceMap, Exponential
from coadjoint.errors import StepError, must_give
from coadjoint.groups.group import Element, LieGroup
from coadjoint.kernels.newton.solver import DenseStage
from coadjoint.kernels.program import Code
from coadjoint.kernels.run import backend
from coadjoint.spaces import Space


class Algorithm(DenseStage):
    """A program of one stage whose unknowns are the increment F and the point s: the next pair follows from them.

    A subclass gives `group`, `space`, `last`, `conditions` and `following`. Newton's unknowns are (ξ, y) with
    F = F_last τ(h(ξ − ξ_last)) and s = ρ(n, hE_n y), so that large relative motions stay inside the chart.
    """

    group: LieGroup
    space: Space
    difference_map: DifferenceMap = Exponential()
    fraction: float = 1.0
    tolerant: bool = False
    stops: bool = False

    def last(self, pair: PyTree, h: Scalar) -> tuple[Element, Array, Array]:
        """The last increment, the point n (ambient,) that s starts from, and the last velocity (s − n)/h (ambient,)."""
        must_give(self, "last")

    def conditions(self, pair: PyTree, h: Scalar, F: Element, s: Array) -> tuple[Array, Array]:
        """The equations that F and s solve, (dim G,) on 𝔤* and (ambient,) on T*Q at n."""
        must_give(self, "conditions")

    def following(self, pair: PyTree, h: Scalar, F: Element, s: Array) -> PyTree:
        """The next pair, from the increment F and the point s (ambient,)."""
        must_give(self, "following")

    def linked(self, state: PyTree) -> None:
        """Its equations are those of one increment: no code loops over links."""

    def run(self, pair: object, h: Scalar, steps: int) -> PyTree:
        """The pairs 0 … steps, every leaf with a leading axis; raises StepError at a step that fails."""
        pair = jax.tree.map(lambda leaf: np.asarray(leaf, dtype=float), pair)
        with jax.enable_x64(True):
            chosen = backend.choose(self, (), pair, False, "auto")
            found = backend.run(chosen, self, (), pair, float(h), steps, 1, False)
        if found.code:
            raise StepError(
                f"Step {found.steps} of the {type(self).__name__} algorithm failed: "
                f"{Code(found.code).name.lower().replace('_', ' ')}; take a smaller h or a slower start."
            )
        return jax.tree.map(lambda rows, end: np.concatenate([rows, end[None]]), found.records, found.final)

    @property
    def stages(self) -> tuple[Algorithm, ...]:
        return (self,)

    @property
    def substeps(self) -> tuple[float, ...]:
        return (1.0,)

    @property
    def blocks(self) -> tuple[int, ...]:
        return self.group.dim, self.space.dim(self.group)

    def prepare(self, parameters: PyTree, state: PyTree, h: Array | float) -> PyTree:
        """The state: the step of h, one number, needs nothing more."""
        return state

    def monitors(self, parameters: PyTree, record: PyTree, h: Scalar) -> Mapping[str, Array]:
        """None: shape () each, by name."""
        return {}

    def _velocity(self, F: Element, h: Scalar) -> Array:
        group = self.group
        return group.vee(group.matrix(F) - group.matrix(group.inverse(F))) / (2 * h)

    def _last(self, pair: object, h: Scalar) -> tuple[Element, Array, Array]:
        """`last` with F back on its group: what leaves it would grow from step to step."""
        F, n, velocity = self.last(pair, h)
        return self.group.project(F) if self.group.constrained else F, n, velocity

    def guess(self, parameters: PyTree, state: PyTree, h: Scalar) -> Array:
        """The last unknowns (ξ, y), (dim G + dim Q,)."""
        F, n, velocity = self._last(state, h)
        return jnp.concatenate([self._velocity(F, h), self.space.coordinates(self.group, n, velocity)])

    def _solution(self, state: PyTree, h: Scalar, z: Array) -> tuple[Element, Array]:
        group, Q = self.group, self.space
        F, n, _ = self._last(state, h)
        xi, y = z[: group.dim], z[group.dim :]
        F = group.compose(F, self.difference_map.tau(group, h * (xi - self._velocity(F, h))))
        return F, n + Q.difference(group, n, h * Q.tangent(group, n, y))

    def residual(self, parameters: PyTree, state: PyTree, h: Scalar, z: Array) -> Array:
        """`conditions` at the unknowns z = (ξ, y), both (dim G + dim Q,)."""
        on_group, on_space = self.conditions(state, h, *self._solution(state, h, z))
        n = self.last(state, h)[1]
        return jnp.concatenate([on_group, self.space.coordinates(self.group, n, on_space)])

    def chart(self, parameters: PyTree, state: PyTree, h: Scalar, z: Array) -> Array | float:
        """How far the increment of F is into its chart, one number, for the unknowns z (dim G + dim Q,)."""
        F = self._last(state, h)[0]
        return self.difference_map.chart(self.group, h * (z[: self.group.dim] - self._velocity(F, h)))

    def record(self, parameters: PyTree, state: PyTree, h: Scalar, z: Array) -> PyTree:
        """The pair itself; the unknowns z (dim G + dim Q,) are in the next one."""
        return state

    def advance(self, parameters: PyTree, state: PyTree, h: Scalar, z: Array, sound: Array) -> PyTree:
        """The next pair, from the unknowns z (dim G + dim Q,)."""
        return self.following(state, h, *self._solution(state, h, z))

    def certificate(
        self, parameters: PyTree, before: PyTree, h: Scalar, z: Array, after: PyTree
    ) -> Mapping[str, Array]:
        """Nothing is measured: no numbers."""
        return {}

    def stop(self, parameters: PyTree, before: PyTree, after: PyTree) -> Array:
        """0, one number: an algorithm does all its steps."""
        return jnp.zeros(())
