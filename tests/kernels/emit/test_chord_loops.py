"""Loops over the links of a chain without joints: points on springs that stiffen, by an implicit rule."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coadjoint.kernels.emit.link_check import require_links
from coadjoint.kernels.emit.link_plan import plan_links
from coadjoint.kernels.newton.coupled import Coupled
from coadjoint.kernels.program import Code
from coadjoint.kernels.run import native
from coadjoint.kernels.trace.evaluate import tabulate
from coadjoint.kernels.untraceable import NotLinked

H = 0.1


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Points:
    """Places and velocities (N, 2), the stretch of each spring (N − 1, 2) at the start of the step, and the time."""

    x: object
    v: object
    stretch: object
    t: object


@dataclass(frozen=True)
class Springs:
    """p (u − v) = −½h ∂V(x + ½hu), V = Σ |x_{i+1} − x_i|²/2 + |x_{i+1} − x_i|⁴/4; masses p (N,)."""

    count: int
    odd: int | None = None
    """A link that weighs twice as much, wherever it is in the chain."""
    far: bool = False
    """Whether the first and the last point are joined, too."""
    reach: float = 0.0
    coupled: bool = True
    dear: int = 0
    """How many sines the force of a spring takes."""

    @property
    def blocks(self):
        return (2 * self.count,)

    @property
    def structure(self):
        return Coupled(self.count, (2,), tuple((i, i + 1) for i in range(self.count - 1)))

    def shortened(self, count):
        return replace(self, count=count)

    def per_link(self, parameters):
        return [True]

    def short(self, parameters, count):
        return parameters[:count]

    def short_state(self, state, count):
        return Points(np.zeros((count, 2)), np.zeros((count, 2)), np.zeros((count - 1, 2)), np.zeros(()))

    def nearby(self, state, random, size, later):
        return jax.tree.map(lambda leaf: leaf + random.normal(size=np.shape(leaf)), state)

    def rows(self, state):
        return [state.x, state.v, jnp.concatenate([jnp.full((1, 2), -1.0), state.stretch])], [state.t]

    def prepare(self, p, s, h):
        return s

    def guess(self, p, s, h):
        return jnp.ravel(s.v)

    def pull(self, x):
        """∂V."""
        e = jnp.diff(x, axis=0) * (1.0 if self.coupled else 0.0)
        size = 1 + jnp.sum(e**2, axis=1, keepdims=True)
        for _ in range(self.dear):
            size = jnp.sin(size)
        force = e * size
        found = jnp.pad(-force, [(0, 1), (0, 0)]) + jnp.pad(force, [(1, 0), (0, 0)]) + 0.1 * x**3
        return found.at[0].add(0.2 * (x[0] - x[-1])) if self.far else found

    def residual(self, p, s, h, z):
        u = jnp.reshape(z, (-1, 2))
        masses = p if self.odd is None else p * jnp.where(np.arange(self.count) == self.odd, 2.0, 1.0)
        return jnp.ravel(masses[:, None] * (u - s.v) + 0.5 * h * self.pull(s.x + 0.5 * h * u))

    def chart(self, p, s, h, z):
        return jnp.max(1e-3 * h * jnp.abs(z)) + self.reach

    def record(self, p, s, h, z):
        return replace(s, v=jnp.reshape(z, (-1, 2)))

    def advanced(self, p, s, h, z):
        u = jnp.reshape(z, (-1, 2))
        return Points(s.x + h * u, 2 * u - s.v, jnp.diff(s.x + h * u, axis=0), s.t + h)


@dataclass(frozen=True)
class OneStage:
    """A program of that stage."""

    stage: Springs
    stages = (SimpleNamespace(structure=SimpleNamespace(native=False)),)
    substeps = (1.0,)

    def linked(self, state):
        return self.stage


def bent(count, speed=1.0):
    """Points on an arc that move up and down."""
    s = np.linspace(0.0, 3.0, count)
    x, v = (np.stack(pair, axis=1) for pair in ((s, np.sin(s)), (0 * s, speed * np.cos(2 * s))))
    return Points(x, v, np.diff(x, axis=0), np.zeros(()))


def by_hand(stage, p, s, steps, h):
    """The same steps by a dense Newton iteration in NumPy."""
    nothing = np.zeros(2 * stage.count)
    with jax.enable_x64(True):
        residual = tabulate(lambda s, z: stage.residual(p, s, h, z), s, nothing)
        slopes = tabulate(jax.jacfwd(lambda s, z: stage.residual(p, s, h, z), 1), s, nothing)
    for _ in range(steps):
        z = np.ravel(s.v)
        for _ in range(6):
            z = z - np.linalg.solve(slopes(s, z), residual(s, z))
        u = z.reshape(-1, 2)
        s = Points(s.x + h * u, 2 * u - s.v, np.diff(s.x + h * u, axis=0), s.t + h)
    return s


SLOW = pytest.mark.long


@pytest.mark.parametrize(
    ("count", "coupled", "dear"),
    [(21, True, 20), *(pytest.param(*case, marks=SLOW) for case in ((6, True, 0), (6, True, 30), (21, False, 0)))],
)
def test_loops_take_the_steps_of_a_dense_newton_iteration(count, coupled, dear):
    """Lengths that are no multiple of the lanes, blocks of which those at links next to it are zero, and values of
    pairs of links that are computed once."""
    stage, p = Springs(count, coupled=coupled, dear=dear), np.linspace(1.0, 2.0, count)
    plan = plan_links(stage, p, bent(count), (2,) * count)
    assert len(plan.pairs) == (2 if dear else 0)
    found = native.run(OneStage(stage), p, bent(count), H, 4, 5, monitors=False)
    assert found.code is Code.CONVERGED and found.steps == 20 and found.iterations <= 4 * 20
    expected = by_hand(stage, p, bent(count), 20, H)
    for one, other in zip(jax.tree.leaves(found.final), jax.tree.leaves(expected), strict=True):
        assert np.abs(one - other).max() < 1e-13 * (1 + np.abs(other).max())
    assert np.abs(found.records.stretch - np.diff(found.records.x, axis=1)).max() < 1e-14
    assert np.abs(found.records.t - 0.5 * np.arange(4)).max() < 1e-12


def test_chords_that_shrink_slowly_give_way_to_newton():
    """Steps so long that the matrix of the guess is far from that of the solution."""
    stage, p, h = Springs(9), np.ones(9), 1.0
    found = native.run(OneStage(stage), p, bent(9, 4.0), h, 1, 4, monitors=False)
    assert found.code is Code.CONVERGED and found.iterations_max > 4
    expected = by_hand(stage, p, bent(9, 4.0), 4, h)
    assert np.abs(found.final.x - expected.x).max() < 1e-11 * np.abs(expected.x).max()


def test_a_run_in_two_parts_is_that_in_one():
    program, p = OneStage(Springs(12)), np.linspace(1.0, 2.0, 12)
    whole = native.run(program, p, bent(12), H, 20, 1, monitors=False)
    half = native.run(program, p, bent(12), H, 10, 1, monitors=False)
    rest = native.run(program, p, half.final, H, 10, 1, monitors=False)
    for one, other in zip(jax.tree.leaves(whole.records), jax.tree.leaves(rest.records), strict=True):
        assert np.array_equal(one[10:], other)


def test_a_step_that_fails_leaves_the_state_and_says_why():
    p = np.ones(9)
    beyond = native.run(OneStage(Springs(9, reach=1.0)), p, bent(9), H, 3, 1, monitors=False)
    assert beyond.code is Code.BEYOND_CHART and beyond.steps == 0 and np.array_equal(beyond.final.x, bent(9).x)
    assert native.run(OneStage(Springs(9)), p, bent(9), H, 3, 1, monitors=False).code is Code.CONVERGED
    broken = replace(bent(9), v=np.full((9, 2), np.inf))
    assert native.run(OneStage(Springs(9)), p, broken, H, 3, 1, monitors=False).code is Code.NOT_FINITE


@pytest.mark.parametrize(("stage", "words"), [(Springs(9, odd=6), "not all alike"), (Springs(9, far=True), "links")])
def test_links_that_are_not_alike_or_act_on_others_are_no_loop(stage, words):
    with pytest.raises(NotLinked, match=words):
        require_links(plan_links(stage, np.ones(9), bent(9), (2,) * 9), stage, np.ones(9), bent(9))
