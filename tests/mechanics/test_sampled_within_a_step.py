"""Sampled controllers whose period is shorter than a step, with delays."""

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co

DT = 0.01


def clock(period, delay):
    """A mass whose controller commands the time of its sample."""

    def rule(motion, h, p):
        held = motion.internal.clock
        return {
            "clock": co.mechanics.sampled(
                motion, h, held, lambda last: {"time": motion.t}, period=p.period, delay=p.delay
            )
        }

    body = co.System(
        co.Translation(1),
        lambda xi, p: 0.5 * xi @ xi,
        parameters={"period": period, "delay": delay},
        forces=lambda motion, p: co.Force(torque=0.0 * jnp.ones(1) * motion.internal.clock.value.time),
        internal=rule,
    )
    return body, body.state(xi=[0.0], internal={"clock": co.mechanics.sampling({"time": -1.0})})


@pytest.mark.cases(1)
@pytest.mark.parametrize(("period", "delay"), [(0.004, 0.0), (0.004, 0.003), (0.007, 0.0065), (0.0049, 0.0049)])
def test_every_node_samples_and_a_sample_is_in_force_at_the_node_nearest_to_its_release(period, delay):
    body, start = clock(period, delay)
    made = co.simulate(body, start, dt=DT, steps=200, backend="native", monitors=False).dataset
    value, t = made.internal_clock_value_time.values, made.time.values
    late = 0
    for n in range(2, 200):
        now = t[n] + 0.5 * DT
        multiple = np.floor(now / period * (1 + 1e-12)) * period
        if min(abs(now - multiple - delay), now - multiple, multiple + period - now) < 1e-9:
            continue  # round-off decides
        # A sample whose time of release has not come leaves the one before in force, from the node before.
        released = multiple + delay <= now
        late += not released
        assert value[n] == pytest.approx(t[n] if released else t[n - 1], abs=1e-12), n
    assert (late > 0) == (delay > 0)


@pytest.mark.parametrize(
    ("result", "says"),
    [
        ({"torque": 1.0}, r"must return torque, error, but returned \['torque'\]"),
        (2.0, "a dictionary, but returned float"),
    ],
)
def test_an_update_of_other_names_than_the_start_has_is_said(result, says):
    held = co.mechanics.sampling({"torque": 0.0, "error": 1.0})
    system = co.System(
        co.SO2(),
        lambda xi: 0.5 * xi @ xi,
        internal=lambda motion, h: co.mechanics.sampled(
            motion, h, motion.internal, lambda last: result, period=0.1, delay=0.0
        ),
    )
    with pytest.raises(co.errors.CoadjointError, match=says):
        co.simulate(system, system.state(internal=held), dt=0.1, steps=1, progress=False)
