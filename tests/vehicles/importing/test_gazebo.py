"""Vehicles of Gazebo: they move here as by the equations of its systems."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from other_simulators import moved, rigid, turned

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint_vehicles.importing import import_vehicle

TORPEDO = Path(__file__).parent / "descriptions" / "torpedo.sdf"
NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
BOW = np.array([-1.0, 1.0, -1.0])
"""The signs from the axes of the model, whose bow points along -x, to forward, starboard, down."""


def foil(v: np.ndarray, forward: np.ndarray, upward: np.ndarray, a0: float) -> np.ndarray:
    """The force of the system LiftDrag in a flow v past a foil with these directions, in the same axes."""
    span = np.cross(forward, upward)
    speed = np.linalg.norm(v)
    if speed <= 0.01 or forward @ v <= 0:
        return np.zeros(3)
    sweep = 1 - (span @ v / speed) ** 2
    w = v - (v @ span) * span
    lift = np.cross(span, w) / np.linalg.norm(w)
    alpha = a0 + np.sign(lift @ forward) * np.arccos(np.clip(lift @ upward, -1, 1))
    past = abs(alpha) - 0.17
    cl = 4.13 * alpha if past <= 0 else np.sign(alpha) * max(0.0, 4.13 * 0.17 - 1.1 * past)
    cd = 0.2 * abs(alpha) if past <= 0 else 0.2 * 0.17 + 0.03 * past
    q = 0.5 * 1000 * (w @ w) * 0.0244 * sweep
    return q * (cl * lift - cd * w / np.linalg.norm(w))


@pytest.mark.long
def test_a_torpedo_of_gazebo_swims_as_by_its_systems() -> None:
    """60 s with propeller, rudder and elevator: within 5 mm of where the systems' equations lead."""
    found = import_vehicle(TORPEDO, forward="-x")
    commands = {"thrusters": np.array([30.0]), "vertical_fins": 0.05, "horizontal_fins": 0.02}
    craft = vehicles.Craft(found.vehicle)
    heading = np.array([0.7, 0.05, 0.02])
    start = craft.start(position=(1.0, 2.0, 30.0), speed=0.8, euler_zyx=heading)
    run = co.simulate(craft.system, start, dt=0.0025, duration=60.0, inputs=commands, save_every=24000)

    small = np.diag([0.001] * 3)
    fins, screw = np.array([1.05, 0, 0]), np.array([1.43162, 0, 0])
    lumps = [(0.2, fins, small), (0.2, fins, small), (0.09, screw, np.diag([0.00014, 0.00003, 0.00014]))]
    masses = [(147.0671, np.array([0, 0, -0.02]), np.diag([3.0, 41.980233, 41.980233])), *lumps]
    added = np.diag([4.876161, 126.324739, 126.324739, 0, 33.46, 33.46])
    damped = np.array([6.2282, 601.27, 601.27, 0.1916, 632.698957, 632.698957])
    rudder = (turned(0, 0, 0.05), [0, 1.0, 0], 0.0)
    elevator = (turned(0, 0.02, 0), [0, 0, 1.0], 0.01)

    def wrench(t, q, R, v, w):
        nu = np.concatenate([v, w])
        total = -damped * np.abs(nu) * nu
        total[1] -= 3.0 * w[2]
        total[4] -= 2.0 * v[2] * abs(w[1])
        total[2] += 1.5 * v[0] * w[1]
        up = R.T @ np.array([0.0, 0.0, 9.81])
        acting = [(np.zeros(3), 2 * 0.3 * 0.24592783333333334 * 1000 * up), *((r, -m * up) for m, r, _ in masses)]
        acting.append((screw, np.array([-0.004422 * 1000 * 0.2**4 * 30.0**2, 0, 0])))
        for turn, upward, a0 in (rudder, elevator):
            flow = v + np.cross(w, fins)
            acting.append((fins, foil(flow, turn @ [-1.0, 0, 0], turn @ np.array(upward), a0)))
        return total + sum(np.concatenate([force, np.cross(r, force)]) for r, force in acting)

    cy = turned(0.02, 0.05, 0.7)  # body to space in north, east, down
    R = NED @ cy @ np.diag(BOW)
    first = np.concatenate([[2.0, 1.0, -30.0], R.ravel(), [-0.8, 0, 0], np.zeros(3)])
    last = moved(rigid(masses), added, wrench, first, 60.0)
    here = NED @ np.asarray(run.final.q)
    assert np.linalg.norm(here - first[:3]) > 5.0
    assert np.linalg.norm(here - last[:3]) < 5e-3
    np.testing.assert_allclose(np.asarray(run.final.nu) * BOW, last[12:15], atol=2e-3)


def test_a_model_of_gazebo_is_told_of() -> None:
    report = import_vehicle(TORPEDO, forward="-x").report
    assert any(row.what.startswith("<plugin> 'gz::sim::systems::Imu'") for row in report.left)
    assert {"body.gravity", "added_mass.matrix", "derivatives.M_w|q|"} <= {row.key for row in report.taken}
    assert any("joint" in sentence for sentence in report.differs)


def test_fluid_added_mass_is_that_of_the_systems_derivatives(tmp_path: Path) -> None:
    """M_A of <fluid_added_mass> and −M_a of xDotU are one matrix."""
    text = TORPEDO.read_text()
    said = {"xx": 4.876161, "yy": 126.324739, "zz": 126.324739, "qq": 33.46, "rr": 33.46}
    fluid = "".join(f"<{key}>{value}</{key}>" for key, value in said.items())
    head, mass, tail = text.partition("<mass>147.0671</mass>")
    other = f"{head}{mass}<fluid_added_mass>{fluid}</fluid_added_mass>{tail}"
    name = "<link_name>base_link</link_name>"
    other = other.replace(name, f"{name}<disable_added_mass>1</disable_added_mass>")
    (tmp_path / "other.sdf").write_text(other)
    found = import_vehicle(tmp_path / "other.sdf").vehicle.added_mass
    np.testing.assert_array_equal(found, import_vehicle(TORPEDO).vehicle.added_mass)


LINK = """<link name="{name}">{pose}<inertial><pose>0.1 0 0.02 0 0 0</pose><mass>{mass}</mass>
  <inertia><ixx>0.1</ixx><iyy>0.2</iyy><izz>0.3</izz></inertia></inertial>
  <collision name="c"><geometry><box><size>0.2 0.2 0.3</size></box></geometry></collision></link>"""
JOINT = '<joint name="{name}_joint" type="fixed"><parent>base</parent><child>{name}</child></joint>'


def test_included_models_stand_where_the_include_puts_them(tmp_path: Path) -> None:
    """As one file with all links in place; the pose of the <include> takes the place of that of its model."""
    placed = "<pose>-1 0.2 0.3 0 0 1.2</pose>"
    inner = "<pose>0.4 0 0 0.3 0 0</pose>"
    base = LINK.format(name="base", pose="", mass=20)
    flat = f"{base}<frame name='f'>{placed}</frame>" + LINK.format(
        name="fin", pose=inner.replace("<pose>", "<pose relative_to='f'>"), mass=2
    )
    whole = "<sdf><model name='v'>{}</model></sdf>"
    (tmp_path / "flat.sdf").write_text(whole.format(flat + JOINT.format(name="fin")))
    fin = LINK.format(name="fin", pose=inner, mass=2)
    for own, of_include in (("<pose>9 9 9 0 0 0</pose>", placed), (placed, "")):
        (tmp_path / "fin.sdf").write_text(whole.format(own + fin))
        include = f"<include><uri>fin.sdf</uri>{of_include}</include>"
        (tmp_path / "parts.sdf").write_text(whole.format(base + include + JOINT.format(name="fin")))
        there, here = (import_vehicle(tmp_path / f"{name}.sdf").vehicle for name in ("flat", "parts"))
        for field in ("mass", "inertia", "center_of_mass", "volume", "center_of_buoyancy"):
            np.testing.assert_allclose(getattr(here, field), getattr(there, field), atol=1e-12, err_msg=field)
    assert abs(float(np.asarray(here.center_of_mass)[0])) < 0.1
