"""The controller of standard manoeuvres: its orders stage by stage, and a published ship that it steers."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
import pytest
import xarray
from mariner import LENGTH, M11, M22, M33, SPEED, TURN_TO_PORT, accelerations

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint import units as u
from coadjoint.errors import ArgumentError
from coadjoint.extending import evaluate, named
from coadjoint.mechanics import Force
from coadjoint.models.quantities import positive
from coadjoint.plotting.plots import common
from coadjoint.spaces import Named
from coadjoint_vehicles import Command, Craft, Part, Vehicle
from coadjoint_vehicles.controllers import Trial
from coadjoint_vehicles.controllers.allocation import Allocation
from coadjoint_vehicles.controllers.manoeuvres import TRIAL
from coadjoint_vehicles.missions.example import TRIALS, standard_manoeuvre
from coadjoint_vehicles.model.controller import Feedback
from coadjoint_vehicles.parts import Damping, Derivatives, Thrusters
from coadjoint_vehicles.parts.measured import Measured, measured
from coadjoint_vehicles.trials import Track, analyse

REMUS = vehicles.load("remus_100")
MIXED = Allocation(np.array([[0.0, 1, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]]), ("stern_planes", "rudder", "propeller"))
GAINS = dict.fromkeys(("depth_gains", "pitch_gains", "heading_gains", "roll_gains", "speed_gains"), (0.0, 0.0, 0.0))
REACH = {"pitch_reach": 1.0, "heading_reach": 1.0, "fin_limit": 0.3, "thrust_limit": 20.0, "feed_forward": 10.0}

LIMITED = {**REACH, "fin_limit": np.radians(15.0)}


def orders(manoeuvre, headings, *, begin=1.0, period=1.0, slower=0.0, **fields):
    """(rudder order, propeller command) of each sample, of a controller that is fed these headings, and speeds that
    fall by `slower` from sample to sample."""
    made = Trial(
        manoeuvre=manoeuvre, begin=begin, period=period, allocation=MIXED, **{**GAINS, "speed_gains": (5.0, 0, 0)},
        **REACH, **fields,
    )  # fmt: skip
    memory, found = made.memory(), []
    own = named(made.parameters())
    for k, heading in enumerate(headings):
        zero = np.zeros(3)
        inputs = named({"depth": 5.0, "heading": 0.0, "speed": 1.5})
        feedback = Feedback(
            zero, np.array([1.5 - slower * k, 0, 0]), zero, zero, np.array([0.0, 0, 1]), np.array([1.0, 0, 0]),
            zero[0], zero[0], heading, 5 + zero[0], zero[0], k * period, inputs, None,
        )  # fmt: skip
        commands, memory = evaluate(lambda f, m, o: made.steer(f, m, o, REMUS), feedback, named(memory), own)
        found.append((-float(commands["rudder"]), float(commands["propeller"])))
    return np.array(found)


def test_a_zigzag_reverses_where_the_heading_is_off_by_its_deviation_on_the_side_of_the_order():
    headings = np.radians([0, 3, 4, 12, 14, 2, -9, -11, -14, 0])
    found = orders("zigzag", headings, rudder=0.2, deviation=np.radians(10))
    # the course is the heading at the execute, 3°
    assert found[:, 0] == pytest.approx([0, 0.2, 0.2, 0.2, -0.2, -0.2, 0.2, 0.2, 0.2, 0.2])
    assert found[:, 1] == pytest.approx(15.0)


def test_the_command_of_the_propulsion_stays_from_the_execute_on():
    found = orders("turning_circle", np.zeros(5), rudder=0.2, begin=2.0, slower=0.1)
    assert found[:, 1] == pytest.approx([15.0, 15.5, 16.0, 16.0, 16.0])


def test_a_run_does_not_warn_of_the_limits_that_a_trial_orders():
    def fins(manoeuvre):
        made = Trial(manoeuvre=manoeuvre, rudder=0.2, allocation=MIXED, **GAINS, **REACH)
        rule = Craft(REMUS, controller=made).rule
        nodes = 20
        value = Named(stern_planes=np.zeros(nodes), rudder=np.zeros(nodes), propeller=np.zeros(nodes))
        ends = {name: np.full(nodes, ends[1]) for name, ends in rule.limits(Craft(REMUS).parameters).items()}
        told = rule.concluded([Named(controller=Named(value=value), **ends)], Craft(REMUS).parameters)
        return {name for name in ends if any(f"`{name}`" in sentence for sentence in told)}

    assert fins("turning_circle") == {"stern_planes", "propeller"}
    assert fins("stop") == {"stern_planes", "rudder"}


def test_a_spiral_goes_down_and_up_in_equal_steps_and_a_pull_out_ends_midships():
    found = orders("spiral", np.zeros(12), rudder=0.2, steps=2, hold=1.0, begin=0.0)
    assert found[:, 0] == pytest.approx([0.2, 0.1, 0, -0.1, -0.2, -0.1, 0, 0.1, 0.2, 0.2, 0.2, 0.2])
    assert orders("pull_out", np.zeros(6), rudder=-0.2, hold=3.0)[:, 0] == pytest.approx([0, -0.2, -0.2, -0.2, 0, 0])


def test_a_stop_orders_astern_and_leaves_the_rudder_midships():
    found = orders("stop", np.zeros(4), rudder=0.2, astern=-12.0)
    assert found.tolist() == [[0, 15], [0, -12], [0, -12], [0, -12]]


def test_a_vehicle_that_stops_is_left_alone_once_it_goes_ahead_no_more():
    found = orders("stop", np.zeros(6), slower=0.5, rudder=0.2, astern=-12.0)
    assert found[:, 1].tolist() == [15, -12, -12, 0, 0, 0] and not found[:, 0].any()


def test_orders_beyond_the_fins_are_refused():
    with pytest.raises(ArgumentError, match="within ±15°"):
        Trial(rudder=0.5, allocation=MIXED, **GAINS, **LIMITED).fitted(REMUS)
    with pytest.raises(ArgumentError, match="not 0"):
        Trial(rudder=0.0, allocation=MIXED, **GAINS, **LIMITED).fitted(REMUS)


def test_a_dataset_of_a_trial_is_read_with_the_shares_of_its_fins():
    """A circle of 10 m to port at 1 m/s, by an X-tail of which each of two fins has a share of −½."""
    time = np.arange(0.0, 80.0, 0.1)
    after = np.maximum(time - 10.0, 0.0)
    heading, zero, one = -0.1 * after, np.zeros(len(time)), np.ones(len(time))
    place = np.stack([np.minimum(time, 10.0) - 10 * np.sin(heading), -10 * (1 - np.cos(heading)), 5 * one], 1)
    sine, cosine = np.sin(heading), np.cos(heading)
    R = np.moveaxis(np.array([[cosine, -sine, zero], [sine, cosine, zero], [zero, zero, one]]), 2, 0)
    begun = time > 10.0
    held = {
        "n": np.einsum("kji,kj->ki", R, place),
        "nu": np.stack([one, zero, zero], 1),
        "xi": np.stack([zero, zero, np.where(begun, -0.1, 0.0)], 1),
        "a_down": R[:, 2],
        "a_north": R[:, 0],
        "internal_fin_1": np.where(begun, 0.1, 0.0),
        "internal_fin_2": np.where(begun, 0.1, 0.0),
        "internal_controller_value_memory_stage": np.where(begun, 0.0, -1.0),
        "internal_controller_value_memory_since": np.where(begun, 10.0, 0.0),
        "internal_controller_value_memory_order": np.where(begun, -0.2, 0.0),
    }
    dims = {name: ("time", *(f"{name}_{i}" for i in range(np.ndim(x) - 1))) for name, x in held.items()}
    made = xarray.Dataset({k: (dims[k], x) for k, x in held.items()}, coords={"time": time})
    told = {"manoeuvre": "turning_circle", "fins": ["fin_1", "fin_2"], "shares": [-0.5, -0.5], "length": 2.0}
    recorded = made.assign_attrs({TRIAL: json.dumps(told)})
    assert "trial" in common([recorded]) and "trial" in common([recorded, recorded])
    found = analyse(recorded)
    assert found.track.begin == 10.0 and found.track.side == -1.0
    assert found.track.rudder is not None and found.track.rudder[-1] == pytest.approx(-0.2)
    assert found["steady_radius"] == pytest.approx(10.0, rel=1e-3)
    assert found["advance"] == pytest.approx(10.0, rel=1e-3) and found["tactical_diameter"] == pytest.approx(
        20, rel=1e-3
    )
    assert found["K"] == pytest.approx(0.5, rel=1e-2)
    with pytest.raises(ArgumentError, match='kind = "trial"'):
        Track.of(made)


@pytest.mark.parametrize("name", TRIALS)
def test_missions_of_standard_manoeuvres_can_be_read(name, tmp_path):
    path = tmp_path / "trial.toml"
    path.write_text(standard_manoeuvre("remus_100", name), encoding="utf-8")
    given = vehicles.load_mission(path).file.controller
    assert given["kind"] == "trial" and given["begin_s"] == pytest.approx(10 * 1.6 / 1.5, rel=0.05)
    assert given.get("rudder_deg", 10) == {"zigzag_20": 15}.get(name, 10)


@dataclass(frozen=True, eq=False)
class Mariner(Part):
    """A part whose force gives the ship its published accelerations, M ν̇ + C(ν)ν in the plane."""

    kind: ClassVar[str] = "mariner"
    limit: Measured = measured(u.ANGLE, positive, default=np.radians(40.0))
    lag: Measured = measured(u.TIME, positive, default=1.0)
    rate: Measured = measured(u.ANGULAR_VELOCITY, positive, default=np.radians(5.0))

    @property
    def command(self):
        return Command("rad")

    def force(self, flow, actual, own):
        along, across, r = flow.velocity[0], flow.velocity[1], flow.omega[2]
        surging, swaying, turning = accelerations(along, across, r, actual)
        m, zero = MASS, jnp.zeros(())
        X, Y = m[0] * surging - m[1] * across * r, m[1] * swaying + m[0] * along * r
        N = m[2] * turning + (m[1] - m[0]) * along * across
        return Force(force=jnp.stack([X, Y, zero]), torque=jnp.stack([zero, zero, N]))


HALF = 0.5 * 1025.0
MASS = (HALF * LENGTH**3 * M11, HALF * LENGTH**3 * M22, HALF * LENGTH**5 * M33)


@pytest.mark.long
def test_the_mariner_flies_its_published_turning_circle():
    body, own = 0.9 * MASS[0], 0.5 * MASS[2]
    steady = Damping("damping", linear=(0, 0, 1e8, 1e11, 1e12, 0))
    planes = Derivatives("planes", {"M_uu_planes": -1e7}, limit=0.3)
    screw = Thrusters("screw", curve={"linear": 1e3}, positions=[(-80, 0, 0)], directions=[(1, 0, 0)], limit=10.0)
    added = (MASS[0] - body, MASS[1] - body, MASS[1] - body, own, own, MASS[2] - own)
    ship = Vehicle(
        name="Mariner", mass=body, inertia=(own, own, own), added_mass=added, center_of_buoyancy=(0, 0, -1.0),
        length=LENGTH, parts=(Mariner("rudder"), steady, planes, screw),
    )  # fmt: skip
    gains = {**GAINS, **REACH, "feed_forward": 0.0, "fin_limit": np.radians(40.0)}
    trial = Trial(rudder=np.radians(-15.0), begin=99.5, speed=SPEED, period=0.5, **gains)
    craft = Craft(ship, controller=trial)
    inputs = {"depth": 100.0, "heading": 0.0, "speed": SPEED}
    start = craft.start(position=(0, 0, 100), speed=SPEED)
    run = co.simulate(craft.system, start, dt=0.1, duration=800, inputs=inputs, save_every=5)
    assert craft.controller is not None
    run.dataset.attrs.update(craft.controller.attributes())
    track = Track.of(run.dataset)
    object.__setattr__(track, "course", 0.0)
    found, aside = analyse(track), -track.east[track.first]
    reached = {name: found[name] + aside * (name in ("maximum_transfer", "tactical_diameter")) for name in TURN_TO_PORT}
    reached["maximum_advance"] -= 0.4 * SPEED
    assert reached == pytest.approx(TURN_TO_PORT, abs=1.5)


def test_a_standard_manoeuvre_of_a_vehicle_without_fins_is_refused():
    with pytest.raises(ArgumentError, match=r"`[^`]+` has no fins with a limit"):
        standard_manoeuvre("bluerov2_heavy_blue", "zigzag_20")
