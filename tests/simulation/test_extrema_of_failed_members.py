"""Extrema are those of good steps alone, of members that failed as well."""

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co

TORQUES = [0.0, 40.0, 5.0, 80.0, 1.0, 0.5, 60.0, 0.1, 50.0]
"""N m about the axis of a top, of nine members: those of 40 and more leave the chart before the end."""


def spun_up():
    body = co.System(
        co.SO3(),
        lambda xi, a, p: 0.5 * xi @ p.inertia @ xi - 20.0 * a[2],
        advected=co.Defining(),
        parameters={"inertia": np.diag([5.0, 5.0, 1.0]), "torque": co.each(np.array(TORQUES))},
        forces=lambda motion, p: co.Force(torque=jnp.array([0.0, 0.0, 1.0]) * p.torque),
    )
    return body, body.state(g=co.attitude.zyx(0, 0, 0.3), xi=[0, 0, 20], a0=[0, 0, 1])


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("backend", ["native", "xla"])
@pytest.mark.parametrize("patience", [0.0, 1e9], ids=["step by step", "at once"])
def test_extrema_of_members_are_over_their_good_steps(monkeypatch, backend, patience):
    monkeypatch.setattr("coadjoint.simulation.driver.PATIENCE", patience)
    system, start = spun_up()
    run: Any = co.simulate(system, start, dt=0.1, steps=60, backend=backend, progress=False)
    # XLA may compute a monitor twice, for its row and for the extremum, and contract its sums differently.
    rounding = {"native": 0.0, "xla": 4 * np.finfo(float).eps}[backend]
    failed = [i for i, torque in enumerate(TORQUES) if torque >= 40.0]
    assert sorted(run.failures) == failed and np.all(run.steps_done[failed] > 2)
    for name in ("energy", "kelvin_noether", "newton_residual"):
        low, high = run.extrema[name]
        if name not in run.monitors:
            assert np.all(np.abs(high) < 1e-9), "residuals of steps that failed are none"
            continue
        for member, done in enumerate(run.steps_done):
            rows = run.monitors[name][member, : done + (0 if member in failed else 1)]
            np.testing.assert_allclose(low[member], rows.min(axis=0), rtol=rounding)
            np.testing.assert_allclose(high[member], rows.max(axis=0), rtol=rounding)
