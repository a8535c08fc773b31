"""The native kernel takes the same steps as plain Newton in JAX, and fails as data."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from vehicle import PAPER, LeftRectangle, VehicleProgram, start

from coadjoint.kernels.newton import solver
from coadjoint.kernels.program import Code
from coadjoint.kernels.run import ensemble, native, xla
from coadjoint.kernels.trace.evaluate import tabulate
from coadjoint.kernels.untraceable import Untraceable

H = 0.01


def full(matrix, seed=7):
    """A symmetric matrix without zeros near a diagonal one."""
    print(f"seed {seed}")
    noise = np.random.default_rng(seed).normal(size=(3, 3))
    return matrix + 0.02 * np.trace(matrix) * (noise + noise.T) / 6


SKEW = PAPER._replace(mass=full(PAPER.mass), inertia=full(PAPER.inertia), center=np.array([0.01, 0.02, -0.01]))


@lru_cache
def reference(program):
    """One step in JAX: the record, the state after it, and Newton's iterations."""

    def step(p, s, h):
        s = program.prepare(p, s, h)
        iterations, record = 0, None
        for stage in program.stages:
            part = stage.fraction * h
            guess = stage.guess(p, s, part)
            root = solver.solve(lambda z, t=stage, s=s, d=part: t.residual(p, s, d, z), guess, part, stage.blocks)
            record = stage.record(p, s, part, root.unknowns) if record is None else record
            s, iterations = stage.advance(p, s, part, root.unknowns), iterations + root.iterations
        return record, s, iterations

    return step


def follow(program, p, s, h, steps):
    """Records, final state and iterations of the reference."""
    records, counts, step = [], [], tabulate(reference(program), p, s, h)
    for _ in range(steps):
        record, s, count = step(p, s, h)
        records.append(record)
        counts.append(int(count))
    return jax.tree.map(lambda *leaves: np.stack(leaves), *records), s, counts


def assert_close(ours, theirs, tolerance=1e-12):
    for x, y in zip(jax.tree.leaves(ours), jax.tree.leaves(theirs), strict=True):
        np.testing.assert_allclose(x, y, rtol=tolerance, atol=tolerance * max(1.0, np.max(np.abs(y))))


@dataclass(frozen=True)
class Raw(LeftRectangle):
    """The same equations, mixed and shuffled so that no block can be told apart."""

    def residual(self, p, s, h, z):
        r = super().residual(p, s, h, z)
        mix = jnp.eye(6) + 0.1 * jnp.arange(36.0).reshape(6, 6) / 36
        return (mix @ r)[::-1]


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("p", [PAPER, SKEW], ids=["diagonal", "full"])
@pytest.mark.parametrize("stage", [LeftRectangle(), Raw()], ids=["blocks", "mixed"])
def test_native_steps_equal_plain_newton(p, stage):
    program = VehicleProgram((stage,))
    s = start(H, [1.0, -2.0, 3.0], p)
    records, final, counts = follow(program, p, s, H, 60)
    chunk = native.run(program, p, s, H, 60, 1)
    assert chunk.code is Code.CONVERGED
    assert chunk.steps == 60
    assert_close(chunk.records, records)
    assert_close(chunk.final, final)
    assert (chunk.iterations, chunk.iterations_max) == (sum(counts), max(counts))


@pytest.mark.long
def test_stages_follow_each_other():
    stages = tuple(LeftRectangle(fraction) for fraction in (0.4, 0.2, 0.4))
    s = start(H)
    records, final, counts = follow(VehicleProgram(stages), PAPER, s, H, 10)
    chunk = native.run(VehicleProgram(stages), PAPER, s, H, 10, 1)
    assert_close(chunk.records, records)
    assert_close(chunk.final, final)
    assert chunk.iterations == sum(counts)


def test_every_kth_record_is_kept_and_runs_continue():
    s = start(H)
    whole = native.run(VehicleProgram(), PAPER, s, H, 30, 1)
    thinned = native.run(VehicleProgram(), PAPER, s, H, 6, 5)
    first = native.run(VehicleProgram(), PAPER, s, H, 3, 5)
    second = native.run(VehicleProgram(), PAPER, first.final, H, 3, 5)
    assert_close(thinned.records, jax.tree.map(lambda x: x[::5], whole.records), 0.0)
    assert_close(second.records, jax.tree.map(lambda x: x[3:], thinned.records), 0.0)
    assert_close(second.final, whole.final, 0.0)


def test_monitors_and_certificates_are_observed_at_every_step():
    chunk = native.run(VehicleProgram(), PAPER, start(H), H, 20, 5)
    every = native.run(VehicleProgram(), PAPER, start(H), H, 100, 1)
    assert chunk.monitors["spatial_momentum"].shape == (20, 3)
    for name in ("energy", "spatial_momentum"):
        low, high = chunk.extrema[name]
        np.testing.assert_array_equal(low, every.monitors[name].min(axis=0))
        np.testing.assert_array_equal(high, every.monitors[name].max(axis=0))
    assert chunk.extrema["balance_residual"][1] < 1e-13
    assert chunk.extrema["newton_residual"][1] < 1e-12
    assert native.run(VehicleProgram(), PAPER, start(H), H, 2, 5, monitors=False).extrema == {}


def test_monitors_change_no_digit_of_a_motion():
    watched, bare = (native.run(VehicleProgram(), SKEW, start(H, p=SKEW), H, 2, 100, on) for on in (True, False))
    assert_close((watched.records, watched.final), (bare.records, bare.final), 0.0)


def test_the_kelvin_noether_quantity_is_kept():
    chunk = native.run(VehicleProgram(), PAPER, start(H), H, 50, 1000)
    low, high = chunk.extrema["kelvin_noether"]
    assert high - low < 1e-10 * abs(high)
    assert chunk.records.t[-1] == pytest.approx(490.0)


@pytest.mark.parametrize(
    ("xi", "code"),
    [([np.nan, 0, 0], Code.NOT_FINITE), ([1e200, 1e200, 1e200], Code.NOT_FINITE), ([410, 1, 0], Code.BEYOND_CHART)],
)
def test_a_failed_first_step_leaves_the_state(xi, code):
    s = start(H)._replace(xi=np.asarray(xi, float))
    s = start(H, xi) if code is Code.BEYOND_CHART else s
    chunk = native.run(VehicleProgram(), PAPER, s, H, 4, 5)
    assert (chunk.code, chunk.steps) == (code, 0)
    assert chunk.records.t.shape == (0,)
    assert_close(chunk.final.g, np.eye(3), 0.0)


@dataclass(frozen=True)
class Rootless(LeftRectangle):
    """Has no root once t reaches 0.045."""

    def residual(self, p, s, h, z):
        return jnp.where(s.t > 0.045, 1.0 + z**2, super().residual(p, s, h, z))


def test_a_later_failure_keeps_what_was_computed():
    chunk = native.run(VehicleProgram((Rootless(),)), PAPER, start(H), H, 4, 2)
    assert (chunk.code, chunk.steps) == (Code.NOT_CONVERGED, 5)
    assert chunk.records.t == pytest.approx([0.0, 0.02, 0.04])
    assert chunk.final.t == pytest.approx(0.05)
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(chunk.records))


@dataclass(frozen=True)
class Watching(VehicleProgram):
    """What it watches is NaN from t = 0.045."""

    def monitors(self, p, s, h):
        return {"clock": jnp.sqrt(0.045 - s.t), "height": s.n[2]}


@pytest.mark.parametrize("kernel", [native, pytest.param(xla, marks=pytest.mark.long)])
def test_a_monitor_that_is_no_number_ends_the_run_at_the_last_good_node(kernel):
    chunk = kernel.run(Watching(), PAPER, start(H), H, 10, 1)
    assert (chunk.code, chunk.steps) == (Code.NOT_FINITE, 5)
    assert chunk.records.t == pytest.approx([0.0, 0.01, 0.02, 0.03, 0.04])
    assert chunk.final.t == pytest.approx(0.05)
    assert np.all(np.isfinite(chunk.monitors["clock"]))
    assert kernel.run(Watching(), PAPER, start(H), H, 10, 1, False).code is Code.CONVERGED


def test_a_monitor_that_is_no_number_ends_only_its_member():
    late = start(H)._replace(t=np.array([0.0, 0.03]))
    axes = (False, jax.tree.map(lambda leaf: False, start(H))._replace(t=True))
    chunk = ensemble.run_ensemble(Watching(), PAPER, late, H, 10, 1, axes=axes)
    assert chunk.code.tolist() == [Code.NOT_FINITE, Code.NOT_FINITE]
    assert chunk.steps.tolist() == [5, 2]


@dataclass(frozen=True)
class Sorting(LeftRectangle):
    def guess(self, p, s, h):
        return jnp.sort(super().guess(p, s, h))


def test_what_the_tracer_cannot_take_is_named():
    with pytest.raises(Untraceable, match="`sort`"):
        native.run(VehicleProgram((Sorting(),)), PAPER, start(H), H, 1, 1)


@pytest.mark.long
def test_parameters_that_change_their_zeros_are_not_confused():
    for mass in (PAPER.mass, SKEW.mass, PAPER.mass * 1.5):
        p = PAPER._replace(mass=mass)
        _, final, _ = follow(VehicleProgram(), p, start(H, None, p), H, 3)
        assert_close(native.run(VehicleProgram(), p, start(H, None, p), H, 1, 3).final, final)
