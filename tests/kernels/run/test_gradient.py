"""The native adjoint equals the derivative that JAX takes of plain Newton's steps, to round-off."""

from __future__ import annotations

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from vehicle import PAPER, LeftRectangle, VehicleProgram, start

from coadjoint.kernels.packing import pack
from coadjoint.kernels.program import Code
from coadjoint.kernels.run import gradient, tapes, xla
from coadjoint.kernels.run.tapes import Tapes

H, RECORDS, EVERY = 0.01, 3, 5

PROGRAMS = {
    "one stage": VehicleProgram(),
    "three stages": VehicleProgram(tuple(LeftRectangle(fraction) for fraction in (0.4, 0.2, 0.4))),
}


def of_records(records):
    return 0.1 * jnp.sum(records.n**2) + jnp.sum(records.xi**3)


def of_final(final):
    return jnp.sum(final.n**2) + 3.0 * final.g[0, 1] + final.mu @ jnp.arange(3.0)


def through_xla(program):
    """The gradient by parameters, state and h of of_records + of_final."""

    def total(p, s, h):
        def step(state, _):
            result = xla.step(program, p, state, h, certify=False)
            return result.after, result.record

        final, records = jax.lax.scan(step, s, None, length=RECORDS * EVERY)
        return of_records(jax.tree.map(lambda x: x[::EVERY], records)) + of_final(final)

    return jax.jit(jax.grad(total, (0, 1, 2)))


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("name", PROGRAMS)
def test_the_adjoint_equals_the_gradient_through_xla(name):
    program, s = PROGRAMS[name], start(H, [1.0, -2.0, 3.0])
    chunk, pull = gradient.vjp(program, PAPER, s, H, RECORDS, EVERY)
    with jax.enable_x64(True):
        records_bar, final_bar = jax.grad(of_records)(chunk.records), jax.grad(of_final)(chunk.final)
        theirs = jax.tree.map(np.asarray, through_xla(program)(PAPER, s, H))
    ours = pull(jax.tree.map(np.asarray, records_bar), jax.tree.map(np.asarray, final_bar))
    for x, y in zip(jax.tree.leaves(tuple(ours)), jax.tree.leaves(theirs), strict=True):
        assert x.shape == y.shape
        np.testing.assert_allclose(x, y, rtol=1e-12, atol=1e-13 * np.max(np.abs(y)))


def test_the_adjoint_of_a_long_run_equals_differences():
    s = start(H)
    steps, shift = 2000, 1e-4
    chunk, pull = gradient.vjp(VehicleProgram(), PAPER, s, H, 1, steps)
    final_bar = jax.tree.map(np.zeros_like, chunk.final)._replace(n=np.array([0.0, 0.0, 1.0]))
    along = np.array([1.0, 2.0, 3.0])
    ends = [
        gradient.native.run(VehicleProgram(), PAPER, s._replace(pi=s.pi + e * along), H, 1, steps).final.n[2]
        for e in (shift, -shift)
    ]
    assert pull(None, final_bar).state.pi @ along == pytest.approx((ends[0] - ends[1]) / (2 * shift), rel=1e-6)


@dataclass(frozen=True)
class Ending(LeftRectangle):
    """Leaves its chart at t = `end`."""

    end: float = 0.0

    def chart(self, p, s, h, z):
        return jnp.where(s.t < self.end - 0.5 * h, 0.0, 1.0)


@pytest.mark.cases(1)
@pytest.mark.parametrize("end", [0.0, 0.04, 0.24], ids=["first", "early", "last"])
def test_a_run_that_fails_has_no_derivative(end):
    chunk, pull = gradient.vjp(VehicleProgram((Ending(end=end),)), PAPER, start(H), H, 5, 5)
    assert (chunk.code, chunk.steps) == (Code.BEYOND_CHART, round(end / H))
    assert all(np.all(np.isnan(leaf)) for leaf in jax.tree.leaves(tuple(pull(None, chunk.final))))
    numbers = np.concatenate([pack(PAPER)[1], pack(start(H))[1], [H]])
    for taped in (False, True):
        found = gradient.NativeRun(VehicleProgram((Ending(end=end),)), PAPER, start(H), 5, 5).value(numbers, taped)
        assert found[-2] == Code.BEYOND_CHART
        np.testing.assert_array_equal(found[:5], [*chunk.records.t, *[chunk.records.t[-1] if end else 0.0] * 5][:5])


def counted(monkeypatch):
    """The steps that each later call of the machine takes."""
    launch, steps = gradient.native.launch, []

    def counting(kernel, p, h, s, records, save_every, rows=None):
        steps.append(records * save_every)
        return launch(kernel, p, h, s, records, save_every, rows)

    monkeypatch.setattr(gradient.native, "launch", counting)
    return steps


def of_state(chunk, pull):
    return pack(pull(None, chunk.final).state)[1]


def test_only_numbers_that_have_not_run_go_forward_again(monkeypatch):
    """A pullback takes the tape of its run, however often, and not that of another one."""
    monkeypatch.setattr(gradient, "_tapes", Tapes())
    steps = counted(monkeypatch)
    chunk, pull = gradient.vjp(VehicleProgram(), PAPER, start(H), H, 5, 8)
    first = of_state(chunk, pull)
    assert steps == [40]
    for other in (gradient.vjp(VehicleProgram(), PAPER, start(H), s * H, 5, 8)[1] for s in (1.0, 2.0, 3.0)):
        of_state(chunk, other)
    steps.clear()
    np.testing.assert_array_equal(of_state(chunk, pull), first)  # the memory of its tape serves another run now
    np.testing.assert_array_equal(of_state(chunk, pull), first)
    assert steps == [40]


def test_a_pullback_needs_no_run_before_it():
    final = gradient.native.run(VehicleProgram(), PAPER, start(H), H, 2, 3, monitors=False).final
    numbers = np.concatenate([pack(PAPER)[1], pack(start(H))[1], [H]])
    alone = gradient.NativeRun(VehicleProgram(), PAPER, start(H), 2, 3).pulled(numbers, None, pack(final)[1])
    expected = gradient.vjp(VehicleProgram(), PAPER, start(H), H, 2, 3)[1](None, final)
    np.testing.assert_array_equal(alone, pack(tuple(expected))[1])


def test_without_room_for_a_tape_a_pullback_goes_forward_twice(monkeypatch):
    """Once for the checkpoints, once for the tape; the cotangents are the same."""
    chunk, pull = gradient.vjp(VehicleProgram(), PAPER, start(H), H, 80, 5)
    records_bar = jax.tree.map(np.cos, chunk.records)
    expected = pack(pull(records_bar, chunk.final))[1]
    monkeypatch.setattr(gradient, "STRETCH", 1)
    monkeypatch.setattr(gradient, "ROOM", 0)
    steps = counted(monkeypatch)
    np.testing.assert_array_equal(pack(pull(records_bar, chunk.final))[1], expected)
    assert sum(steps) == 400 + 380


def test_records_of_some_steps_pull_as_those_of_all_do():
    chunk, pull = gradient.vjp(VehicleProgram(), PAPER, start(H), H, 3, 5)
    bar = jax.tree.map(np.cos, chunk.records)
    every = jax.tree.map(lambda rows: np.insert(rows, np.repeat([1, 2, 3], 4), 0.0, axis=0), bar)
    expected = gradient.vjp(VehicleProgram(), PAPER, start(H), H, 15, 1)[1](every, None)
    np.testing.assert_array_equal(pack(tuple(pull(bar, None)))[1], pack(tuple(expected))[1])


class Repeating(LeftRectangle):
    """Records ξ twice."""

    def record(self, p, s, h, z):
        found = super().record(p, s, h, z)
        return found._replace(n=found.xi)


@pytest.mark.parametrize("program", [VehicleProgram(), VehicleProgram((Repeating(),))], ids=["", "repeating"])
def test_a_run_with_its_tape_is_the_run_to_the_bit(optimised, program):
    for records, every in ((1, 40), (8, 5), (40, 1)):
        taped = gradient.vjp(program, PAPER, start(H), H, records, every)[0]
        alone = gradient.native.run(program, PAPER, start(H), H, records, every, monitors=False)
        for found, expected in ((taped.records, alone.records), (taped.final, alone.final)):
            np.testing.assert_array_equal(pack(found)[1], pack(expected)[1])
        assert (taped.steps, taped.iterations) == (alone.steps, alone.iterations)


def test_tapes_leave_when_others_need_their_room(monkeypatch):
    monkeypatch.setattr(tapes, "ROOM", 2 * 8 * 12)
    kept, (a, b, c) = Tapes(), (np.full((4, 3), x) for x in (1.0, 2.0, 3.0))
    kept.keep("a", a)
    assert kept.room((4, 3)) is not a
    kept.keep("b", b, pulled=True)
    assert kept.room((4, 2)) is not b
    kept.keep("c", c)
    assert (kept.taken("a"), kept.taken("b"), kept.taken("c")) == (a, None, c)
    kept.keep("b", b, pulled=True)
    assert kept.room((4, 3)) is b and kept.taken("b") is None
