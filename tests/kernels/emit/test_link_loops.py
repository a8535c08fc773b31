"""Loops over the links of a chain: RATTLE with Euler's rule for points on rods in a plane."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from llvmlite import ir

from coadjoint.kernels.emit import link_check
from coadjoint.kernels.emit.link_arrays import LinkArrays, sizes, stride
from coadjoint.kernels.emit.link_check import require_links
from coadjoint.kernels.emit.link_plan import plan_links
from coadjoint.kernels.program import Code
from coadjoint.kernels.run import linked_members, native
from coadjoint.kernels.trace.evaluate import evaluate, tabulate
from coadjoint.kernels.untraceable import NotLinked
from coadjoint.methods.coupled_links import Joined

DOWN = np.array([0.0, -9.81])
H = 0.01


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Points:
    """Places and velocities (N, 2), multipliers (N,) and the time."""

    x: object
    v: object
    strength: object
    t: object


def reaction(x, strength):
    """Aᵀλ of φ_i = (|x_i − x_{i−1}|² − 1)/2, with x_{−1} = 0."""
    pull = rods(x) * strength[:, None]
    return pull - jnp.concatenate([pull[1:], jnp.zeros((1, 2))])


def rods(x):
    return x - jnp.concatenate([jnp.zeros((1, 2)), x[:-1]])


@dataclass(frozen=True)
class Rods:
    """v + hg + ½hAᵀλ = u, φ(x + hu) = 0, then v = u + impulse; masses p (N,)."""

    count: int
    odd: int | None = None
    """A link that weighs twice as much, wherever it is in the chain."""
    springs: bool = False
    reach: float = 0.0

    @property
    def blocks(self):
        return 2 * self.count, self.count

    @property
    def structure(self):
        return Joined(self.count, (2, 1), tuple((i, i + 1) for i in range(self.count - 1)))

    def shortened(self, count):
        return replace(self, count=count)

    def per_link(self, parameters):
        return [np.shape(leaf)[:1] == (self.count,) for leaf in jax.tree.leaves(parameters)]

    def short(self, parameters, count):
        return parameters[:count]

    def short_state(self, state, count):
        return Points(*(np.zeros((count, 2)) for _ in range(2)), np.zeros(count), np.zeros(()))

    def nearby(self, state, random, size, later):
        return jax.tree.map(lambda leaf: leaf + random.normal(size=leaf.shape), state)

    def rows(self, state):
        return [state.x, state.v, state.strength], [state.t]

    def _parts(self, z):
        return jnp.reshape(z[: 2 * self.count], (-1, 2)), z[2 * self.count :]

    def _masses(self, p):
        return p if self.odd is None else p * jnp.where(np.arange(self.count) == self.odd, 2.0, 1.0)

    def prepare(self, p, s, h):
        return s

    def guess(self, p, s, h):
        return jnp.concatenate([jnp.ravel(s.v), s.strength])

    def residual(self, p, s, h, z):
        u, strength = self._parts(z)
        force = reaction(s.x, strength)
        if self.springs:
            force = force - rods(u)
        left = self._masses(p)[:, None] * (u - s.v - h * DOWN) - 0.5 * h * force
        return jnp.concatenate([jnp.ravel(left), (jnp.sum(rods(s.x + h * u) ** 2, axis=1) - 1) / (2 * h)])

    def chart(self, p, s, h, z):
        return jnp.max(h * jnp.abs(z[: 2 * self.count])) + self.reach

    def record(self, p, s, h, z):
        return replace(s, v=self._parts(z)[0], strength=self._parts(z)[1])

    def free(self, p, s, h, z):
        u = self._parts(z)[0]
        return replace(s, x=s.x + h * u, v=u, t=s.t + h)

    def velocities(self, p, free, impulse):
        return replace(free, v=free.v + reaction(free.x, impulse) / self._masses(p)[:, None])

    def momenta(self, p, state, moving):
        return replace(state, v=moving.v)

    def rate(self, p, state):
        return jnp.sum(rods(state.x) * rods(state.v), axis=1)

    def ended(self, p, free, h, impulse):
        return replace(self.velocities(p, free, impulse), strength=2 * impulse / h)


@dataclass(frozen=True)
class OneStage:
    """A program of that stage."""

    stage: Rods
    stages = (SimpleNamespace(structure=SimpleNamespace(native=False)),)
    substeps = (1.0,)

    def linked(self, state):
        return self.stage


def level(count):
    """At rest along the first axis."""
    x = np.stack([np.arange(1.0, count + 1), np.zeros(count)], axis=1)
    return Points(x, np.zeros((count, 2)), np.zeros(count), np.zeros(()))


def by_hand(stage, p, s, steps):
    """The same steps by a dense Newton iteration in NumPy."""
    z, nothing = np.zeros(3 * stage.count), np.zeros(stage.count)
    with jax.enable_x64(True):
        residual = tabulate(lambda s, z: stage.residual(p, s, H, z), s, z)
        slopes = tabulate(jax.jacfwd(lambda s, z: stage.residual(p, s, H, z), 1), s, z)
        closing = tabulate(lambda f, d: stage.rate(p, stage.velocities(p, f, d)), s, nothing)
        matrix = tabulate(jax.jacfwd(lambda f, d: stage.rate(p, stage.velocities(p, f, d)), 1), s, nothing)
        for _ in range(steps):
            z = np.concatenate([np.ravel(s.v), s.strength])
            for _ in range(5):
                z = z - np.linalg.solve(slopes(s, z), residual(s, z))
            free = evaluate(stage.free, p, s, H, z)
            s = evaluate(stage.ended, p, free, H, -np.linalg.solve(matrix(free, nothing), closing(free, nothing)))
    return s


@pytest.mark.parametrize("count", [9, pytest.param(18, marks=pytest.mark.long)])
def test_loops_take_the_steps_of_a_dense_newton_iteration(count):
    stage, p = Rods(count), np.linspace(1.0, 2.0, count)
    found = native.run(OneStage(stage), p, level(count), H, 4, 5, monitors=False)
    assert found.code is Code.CONVERGED and found.steps == 20 and found.iterations <= 4 * 20
    expected = by_hand(stage, p, level(count), 20)
    for one, other in zip(jax.tree.leaves(found.final), jax.tree.leaves(expected), strict=True):
        assert np.abs(one - other).max() < 1e-9 * (1 + np.abs(other).max())
    assert np.abs(np.sum(np.diff(found.records.x, axis=1) ** 2, axis=2) - 1).max() < 1e-12
    assert np.abs(found.records.t - 0.05 * np.arange(4)).max() < 1e-12


def test_a_run_in_two_parts_is_that_in_one():
    program, p = OneStage(Rods(12)), np.linspace(1.0, 2.0, 12)
    whole = native.run(program, p, level(12), H, 20, 1, monitors=False)
    half = native.run(program, p, level(12), H, 10, 1, monitors=False)
    rest = native.run(program, p, half.final, H, 10, 1, monitors=False)
    for one, other in zip(jax.tree.leaves(whole.records), jax.tree.leaves(rest.records), strict=True):
        assert np.array_equal(one[10:], other)
    assert whole.iterations == half.iterations + rest.iterations


def test_a_step_that_fails_leaves_the_state_and_says_why():
    p = np.ones(9)
    beyond = native.run(OneStage(Rods(9, reach=1.0)), p, level(9), H, 3, 1, monitors=False)
    assert beyond.code is Code.BEYOND_CHART and beyond.steps == 0 and np.array_equal(beyond.final.x, level(9).x)
    good = native.run(OneStage(Rods(9)), p, level(9), H, 3, 1, monitors=False)
    assert good.code is Code.CONVERGED
    broken = replace(level(9), v=np.full((9, 2), np.inf))
    assert native.run(OneStage(Rods(9)), p, broken, H, 3, 1, monitors=False).code is Code.NOT_FINITE


UNLIKE = [(Rods(9, odd=6), "not all alike"), (Rods(9, springs=True), "more than the reactions of joints")]


@pytest.mark.parametrize(("stage", "words"), UNLIKE)
def test_links_that_are_not_alike_or_act_on_each_other_are_no_loop(stage, words):
    with pytest.raises(NotLinked, match=words):
        require_links(plan_links(stage, np.ones(9), level(9), (2,) * 9), stage, np.ones(9), level(9))


def arrays_of(count: int, reach: int, width: int):
    """Loops over links with an empty function around them, and its text."""
    codes = [SimpleNamespace(solved=[0] * 5, joints=[0] * 3)] * (2 * reach + 1)
    places = SimpleNamespace(links=np.zeros((count, 4)))
    plan = SimpleNamespace(
        count=count, reach=reach, codes=codes, joint=2, state=places, parameters=places, blocks=[0] * 3, jointed=True
    )
    module = ir.Module()
    number = ir.DoubleType().as_pointer()
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), [number]), "f")
    b = ir.IRBuilder(function.append_basic_block())
    return LinkArrays(plan, module, b, function.args[0], width), plan, module


@pytest.mark.parametrize(
    ("count", "reach", "width", "widths"),
    [(12, 1, 1, [1]), (9, 1, 8, [1]), (10, 1, 8, [1, 8]), (11, 2, 8, [1]), (12, 2, 8, [1, 8])],
)
def test_lanes_are_used_where_the_inner_links_fill_them(count, reach, width, widths):
    found = arrays_of(count, reach, width)[0]
    assert [emit.width for emit in found.emitters] == widths and found.many.width == widths[-1]


def test_arrays_stand_one_after_the_other_and_are_copied_whole():
    found, plan, module = arrays_of(9, 1, 1)
    assert [stride(SimpleNamespace(count=n)) for n in (8, 9, 16, 17, 24, 25)] == [8, 24, 24, 24, 24, 40]
    assert sizes(plan) == {
        "p": 4, "s": 4, "n": 4, "b": 4, "z": 3, "y": 3, "d": 2, "f": 4, "x": 5, "q": 3, "t": 14, "w": 6
    }  # fmt: skip
    ends = np.cumsum([0, *sizes(plan).values()]) * 24
    assert [place.constant for place in found.place.values()] == ends[:-1].tolist()
    found.copied("y", "z")
    (copy,) = (line for line in str(module).splitlines() if "call void @" in line and "memcpy" in line)
    assert f"i64 {3 * 24 * 8}, i1" in copy


def test_parameters_of_other_members_differ_but_for_zeros_ones_and_numbers_that_count():
    given = np.array([0.0, 1.0, -2.0, 1e-4, 5.0]), np.array([0, 3])
    floats, counts = link_check._varied(given, np.random.default_rng(2))
    assert floats[:2].tolist() == [0.0, 1.0] and counts is given[1]
    for old, new in zip((2.0, 1.0, 5.0), np.abs(floats[2:]), strict=True):
        assert 0.5 * old <= new <= 1.5 * old and new != old
    assert np.sign(floats).tolist() == [0.0, 1.0, -1.0, 1.0, 1.0]


@pytest.mark.parametrize(
    ("one", "strict", "apart"),
    [
        ([[2.0, 1.0], [100.0, 1.0]], True, 0.0), ([[2.0, 1.0], [100.0, 1.5]], True, 0.5),
        ([[2.0, 1.0], [101.0, 1.0]], True, 0.01), ([[np.nan, 1.0], [100.0, 1.0]], True, np.inf),
        ([[np.nan, 1.0], [100.0, 1.0]], False, np.inf),
    ],
)  # fmt: skip
def test_columns_differ_relative_to_their_largest_number(one, strict, apart):
    assert link_check._apart(np.array(one), np.array([[2.0, 1.0], [100.0, 1.0]]), strict) == pytest.approx(apart)
    there = np.array([[np.inf, 1.0], [100.0, 1.0]])
    with np.errstate(invalid="ignore"):
        assert link_check._apart(there, there, False) == 0.0 and link_check._apart(there, there, True) == np.inf


def test_a_small_column_is_compared_with_the_largest_of_all():
    other = np.array([[1e-6, 1.0]])
    assert link_check._apart(np.add(other, [[1e-4, 0.0]]), other, True) == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("count", "changes", "words"),
    [
        (4, {}, "a chain of 4 links is too short"),
        (9, {"prepare": lambda p, s, h: replace(s, t=s.t + s.x[0, 0])}, "the time or an input of all links depends"),
        (9, {"guess": lambda p, s, h: jnp.concatenate([jnp.ravel(s.v + s.v[::-1]), s.strength])}, "beyond its neigh"),
        (9, {"rows": lambda s: ([s.x[:-1], s.v, s.strength], [s.t])}, "other sizes than a number of each link"),
        (9, {"rows": lambda s: ([s.x, s.v], [s.t])}, "numbers of the state belong to no link"),
    ],
)
def test_what_no_loop_takes_is_said(count, changes, words):
    stage = Rods(count)
    kind = type("Changed", (Rods,), {name: staticmethod(function) for name, function in changes.items()})
    stage = kind(count)
    with pytest.raises(NotLinked, match=words):
        plan_links(stage, np.ones(count), level(count), (2,) * count)


def test_members_run_one_by_one_with_their_own_parameters_and_states(monkeypatch):
    seen = []

    def run(program, p, s, h, records, every, monitors, pattern):
        seen.append((p.tolist(), s.tolist(), pattern))
        return p, s, h, records, every, monitors

    monkeypatch.setattr(native, "run", run)
    monkeypatch.setattr(linked_members, "_gathered", lambda chunks, records: (chunks, records))
    p, s = np.array([[0.0, 2.0, 1.0], [0.0, 3.0, 1.0]]), np.array([5.0, 6.0])
    chunks, records = linked_members.run_ensemble("program", p, s, 0.1, 7, 3, False, axes=(True, False))
    assert records == 7 and [chunk[0].tolist() for chunk in chunks] == p.tolist()
    assert all(chunk[1].tolist() == [5.0, 6.0] and chunk[2:] == (0.1, 7, 3, False) for chunk in chunks)
    assert {pattern for _, _, pattern in seen} == {(0, 2, 1)}
