"""Foils at rest, and broadside, have no force that jumps and no derivative that is not a number."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.parameters import Parameters
from coadjoint_vehicles.parts import Airfoil, Fin, LiftingBody
from coadjoint_vehicles.parts.part import Flow

FOIL: dict[str, Any] = {"name": "foil", "position": (0.0, 0.0, 0.0), "area": 0.1, "lift_slope": 3.0, "stall": 0.3}
PARTS = {
    "fin": Fin(**FOIL, normal=(0.0, 0.0, 1.0), drag=0.02, limit=0.5),
    "airfoil": Airfoil(**FOIL, chord=(1.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), drag_slope=0.1, swept=1.0, limit=0.5),
    "lifting body": LiftingBody("hull", drag=(2.0, 30.0), lift=(0.5, 80.0), pitch=(0.1, -20.0, -5.0), side=-20.0),
}


def wrench(part: Any, velocity: Any, angle: Any) -> Any:
    """(torque, force) in water of 1000 kg/m³, (6,)."""
    zero = jnp.zeros(3)
    flow = Flow(velocity, zero, jnp.asarray(1000.0), jnp.array([0.0, 0.0, 1.0]), jnp.zeros(()), jnp.zeros(()))
    found = part.force(flow, None if part.command is None else angle, Parameters(**part.parameters()))
    return jnp.concatenate([found.torque, found.force])


@pytest.mark.parametrize("part", PARTS.values(), ids=PARTS.keys())
@pytest.mark.parametrize("velocity", [(0.0, 0.0, 0.0), (0.0, 1.2, 0.0)], ids=["at rest", "along its span"])
def test_the_derivatives_of_a_foil_that_meets_no_flow_are_numbers(part, velocity):
    slopes = evaluate(jax.jacfwd(lambda v, angle: wrench(part, v, angle), (0, 1)), np.array(velocity), np.array(0.1))
    back = evaluate(jax.jacrev(lambda v, angle: wrench(part, v, angle), (0, 1)), np.array(velocity), np.array(0.1))
    for one, other in zip(slopes, back, strict=True):
        assert np.all(np.isfinite(one)) and np.allclose(one, other)


@pytest.mark.parametrize("part", PARTS.values(), ids=PARTS.keys())
def test_the_force_of_a_foil_is_none_at_rest_and_goes_with_the_square_of_the_speed(part):
    v = np.array([0.9, 0.1, 0.2])
    for scale in (0.0, 1e-3):
        found = evaluate(lambda v: wrench(part, v, jnp.zeros(())), scale * v)
        assert found == pytest.approx(scale**2 * evaluate(lambda v: wrench(part, v, jnp.zeros(())), v), rel=1e-12)
