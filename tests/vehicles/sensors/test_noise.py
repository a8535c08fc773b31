"""The errors of simulated readings are those of the data sheet, within the intervals of their samples."""

import numpy as np
import pytest
from scipy.stats import chi2

from coadjoint.errors import ArgumentError
from coadjoint_vehicles.sensors import Ahrs, Altimeter, Compass, Depth, Dvl, DvlBeams, Errors, Gps, Imu, Usbl
from coadjoint_vehicles.sensors.allan import allan_deviation, expected_allan_deviation
from coadjoint_vehicles.sensors.errors import ALLAN_PEAK
from coadjoint_vehicles.sensors.noise import Noise

SURE = 1e-4
"""How often a right sample would be outside of its interval."""


def require_variance(sample, expected, freedom):
    """Raise AssertionError unless a variance of `freedom` degrees of freedom is in the χ² interval of the expected."""
    low, high = chi2.ppf([SURE / 2, 1 - SURE / 2], freedom) / freedom
    assert np.all((low < sample / expected) & (sample / expected < high)), (sample / expected, low, high)


def white_freedom(count, n):
    """The degrees of freedom of an overlapping Allan variance of white noise (Greenhall and Riley 2003)."""
    return (3 * (count - 1) / (2 * n) - 2 * (count - 2) / count) * 4 * n**2 / (4 * n**2 + 5)


def test_the_allan_deviation_of_an_imu_at_rest_is_that_of_its_noise_densities():
    rate, count = 100.0, 40_000
    imu = Imu(name="imu", rate=rate, gyroscope=Errors(noise_density=1e-3), accelerometer=Errors(noise_density=2e-2))
    read = Noise(imu, 1).read(np.tile([0, 0, 0, 0, 0, -9.81], (count, 1))).values
    times = np.array([0.01, 0.1, 1.0, 10.0])
    found = allan_deviation(read, rate, times)
    np.testing.assert_allclose(
        expected_allan_deviation(imu.gyroscope, imu.channels[0], rate, times)[:, 0], 1e-3 / np.sqrt(times)
    )
    for row, tau in zip(found, times, strict=True):
        density = np.array([1e-3] * 3 + [2e-2] * 3)
        require_variance(row**2, density**2 / tau, white_freedom(count, round(tau * rate)))


@pytest.mark.cases(2)
@pytest.mark.parametrize(
    "errors, times",
    [
        (Errors(bias_instability=3e-5, bias_time=2.0), [0.5, 3.8, 20.0]),
        (Errors(random_walk=1e-4), [0.5, 2.0, 10.0]),
        (Errors(noise_density=1e-4, bias_instability=3e-4, bias_time=2.0, random_walk=1e-4), [0.5, 1.0, 3.8, 10.0]),
    ],
    ids=["bias", "walk", "all"],
)
def test_biases_and_walks_have_the_allan_deviation_of_their_law(errors, times):
    rate, members = 20.0, 100
    imu = Imu(name="imu", rate=rate, gyroscope=errors)
    exact = np.zeros((1600, 6))
    squares = np.array(
        [allan_deviation(Noise(imu, k).read(exact).values[:, :3], rate, times) ** 2 for k in range(members)]
    )
    squares = squares.transpose(1, 0, 2).reshape(len(times), -1)  # 300 independent series
    error = squares.std(axis=1) / np.sqrt(squares.shape[1])
    expected = expected_allan_deviation(errors, imu.channels[0], rate, times)[:, 0] ** 2
    # Of readings Δ apart, not of a continuous bias: of a random walk σ² is (1 + ½(Δ/τ)²) of the law.
    assert np.all(np.abs(squares.mean(axis=1) - expected) < 4 * error + 0.005 * expected)


def test_the_bias_instability_of_a_data_sheet_is_the_highest_point_of_its_allan_deviation():
    errors = Errors(bias_instability=2.0, bias_time=100.0)
    times = np.linspace(50, 500, 4501)
    found = expected_allan_deviation(errors, Depth.channels[0], 1.0, times)[:, 0]
    assert np.max(found) == pytest.approx(2.0, rel=1e-5)
    assert times[np.argmax(found)] == pytest.approx(189, abs=1)
    assert errors.wandering(1)[0] == 2.0 / ALLAN_PEAK


EVERY = [
    Imu(name="imu", rate=50, gyroscope=Errors(noise=[1e-3, 2e-3, 3e-3]), accelerometer=Errors(noise_density=0.01)),
    Depth(name="depth", rate=10, depth=Errors(noise=0.02)),
    Compass(name="compass", rate=10, heading=Errors(noise=0.03)),
    Ahrs(name="ahrs", rate=10, tilt=Errors(noise=[0.01, 0.02]), heading=Errors(noise=0.03)),
    Dvl(name="dvl", rate=5, velocity=Errors(noise=0.01)),
    DvlBeams(name="beams", rate=5, beam_angle=0.4, velocity=Errors(noise=0.02)),
    Gps(name="gps", rate=1, fix=Errors(noise=[2.5, 3.5])),
    Usbl(name="usbl", rate=0.2, beacon=(0, 0, 10), range=Errors(noise=0.3), direction=Errors(noise=0.02)),
    Altimeter(name="altimeter", rate=5, range=Errors(noise=0.05)),
]


@pytest.mark.parametrize("sensor", EVERY, ids=lambda sensor: sensor.kind)
def test_the_noise_of_a_reading_is_that_of_the_data_sheet_and_the_covariance_says_so(sensor):
    count = 20_000
    read = Noise(sensor, 3).read(np.zeros((count, sensor.size))).values
    require_variance(read.var(axis=0, ddof=1), np.diag(sensor.covariance), count - 1)
    correlation = np.corrcoef(read.T) - np.eye(sensor.size) if sensor.size > 1 else np.zeros(1)
    assert np.max(np.abs(correlation)) < 5 / np.sqrt(count)


def test_what_is_drawn_once_has_the_deviations_of_the_data_sheet():
    errors = Errors(turn_on_bias=0.2, scale=0.01, misalignment=0.002)
    dvl, members = Dvl(name="dvl", rate=1, velocity=errors), 500
    still, ahead = np.zeros((1, 3)), np.array([[100.0, 0, 0]])
    pairs = []
    for seed in range(members):
        noise = Noise(dvl, seed)
        pairs.append(noise.read(np.concatenate([still, ahead])).values)
    at_rest, moving = np.array(pairs).transpose(1, 0, 2)
    require_variance(at_rest.var(axis=0), 0.04, members - 1)
    gained = (moving - at_rest) / 100
    require_variance(gained[:, 0].var(), 1e-4, members - 1)  # 1 + s
    require_variance(gained[:, 1:].var(axis=0), 0.002**2, members - 1)  # turned to the side and down


def test_dropouts_and_outliers_come_as_often_as_they_should_and_are_as_large():
    count, share = 40_000, 0.05
    depth = Depth(name="depth", rate=10, dropout=share, outliers=0.02, depth=Errors(noise=0.01, outlier=3.0))
    drawn = Noise(depth, 5).read(np.full((count, 1), 10.0))
    assert abs(np.mean(drawn.lost) - share) < 4 * np.sqrt(share * (1 - share) / count)
    plain = Depth(name="depth", rate=10, depth=Errors(noise=0.01))
    same = Noise(plain, 5).read(np.full((count, 1), 10.0))
    added = (drawn.values - same.values)[:, 0]
    wild = added != 0
    assert abs(np.mean(wild) - 0.02) < 4 * np.sqrt(0.02 / count) and not same.lost.any()
    require_variance(added[wild].var(), 9.0, int(np.sum(wild)) - 1)


def test_readings_are_rounded_to_the_resolution_and_headings_stay_headings():
    depth = Depth(name="depth", rate=10, depth=Errors(noise=0.5, resolution=0.25))
    read = Noise(depth, 1).read(np.zeros((1000, 1))).values
    assert np.array_equal(read, 0.25 * np.round(read / 0.25)) and len(np.unique(read)) > 5
    compass = Compass(name="compass", rate=10, heading=Errors(noise=0.2))
    heading = Noise(compass, 1).read(np.full((1000, 1), np.pi - 0.01)).values
    assert np.all((heading >= -np.pi) & (heading < np.pi)) and np.any(heading < 0)


def test_readings_are_the_same_to_the_bit_however_many_are_taken_at_once():
    errors = Errors(
        noise_density=1e-3, turn_on_bias=0.1, bias_instability=1e-3, bias_time=3.0, random_walk=1e-3, scale=0.1,
        misalignment=0.1, outlier=1.0,
    )  # fmt: skip
    imu = Imu(name="imu", rate=100, dropout=0.1, outliers=0.1, gyroscope=errors, accelerometer=errors)
    exact = np.random.default_rng(0).normal(size=(700, 6))
    whole, noise = Noise(imu, 9).read(exact), Noise(imu, 9)
    pieces = [noise.read(exact[a:b]) for a, b in [(0, 1), (1, 1), (1, 300), (300, 301), (301, 700)]]
    assert np.array_equal(np.concatenate([piece.values for piece in pieces]), whole.values)
    assert np.array_equal(np.concatenate([piece.lost for piece in pieces]), whole.lost)


def test_sensors_have_numbers_of_their_own_by_name_and_by_seed():
    def drawn(name, seed):
        return Noise(Depth(name=name, rate=1, depth=Errors(noise=1.0)), seed).read(np.zeros((4000, 1))).values[:, 0]

    first = drawn("depth", 1)
    assert np.array_equal(first, drawn("depth", 1))
    for other in (drawn("depth", 2), drawn("deep", 1)):
        assert abs(np.corrcoef(first, other)[0, 1]) < 5 / np.sqrt(4000)
    for seed in (-1, 1.5, True, "one"):
        with pytest.raises(ArgumentError, match="`seed` must be a whole number from 0"):
            drawn("depth", seed)


def test_an_allan_deviation_needs_readings_enough():
    with pytest.raises(ArgumentError, match="at 6 s needs more than 12 s of readings, but there are 10 s"):
        allan_deviation(np.zeros(100), 10.0, [1.0, 6.0])


@pytest.mark.parametrize(
    ("rate", "times", "sentence"),
    [
        (10.0, [0.01], "begins at 0.1 s, but is asked at 0.01 s"),
        (10.0, [-1.0], "must be positive numbers"),
        (10.0, [np.nan], "must be positive numbers"),
        (0.0, [1.0], "rate of readings must be a positive"),
    ],
)
def test_an_allan_deviation_at_a_time_that_readings_do_not_have_is_refused(rate, times, sentence):
    with pytest.raises(ArgumentError, match=sentence):
        allan_deviation(np.zeros(100), rate, times)
    with pytest.raises(ArgumentError, match="finite readings"):
        allan_deviation([np.nan, 1.0], 1.0, [1.0])


@pytest.mark.parametrize(
    ("exact", "told"),
    [
        ([[1.0], [np.nan]], r"finite readings of `depth`, but number 2 of 2 is \[nan\]: give 0 in place"),
        ([[-np.inf]], r"number 1 of 1 is \[-inf\]"),
        ([[None]], r"number 1 of 1 is \[nan\]"),
        ([["deep"]], "must be readings as numbers, but is"),
        ([1.0], r"readings of depth, \(k, 1\), but has the shape \(1,\)"),
    ],
)
def test_what_is_no_reading_is_told(exact, told):
    noise = Noise(Depth(name="depth", rate=1, depth=Errors(noise=0.1)), 1)
    with pytest.raises(ArgumentError, match=told):
        noise.read(exact)
    assert noise.count == 0 and noise.read(np.zeros((0, 1))).values.shape == (0, 1)
