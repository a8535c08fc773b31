"""One model of a step: rows of numbers in, rows out, with exact derivatives, also of compositions and by XLA."""

from __future__ import annotations

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.run import ensemble, native, xla
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.methods.step_model import StepModel

H = 0.1
SUZUKI = co.Suzuki4(co.Midpoint(), negative_substeps="allow")


def model(method, **more):
    """A body under a drag that grows as the turning of a rotor, which follows the motion."""
    system = co.System(
        co.SO3(),
        lambda xi, p: 0.5 * xi @ (p.inertia * xi),
        parameters={"inertia": [1.0, 2.0, 3.0]},
        forces=lambda motion, p: co.Force(torque=-0.1 * motion.xi * (1 + motion.internal.rotor[0])),
        internal=lambda motion, h, p: {"rotor": co.mechanics.jumped(0.5 * motion.xi[:1])},
    )
    start = system.state(xi=[0.3, -0.2, 0.5], internal={"rotor": [0.1]})
    program = StepProgram(replace_parameters(system, None), method)
    constants = Constants(system.parameters, None)
    made = StepModel(program, constants, method.begin(system, start, H), **{"course": True, **more})
    return made, system, start


def moving(found):
    """The numbers of a state that determine all others after it."""
    at = found.layout.places
    return np.concatenate([np.ravel(leaf).astype(int) for leaf in jax.tree.leaves((at.g, at.mu))])


def differences(found, row):
    """∂x⁺/∂x to order 4, a column for each number of g and μ."""
    e, columns = 1e-3, []
    for place in moving(found):
        slope = 0.0
        for sign, weight in ((1, 8), (-1, -8), (2, -1), (-2, 1)):
            moved = row.copy()
            moved[:, place] += sign * e
            slope = slope + weight * found.step(moved, np.full(1, H)).after[0]
        columns.append(slope / (12 * e))
    return np.stack(columns, axis=1)


def test_steps_of_rows_are_those_of_a_run_with_the_tangent_of_differences():
    found, system, start = model(SUZUKI)
    row = found.pack(jax.tree.map(lambda leaf: np.asarray(leaf)[None], found._begun))
    run = co.simulate(system, start, dt=H, steps=3, method=SUZUKI, accuracy=False, monitors=False)
    taken = found.step(row, np.full(1, H), 3)
    np.testing.assert_array_equal(found.unpack(taken.after).mu[0], run.final.mu)
    assert taken.code == [0] and taken.course.shape == (1, 5, found.program.unknowns + found.size)
    first = found.step(row, np.full(1, H))
    np.testing.assert_array_equal(first.course[:, -1, found.program.unknowns :], first.after)
    np.testing.assert_array_equal(found.unpack(first.record).mu[0], found._begun.mu)
    places = moving(found)
    exact = found.tangent(row, np.full(1, H))[0]
    np.testing.assert_allclose(exact[np.ix_(places, places)], differences(found, row)[places], atol=1e-11)


def test_steps_by_xla_take_the_loop_that_a_run_has_compiled(monkeypatch):
    """XLA compiles once more for constants of other types, as for arrays in place of numbers."""
    seen = []

    def run(program, constants, *rest):
        seen.append(constants)
        return native.run(program, constants, *rest)

    monkeypatch.setattr(xla, "run", run)
    (plain, *_), (by_xla, *_) = (model(co.Midpoint(), course=False, backend=name) for name in ("native", "xla"))
    rows = np.repeat(plain.pack(jax.tree.map(lambda leaf: np.asarray(leaf)[None], plain._begun)), 2, axis=0)
    for found, other in zip(by_xla(rows, np.full(2, H)), plain(rows, np.full(2, H)), strict=True):
        np.testing.assert_array_equal(found, other)
    assert len(seen) == 2 and all(one is by_xla.constants for one in seen)


def test_rows_by_xla_are_taken_in_groups_of_one_step_size_with_the_constants_of_their_members(monkeypatch):
    system = co.System(co.Translation(1), lambda xi, p: 0.5 * p.mass * xi @ xi, parameters={"mass": 1.0})
    constants = Constants(co.Parameters(mass=np.array([1.0, 2.0, 4.0])), None)
    begun = co.Midpoint().begin(system, system.state(mu=[2.0]), H)
    groups = []

    def run(program, constants, states, h, *rest, axes):
        groups.append((h, constants.system.mass.tolist()))
        return ensemble.run_ensemble(program, constants, states, h, *rest, axes=axes)

    monkeypatch.setattr(xla, "run_ensemble", run)
    program = StepProgram(replace_parameters(system, None), co.Midpoint())
    axes = jax.tree.map(lambda _: True, constants)
    found = StepModel(program, constants, begun, backend="xla", axes=axes, count=2)
    rows = np.repeat(found.pack(jax.tree.map(lambda leaf: np.asarray(leaf)[None], begun)), 5, axis=0)
    h, members = np.array([0.1, 0.2, 0.1, 0.1, 0.2]), [0, 1, 2, 0, 2]
    taken = found.step(rows, h, 3, members)
    assert groups == [(0.1, [1.0, 4.0]), (0.1, [1.0, 1.0]), (0.2, [2.0, 4.0])]
    expected = 3 * h * 2.0 / np.array([1.0, 2.0, 4.0])[members]
    np.testing.assert_allclose(found.unpack(taken.after).g[:, 0], expected, rtol=1e-14)
    np.testing.assert_array_equal(found.unpack(taken.record).g[:, 0], np.zeros(5))
    assert taken.code.tolist() == [0] * 5 and taken.course.shape == (5, 0)
    with pytest.raises(ValueError, match="have the constants of their members"):
        found.step(rows, h, 1, members, np.ones((5, 1)))


@pytest.mark.long
@pytest.mark.parametrize(
    "method", [co.Midpoint(), SUZUKI, co.methods.LeftRight(), co.Galerkin()], ids=lambda m: m.title
)
def test_steps_and_tangents_by_xla_and_in_lanes_are_those_of_one_lane(method):
    found, _, _ = model(method)
    by_xla, _, _ = model(method, backend="xla")
    row = found.pack(jax.tree.map(lambda leaf: np.asarray(leaf)[None], found._begun))
    rows = np.concatenate([row + 1e-3 * k for k in range(5)])
    h, places = H * np.linspace(0.5, 1.0, 5), moving(found)
    many, other = found.step(rows, h, 2), by_xla.step(rows, h, 2)
    each = np.concatenate([found.step(rows[[k]], h[[k]], 2).after for k in range(5)])
    np.testing.assert_allclose(many.after, each, atol=1e-14)
    np.testing.assert_allclose(other.after, each, atol=1e-13)
    np.testing.assert_allclose(other.course, many.course, atol=1e-12)
    exact, xla = (one.tangent(rows, h)[:, places][:, :, places] for one in (found, by_xla))
    np.testing.assert_allclose(xla, exact, atol=1e-12)


def test_an_ensemble_that_fills_its_lanes_is_judged_without_any_parameter():
    body = co.System(co.SO3(), lambda xi: 0.5 * xi @ (np.array([1.0, 2.0, 3.0]) * xi))
    start = body.state(xi=co.each(np.linspace(0.1, 0.5, 48).reshape(16, 3)))
    run = co.simulate(body, start, dt=0.1, steps=4, monitors=False, progress=False)
    assert run.accuracy is not None
