"""Lifts of paths of shapes by connections that are constant: exponentials of what the shapes have gone."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError, StepError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics import bundle
from coadjoint.mechanics.bundle import _product, _transports

SO3 = co.SO3()
AXIS = np.array([0.3, -0.2, 0.5])


class Constant:
    """g⁻¹ġ = c ẋ with one shape; with `turning`, c changes with x, so that factors do not commute."""

    group, size = SO3, 1

    def require_shapes(self, x: np.ndarray, name: str) -> None:
        """All of ℝ."""

    def __init__(self, turning: float = 0.0):
        self.turning = turning

    def velocity(self, x: Any, v: Any) -> Any:
        return (jnp.asarray(AXIS) + self.turning * jnp.stack([x[0], -(x[0] ** 2), 0 * x[0]])) * v[0]


def test_a_constant_connection_turns_by_what_the_shape_has_gone():
    times = np.array([0.0, 0.5, 2.0])
    found = _transports(Constant(), lambda t: jnp.stack([t**2]), times)  # pyright: ignore[reportArgumentType]
    for g, gone in zip(found, (0.25, 3.75), strict=True):
        assert g == pytest.approx(evaluate(SO3.exp, gone * AXIS), abs=1e-13)


def test_a_lift_meets_its_equation_where_factors_do_not_commute():
    """d/dt of the lift is g c(x) ẋ, by a central difference."""
    connection: Any = Constant(turning=0.8)
    h = 1e-4
    step = _transports(connection, lambda t: jnp.stack([t]), np.array([0.0, 1.0 - h, 1.0 + h]))
    before, after = step[0], step[0] @ step[1]
    slope = before.T @ (after - before) / (2 * h)
    at = AXIS + 0.8 * np.array([1.0, -1.0, 0.0])
    assert [slope[2, 1], slope[0, 2], slope[1, 0]] == pytest.approx(at, abs=1e-3)


def test_a_lift_that_does_not_settle_raises(monkeypatch):
    monkeypatch.setattr(bundle, "_FINEST", 16)
    connection: Any = Constant(turning=9.0)
    with pytest.raises(StepError, match="does not settle with 16 pieces an interval: give more `times`"):
        _transports(connection, lambda t: jnp.stack([jnp.sin(30 * t)]), np.array([0.0, 1.0]))


def test_a_path_returns_shapes():
    connection: Any = Constant()
    with pytest.raises(ArgumentError, match=r"must return an array of shape \(1,\), but returns \(2,\)"):
        _transports(connection, lambda t: jnp.stack([t, t]), np.array([0.0, 1.0]))
    with pytest.raises(ArgumentError, match="lifts a function t → x"):
        _transports(connection, np.zeros((3, 1)), np.array([0.0, 1.0]))


def test_increments_are_multiplied_from_the_left_to_the_right():
    first, second = (evaluate(SO3.exp, np.array(x)) for x in ([0.3, 0.0, 0.0], [0.0, 0.4, 0.0]))
    start = evaluate(SO3.exp, np.array([0.0, 0.0, 0.5]))
    found = _product(SO3, start, np.stack([first, second]))
    assert found == pytest.approx(np.stack([start, start @ first, start @ first @ second]))


@pytest.mark.parametrize(
    ("times", "sentence"), [(None, "needs `times`"), ([0.0], "two times or more"), ([[0.0]], "shape")]
)
def test_times_are_at_least_two(times, sentence):
    with pytest.raises(ArgumentError, match=sentence):
        bundle._times(times)
    assert bundle._times([0.0, 1.0]).tolist() == [0.0, 1.0]
