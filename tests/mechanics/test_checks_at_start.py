"""What is wrong with a Lagrangian, a Hamiltonian or a force at the start is named, with how much and where."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import LagrangianError
from coadjoint.mechanics.check import _asymmetric, check

INERTIA = np.diag([1.0, 2.0, 3.0])


def top(lagrangian: Any, **more: Any) -> tuple[co.System, co.State]:
    system = co.System(co.SO3(), lagrangian, **more)
    return system, system.state(xi=[0.1, 0.2, 0.3])


def sentence(lagrangian: Any, **more: Any) -> str:
    with pytest.raises(LagrangianError) as raised:
        check(*top(lagrangian, **more))
    return str(raised.value)


def test_a_matrix_whose_antisymmetric_part_is_lost_is_named_with_how_much_it_is():
    skewed = INERTIA + np.array([[0.0, 0.25, 0.0], [-0.25, 0.0, 0.0], [0.0, 0.0, 0.0]])
    said = sentence(lambda xi, p: 0.5 * xi @ p.inertia @ xi, parameters={"inertia": skewed})
    assert "`inertia` must be symmetric, but differs from its transpose by 0.5:" in said
    kept = {"inertia": INERTIA, "other": skewed}
    assert check(*top(lambda xi, p: 0.5 * xi @ (p.inertia + p.other @ p.other.T) @ xi, parameters=kept)) == []


def test_a_matrix_is_asymmetric_beyond_round_off_and_where_it_is_square():
    assert not _asymmetric(np.array([[1.0, 1e-9], [0.0, 1.0]])) and _asymmetric(np.array([[1.0, 2e-9], [0.0, 1.0]]))
    assert not _asymmetric(np.zeros((2, 3))) and not _asymmetric(np.zeros((0, 0))) and not _asymmetric(np.ones(2))


def test_a_mass_matrix_that_is_singular_is_told_with_its_direction():
    said = sentence(lambda xi: 0.5 * (xi[0] ** 2 + xi[2] ** 2))
    assert "is singular: motion along (ξ, ν) = [0.0, 1.0, 0.0]" in said.replace("-0.0", "0.0").replace("-1.0", "1.0")


def test_a_kinetic_energy_with_negative_axes_warns_of_how_many():
    (warning,) = check(*top(lambda xi: 0.5 * (xi[0] ** 2 - xi[1] ** 2 - xi[2] ** 2)))
    assert warning == "The kinetic energy is not positive definite: 2 of its 3 axes are negative."
    assert check(*top(lambda xi: 0.5 * xi @ xi)) == []


def test_a_value_that_is_not_finite_and_a_gradient_that_is_not_are_told_apart():
    assert "must be finite at the start, but is nan" in sentence(lambda xi: 0.5 * xi @ xi + jnp.log(-(xi[0] ** 2) - 1))
    said = sentence(lambda xi: 0.5 * xi @ xi + jnp.sqrt(jnp.sum((xi - jnp.array([0.1, 0.2, 0.3])) ** 2)))
    assert "The gradient of the Lagrangian in xi must be finite at the start" in said


def test_a_force_whose_derivative_is_not_finite_is_named():
    drag = {"lift": lambda motion: co.Force(-motion.xi), "drag": lambda motion: co.Force(-_norm(motion.xi) * motion.xi)}
    system = co.System(co.SO3(), lambda xi: 0.5 * xi @ xi, forces=drag)
    with pytest.raises(LagrangianError, match="The derivative of the force `drag` in the velocities must be finite"):
        check(system, system.state(xi=[0.0, 0.0, 0.0]))
    assert check(system, system.state(xi=[0.1, 0.0, 0.0])) == []


def _norm(x: Any) -> Any:
    return jnp.sqrt(x @ x)
