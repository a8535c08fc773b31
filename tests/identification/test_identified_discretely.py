"""Parameters of systems that have only a discrete Lagrangian."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import coadjoint as co
from coadjoint.identification import Log, identify

INERTIA = np.array([1.0, 2.0, 3.0])
H = 0.05
METHOD = co.Variational(co.Cayley(), start="velocity")
BODY = co.System(
    co.SO3(), discrete_lagrangian=lambda xi, p, h: 0.5 * h * xi @ (INERTIA * xi), parameters=co.Parameters(drag=0.3),
    forces=lambda motion, p: co.Force(torque=-p.drag * motion.xi),
)  # fmt: skip
SEEN = {"a": lambda s: s.g[0, 0], "b": lambda s: s.g[1, 0], "c": lambda s: s.g[2, 1]}


@cache
def logged() -> tuple[co.Run, Log]:
    """A run of 4 s from ξ of its first step, with three entries of g."""
    run = co.simulate(BODY, BODY.state(xi=[0.3, 0.2, -0.5]), dt=H, duration=4.0, method=METHOD, monitors=False)
    g = run.dataset.R.values
    return run, Log(run.dataset.time.values, {"a": g[:, 0, 0], "b": g[:, 1, 0], "c": g[:, 2, 1]}, {})


@pytest.mark.long
@pytest.mark.parametrize(("segment", "momenta"), [(None, True), (2.0, False)])
def test_drag_is_found_without_a_continuous_lagrangian(segment: float | None, momenta: bool):
    run, log = logged()
    guess, first = BODY.replace(drag=0.2), run.records
    start = guess.state(mu=first.mu[0]) if momenta else guess.state(xi=[0.3, 0.2, -0.5])
    found = identify(guess, log, start=start, parameters=["drag"], measured=SEEN, method=METHOD, dt=H, segment=segment)
    assert found["drag"].value == pytest.approx(0.3, rel=1e-6)
    assert found["drag"].standard_error < 1e-4


def test_a_measured_rate_is_that_of_the_step_that_led_to_the_node():
    run, log = logged()
    rates = np.asarray(run.records.xi)[:, 2]
    seen = Log(log.time, {"r": np.concatenate([rates[:1], rates[:-1]])}, {})
    options = {"measured": {"r": lambda s: s.xi[2]}, "method": METHOD, "dt": H, "segment": None}
    start = BODY.state(xi=[0.3, 0.2, -0.5])
    found = identify(BODY.replace(drag=0.2), seen, start=start, parameters=["drag"], **options)
    assert found["drag"].value == pytest.approx(0.3, rel=1e-5)
