"""What sensors read of a motion without errors, in closed form."""

from typing import Any

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.groups import attitude
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint_vehicles.sensors import (
    Ahrs,
    Altimeter,
    Compass,
    Depth,
    Dvl,
    DvlBeams,
    Errors,
    Gps,
    Imu,
    Kinematics,
    Noise,
    Usbl,
    at_node,
)

G = 9.81
ANYTHING: Any = 3.0


def moving(yaw=0.4, pitch=-0.2, roll=0.3, **more):
    """A vehicle at (3, −2, 8) m with an attitude, in motion."""
    of = {"velocity": np.array([1.2, -0.3, 0.2]), "omega": np.array([0.1, -0.2, 0.3]), "gravity": G, "bottom": 30.0}
    return Kinematics(np.array([3.0, -2.0, 8.0]), attitude.zyx(yaw, pitch, roll), **{**of, **more})


def test_an_imu_on_a_circling_vehicle_reads_the_centripetal_acceleration_at_its_own_place():
    # A turn to starboard of radius R at the yaw rate w: Rᵀq̈ = w × ν, and at r ahead of O also −w² r.
    w, radius, r = 0.2, 10.0, np.array([0.5, 0.1, -0.05])
    ahead = w * radius
    motion = moving(
        pitch=0.0, roll=0.0, velocity=np.array([ahead, 0, 0]), omega=np.array([0, 0, w]),
        acceleration=np.array([0, w * ahead, 0]), angular_acceleration=np.zeros(3),
    )  # fmt: skip
    imu = Imu(name="imu", rate=100, position=r)
    expected = [0, 0, w, -(w**2) * r[0], w * ahead - w**2 * r[1], -G]
    np.testing.assert_allclose(imu.measured(motion), expected, rtol=0, atol=1e-14)


def test_an_imu_that_is_mounted_turned_reads_in_its_own_axes():
    motion = moving(acceleration=np.array([0.1, 0.2, 0.3]), angular_acceleration=np.array([0.3, 0.1, -0.2]))
    angles = (0.5, -0.3, 1.1)
    level = Imu(name="imu", rate=100, position=(0.2, 0, 0.1)).measured(motion)
    turned = Imu(name="imu", rate=100, position=(0.2, 0, 0.1), euler_zyx=angles).measured(motion)
    M = attitude.zyx(*angles)
    np.testing.assert_allclose(turned, np.concatenate([M.T @ level[:3], M.T @ level[3:]]), atol=1e-14)


def test_a_tilted_dvl_reads_the_velocity_of_its_place_in_its_own_axes_over_ground_and_through_water():
    motion = moving(current=np.array([0.3, 0.1, 0.0]))
    angles, r = (np.pi / 4, 0.1, 0.0), np.array([0.5, 0.0, 0.2])
    M, v = attitude.zyx(*angles), motion.velocity + np.cross(motion.omega, r)
    dvl = Dvl(name="dvl", rate=5, position=r, euler_zyx=angles)
    np.testing.assert_allclose(dvl.measured(motion), M.T @ v, atol=1e-14)
    water = Dvl(name="dvl", rate=5, position=r, euler_zyx=angles, track="water")
    np.testing.assert_allclose(water.measured(motion), M.T @ (v - motion.rotation.T @ motion.current), atol=1e-14)


def test_the_beams_of_a_dvl_are_a_velocity_that_can_be_solved_for():
    motion = moving()
    beams = DvlBeams(name="dvl", rate=5, beam_angle=np.radians(30), azimuth=np.radians(45))
    read = beams.measured(motion)
    assert read.shape == (4,) and beams.names == ("beam_1", "beam_2", "beam_3", "beam_4")
    found = np.linalg.lstsq(np.asarray(beams.beams()), read, rcond=None)[0]
    np.testing.assert_allclose(found, motion.velocity, atol=1e-14)
    # Opposite beams: the sum is the velocity along z alone, and a speed ahead reads sin α cos 45° in the first.
    assert read[0] + read[2] == pytest.approx(2 * np.cos(np.radians(30)) * motion.velocity[2])
    ahead = beams.measured(moving(velocity=np.array([1.0, 0, 0]), omega=np.zeros(3)))
    assert ahead[0] == pytest.approx(0.5 * np.sqrt(0.5)) and ahead[1] == pytest.approx(-0.5 * np.sqrt(0.5))


@pytest.mark.parametrize("altitude, tilt, locked", [(1, 0, True), (0.2, 0, False), (60, 0, False), (1, 0.5, False)])
def test_bottom_lock_is_lost_by_altitude_and_by_tilt(altitude, tilt, locked):
    dvl = Dvl(name="dvl", rate=5, lowest=0.3, highest=50, largest_tilt=np.radians(25))
    motion = moving(pitch=0.0, roll=tilt, bottom=8.0 + altitude)
    assert bool(dvl.available(motion)) is locked
    assert bool(dvl.available(motion._replace(bottom=None))) is (tilt == 0)


def test_depth_is_that_of_its_place_and_of_the_pressure_in_the_density_that_it_was_set_to():
    motion, r = moving(), np.array([0.7, 0.1, -0.2])
    z = 8.0 + (motion.rotation @ r)[2]
    assert Depth(name="depth", rate=10, position=r).measured(motion)[0] == pytest.approx(z, abs=1e-14)
    salty = motion._replace(head=8.0 * 1027, density=1027.0)
    set_to_fresh = Depth(name="depth", rate=10, position=r, density=1000).measured(salty)[0]
    assert set_to_fresh == pytest.approx(1.027 * z)
    shallow = Depth(name="depth", rate=10, limit=5)
    assert not shallow.available(motion) and shallow.available(motion._replace(position=np.zeros(3)))


def test_headings_and_attitudes_are_those_of_the_mounted_axes():
    motion = moving()
    compass = Compass(name="compass", rate=10, declination=np.radians(3))
    assert compass.measured(motion)[0] == pytest.approx(0.4 - np.radians(3))
    backwards = Compass(name="compass", rate=10, euler_zyx=(np.pi, 0, 0))
    assert backwards.measured(moving(pitch=0.0, roll=0.0))[0] == pytest.approx(0.4 - np.pi)
    np.testing.assert_allclose(Ahrs(name="ahrs", rate=50).measured(motion), [0.3, -0.2, 0.4], atol=1e-14)


def test_satellites_are_seen_from_the_surface_alone():
    gps = Gps(name="gps", rate=1, position=(0, 0, -0.15))
    at_surface = moving(pitch=0.0, roll=0.0)._replace(position=np.array([3.0, -2.0, 0.1]))
    assert gps.available(at_surface) and not gps.available(moving())
    np.testing.assert_allclose(gps.measured(at_surface), [3, -2])


def test_range_and_bearing_of_a_known_pose():
    at = Kinematics(np.array([10.0, 0.0, 0.0]), attitude.zyx(np.pi / 2, 0, 0))  # heads east
    usbl = Usbl(name="usbl", rate=0.5, beacon=(13.0, 4.0, 12.0), farthest=100)
    # From the vehicle the beacon is 3 m to port (north), 4 m ahead (east) and 12 m below.
    np.testing.assert_allclose(usbl.measured(at), [13, np.arctan2(-3, 4), -np.arctan2(12, 5)], atol=1e-14)
    ship = Usbl(name="usbl", rate=0.5, beacon=(13.0, 4.0, 12.0), seen_from="beacon")
    np.testing.assert_allclose(ship.measured(at), [13, np.arctan2(-4, -3), np.arctan2(12, 5)], atol=1e-14)
    assert usbl.available(at) and not usbl.available(at._replace(position=np.array([200.0, 0, 0])))


def test_an_altimeter_measures_along_its_beam():
    level, tilt = moving(pitch=0.0, roll=0.0), 0.3
    assert Altimeter(name="altimeter", rate=10).measured(level)[0] == pytest.approx(22)
    rolled = moving(pitch=0.0, roll=tilt)
    assert Altimeter(name="altimeter", rate=10).measured(rolled)[0] == pytest.approx(22 / np.cos(tilt))
    righted = Altimeter(name="altimeter", rate=10, euler_zyx=(0, 0, -tilt))
    assert righted.measured(rolled)[0] == pytest.approx(22)
    assert not Altimeter(name="altimeter", rate=10, highest=20).available(level)
    assert not Altimeter(name="altimeter", rate=10).available(moving(roll=np.pi))
    with pytest.raises(ArgumentError, match="needs `bottom` of the motion"):
        Altimeter(name="altimeter", rate=10).measured(level._replace(bottom=None))


def every():
    at = {"position": (0.3, 0.1, -0.1), "euler_zyx": (0.3, 0.2, -0.1), "rate": 1.0}
    return [
        Imu(name="imu", **at), Depth(name="depth", density=1000.0, **at), Compass(name="compass", **at),
        Ahrs(name="ahrs", **at), Dvl(name="dvl", **at), DvlBeams(name="beams", beam_angle=0.5, **at),
        Gps(name="gps", **at), Usbl(name="usbl", beacon=(30.0, 20.0, 5.0), **at), Altimeter(name="altimeter", **at),
    ]  # fmt: skip


@pytest.mark.cases(1)
@pytest.mark.parametrize("sensor", every(), ids=lambda sensor: sensor.kind)
def test_readings_are_differentiated_exactly_by_the_motion_and_by_the_sensors_numbers(sensor):
    whole = moving(
        acceleration=np.array([0.1, 0.2, 0.3]), angular_acceleration=np.array([0.3, 0.1, -0.2]), head=8e3, density=1e3
    )
    along = jax.tree.map(lambda leaf: np.random.default_rng(1).normal(size=np.shape(leaf)), whole)
    own = {name: np.asarray(value, dtype=float) for name, value in sensor.parameters().items()}
    shift = {**jax.tree.map(np.zeros_like, own), "position": np.array([1.0, 2.0, -1.0])}

    def at(h):
        moved = jax.tree.map(lambda leaf, d: leaf + h * d, whole, along)
        return sensor.measured(moved, {name: own[name] + h * shift[name] for name in own})

    slope = evaluate(lambda h: jax.jvp(at, (h,), (1.0,))[1], 0.0)
    h = 1e-5
    np.testing.assert_allclose(slope, (at(h) - at(-h)) / (2 * h), rtol=1e-7, atol=1e-7)
    assert len(sensor.names) == len(sensor.units) == sensor.size == len(sensor.measured(whole))


def test_the_covariance_is_that_of_the_data_sheets_noise_and_of_rounding():
    imu = Imu(name="imu", rate=100, gyroscope=Errors(noise_density=2e-3), accelerometer=Errors(noise=[0.1, 0.2, 0.3]))
    np.testing.assert_allclose(np.diag(imu.covariance), [4e-4] * 3 + [0.01, 0.04, 0.09])
    rounded = Depth(name="depth", rate=1, depth=Errors(resolution=0.12))
    np.testing.assert_allclose(rounded.covariance, [[0.0012]])


def test_residuals_of_angles_go_the_shorter_way():
    compass = Compass(name="compass", rate=1)
    assert compass.residual([3.1], [-3.1])[0] == pytest.approx(6.2 - 2 * np.pi)
    usbl = Usbl(name="usbl", rate=1, beacon=(0, 0, 0))
    np.testing.assert_allclose(usbl.residual([9, 3.1, 0], [1, -3.1, 0.0]), [8, 6.2 - 2 * np.pi, 0.0], atol=1e-15)


def test_residuals_of_directions_and_attitudes_have_the_length_of_the_way_between():
    usbl = Usbl(name="usbl", rate=1, beacon=(0, 0, 0))
    for below in (0.2, 1.5, np.pi / 2):
        off = usbl.residual([9, 3.1, -below], [9, -1.0, 0.3 - below])
        u, v = (
            np.array([np.cos(e) * np.cos(b), np.cos(e) * np.sin(b), -np.sin(e)])
            for b, e in ((3.1, -below), (-1.0, 0.3 - below))
        )
        assert np.linalg.norm(off[1:]) == pytest.approx(np.arctan2(np.linalg.norm(np.cross(u, v)), u @ v))
    steep = Ahrs(name="ahrs", rate=1).residual([0.3, 1.55, 0.1], [-1.0, 1.56, -1.2])
    turn = co.attitude.zyx(-1.2, 1.56, -1.0).T @ co.attitude.zyx(0.1, 1.55, 0.3)
    np.testing.assert_allclose(steep, co.attitude.rotation_vector(turn), atol=1e-12)


def test_a_node_of_a_craft_is_read():
    craft = co.vehicles.Craft(co.vehicles.load("remus_100"))
    start = craft.start(position=(1, 2, 3), euler_zyx=(0.3, 0.1, -0.2), speed=1.5)
    named = start.named
    motion = co.mechanics.NodeMotion(start.xi, start.n, start.nu, named.a, start.t, None, None, start.g, start.q)
    read = at_node(motion)
    np.testing.assert_allclose(Ahrs(name="ahrs", rate=1).measured(read), [-0.2, 0.1, 0.3], atol=1e-14)
    np.testing.assert_allclose(read.position, [1, 2, 3])


@pytest.mark.parametrize(
    "make, sentence",
    [
        (lambda: Imu(name="my imu", rate=1), "must be a word"),
        (lambda: Imu(name="imu", rate=0), "`rate` of the sensor `imu` must be positive"),
        (lambda: Imu(name="imu", rate=1, latency=-1), "`latency` of the sensor `imu` must be at least 0"),
        (lambda: Imu(name="imu", rate=1, dropout=1.2), "`dropout` of the sensor `imu` must be at most 1"),
        (lambda: Imu(name="imu", rate=1, gyroscope=Errors(noise=-1.0)), "`gyroscope.noise` of the sensor `imu`"),
        (lambda: Imu(name="imu", rate=1, gyroscope=Errors(noise=-1.0)), "of the sensor `imu` must be at least 0, but"),
        (
            lambda: Imu(name="imu", rate=1, euler_zyx=(180, 0, 0)),
            "`euler_zyx` of the sensor `imu` must be at most a turn",
        ),
        (lambda: Compass(name="compass", rate=1, declination=30.0), "`declination` of the sensor `compass` must be at"),
        (
            lambda: Dvl(name="dvl", rate=1, largest_tilt=20.0),
            "at most half a turn, π rad, but is 20.0 rad: give degrees by",
        ),
        (
            lambda: DvlBeams(name="dvl", rate=1, beam_angle=30.0),
            "`beam_angle` of the sensor `dvl` must be at most a right",
        ),
        (lambda: Dvl(name="dvl", rate=1, lowest=50.0, highest=5.0), "must be below `highest`, 5 m, but is 50 m: so it"),
        (
            lambda: Noise(Dvl(name="dvl", rate=1), 0).read(np.zeros((4, 2))),
            "velocity_z, (k, 3), but has the shape (4, 2)",
        ),
        (lambda: Imu(name="imu", rate=1, gyroscope=Errors(noise=[1, 2])), "must be one number or have shape (3,)"),
        (lambda: Imu(name="imu", rate=1, gyroscope=Errors(noise=1.0, noise_density=1.0)), "give one of them"),
        (lambda: Imu(name="imu", rate=1, gyroscope=Errors(bias_instability=1.0)), "`bias_time` together"),
        (lambda: Imu(name="imu", rate=1, gyroscope=ANYTHING), "must be Errors"),
        (lambda: Depth(name="depth", rate=1, depth=Errors(misalignment=0.1)), "turns vectors"),
        (lambda: Dvl(name="dvl", rate=1, track="sky"), '"bottom" or "water"'),
        (lambda: Usbl(name="usbl", rate=1, beacon=(1, 2)), "must have shape"),
        (lambda: Imu(name="imu", rate=1).measured(ANYTHING), "must be Kinematics"),
        (lambda: Imu(name="imu", rate=1).measured(moving()), "needs `acceleration`"),
    ],
)
def test_what_no_sensor_can_have_is_refused_in_a_sentence(make, sentence):
    with pytest.raises(ArgumentError) as told:
        make()
    assert sentence in str(told.value) and str(told.value).endswith(".")
