"""The quickest turn of a wheel in closed loop, pushed after 1 s: angle and speed, torque, and the planned arrival.

Run as: python docs/figures/quickest_turn.py; it writes docs/figures/quickest_turn.png.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co

DT, ANGLE, MOST, SHORTEST = 0.1, 1.0, 1.0, 0.15
PUSH = 0.5  # N m s, about the axis of the turn, at 1 s


def turned() -> dict[str, np.ndarray]:
    """t, angle (rad), torque (N m) and planned arrival (s) at each period."""
    wheel = co.System(
        co.SO2(), lambda xi: 1.5 * xi @ xi, forces=lambda motion: co.Force(torque=motion.inputs.torque), name="wheel"
    )
    goal = np.array([[np.cos(ANGLE), -np.sin(ANGLE)], [np.sin(ANGLE), np.cos(ANGLE)]])
    controller = co.control.Problem(
        wheel,
        wheel.state(),
        dt=DT,
        steps=20,
        inputs={"torque": co.control.Input((1,), lower=-MOST, upper=MOST)},
        cost=lambda motion: 1.0 + 0.0 * motion.t,
        end=co.control.End(g=goal, xi=[0.0], soft=co.control.Penalty(linear=100.0)),
        free_duration=(SHORTEST, 10.0),
    ).controller()
    stepper = co.Stepper(wheel, wheel.state(), dt=DT, inputs={"torque": np.zeros(1)})
    rows: list[tuple[float, ...]] = []
    for k in range(60):
        now = stepper.state
        if k == 10:
            now = now.replace(mu=np.asarray(now.mu) + PUSH)
            stepper = co.Stepper(wheel, now, dt=DT, inputs={"torque": np.zeros(1)})
        answer = controller(now)
        g, t = np.asarray(now.g), float(now.t)
        rows.append((t, np.arctan2(g[1, 0], g[0, 0]), answer.command["torque"][0], t + answer.duration))
        if answer.duration <= SHORTEST + 1e-6:
            break
        stepper.step(answer.command)
    return dict(zip(("t", "angle", "torque", "arrival"), np.array(rows).T, strict=True))


def draw(found: dict[str, np.ndarray]) -> Any:
    """Three panels over time."""
    figure, panels = plt.subplots(3, 1, figsize=(6.4, 5.6), sharex=True, layout="constrained")
    t = found["t"]
    panels[0].plot(t, found["angle"])
    panels[0].axhline(ANGLE, color="0.5", lw=0.8, ls="--")
    panels[0].set_ylabel("angle (rad)")
    panels[1].step(t, found["torque"], where="post")
    for bound in (-MOST, MOST):
        panels[1].axhline(bound, color="0.5", lw=0.8, ls="--")
    panels[1].set_ylabel("torque (N m)")
    panels[2].plot(t, found["arrival"], ".-")
    panels[2].set_ylabel("planned arrival (s)")
    panels[2].set_xlabel("time t (s)")
    for panel in panels:
        panel.axvline(1.0, color="C3", lw=0.8)
    return figure


if __name__ == "__main__":
    draw(turned()).savefig(Path(__file__).with_suffix(".png"), dpi=120)
