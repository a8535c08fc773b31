"""Episodes whose parameters are uncertain: their statistics are those of the file, and their seed says all of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2, kstest

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint.errors import ArgumentError
from coadjoint_vehicles import Craft
from coadjoint_vehicles.environments import Uncertain, environment, vector_environment
from coadjoint_vehicles.environments.uncertainties import of_file
from coadjoint_vehicles.files import vehicle_to_toml
from coadjoint_vehicles.files.registry import vehicle_text

NAME = "bluerov2_heavy_von_benzon"
ACTIONS = np.random.default_rng(2).uniform(-1, 1, (10, 8))


def uncertain_file(folder: Path) -> Path:
    """The shipped file with uncertainties of mass (kg), added mass (a share) and quadratic damping (SI, each)."""
    text = vehicle_text(NAME)
    for key, uncertainty in (
        ('mass = { value = 13.5, unit = "kg"', "0.2"),
        ('matrix = { value = [6.3567, 7.1206, 18.6863, 0.1858, 0.1348, 0.2215], unit = "SI"', '"10 %"'),
        ('quadratic = { value = [141.0, 217.0, 190.0, 1.192, 0.470, 1.500], unit = "SI"', "[7, 8, 9, 0.1, 0.05, 0.1]"),
        ('center_of_buoyancy = { value = [0, 0, -10], unit = "mm"', "1.5"),
    ):
        assert text.count(key) == 1
        text = text.replace(key, f"{key}, uncertainty = {uncertainty}")
    path = folder / "uncertain.toml"
    path.write_text(text, encoding="utf-8")
    return path


def deviations() -> dict[str, np.ndarray]:
    """What is written above, in SI units, of the numbers that vary."""
    vehicle = vehicles.load(NAME)
    return {
        "mass": np.array(0.2),
        "added_mass": 0.1 * np.abs(np.asarray(vehicle.added_mass)),
        "damping.quadratic": np.array([7, 8, 9, 0.1, 0.05, 0.1]),
        "center_of_buoyancy": np.full(3, 0.0015),
    }


def test_draws_have_the_standard_deviations_of_the_file(tmp_path):
    craft = Craft(vehicles.load(uncertain_file(tmp_path)))
    draw, count = Uncertain(craft, of_file(craft)), 2000
    assert set(draw.reaches.values()) == {5.0}
    random = np.random.default_rng(0)
    drawn = [draw(random) for _ in range(count)]
    zetas = []
    for path, sigma in deviations().items():
        values = np.array([one[path] for one in drawn])
        for place in np.ndindex(sigma.shape):
            if sigma[place] == 0 or place != tuple(sorted(place)):
                continue
            zeta = (values[(slice(None), *place)] - draw.nominal[path][place]) / sigma[place]
            zetas.append(zeta)
            # The sum of squares of standard normal numbers, and of their mean, by chance once in 10⁵.
            assert 5e-6 < chi2.cdf(zeta @ zeta, count) < 1 - 5e-6, (path, place)
            assert abs(zeta.mean()) * np.sqrt(count) < 4.5
            assert kstest(zeta, "norm").pvalue > 1e-5
    assert len(zetas) == 1 + 8 + 6 + 3  # added mass about the origin couples surge with pitch, and sway with roll
    first = np.array(zetas)[:1] @ np.array(zetas)[9:].T / count
    assert np.all(np.abs(first) < 5 / np.sqrt(count))
    matrix = drawn[0]["added_mass"]
    assert np.array_equal(matrix, matrix.T)


def test_a_file_is_written_with_its_uncertainties_and_read_again(tmp_path):
    vehicle = vehicles.load(uncertain_file(tmp_path))
    assert vehicle.provenance["body.mass"].uncertainty == 0.2
    assert np.allclose(vehicle.provenance["body.center_of_buoyancy"].uncertainty, 0.0015)
    again = tmp_path / "again.toml"
    again.write_text(vehicle_to_toml(vehicle), encoding="utf-8")
    read = vehicles.read(again)
    for key, quantity in vehicle.provenance.items():
        if quantity.uncertainty is not None:
            assert read.provenance[key].uncertainty == quantity.uncertainty, key


def test_a_mistaken_uncertainty_in_a_file_is_a_sentence(tmp_path):
    path = uncertain_file(tmp_path)
    text = path.read_text(encoding="utf-8")
    for wrong, sentence in (
        ('"much"', 'a share such as "5 %"'),
        ("-0.2", "at least 0"),
        ("[0.1, 0.2]", "one number, or as many"),
        ("true", "must be a number"),
    ):
        path.write_text(text.replace("uncertainty = 0.2", f"uncertainty = {wrong}"), encoding="utf-8")
        with pytest.raises(ArgumentError, match=sentence):
            vehicles.read(path)


@pytest.fixture(scope="module")
def env(tmp_path_factory):
    return environment(uncertain_file(tmp_path_factory.mktemp("file")), randomise=True)


def episode(env, **reset):
    row, _ = env.reset(**reset)
    p = env.stepper.parameters
    return np.array([row] + [env.step(action)[0] for action in ACTIONS]), float(p.mass), np.asarray(p.added_mass)


@pytest.mark.long
def test_every_episode_has_its_parameters_and_the_same_seed_the_same_bits(env):
    first, second = [episode(env, seed=4), episode(env)], [episode(env, seed=4), episode(env)]
    for a, b in zip(first, second, strict=True):
        assert all(np.array_equal(x, y) for x, y in zip(a, b, strict=True))
    assert len({13.5, first[0][1], first[1][1], episode(env, seed=5)[1]}) == 4


@pytest.mark.long
def test_an_episode_is_that_of_a_craft_with_these_parameters(env):
    env.reset(seed=4)
    p, state = env.stepper.parameters, env.stepper.state
    craft = Craft(vehicles.load(NAME)).replace(
        mass=float(p.mass),
        added_mass=np.asarray(p.added_mass),
        center_of_buoyancy=np.asarray(p.center_of_buoyancy),
        damping={"quadratic": np.asarray(p.damping.quadratic)},
    )
    start = craft.start(position=state.q, euler_zyx=co.attitude.zyx_angles(np.asarray(state.g)))
    other = co.Stepper(craft.system, start, dt=0.05, inputs={"thrusters": np.full(8, 1500.0)})
    assert np.allclose(other.state.pi, state.pi, atol=1e-12) and np.allclose(other.state.mu, state.mu, atol=1e-12)
    for action in ACTIONS:
        env.step(action)
        other.step({"thrusters": 1500.0 + 400.0 * action}, n=2)
    for name in ("g", "n", "mu", "pi"):
        assert np.allclose(getattr(env.stepper.state, name), getattr(other.state, name), rtol=0, atol=1e-11)


@pytest.mark.long
def test_randomisation_leaves_the_starts_alone_and_may_have_a_seed_of_its_own(env):
    plain = environment(NAME)
    starts = [plain.reset(seed=9)[0], plain.reset()[0]]
    assert np.allclose([env.reset(seed=9)[0], env.reset()[0]], starts, atol=1e-12)
    given = {"mass": "2 %"}
    masses = []
    for seed in (1, 2):
        own = environment(NAME, randomise=given, randomise_seed=77)
        own.reset(seed=seed)
        masses.append(float(own.stepper.parameters.mass))
    assert masses[0] == masses[1] != 13.5


@pytest.mark.long
def test_members_have_parameters_of_their_own_and_of_each_episode(env):
    given = {"mass": "1 %", "damping.linear": "10 %"}
    many = vector_environment(NAME, num_envs=5, randomise=given, seconds=0.5, autoreset="same_step")
    single = environment(NAME, randomise=given, seconds=0.5)
    many.reset(seed=6)
    first = np.asarray(many.stepper.parameters.mass)
    assert len(set(first)) == 5
    single.reset(seed=6 + 3)
    for k, action in enumerate(ACTIONS):
        row, rewards, *_ = many.step(np.tile(action, (5, 1)))
        seen, reward, _, truncated, _ = single.step(action)
        assert rewards[3] == pytest.approx(reward, abs=1e-11)
        if truncated:
            assert k in (4, 9)
            seen, _ = single.reset()
        assert np.allclose(row[3], seen, rtol=0, atol=1e-12)
    assert not set(first) & set(np.asarray(many.stepper.parameters.mass))


def test_large_uncertainties_are_cut_off_where_the_vehicle_can_still_be():
    craft = Craft(vehicles.load(NAME))
    wide = Uncertain(craft, {"mass": "30 %"})
    assert wide.reaches == {"mass": 3.0}
    drawn = [float(wide(np.random.default_rng(i))["mass"]) for i in range(300)]
    assert min(drawn) > 1.3 and max(drawn) < 25.7
    with pytest.raises(ArgumentError, match="so large that 2 standard deviations away"):
        Uncertain(craft, {"mass": "60 %"})
