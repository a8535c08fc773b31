"""Water by itself: random numbers, random currents, profiles, tables, density, surface and bottom."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats
from scipy.integrate import quad

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.spaces.named import Named, named
from coadjoint_vehicles import Craft, Vehicle
from coadjoint_vehicles.water import (
    CurrentField,
    CurrentTable,
    DensityTable,
    ExponentialDensity,
    GaussMarkovCurrent,
    LinearDensity,
    LinearProfile,
    LinearShear,
    Logarithmic,
    PowerLaw,
    Sea,
    Sheared,
    TidalCurrent,
    TimeCurrent,
    altitude,
    at_bottom,
    at_surface,
    first_of,
)
from coadjoint_vehicles.water.random_numbers import normal, stream, uniform


def drawn(state: Any, count: int) -> tuple[np.ndarray, np.ndarray]:
    found = []
    for _ in range(count):
        u, state = evaluate(uniform, state)
        found.append(u)
    return np.array(found), np.asarray(state)


def test_random_numbers_are_those_that_the_authors_of_mrg32k3a_publish():
    """RngStreams, test2RngStream.res: streams 2 and 3, stream 1 after 35 numbers, whole numbers from 1 to 10."""
    np.testing.assert_array_equal(stream(0), np.full(6, 12345))
    np.testing.assert_array_equal(stream(1), [3692455944, 1366884236, 2968912127, 335948734, 4161675175, 475798818])
    np.testing.assert_array_equal(stream(2), [1015873554, 1310354410, 2249465273, 994084013, 2912484720, 3876682925])
    u, after = drawn(stream(0), 35)
    np.testing.assert_array_equal(after, [1040577685, 3747037609, 277208355, 1712706441, 627445683, 2408037141])
    assert np.sum(np.floor(10 * u) + 1) == 186
    assert drawn(after, 1)[0][0] == pytest.approx(0.07941673614985, abs=1e-14)
    third = [0.7285097861965, 0.9655872822837, 0.9961841304801, 0.1149884161813, 0.9731454191297]
    np.testing.assert_allclose(drawn(stream(2), 5)[0], third, atol=1e-13)


def random_system() -> tuple[co.System, co.State]:
    """A turntable with random numbers as its internal state."""

    def rule(motion, h):
        z, random = normal(motion.internal.random, 3)
        return {"z": z, "random": random}

    system = co.System(co.SO2(), lambda xi: 0.5 * xi @ xi, internal=rule)
    return system, system.state(internal={"z": np.zeros(3), "random": stream(5)})


@pytest.mark.long
def test_both_backends_draw_the_same_random_numbers_to_the_bit():
    system, start = random_system()
    native, xla = (co.simulate(system, start, dt=0.1, steps=3000, backend=backend) for backend in ("native", "xla"))
    np.testing.assert_array_equal(native.records.internal.random, xla.records.internal.random)
    np.testing.assert_allclose(native.records.internal.z, xla.records.internal.z, rtol=1e-13, atol=1e-14)
    expected, state = [], stream(5)
    for _ in range(5):
        u, state = drawn(state, 4)
        far, turn = np.sqrt(-2 * np.log(u[::2])), 2 * np.pi * u[1::2]
        expected.append([far[0] * np.cos(turn[0]), far[0] * np.sin(turn[0]), far[1] * np.cos(turn[1])])
    np.testing.assert_allclose(native.records.internal.z[1:6], expected, rtol=1e-12)
    z = np.ravel(native.records.internal.z[1:])
    assert stats.kstest(z, "norm").pvalue > 0.01


@pytest.mark.long
def test_gradients_do_not_go_through_random_numbers_and_stay_finite():
    drawing, _ = random_system()
    system = co.System(
        co.SO2(),
        lambda xi, p: 0.5 * p.inertia * xi @ xi,
        internal=lambda motion, h, p: drawing.internal(motion, h),  # type: ignore[misc]
        forces=lambda motion, p: co.Force(torque=motion.internal.z[:1]),
        parameters=co.Parameters(inertia=2.0),
    )
    start = system.state(internal={"z": np.zeros(3), "random": stream(5)})

    def end(inertia):
        return co.trajectory(system.replace(inertia=inertia), start, dt=0.1, steps=200).final.g[1, 0]

    with co.float64():
        slope = jax.grad(end)(2.0)
        difference = (end(2.0 + 1e-6) - end(2.0 - 1e-6)) / 2e-6
    assert slope == pytest.approx(difference, rel=1e-5)


def ball(**changes: Any) -> Vehicle:
    given = {"mass": 20.0, "inertia": np.ones(3), "added_mass": [10.0] * 3 + [0.0] * 3, "fluid_density": 1000.0}
    return Vehicle(**{"name": "ball", **given, **changes})


TAU, MEMBERS = 5.0, 2000


def drifting(seed: Any) -> Craft:
    return Craft(ball(), water=GaussMarkovCurrent((0.2, 0.1, 0.0), TAU, mean=(0.3, 0.0, 0.0), seed=seed))


@pytest.fixture(scope="module")
def fleet() -> Craft:
    return drifting(co.each(np.arange(MEMBERS)))


@pytest.mark.long
@pytest.mark.parametrize("dt", [0.25, 2.5])
def test_a_random_current_has_the_same_mean_variance_and_correlation_whatever_the_step(fleet, dt):
    """Over 2000 seeds, at every 2.5 s: mean, variance, e^{−t/τ} within 4 standard errors; fixed seeds."""
    run = co.simulate(fleet.system, fleet.start(), dt=dt, duration=10.0, save_every=round(2.5 / dt))
    z = run.dataset.internal_water_z.values
    assert z.shape == (MEMBERS, 5, 3)
    assert np.max(np.abs(z.mean(axis=0))) < 4 / np.sqrt(MEMBERS)
    assert np.max(np.abs(z.var(axis=0) - 1)) < 4 * np.sqrt(2 / MEMBERS)
    for k in range(1, 5):
        kept = np.exp(-2.5 * k / TAU)
        assert np.mean(z[:, 0] * z[:, k]) == pytest.approx(kept, abs=4 * np.sqrt((1 + kept**2) / (3 * MEMBERS)))
    assert np.max(np.abs(np.mean(z[..., 0] * z[..., 1], axis=0))) < 4 / np.sqrt(MEMBERS)


@pytest.mark.long
def test_a_member_of_an_ensemble_is_the_run_of_its_seed(fleet):
    alone = drifting(9)
    many = co.simulate(fleet.system, fleet.start(speed=1.0), dt=0.5, steps=20)
    one = co.simulate(alone.system, alone.start(speed=1.0), dt=0.5, steps=20)
    np.testing.assert_array_equal(many.dataset.internal_water_random[9], one.dataset.internal_water_random)
    np.testing.assert_allclose(many.dataset.q[9], one.dataset.q, rtol=1e-12)
    assert np.max(np.abs(many.dataset.q[0] - one.dataset.q)) > 0.1


def at(water: Any, position: Any, t: float = 0.0) -> np.ndarray:
    """The current of a water with its own parameters."""
    own = named(water.parameters())
    return np.asarray(evaluate(lambda q, t: water.current(q, t, None, own), np.asarray(position, float), np.float64(t)))


def heights(water: Any, depths: Any) -> np.ndarray:
    return np.array([at(water, (3.0, 2.0, z))[0] for z in depths])


def test_profiles_follow_their_laws_between_surface_and_bottom():
    depths = np.array([-1.0, 0.0, 10.0, 30.0, 39.8, 40.0, 60.0])
    np.testing.assert_allclose(heights(LinearShear((1, 0, 0), (0.01, 0, 0)), depths), 1 + 0.01 * depths)
    wind = heights(Sheared((2.0, 0, 0), LinearProfile(50.0)), depths)
    np.testing.assert_allclose(wind, [2, 2, 1.6, 0.8, 0.408, 0.4, 0])
    tide = heights(Sheared((2.0, 0, 0), PowerLaw(40.0)), depths)
    np.testing.assert_allclose(
        tide, [2, 2, 2 * 0.75 ** (1 / 7), 2 * 0.25 ** (1 / 7), 0.01 ** (1 / 7), 0, 0], atol=1e-15
    )
    wall = heights(Sheared((2.0, 0, 0), Logarithmic(40.0, 0.006)), depths)
    heightened = np.log(1 + np.clip(40 - depths, 0, 40) / 0.006) / np.log(1 + 40 / 0.006)
    np.testing.assert_allclose(wall, 2 * heightened, rtol=1e-13)


def test_a_tide_is_the_sum_of_its_constituents():
    tide = TidalCurrent(["M2", 7200.0], [[0.5, 0.2, 0], [0.1, 0, 0]], [[0.3, 1.0, 0], [0, 0, 0]], mean=(0.05, 0, 0))
    for t in (0.0, 5000.0):
        angle = 2 * np.pi * t / (12.4206012 * 3600)
        north = 0.05 + 0.5 * np.cos(angle - 0.3) + 0.1 * np.cos(2 * np.pi * t / 7200)
        np.testing.assert_allclose(at(tide, np.zeros(3), t), [north, 0.2 * np.cos(angle - 1.0), 0], rtol=1e-13)


CSV = """# measured off the pier
time,depth,north,east
0,0,0.5,0.1
0,10,0.3,0.1
60,0,0.7,0.0
60,10,0.4,-0.1
"""


def written(path: Path, text: str) -> Path:
    file = path / "current.csv"
    file.write_text(text)
    return file


def test_a_table_from_csv_is_linear_between_its_rows_and_held_outside(tmp_path):
    table = CurrentTable.from_csv(written(tmp_path, CSV))
    assert not table.uniform and not table.steady
    np.testing.assert_allclose(at(table, (0, 0, 5), 30.0), [0.475, 0.025, 0])
    np.testing.assert_allclose(at(table, (0, 0, -3), -5.0), [0.5, 0.1, 0])
    np.testing.assert_allclose(at(table, (0, 0, 99), 900.0), [0.4, -0.1, 0])
    over_time = CurrentTable.from_csv(written(tmp_path, "time, north, east, down\n0,0,0,0\n10,1,2,0.5\n"))
    assert over_time.uniform
    np.testing.assert_allclose(at(over_time, (0, 0, 5), 5.0), [0.5, 1, 0.25])
    over_depth = CurrentTable.from_csv(written(tmp_path, "depth,north,east\n0,0,0\n10,1,2\n"))
    assert over_depth.steady
    np.testing.assert_allclose(at(over_depth, (0, 0, 2.5)), [0.25, 0.5, 0])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time,north\n0,1\n", "line 1: column `east` is missing"),
        ("north,east\n0,1\n", "column `time` or `depth` is missing"),
        ("time,north,east,salt\n0,1,1,1\n", "column `salt` is not known"),
        ("time,north,east,north\n0,1,1,1\n", "column `north` is there twice"),
        ("time,north,east\n0,1\n", "line 2: there are 2 cells for 3 columns"),
        ("time,north,east\n0,1,x\n", "line 2, column `east`: 'x' is not a number"),
        ("time,north,east\n0,1,\n", "line 2, column `east`: a number is missing"),
        ("time,north,east\n0,1,1\n1,nan,1\n", "line 3, column `north`: 'nan' is not a finite number"),
        ("time,north,east\n5,1,1\n3,1,1\n", "line 3, column `time`: 3 comes after 5: sort the rows by time"),
        ("time,north,east\n5,1,1\n\n5,1,1\n", "line 4, column `time`: 5 is there twice, in line 2"),
        ("time,depth,north,east\n0,5,1,1\n0,2,1,1\n", "line 3, column `depth`: 2 comes after 5"),
        ("time,depth,north,east\n1,5,1,1\n0,5,1,1\n", "line 3, column `time`: 0 comes after 1"),
        ("time,depth,north,east\n0,5,1,1\n0,6,1,1\n1,5,1,1\n", "line 4, column `depth`: time 1 has the depths 5, but"),
        ("depth,north,east\n-10,1,1\n0,1,1\n", "line 2, column `depth`: -10 m is above the surface: z points down"),
        ("time (min),north,east\n0,1,1\n", "line 1: column `time (min)` must be called `time` and be in s"),
        ("depth,North [cm/s],east\n0,1,1\n", "column `North [cm/s]` must be called `north` and be in m/s"),
        ("time;north;east\n0;0,1;0,1\n", "line 2, column `north`: '0,1' is not a number"),
        ("time,north,east\n", "at least one line of numbers"),
        ("", "at least one line of numbers"),
    ],
)
def test_a_wrong_file_of_currents_is_told_by_line_and_column(tmp_path, text, words):
    with pytest.raises(co.errors.FileError) as caught:
        CurrentTable.from_csv(written(tmp_path, text))
    assert words in str(caught.value) and "\n" not in str(caught.value) and "current.csv" in str(caught.value)


DENSITIES = {
    "linear": LinearDensity(1020.0, 0.3),
    "exponential": ExponentialDensity(1020.0, 1028.0, 25.0),
    "table": DensityTable([0.0, 10.0, 15.0, 60.0], [1020.0, 1021.0, 1026.0, 1028.0]),
    "table from below": DensityTable([5.0, 20.0], [1020.0, 1026.0]),
}


@pytest.mark.cases(1)
@pytest.mark.parametrize("density", DENSITIES.values(), ids=DENSITIES)
def test_the_head_of_pressure_is_the_integral_of_the_density(density):
    own = Named(**density.parameters())

    def rho(z):
        return float(evaluate(lambda z: density.density(z, own), np.float64(z)))

    for depth in (-4.0, 0.0, 7.0, 12.0, 40.0, 90.0):
        head = float(evaluate(lambda z: density.pressure_head(z, own), np.float64(depth)))
        assert head == pytest.approx(
            quad(rho, 0.0, depth, points=[5, 10, 15, 20, 60], epsabs=1e-9)[0], rel=1e-11, abs=1e-9
        )
    assert rho(-4.0) == rho(0.0) == 1020.0


@pytest.mark.long
def test_a_float_in_a_density_gradient_bobs_at_the_frequency_of_brunt_and_vaisala():
    """(m + m_A) z̈ = −gVρ′(z − z₀): with added mass, ω² = N²ρV/(m + m_A), N² = gρ′/ρ."""
    gradient, depth = 0.5, 20.0
    vehicle = ball(mass=(1000.0 + gradient * depth) * 0.02, volume=0.02)
    craft = Craft(vehicle, water=Sea(density=LinearDensity(1000.0, gradient)))
    run = co.simulate(craft.system, craft.start(position=(0.0, 0.0, depth + 1.0)), dt=0.05, duration=60.0)
    rate = np.sqrt(9.81 * 0.02 * gradient / (vehicle.mass + 10.0))
    t = run.dataset.time.values
    np.testing.assert_allclose(run.dataset.q[:, 2] - depth, np.cos(rate * t), atol=1e-4)
    assert run.relative_change("energy") < 1e-6


@pytest.mark.long
def test_surface_and_bottom_end_a_run_where_they_are():
    riser, sinker = Craft(ball(volume=0.021)), Craft(ball(volume=0.019))
    up = co.simulate(
        riser.system,
        riser.start(position=(0, 0, 5.0)),
        dt=0.1,
        duration=60.0,
        until=first_of(at_surface(), at_bottom(9.0)),
    )
    assert up.event is not None and up.final.q[2] == pytest.approx(0.0, abs=1e-9)

    def slope(north, east):
        return 20.0 + 0.1 * north

    start = sinker.start(position=(10.0, 0, 0.0), velocity=(1.0, 0, 0))
    down = co.simulate(
        sinker.system, start, dt=0.1, duration=60.0, until=first_of(at_surface(), at_bottom(slope, clearance=2.0))
    )
    assert down.event is not None
    assert altitude(slope)(down.final) == pytest.approx(2.0, abs=1e-9)
    assert down.final.q[2] == pytest.approx(18.0 + 0.1 * down.final.q[0], abs=1e-9)


TIDE = TidalCurrent(["M2"], [[0.5, 0.0, 0.0]])
GUSTS = GaussMarkovCurrent((0.1, 0.1, 0), 500.0)


def test_an_argument_of_a_current_field_that_has_a_default_is_not_the_time():
    """The function has a speed of its own, 0.3 m/s, which no time may take the place of; `t` by name is the time."""
    at = np.zeros(3), np.float64(7.0)
    field = CurrentField(lambda q, speed=0.3: speed * jnp.array([1.0, 0, 0]))
    np.testing.assert_array_equal(evaluate(lambda q, t: field.current(q, t, None, None), *at), [0.3, 0, 0])
    assert field.steady
    timed = CurrentField(lambda q, t=0.0: t * jnp.array([1.0, 0, 0]))
    np.testing.assert_array_equal(evaluate(lambda q, t: timed.current(q, t, None, None), *at), [7.0, 0, 0])


REFUSED = [
    (lambda: GaussMarkovCurrent((0.1, 0.1, 0), 0.0), "`correlation_time` must be positive"),
    (lambda: GaussMarkovCurrent((0.1, 0.1, 0), -5.0), "`correlation_time` must be positive"),
    (lambda: GaussMarkovCurrent((0.1, -0.1, 0), 5.0), "must not be negative"),
    (lambda: GaussMarkovCurrent((0.1, 0.1), 5.0), "must have shape (3,)"),
    (lambda: GaussMarkovCurrent((0.1, 0.1, 0), 5.0, seed=-1), "whole number from 0"),
    (lambda: GaussMarkovCurrent((0.1, 0.1, 0), 5.0, seed=1.5), "must be a whole number"),
    (lambda: GaussMarkovCurrent((0.1, 0.1, 0), 5.0, seed=co.each([1.5, 2.0])), "whole number from 0"),
    (lambda: GaussMarkovCurrent((0.1, 0.1, 0), 5.0, seed=co.each([1, 1])), "some are the same"),
    (lambda: LinearShear((0, 0, 0), (0.1, 0, 0.1)), "water keeps its volume"),
    (lambda: Sheared((0.1, 0, 0), 0.5), "must be a Profile"),
    (lambda: Sheared(LinearShear((0, 0, 0), (0.1, 0, 0)), PowerLaw(40.0)), "the same everywhere"),
    (lambda: Sheared(Sea(density=LinearDensity(1000.0), a=TIDE), PowerLaw(40.0)), "has a density, but a profile"),
    (lambda: Sea(a=Sea(density=LinearDensity(1000.0), b=TIDE)), "`a` has a density, and so has a sea"),
    (lambda: PowerLaw(-40.0), "`bottom` must be positive"),
    (lambda: Logarithmic(40.0, 0.0), "`roughness` must be positive"),
    (lambda: TidalCurrent(["M7"], [[0, 0, 0]]), "'M7' is not known"),
    (lambda: TidalCurrent([0.0], [[0, 0, 0]]), "must be positive"),
    (lambda: TidalCurrent(["M2"], [0.5, 0, 0]), "must have shape (1, 3)"),
    (lambda: TidalCurrent("M2", [[0.5, 0, 0]]), "must be a list"),
    (lambda: TimeCurrent(3.0), "must be a function of time"),  # type: ignore[arg-type]
    (lambda: TimeCurrent(co.Held([0.0, 1.0], np.zeros((2, 3)))), "must not jump"),
    (lambda: TimeCurrent(lambda t: jnp.sin(t)), "shape (3,), but returned shape ()"),
    (lambda: TimeCurrent(lambda t: jnp.ones(3) / t), "must be finite"),
    (lambda: TimeCurrent(lambda t: (np.sin(float(t)), 0.0, 0.0)), "of time must be written with jax.numpy"),
    (lambda: CurrentField(lambda q: np.sin(np.asarray(q))), "of place must be written with jax.numpy"),
    (lambda: CurrentField(lambda q: q if q[2] > 5 else 0 * q), "of place must be written with jax.numpy"),
    (lambda: CurrentField(lambda q: unknown(q)), "of place failed: NameError"),  # type: ignore[name-defined]  # noqa: F821
    (lambda: CurrentField(lambda: 0.0), "function of (position)"),
    (lambda: CurrentField(lambda q: q / jnp.sum(q**2)), "must be finite"),
    (lambda: CurrentTable(np.zeros((2, 3))), "needs `times`, `depths` or both"),
    (lambda: CurrentTable(np.zeros((2, 3)), times=[1.0, 1.0]), "must be strictly increasing"),
    (lambda: CurrentTable(np.zeros((3, 3)), depths=[0.0, 1.0]), "must have shape (2, 3)"),
    (lambda: CurrentTable(np.zeros((2, 3)), depths=[-10.0, 0.0]), "but has -10 m: z points down"),
    (lambda: CurrentTable.from_csv("/nowhere/current.csv"), "There is no file /nowhere/current.csv"),
    (lambda: LinearDensity(0.0), "`surface` must be positive"),
    (lambda: LinearDensity(1025.0, -1.0), "makes it 0 at 1025 m"),
    (lambda: ExponentialDensity(1020.0, -1.0, 20.0), "`deep` must be positive"),
    (lambda: ExponentialDensity(1020.0, 1025.0, 0.0), "`scale` must be positive"),
    (lambda: DensityTable([0.0, 1.0], [1025.0, 0.0]), "must be positive"),
    (lambda: DensityTable([1.0, 0.0], [1025.0, 1025.0]), "must be strictly increasing"),
    (lambda: DensityTable([-1.0, 0.0], [1025.0, 1025.0]), "but has -1 m: z points down"),
    (lambda: DensityTable([0.0, 1.0], [1025.0]), "the same shape"),
    (lambda: Sea(), "at least one current or a density"),
    (lambda: Sea(tide=3.0), "`tide` must be a Water"),  # type: ignore[arg-type]
    (lambda: Sea(density=1025.0), "must be a Density"),  # type: ignore[arg-type]
    (lambda: Sea(slow=GUSTS, fast=GaussMarkovCurrent((0.1, 0.1, 0), 5.0)), "`slow` and `fast` have the same seed"),
    (lambda: at_bottom("deep"), "must be a depth"),
    (lambda: at_bottom(lambda north, east: 20 + np.sin(np.asarray(north))), "must be written with jax.numpy"),
    (
        lambda: at_bottom(lambda north, east: jnp.ones(2)),
        "must return one number, a depth in m, but returned shape (2,)",
    ),
    (lambda: at_bottom(-3.0), "at least 0"),
    (lambda: at_surface("top"), "`depth`"),
    (lambda: first_of(), "at least one event"),
]


@pytest.mark.parametrize(("make", "words"), REFUSED)
def test_water_that_cannot_be_is_refused_in_one_sentence(make, words):
    with pytest.raises(co.errors.CoadjointError) as caught:
        make()
    assert words in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("depth,density\n0,1025\n5,0\n", "line 3, column `density`: 0 kg/m³ is not positive"),
        ("depth,density\n-1,1025\n", "line 2, column `depth`: -1 m is above the surface"),
        ("depth,density\n5,1025\n0,1025\n", "line 3, column `depth`: 0 comes after 5"),
        ("depth,density\n5,1025\n5,1026\n", "line 3, column `depth`: 5 is there twice, in line 2"),
    ],
)
def test_a_wrong_file_of_densities_is_told_by_line_and_column(tmp_path, text, words):
    with pytest.raises(co.errors.FileError) as caught:
        DensityTable.from_csv(written(tmp_path, text))
    assert words in str(caught.value) and "\n" not in str(caught.value)
    good = DensityTable.from_csv(written(tmp_path, "depth,density\n0,1020\n10,1025\n"))
    np.testing.assert_array_equal(good.densities, [1020.0, 1025.0])
