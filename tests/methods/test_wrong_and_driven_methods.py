"""What a method refuses, and the work of steady forces over its steps: force times way."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import CoadjointError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.methods import (
    AdjointVariational,
    EnergyMomentum,
    Galerkin,
    HamiltonianMidpoint,
    IsospectralMidpoint,
    LeftRectangle,
    LeftRight,
    Midpoint,
    RightRectangle,
    Simpson,
    Symmetrised,
    Trapezoidal,
    Variational,
)
from stepping import Stepper

INERTIA = np.array([1.0, 2.0, 3.0])


def turning(**more: Any) -> co.System:
    """A free body by ℋ = ½ μ·J⁻¹μ."""
    given: Any = {"hamiltonian": lambda mu: 0.5 * mu @ (mu / INERTIA), **more}
    return co.System(co.SO3(), **given)


def begun(method: Any, system: co.System, **start: Any) -> Any:
    return method.begin(system, system.state(**start), 0.1)


CURVED = co.System(
    co.SO3(), hamiltonian=lambda mu, n, pi: 0.5 * mu @ mu + 0.5 * pi @ pi, additional=co.Sphere()
)  # fmt: skip
PLAIN = co.System(co.SO3(), lambda xi: 0.5 * xi @ xi)
MOVING = co.System(co.SO3(), hamiltonian=lambda mu, n, pi: 0.5 * mu @ mu + 0.5 * pi @ pi, additional=co.Defining())
PUSHED = turning(forces=lambda motion: co.Force(torque=-motion.xi))
WRONG = {
    "a tolerance of nothing": (lambda: IsospectralMidpoint(tolerance=0.0), "over 0 and below 0.001, but is 0.0"),
    "a tolerance that is large": (lambda: IsospectralMidpoint(tolerance=1e-3), "over 0 and below 0.001, but is 0.001"),
    "g by a number": (lambda: IsospectralMidpoint(carry_g=1), "`carry_g` must be True or False, but is 1"),
    "matrices from velocities": (lambda: IsospectralMidpoint(start="velocity"), "starts from momenta: leave out start"),
    "matrices by another map": (
        lambda: begun(IsospectralMidpoint(co.Exponential()), turning()), "made of the Cayley transform, but got Exp",
    ),
    "matrices without ℋ": (lambda: begun(IsospectralMidpoint(), PLAIN), "needs a system with a `hamiltonian` of the"),
    "matrices and places": (lambda: begun(IsospectralMidpoint(), MOVING, q=np.eye(3)[0]), "no additional dynamics"),
    "matrices under forces": (lambda: begun(IsospectralMidpoint(), PUSHED), "takes no forces"),
    "momenta without ℋ": (lambda: begun(HamiltonianMidpoint(), PLAIN), "needs a system with a `hamiltonian`: use co.M"),
    "momenta by a map of other groups": (
        lambda: begun(HamiltonianMidpoint(co.Cayley()), co.System(co.groups.SLn(3), hamiltonian=lambda mu: mu @ mu)),
        "SL|sl",
    ),
    "momenta on a sphere": (
        lambda: begun(HamiltonianMidpoint(), CURVED, q=np.eye(3)[0], mu=np.zeros(3), pi=np.zeros(3)),
        "needs a flat space of additional dynamics",
    ),
    "momenta from velocities": (
        lambda: begun(HamiltonianMidpoint(start="velocity"), turning(), xi=np.ones(3)), "starts from momenta",
    ),
    "a symmetry in words": (lambda: Variational(symmetric="yes"), "`symmetric` must be True or False, but is 'yes'"),
    "a composition of one-sided steps": (lambda: co.Suzuki4(LeftRectangle()), "needs a symmetric method of order 2"),
    "substeps back in words": (
        lambda: co.Suzuki4(Midpoint(), negative_substeps="never"), 'must be "refuse" or "allow", but is .never.',
    ),
}  # fmt: skip


@pytest.mark.parametrize(("call", "says"), WRONG.values(), ids=WRONG)
def test_what_a_method_does_not_take_is_said_in_one_sentence(call, says):
    with pytest.raises(CoadjointError, match=says) as error:
        call()
    assert "\n" not in str(error.value)


def test_the_adjoints_of_one_sided_rules_are_each_other_and_symmetric_rules_are_their_own():
    tau = co.Exponential()
    for left, right in ((LeftRectangle, RightRectangle), (Variational, AdjointVariational)):
        assert left(tau).adjoint == right(tau) and right(tau).adjoint == left(tau)
    assert Midpoint(tau).adjoint == Midpoint(tau)


PUSH = np.array([0.3, -0.2])


def cart(method: Any) -> co.System:
    """Two steady forces on a point in the plane, and a potential that grows with time."""
    forces = {"one": lambda motion: co.Force(torque=PUSH), "two": lambda motion: co.Force(torque=-3 * PUSH)}
    if isinstance(method, HamiltonianMidpoint):
        return co.System(
            co.Translation(2),
            hamiltonian=lambda mu, *, t: 0.5 * mu @ (mu / np.array([2.0, 3.0])) - 0.1 * t,
            forces=forces,
        )
    discrete = isinstance(method, (Variational, AdjointVariational, Symmetrised))

    def lagrangian(xi, *, t):
        return 0.5 * xi @ (np.array([2.0, 3.0]) * xi) + 0.1 * t

    more: Any = {"discrete_lagrangian": lambda xi, h, *, t: h * lagrangian(xi, t=t)} if discrete else {}
    return co.System(co.Translation(2), lagrangian, forces=forces, **more)


METHODS = (
    AdjointVariational(), EnergyMomentum(), Galerkin(degree=2), HamiltonianMidpoint(), LeftRectangle(), LeftRight(),
    Midpoint(), RightRectangle(), Simpson(), Symmetrised(Variational()), Trapezoidal(), Variational(),
)  # fmt: skip


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.title)
def test_the_work_of_a_steady_force_is_force_times_way_and_time_takes_its_share(method):
    system = cart(method)
    leaps = Stepper(system, method).run(method.begin(system, system.state(mu=[2.0, 6.0]), 0.1), 0.1, 1)
    way, lines = np.zeros(2), np.zeros(3)
    for leap in leaps:
        lines = lines + evaluate(
            lambda record, leap=leap: leap.step.work(system, record, np.float64(leap.h)), leap.record
        )
        way = way + leap.after.g - leap.record.g
    assert np.linalg.norm(way) > 0.1
    np.testing.assert_allclose(lines, [PUSH @ way, -3 * PUSH @ way, -0.1 * 0.1], rtol=1e-12)
