"""What functions and parameters hold beside what they are given: defaults, digits, memory."""

from __future__ import annotations

import numpy as np
import pytest

import coadjoint as co
from coadjoint.checks import float64
from coadjoint.errors import ArgumentError, LagrangianError


def body(**more) -> co.System:
    return co.System(co.SO3(), **more)


def test_an_argument_with_a_default_is_the_constant_that_it_stands_for():
    def scaled(k: float):
        def lagrangian(xi, k=k, *, t=0.0):
            return 0.5 * k * xi @ xi

        return lagrangian

    for k in (1.0, 3.0):
        start = body(lagrangian=scaled(k)).state(xi=[0, 0, 2.0])
        np.testing.assert_array_equal(start.mu, [0, 0, 2 * k])

    def drag(motion, rate=0.5):
        return co.Force(torque=-rate * motion.xi)

    system = body(lagrangian=scaled(1.0), forces=drag)
    (torque, _), *_ = system.body_forces(system.motion(np.ones(3), np.zeros(0), np.zeros(0), np.zeros(0), 0.0))
    np.testing.assert_array_equal(torque, -0.5 * np.ones(3))


@pytest.mark.parametrize(("lagrangian", "sentence"), [
    (lambda xi, k: xi @ xi, r"must take \(xi\), but takes \(xi, k\)"),
    (lambda xi, t=0.0: xi @ xi, r"must take \(xi\): the argument `t=0.0` is given by keyword only.*\(xi, \*, t\)"),
    (lambda xi, n=0.0, nu=0.0: xi @ xi, "the argument `n=0.0` comes with `additional`.* rename it"),
    (lambda xi, a=2.5: a * xi @ xi, "the argument `a=2.5` comes with `advected`, so that it is no constant: rename it"),
    (lambda xi, p=None: xi @ xi, "the argument `p=None` comes with `parameters`"),
])  # fmt: skip
def test_an_argument_that_may_be_given_is_no_constant(lagrangian, sentence):
    with pytest.raises(LagrangianError, match=sentence):
        body(lagrangian=lagrangian)


def test_digits_that_float64_does_not_have_are_refused():
    if np.dtype(np.longdouble).itemsize == 8:
        pytest.skip("longdouble is float64 here")
    exact, lost = np.longdouble("0.5"), np.longdouble("0.1")
    assert float64(exact, "It") == 0.5 and float64(np.array([exact, 2]), "It").dtype == np.float64
    for value in (lost, np.array([0.5, lost]), [lost, 1.0], {"a": lost}["a"]):
        with pytest.raises(ArgumentError, match="whose digits float64 does not have"):
            float64(value, "It")


def test_parameters_cannot_be_changed_in_place_and_leave_what_they_were_made_from_alone():
    given = np.diag([1.0, 2.0, 3.0])
    p = co.Parameters(inertia=given, part={"area": np.ones(2)}, mass=1.0)
    for value in (p.inertia, p.part.area, p.mass, p.replace(inertia=2 * given).inertia):
        with pytest.raises(ValueError, match="read-only"):
            np.asarray(value)[...] = 7.0
    given[0, 0] = 9.0
    assert p.inertia[0, 0] == 1.0
