"""Composed steps, stages that may fail, and events: both kernels agree, and a failed step leaves no trace."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
import pytest
from vehicle import PAPER, VehicleProgram, start

from coadjoint.kernels.newton.solver import DenseStage
from coadjoint.kernels.program import Code
from coadjoint.kernels.run import ensemble, native, xla

H = 0.05
GAMMA = 1 / (4 - 4 ** (1 / 3))
SUZUKI = (GAMMA, GAMMA, 1 - 4 * GAMMA, GAMMA, GAMMA)


@dataclass(frozen=True)
class Composed(VehicleProgram):
    substeps: tuple[float, ...] = SUZUKI


def one_by_one(steps):
    """The composition, each substep a run of its own."""
    state, records = start(H), []
    for _ in range(steps):
        for number, fraction in enumerate(SUZUKI):
            chunk = native.run(VehicleProgram(), PAPER, state, fraction * H, 1, 1)
            if number == 0:
                records.append(chunk.records)
            state = chunk.final
    return state, records


@pytest.mark.cases(1)
@pytest.mark.parametrize("kernel", [native, pytest.param(xla, marks=pytest.mark.long)])
def test_a_composed_step_is_its_substeps_in_turn(kernel):
    chunk = kernel.run(Composed(), PAPER, start(H), H, 3, 2)
    final, records = one_by_one(6)
    assert (chunk.code, chunk.steps, len(chunk.records.t)) == (Code.CONVERGED, 6, 3)
    for ours, single in zip(chunk.final, final, strict=True):
        assert np.max(np.abs(ours - single)) < 1e-14 * max(1.0, np.max(np.abs(single)))
    for row, single in enumerate(records[::2]):
        for ours, theirs in zip(chunk.records, single, strict=True):
            assert np.max(np.abs(ours[row] - theirs[0])) < 1e-14 * max(1.0, np.max(np.abs(theirs)))
    assert chunk.iterations >= 6 * len(SUZUKI)
    assert chunk.extrema["newton_residual"][1] > 0


@pytest.mark.long
def test_certificates_of_a_composed_step_are_the_largest_over_its_substeps():
    looped = native.run(Composed(), PAPER, start(H), H, 4, 1)
    reference = xla.run(Composed(), PAPER, start(H), H, 4, 1)
    for name in ("newton_residual", "balance_residual"):
        assert np.abs(np.array(looped.extrema[name]) - np.array(reference.extrema[name])).max() < 1e-13
    assert looped.extrema["energy"][0] == pytest.approx(np.min(looped.monitors["energy"]), rel=1e-15)


@dataclass(frozen=True)
class BoundedStage(type(VehicleProgram().stages[0])):
    end: float = 0.13

    def chart(self, p, s, h, z):
        return jnp.where(s.t > self.end, 2.0, 0.0)


BOUNDED = Composed(stages=(BoundedStage(),))
"""Fails with its chart in the step in which t passes 0.13, in a later substep than the first."""


@pytest.mark.parametrize("kernel", [native, pytest.param(xla, marks=pytest.mark.long)])
def test_a_step_whose_later_substep_fails_leaves_the_state_at_its_node(kernel):
    chunk = kernel.run(BOUNDED, PAPER, start(H), H, 8, 1)
    good = kernel.run(Composed(), PAPER, start(H), H, 2, 1)
    assert (chunk.code, chunk.steps) == (Code.BEYOND_CHART, 2)
    assert np.array_equal(chunk.final.g, good.final.g)
    assert chunk.extrema["energy"][1] == pytest.approx(good.extrema["energy"][1], rel=1e-15)


def test_members_that_fail_in_a_substep_wait_while_the_others_go_on():
    members = 5
    first = start(H)
    states = first._replace(t=np.linspace(0.0, 0.08, members))
    chunk = ensemble.run_ensemble(
        BOUNDED, PAPER, states, H, 2, 1, axes=(False, type(first)(True, *[False] * (len(first) - 1)))
    )
    for member in range(members):
        alone = native.run(BOUNDED, PAPER, first._replace(t=states.t[member]), H, 2, 1)
        assert (chunk.code[member], chunk.steps[member]) == (alone.code, alone.steps)
        assert np.max(np.abs(chunk.final.g[member] - alone.final.g)) < 1e-15
        for name, (_, high) in chunk.extrema.items():
            assert np.max(np.abs(high[member] - alone.extrema[name][1])) < 1e-12
    assert {int(code) for code in chunk.code} == {Code.CONVERGED, Code.BEYOND_CHART}


class Root(NamedTuple):
    """y, and how often x² = y had no solution."""

    y: Any
    x: Any
    missed: Any


@dataclass(frozen=True)
class SquareRoot(DenseStage):
    """Solves x² = y, which fails for y < 0, and moves y on by −h."""

    fraction: float = 1.0
    tolerant: bool = True
    blocks: tuple[int, ...] = (1,)

    def guess(self, p, s, h):
        return jnp.reshape(s.x, 1)

    def residual(self, p, s, h, z):
        return z * z - s.y

    def chart(self, p, s, h, z):
        return 0.0

    def record(self, p, s, h, z):
        return s._replace(x=z[0])

    def advance(self, p, s, h, z, sound):
        return Root(s.y - h, jnp.where(sound > 0, z[0], 1.0), s.missed + (1.0 - sound))

    def certificate(self, p, before, h, z, after):
        return {}


@dataclass(frozen=True)
class Halving(DenseStage):
    """Solves 2x = y."""

    fraction: float = 1.0
    tolerant: bool = False
    blocks: tuple[int, ...] = (1,)

    guess, chart, certificate = SquareRoot.guess, SquareRoot.chart, SquareRoot.certificate

    def residual(self, p, s, h, z):
        return 2.0 * z - s.y

    def record(self, p, s, h, z):
        return s

    def advance(self, p, s, h, z, sound):
        return s


@dataclass(frozen=True)
class Trying:
    stages: tuple[Any, ...] = (SquareRoot(), Halving())
    substeps: tuple[float, ...] = (1.0,)
    stops: bool = False
    below: float = -np.inf

    def linked(self, s):
        return None

    def prepare(self, p, s, h):
        return s

    def monitors(self, p, s, h):
        return {"y": s.y}

    def stop(self, p, before, after):
        return jnp.where(after.y < self.below, 1.0, -1.0)


ROOT = Root(np.asarray(1.03), np.asarray(1.0), np.asarray(0.0))


@pytest.mark.cases(1)
@pytest.mark.parametrize("substeps", [(1.0,), (0.5, 0.5)])
@pytest.mark.parametrize("kernel", [native, pytest.param(xla, marks=pytest.mark.long)])
def test_a_stage_that_may_fail_tells_so_and_the_step_goes_on(kernel, substeps):
    chunk = kernel.run(Trying(substeps=substeps), np.zeros(0), ROOT, 0.1, 20, 1)
    assert (chunk.code, chunk.steps) == (Code.CONVERGED, 20)
    tried = 1.03 - 0.1 / len(substeps) * np.arange(20 * len(substeps))
    assert chunk.final.missed == np.sum(tried < 0)
    # The record is that of the stage after the tolerant one.
    first = 1.03 - 0.1 * np.arange(11)
    assert chunk.records.x[:11] == pytest.approx(np.sqrt(first), rel=1e-12)
    assert np.all(chunk.records.x[12:] == 1.0)


def test_members_decide_for_themselves_whether_a_tolerant_stage_failed():
    states = ROOT._replace(y=np.array([0.15, 0.35, 2.0]))
    chunk = ensemble.run_ensemble(Trying(), np.zeros(0), states, 0.1, 10, 1, axes=(False, Root(True, False, False)))
    assert np.array_equal(chunk.final.missed, [8, 6, 0])
    assert np.all(chunk.code == Code.CONVERGED)


@pytest.mark.parametrize("kernel", [native, xla])
def test_a_step_fails_where_a_later_substep_of_it_does(kernel):
    program = Trying(stages=(SquareRoot(tolerant=False),), substeps=(0.25, 0.5, 0.25))
    chunk = kernel.run(program, np.zeros(0), ROOT._replace(y=np.asarray(0.05)), 0.1, 3, 1)
    assert chunk.code in (Code.NOT_CONVERGED, Code.NOT_FINITE) and chunk.steps == 0 and chunk.final.y == 0.05


@pytest.mark.parametrize(
    ("kernel", "substeps"), [(native, (1.0,)), (xla, (0.5, 0.5)), pytest.param(xla, (1.0,), marks=pytest.mark.long)]
)
def test_an_event_ends_the_run_at_the_node_before_it_also_after_stages_that_failed(kernel, substeps):
    chunk = kernel.run(Trying(substeps=substeps, stops=True, below=-0.3), np.zeros(0), ROOT, 0.1, 20, 1)
    assert (chunk.code, chunk.steps, len(chunk.records.y)) == (Code.STOPPED, 13, 13)
    assert chunk.final.y == pytest.approx(-0.27)
    tried = 1.03 - 0.1 / len(substeps) * np.arange(13 * len(substeps))
    assert chunk.final.missed == np.sum(tried < 0) > 0


def test_an_event_ends_only_the_member_that_it_happens_to():
    states = ROOT._replace(y=np.array([1.03, 5.0, 0.72]))
    program = Trying(stops=True, below=0.5)
    chunk = ensemble.run_ensemble(program, np.zeros(0), states, 0.1, 10, 1, axes=(False, Root(True, False, False)))
    assert np.array_equal(chunk.code, [Code.STOPPED, Code.CONVERGED, Code.STOPPED])
    assert np.array_equal(chunk.steps, [5, 10, 2])
    assert chunk.final.y == pytest.approx([0.53, 4.0, 0.52])
