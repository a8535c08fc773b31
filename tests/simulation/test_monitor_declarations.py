"""Monitors return what they declare: the names, single numbers, and values in the declared unit."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.simulation import monitors
from coadjoint.simulation.monitors import watched
from coadjoint.units import unit_of

MASS, LENGTH, TIME = 1024.0, 8.0, 4.0
OWN_UNITS = {"energy": "J", "discrete_energy": "J", "kelvin_noether": "N m s", "kelvin_noether_budget": "N m s"}
"""Of variables whose unit is that of a system's own ℓ, on SO(3); in all others no unit means a number."""


def monitored(mass: float, length: float, time: float) -> dict[str, np.ndarray]:
    """The monitors of a braked body that falls, by other units of mass, length and time, so many times smaller."""
    inertia, weight, drag = mass * length**2, mass * length / time**2, -0.1 * mass * length**2 / time
    system = co.System(
        co.SO3(),
        lambda xi, n, nu, a: (
            0.5 * inertia * xi @ (np.array([1.0, 2.0, 3.0]) * xi) + 0.5 * mass * nu @ nu - weight * n @ a
        ),
        additional=co.Defining(),
        advected=co.Defining(),
        forces={"drag": lambda motion: co.Force(drag * motion.xi)},
    )
    xi, q, qdot = np.array([[0.3, 0.2, -0.2], [1.0, 0.0, 2.0], [0.1, 0.3, 0.2]])
    start = system.state(xi=xi / time, q=length * q, qdot=length / time * qdot, a0=[0, 0, 1])
    return dict(co.simulate(system, start, dt=0.05 * time, steps=3).monitors)


def test_monitors_return_what_they_declare_in_the_declared_unit():
    declared, one, other = {it.name: it for it in watched()}, monitored(1.0, 1.0, 1.0), monitored(MASS, LENGTH, TIME)
    assert {*one} >= {"energy", "discrete_energy", "work_drag", "energy_budget", "group_defect"}
    for name, values in one.items():
        found = next(declared[part] for part in (name, name.partition("_")[0]) if part in declared)  # work of work_drag
        assert found.meaning
        assert values.ndim == 1 or name.startswith("kelvin_noether")
        _, (of_mass, of_length, of_time, *_) = unit_of(found.unit or OWN_UNITS.get(found.like or found.name, "1"))
        scale = MASS**of_mass * LENGTH**of_length * TIME**of_time
        np.testing.assert_allclose(other[name], scale * values, rtol=1e-12, atol=1e-13 * scale, err_msg=name)


def test_monitors_of_constraints_are_the_largest_defect_of_a_state_that_is_off_them():
    """φ = n + (1, 2, −3)·10⁻³ at n = 0, and A·ν − b = (0.1, −0.3) at ν = (0.1, 0.2, 0)."""
    system = co.System(
        co.SO3(),
        lambda xi, n, nu: 0.5 * xi @ xi + nu @ nu,
        additional=co.Defining(),
        constraints={
            "pin": co.Holonomic(lambda n: 1e-3 * jnp.array([1.0, 2.0, -3.0]) + n),
            "rail": co.Nonholonomic(lambda n: [[0, 0, 0, 0, 1, 0], [0, 0, 0, 0, 0, 1]], lambda n: [0.1, 0.3]),
        },
    )
    off = system.state(q=-1e-3 * np.array([1, 2, -3.0])).replace(n=np.zeros(3), pi=np.array([0.2, 0.4, 0.0]))
    for monitor, name, expected in (
        (monitors.constraint_gap, "constraint_gap", 3e-3),
        (monitors.constraint_rate, "constraint_rate", 0.3),
    ):
        found = evaluate(lambda state, monitor=monitor: monitor(system, None, state, 0.1, None), off)
        assert found[name] == pytest.approx(expected, rel=1e-12)
