"""What an identification prints and draws, and the differences of rotations that it fits, with their derivatives."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from coadjoint.errors import ArgumentError
from coadjoint.groups import attitude
from coadjoint.identification import rotations
from coadjoint.identification.equalities import SIGN
from coadjoint.identification.figures import autocorrelation_and_histogram, measured_and_simulated
from coadjoint.identification.log import Log
from coadjoint.identification.process_noise_estimate import ProcessNoise
from coadjoint.identification.result import Identification, summary_table
from coadjoint.identification.smoothing import poses
from coadjoint.identification.unknowns import Estimate

TIME = np.arange(5.0)


def log(**columns):
    units = {name: "rad" if name == "heading" else "rad/s" if name == "spin" else "m/s" for name in columns}
    return Log(TIME, columns, {}, units)


FOUND: dict[str, Any] = {
    "system": SimpleNamespace(name="boat"), "log": log(u=np.zeros(5), spin=np.zeros(5)), "level": 0.9,
    "simulated": {"u": None, "spin": None}, "segments": 3, "dt": 0.25, "iterations": 7,
    "estimates": {"mass": Estimate("mass", 2.0, 1.5, 2.5, 0.25, 1.0)},
    "noise": {"u": 0.125, "spin": np.radians(2.0)}, "assumed": ("u",), "whiteness": {"u": 0.25, "spin": -0.5},
    "correlation_times": {"spin": 1.5},
    "process_noise": {
        "push": ProcessNoise(3.0, 20.0, np.zeros(5), np.zeros(5), (2.0, 4.5), (10.0, 40.0), "N"),
    },
    "warnings": ("the log is short",),
}  # fmt: skip


def rows(**changes) -> list[str]:
    """The lines of a summary, with one blank between words."""
    return [" ".join(line.split()) for line in summary_table(cast(Any, SimpleNamespace(**FOUND | changes))).split("\n")]


def test_a_summary_has_estimates_noise_in_degrees_process_noise_and_warnings():
    assert rows() == [
        "Identification of boat",
        "log 5 samples over 4 s, 2 columns",
        "fit 3 segments, dt = 0.25 s, 7 iterations",
        "",
        "parameter estimate 90% interval before",
        "mass 2 1.5 .. 2.5 1",
        "",
        "column noise lag-one correlation",
        "u 0.125 m/s given 0.25",
        "spin 2 deg/s estimated -0.50 over 1.5 s",
        "",
        "wanders deviation 90% interval correlation time",
        "push 3 N 2 N .. 4.5 N 20 s, 10 .. 40 s",
        "",
        "! the log is short",
    ]


def test_an_estimate_is_found_by_its_name_and_by_those_of_equal_parameters():
    found: Any = SimpleNamespace(estimates={"mass": 1, f"left{SIGN}right": 2, "ballast": 3})
    names = ("mass", "left", "right", f"left{SIGN}right", "ballast")
    assert [Identification.__getitem__(found, name) for name in names] == [1, 2, 2, 2, 3]


def test_an_interval_narrower_than_five_digits_is_written_with_eight():
    near = rows(
        estimates={"mass": Estimate("mass", 2.0, 1.9999999, 2.0000001, 1e-8, 1.0)}, process_noise={}, warnings=()
    )
    assert near[5] == "mass 2 1.9999999 .. 2.0000001 1" and near[-1].startswith("spin")
    (head, first) = summary_table(cast(Any, SimpleNamespace(**FOUND))).split("\n")[4:6]
    assert head.index("parameter") == first.index("mass") == 2 and first.index("2") == 2 + 9 + 2 + 10
    long = "the mass of all that moves"
    wide = summary_table(cast(Any, SimpleNamespace(**FOUND | {"estimates": {long: FOUND["estimates"]["mass"]}})))
    assert wide.split("\n")[4].index("estimate") - first.index("mass") == len(long) + 2 + 3


def test_residuals_are_measured_less_simulated_and_angles_within_half_a_turn():
    found = SimpleNamespace(
        log=log(u=np.full(5, 3.0), heading=np.full(5, 3.0)),
        simulated={"u": np.full(5, -3.0), "heading": np.full(5, -3.0)},
    )
    residuals = cast(Any, Identification.residuals).fget(found)
    np.testing.assert_allclose(residuals["u"], 6.0)
    np.testing.assert_allclose(residuals["heading"], 6.0 - 2 * np.pi, atol=1e-14)
    assert repr(Identification.__repr__(cast(Any, SimpleNamespace(estimates={"a": 1, "b": 2})))).count("of a, b;") == 1


def test_the_simulation_of_an_angle_is_drawn_next_to_its_measurement_and_broken_where_it_wraps():
    measured, simulated = np.array([3.0, 3.1, -3.1, -3.0, -2.9]), np.array([3.05, -3.1, -3.0, -2.9, -2.8])
    figure = measured_and_simulated(log(heading=measured, u=measured), {"heading": simulated, "u": simulated})
    first, second = figure.axes
    dots, line = first.lines
    np.testing.assert_allclose(dots.get_ydata(), np.degrees(measured))
    near = np.array([3.05, np.nan, -3.0, -2.9, -2.8])  # −3.1 + 2π is next to 3.1, and then the line wraps
    np.testing.assert_allclose(line.get_ydata(), np.degrees(near))
    np.testing.assert_allclose(second.lines[1].get_ydata(), simulated)
    assert [axes.get_ylabel() for axes in figure.axes] == ["heading (°)", "u (m/s)"]


def test_innovations_are_drawn_with_their_autocorrelation_band_and_normal_density():
    w = np.array([1.0, -1.0, np.nan, 1.0, -1.0, 9.0, -9.0, 1.0])
    figure = autocorrelation_and_histogram({"u": w, "v": w}, ["v"])
    left, right = figure.axes
    band = left.patches[0].get_bbox()
    assert (band.y0, band.y1) == pytest.approx((-1.96 / np.sqrt(7), 1.96 / np.sqrt(7)))
    there = w[np.isfinite(w)]
    c = np.where(np.isfinite(w), w - there.mean(), 0.0)
    pairs = np.isfinite(w[2:]) & np.isfinite(w[:-2])
    second = left.collections[0].get_segments()[1]
    expected = np.sum(c[2:] * c[:-2]) / pairs.sum() / (np.sum(c**2) / 7)
    np.testing.assert_allclose(second, [[2, 0], [2, expected]])
    assert len(left.collections[0].get_segments()) == 7 and left.get_ylabel() == "v"
    assert list(left.lines[0].get_ydata()) == [0, 0]
    bars = np.array([bar.get_height() for bar in right.patches])
    width = 8 / 33
    assert bars.size == 33 and np.sum(bars) * width == pytest.approx(1.0)
    assert bars[[0, -1]] * width == pytest.approx([1 / 7, 1 / 7])  # what is beyond 4 is in the last bars
    (density,) = right.lines
    x, y = density.get_data()
    assert (x[0], x[-1], len(x)) == (-4, 4, 161)
    np.testing.assert_allclose(y, np.exp(-0.5 * x**2) / np.sqrt(2 * np.pi))
    assert [axes.get_xlabel() for axes in figure.axes] == ["lag (samples)", "innovation over noise"]
    assert left.get_title().startswith("autocorrelation") and right.get_title().startswith("histogram")
    with pytest.raises(ArgumentError):
        autocorrelation_and_histogram({"u": w}, ["v"])


def test_a_measured_attitude_is_that_of_its_euler_angles_and_differs_by_the_bias():
    roll, pitch, heading = np.array([[0.1, -0.3]]), np.array([[0.4, 0.2]]), np.array([[-2.0, 3.0]])
    R = rotations.measured(roll, pitch, heading)
    angles = np.stack([heading, pitch, roll], axis=-1).reshape(-1, 3)
    np.testing.assert_allclose(R.reshape(-1, 3, 3), Rotation.from_euler("ZYX", angles).as_matrix(), atol=1e-15)
    bias, turn = np.array([0.1, -0.2, 0.3]), np.array([0.5, 0.4, -0.1])
    simulated = R @ rotations.exponential(turn)
    expected = (Rotation.from_rotvec(turn) * Rotation.from_rotvec(bias)).as_rotvec()
    np.testing.assert_allclose(rotations.difference(R, simulated, bias)[0], [expected, expected], atol=1e-14)


def test_differences_of_rotations_change_as_their_slopes_say():
    """δ of R exp(x ω) and of b + x e, against central differences."""
    random, step = np.random.default_rng(4), 1e-5
    measured, simulated = (Rotation.random(6, random_state=k).as_matrix().reshape(2, 3, 3, 3) for k in (1, 2))
    omega, bias = random.normal(size=(2, 3, 4, 3)), np.array([0.3, -0.2, 0.4])
    off = rotations.difference(measured, simulated, bias)
    along = (simulated[:, :, None] @ rotations.hat(omega)).reshape(2, 3, 4, 9)
    found = rotations.slopes(off, simulated, along, bias)
    for column in range(4):
        ends = [
            rotations.difference(
                measured,
                simulated
                @ Rotation.from_rotvec(s * step * omega[:, :, column].reshape(-1, 3)).as_matrix().reshape(2, 3, 3, 3),
                bias,
            )
            for s in (1, -1)
        ]
        np.testing.assert_allclose(found[:, :, column], (ends[0] - ends[1]) / (2 * step), atol=1e-7)
    by_bias = rotations.slopes_of_bias(off, bias)
    for i, e in enumerate(np.eye(3) * step):
        ends = [rotations.difference(measured, simulated, bias + s * e) for s in (1, -1)]
        np.testing.assert_allclose(by_bias[:, :, i], (ends[0] - ends[1]) / (2 * step), atol=1e-7)


@pytest.mark.parametrize("known", [("roll", "pitch", "heading"), ("heading",), ()])
def test_poses_of_a_log_turn_by_the_angles_that_it_has_and_by_zero_else(known):
    """At constant angles: R = Rz(heading) Ry(pitch) Rx(roll), ω = 0, and v that of the log."""
    angles = {"roll": 0.1, "pitch": -0.2, "heading": 0.3}
    columns = {name: np.full(5, angles[name]) for name in known} | {"u": 1 + TIME, "v": 0 * TIME, "w": -TIME}
    units = {name: "rad" if name in angles else "m/s" for name in columns}
    found = poses(Log(TIME, columns, {}, units), np.array([1.0, 2.5]))
    of = [angles[name] if name in known else 0.0 for name in ("heading", "pitch", "roll")]
    np.testing.assert_allclose(found[0], np.broadcast_to(attitude.zyx(*of), (2, 3, 3)), atol=1e-12)
    np.testing.assert_allclose(found[2], 0.0, atol=1e-12)
    np.testing.assert_allclose(found[3], [[2.0, 0.0, -1.0], [3.5, 0.0, -2.5]], atol=1e-12)
