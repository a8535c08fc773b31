"""Explicit Runge–Kutta methods on groups: their orders, what they keep, and what they lose."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.mechanics.continuous import reference
from coadjoint.methods import CommutatorFree, CrouchGrossman, MuntheKaas


def sled():
    """A body on SE(2) whose ℓ is no quadratic form and depends on time and a place, and which is dragged and pushed."""

    def lagrangian(xi, n, nu, a, p, *, t):
        kinetic = 0.5 * xi @ p.inertia @ xi + 0.1 * xi[0] ** 4 + 0.5 * nu @ nu * (1 + 0.2 * jnp.cos(t))
        return kinetic + 0.3 * xi[1] * nu[0] - n @ n / 2 - jnp.sin(t) * a[0]

    def drag(motion, p):
        return co.Force(-0.2 * motion.xi, 0.1 * motion.nu * jnp.sin(motion.t))

    system = co.System(
        co.SE2(), lagrangian, additional=co.Trivial(2), advected=co.Defining(),
        parameters={"inertia": np.diag([1.0, 2.0, 3.0])}, forces=drag,
    )  # fmt: skip
    return system, system.state(q=[0.3, -0.2], xi=[0.8, 0.4, -0.3], qdot=[0.5, 0.2], a0=[0.2, 0.4, 1.0])


def top():
    system = co.models.heavy_top.make(mass=1.0, center_of_mass=[0.1, 0.0, 0.3], inertia=np.diag([0.3, 0.35, 0.1]))
    return system, system.state(g=co.attitude.zyx(0.1, 0.4, 0.3), xi=[0.4, 0.5, 4], a0=[0, 0, 1])


def vehicle():
    """The paper's, on SO(3), whose n and ν turn with it."""
    system = co.models.paper_vehicle()
    return system, system.state(q=[1, 2, 1], xi=[0.9, -0.7, 1.2], qdot=[0.4, 0.1, 0.8], a0=[0, 0, 1])


long = pytest.mark.long
METHODS = [
    *(MuntheKaas(co.Exponential(), degree=degree) for degree in (1, 2, 3, 4)),
    MuntheKaas(degree=5),
    CommutatorFree(degree=3),
    CommutatorFree(degree=4),
    CrouchGrossman(degree=3),
    CrouchGrossman(degree=4),
]
RUNS = [pytest.param(world, method, marks=long) for world in (vehicle, sled) for method in METHODS]


@pytest.mark.parametrize(("world", "method"), [(vehicle, MuntheKaas(degree=3)), *RUNS])
def test_errors_against_dop853_shrink_by_the_order(world, method):
    system, start = world()
    exact = reference(system, start, [0.5])
    errors = []
    for steps in (20, 40):
        end = co.simulate(
            system, start, dt=0.5 / steps, steps=steps, method=method, accuracy=False, monitors=False
        ).final
        parts = [jax.tree.leaves([one.g, one.n, one.mu, one.pi, one.a]) for one in (end, exact)]
        errors.append(max(np.max(np.abs(x - y), initial=0.0) for x, y in zip(*parts, strict=True)))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(method.order, abs=0.35)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.title)
def test_where_everything_commutes_the_conditions_of_order_hold(method):
    *stages, b = [table.sum(axis=0) for table in method.tables]
    A = np.array([[*row, *[0.0] * (len(b) - len(row))] for row in stages])
    c = A.sum(axis=1)
    conditions = [
        (1, b.sum(), 1), (2, b @ c, 1 / 2), (3, b @ c**2, 1 / 3), (3, b @ A @ c, 1 / 6), (4, b @ c**3, 1 / 4),
        (4, (b * c) @ A @ c, 1 / 8), (4, b @ A @ c**2, 1 / 12), (4, b @ A @ A @ c, 1 / 24), (5, b @ c**4, 1 / 5),
        (5, b @ A @ c**3, 1 / 20), (5, b @ A @ A @ A @ c, 1 / 120),
    ]  # fmt: skip
    for order, found, expected in conditions:
        if order <= method.order:
            assert found == pytest.approx(expected, abs=1e-14)


def test_on_a_vector_space_the_steps_are_those_of_runge_and_kutta():
    def lagrangian(xi, n, nu):
        return 0.5 * xi @ xi + 0.5 * nu @ nu + 2 * jnp.cos(n[0])

    pendulum = co.System(co.Translation(1), lagrangian, additional=co.Trivial(1))
    start = pendulum.state(xi=[0.3], q=[0.4], qdot=[0.7])
    end = co.simulate(pendulum, start, dt=0.2, steps=10, method=MuntheKaas(), accuracy=False, monitors=False).final

    def rate(y):
        return np.array([y[1], -2 * np.sin(y[0])])

    y, h = np.array([0.4, 0.7]), 0.2
    for _ in range(10):
        k1 = rate(y)
        k2 = rate(y + h / 2 * k1)
        k3 = rate(y + h / 2 * k2)
        y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(y + h * k3))
    np.testing.assert_allclose([end.n[0], end.pi[0]], y, rtol=0, atol=1e-15)


def test_the_group_is_kept_and_momentum_is_not():
    system, start = top()
    runs = {
        m: co.simulate(system, start, dt=0.02, steps=300, method=m, accuracy=False)
        for m in (MuntheKaas(), co.Midpoint())
    }
    changes = [run.relative_change("kelvin_noether") for run in runs.values()]
    assert changes[1] < 1e-12 < 1e-8 < changes[0]
    assert all(run.extrema["group_defect"][1] < 1e-13 for run in runs.values())
    assert runs[next(iter(runs))].extrema["balance"][1] > 1e-9, "the balance of momentum shows what is lost"


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: MuntheKaas(degree=6), "`degree` of MuntheKaas must be 1, 2, 3, 4 or 5, but is 6"),
        (lambda: CrouchGrossman(degree=True), "must be 3 or 4, but is True"),
        (lambda: CommutatorFree(degree=2), "must be 3 or 4"),
        (lambda: MuntheKaas(start="velocity"), "starts from momenta"),
        (lambda: co.simulate(*top(), dt=0.1, steps=1, method=CrouchGrossman(co.Cayley())), "needs co.Exponential"),
        (lambda: co.Suzuki4(MuntheKaas()), "symmetric"),
    ],
)
def test_what_a_method_lacks_is_refused(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()


def test_curved_spaces_are_refused():
    sphere = co.System(co.SO3(), lambda xi, n, nu: 0.5 * xi @ xi + 0.5 * nu @ nu, additional=co.Sphere())
    start = sphere.state(q=[0, 0, 1], xi=[0, 0, 1], qdot=[0.1, 0, 0])
    with pytest.raises(ArgumentError, match="MuntheKaas needs a flat space"):
        co.simulate(sphere, start, dt=0.1, steps=1, method=MuntheKaas())
