"""The PID law with its limits: what it commands, and when its integral stops."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint_vehicles.controllers.pid import nearest_turn, pid, pull

GAINS, PERIOD = (2.0, 0.5, 0.25), 0.1


def law(error: float, rate: float = 0.0, integral: float = 0.0, **more: Any) -> tuple[float, float]:
    command, following = evaluate(lambda *given: pid(GAINS, *given, PERIOD, 3.0, **more), error, rate, integral)
    return float(command), float(following)


def test_within_its_limits_the_command_is_the_sum_of_its_terms_with_the_new_integral():
    for error, rate, integral, base in ((0.3, 0.2, 1.0, 0.1), (-0.3, -0.4, 0.5, 0.0)):
        following = integral + PERIOD * error
        expected = base + 2.0 * error + 0.5 * following - 0.25 * rate
        assert law(error, rate, integral, base=base) == pytest.approx((expected, following), rel=1e-14)


@pytest.mark.parametrize(
    ("error", "integral", "stops"),
    [
        (1.4, 1.0, True), (1.2, 1.0, False), (-1.4, -1.0, True), (-1.2, -1.0, False),
        (-0.1, 9.0, False), (0.1, -9.0, False), (0.1, 9.0, True), (-0.1, -9.0, True),
    ],
)  # fmt: skip
def test_the_integral_stops_beyond_a_limit_where_the_error_drives_it_further(error, integral, stops):
    command, following = law(error, 0.0, integral)
    assert following == pytest.approx(integral if stops else integral + PERIOD * error, rel=1e-14)
    assert command == pytest.approx(np.clip(2.0 * error + 0.5 * following, -3.0, 3.0))


def test_the_rate_and_what_is_known_beforehand_count_for_the_limits():
    assert law(1.4, rate=4.0, integral=1.0)[1] == pytest.approx(1.14) and law(1.2, base=0.2, integral=1.0)[1] == 1.0
    assert law(-0.1, low=0.0) == (0.0, 0.0) and law(-0.1, low=-1.0)[1] == pytest.approx(-0.01)


def test_an_angle_is_turned_into_half_a_turn():
    turned = evaluate(nearest_turn, np.array([3.5, -3.5, 7.0]))
    assert turned == pytest.approx([3.5 - 2 * np.pi, 2 * np.pi - 3.5, 7.0 - 2 * np.pi])


def test_the_propulsion_follows_the_speed_ahead_only():
    own = SimpleNamespace(speed_gains=GAINS, period=PERIOD, thrust_limit=3.0, feed_forward=1.5)

    def command(wanted: float, speed: float) -> float:
        def pulled(wanted, velocity):
            return pull(SimpleNamespace(inputs=SimpleNamespace(speed=wanted), velocity=velocity), 0.0, own)[0]

        return float(evaluate(pulled, wanted, np.array([speed, 9.0, 9.0])))

    assert command(1.0, 0.8) == pytest.approx(1.5 + 2 * 0.2 + 0.5 * 0.02) and command(0.2, 1.5) == 0.0
    assert command(2.0, 1.0) == 3.0
