"""Vehicles of uuv_simulator: they move here as by the equations of its plugins."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from other_simulators import moved, rigid, turned

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint_vehicles.importing import import_vehicle

HERE = Path(__file__).parent / "descriptions"
FLIP = np.array([1.0, -1.0, -1.0])
PLACES = np.array([[-0.890895, y, 0.528822] for y in (0.334385, -0.334385)])
PLACES = np.vstack([PLACES, [[-0.412125, y, 0.129] for y in (0.505415, -0.505415)]])
ANGLES = np.radians([[0, -74.53, -53.21], [0, -74.53, 53.21], [0, 0, 45], [0, 0, -45]])
ADDED = np.array(
    [
        [779.79, -6.8773, -103.32, 8.5426, -165.54, -7.8033],
        [-6.8773, 1222, 51.29, 409.44, -5.8488, 62.726],
        [-103.32, 51.29, 3659.9, 6.1112, -386.42, 10.774],
        [8.5426, 409.44, 6.1112, 534.9, -10.027, 21.019],
        [-165.54, -5.8488, -386.42, -10.027, 842.69, -1.1162],
        [-7.8033, 62.726, 10.775, 21.019, -1.1162, 224.32],
    ]
)
LINEAR = np.array([-74.82, -69.48, -728.4, -268.8, -309.77, -105])
QUADRATIC = np.array([-748.22, -992.53, -1821.01, -672, -774.44, -523.27])


@pytest.mark.long
def test_a_rov_of_uuv_simulator_swims_as_by_its_plugins() -> None:
    """60 s from a slant, with its rotors held after a lag: within 5 mm of where the plugins' equations lead."""
    found = import_vehicle(HERE / "rov" / "rov.xacro", gravity=9.81)
    commands = np.array([250.0, 180.0, 500.0, 420.0])
    craft = vehicles.Craft(found.vehicle)
    angles = np.array([0.3, 0.1, -0.05])
    start = craft.start(position=(1.0, 2.0, -20.0), velocity=(0.2, 0.1, 0.0), euler_zyx=angles, axes="ENU/FLU")
    run = co.simulate(craft.system, start, dt=0.0025, duration=60.0, inputs={"thrusters": commands}, save_every=24000)

    blades = [turned(*angle) for angle in ANGLES]
    inertia = np.array([[525.39, 1.44, 33.41], [1.44, 794.20, 2.6], [33.41, 2.6, 691.23]])
    lumps = [(0.5, r, R @ np.diag([0.001, 0.002, 0.002]) @ R.T) for r, R in zip(PLACES, blades, strict=True)]
    body = rigid([(1862.87, np.zeros(3), inertia), *lumps])
    both = np.concatenate([FLIP, FLIP])

    def wrench(t, q, R, v, w):
        nu = np.concatenate([v, w]) * both
        damping = (LINEAR * nu + QUADRATIC * np.abs(nu) * nu) * both
        up = R.T @ np.array([0.0, 0.0, 9.81])
        rotors = commands * (1 - np.exp(-t / 0.05))
        pushes = [0.00031 * n * abs(n) * B[:, 0] for n, B in zip(rotors, blades, strict=True)]
        acting = [(np.array([0, 0, 0.3]), 1028.0 * 1.83826 * up), (np.zeros(3), -1862.87 * up)]
        acting += [(r, push - 0.5 * up) for r, push in zip(PLACES, pushes, strict=True)]
        return damping + sum(np.concatenate([force, np.cross(r, force)]) for r, force in acting)

    first = np.concatenate([[1.0, 2.0, -20.0], turned(-0.05, 0.1, 0.3).ravel(), [0.2, 0.1, 0.0], np.zeros(3)])
    last = moved(body, ADDED * np.outer(both, both), wrench, first, 60.0)
    here = np.asarray(run.final.q)[[1, 0, 2]] * [1, 1, -1]
    assert np.linalg.norm(here - first[:3]) > 5.0
    assert np.linalg.norm(here - last[:3]) < 5e-3
    np.testing.assert_allclose(np.asarray(run.final.nu) * FLIP, last[12:15], atol=2e-3)


def fin_force(velocity: np.ndarray) -> np.ndarray:
    """Lift and drag of the plugin's quadratic law in the axes of the fin, of the flow across its z axis."""
    x, y = velocity[:2]
    angle, size = np.arctan2(y, x), np.hypot(x, y)
    angle -= np.pi * np.sign(angle) if abs(angle) > np.pi / 2 else 0.0
    across, along = np.array([y, -x, 0.0]), -np.array([x, y, 0.0])
    constant = 0.5 * 1028 * 0.0064
    return size * constant * (3.0 * angle * across + 1.98 * angle**2 * along)


@pytest.mark.long
def test_a_torpedo_of_uuv_simulator_swims_as_by_its_plugins() -> None:
    """LAUV, 60 s with its propeller and four fins, all after their lags: within 5 mm of the plugins' equations."""
    found = import_vehicle(HERE / "lauv.xacro", gravity=9.81)
    craft = vehicles.Craft(found.vehicle)
    told = np.array([0.05, -0.03, -0.05, 0.02])
    start = craft.start(position=(1.0, 2.0, -20.0), velocity=(0.8, 0, 0), euler_zyx=(0.3, 0.05, -0.05), axes="ENU/FLU")
    inputs = {"thrusters": np.array([-160.0]), **{f"fin{i}": angle for i, angle in enumerate(told)}}
    run = co.simulate(craft.system, start, dt=0.0025, duration=60.0, inputs=inputs, save_every=24000)

    places = np.array([[-0.4, 0, 0.04], [-0.4, -0.04, 0], [-0.4, 0, -0.04], [-0.4, 0.04, 0]])
    poses = [turned(angle, 0, 0) for angle in (0, np.pi / 2, np.pi, -np.pi / 2)]
    screw, small, across = np.array([-0.53994, 0, 0]), 1e-6 * np.eye(3), 18 * (3 * 0.075**2 + 1.08**2) / 12
    lumps = [(0.001, r, small) for r in (screw, *places)]
    body = rigid([(18.0, np.zeros(3), np.diag([9 * 0.075**2, across, across])), *lumps])
    both = np.concatenate([FLIP, FLIP])
    linear = np.diag([-2.4, -23, -23, -0.3, -9.7, -9.7])
    linear[1, 5], linear[2, 4], linear[4, 2], linear[5, 1] = 11.5, -11.5, 3.1, -3.1
    quadratic = np.array([-2.4, -80, -80, -0.0006, -9.1, -9.1])  # on the diagonal, as the plugin takes it

    def wrench(t, q, R, v, w):
        nu = np.concatenate([v, w]) * both
        up = R.T @ np.array([0.0, 0.0, 9.81])
        rotor = -160.0 * (1 - np.exp(-t / 0.05))
        acting = [(np.array([0, 0, 0.01]), 1028.0 * 0.017551374956865266 * up), (np.zeros(3), -18.0 * up)]
        acting += [(screw, np.array([-0.0002 * rotor * abs(rotor), 0, 0]) - 0.001 * up)]  # it looks astern
        for r, pose, angle in zip(places, poses, told * (1 - np.exp(-t / 0.2)), strict=True):
            fin = pose @ turned(0, 0, angle)
            acting.append((r, fin @ fin_force(fin.T @ (v + np.cross(w, r))) - 0.001 * up))
        damping = (linear @ nu + quadratic * np.abs(nu) * nu) * both
        return damping + sum(np.concatenate([force, np.cross(r, force)]) for r, force in acting)

    first = np.concatenate([[1.0, 2.0, -20.0], turned(-0.05, 0.05, 0.3).ravel(), [0.8, 0, 0], np.zeros(3)])
    last = moved(body, np.diag([1, 16, 16, 0.005, 1.3, 1.3]), wrench, first, 60.0)
    here = np.asarray(run.final.q)[[1, 0, 2]] * [1, 1, -1]
    assert np.linalg.norm(here - first[:3]) > 5.0 and abs(last[17]) > 0.01
    assert np.linalg.norm(here - last[:3]) < 5e-3
    np.testing.assert_allclose(np.asarray(run.final.nu) * FLIP, last[12:15], atol=2e-3)
    assert any("neither counts" in sentence for sentence in found.report.differs)
    assert any("off-diagonal" in row.what for row in found.report.left)


def test_every_number_of_an_imported_vehicle_has_its_line() -> None:
    found = import_vehicle(HERE / "rov" / "rov.xacro")
    notes = {key: told.note for key, told in found.vehicle.provenance.items()}
    lines = (HERE / "rov" / "hydrodynamics.xacro").read_text().splitlines()
    for key, tag in (("body.volume", "<volume>"), ("damping.linear", "<linear_damping>")):
        file, number = notes[key].split(";")[0].split(":")
        assert file == "hydrodynamics.xacro" and tag in lines[int(number) - 1]
    torpedo = import_vehicle(HERE / "torpedo.sdf", forward="-x").report.taken
    source = (HERE / "torpedo.sdf").read_text().splitlines()
    limits = [row for row in torpedo if row.key.endswith(".limit") and row.unit == "rad"]
    assert limits and all("<joint" in source[int(row.place.partition(":")[2]) - 1] for row in limits)
    assert notes["thrusters.positions"] == "rov.xacro:25, 26, 27, 28"
    assert {row.key for row in found.report.taken} == set(notes)
    assert found.vehicle.mass == pytest.approx(1862.87 + 4 * 0.5, rel=1e-12)


def test_moments_that_no_body_has_are_told_with_their_place(tmp_path: Path) -> None:
    """794 kg m² is above the sum of 525 and 91, and 41.98 of a torpedo above that of 3 and 4.2."""
    rov = tmp_path / "rov"
    shutil.copytree(HERE / "rov", rov)
    (rov / "rov.xacro").write_text((rov / "rov.xacro").read_text().replace('izz="691.23"', 'izz="91.23"'))
    text = (HERE / "torpedo.sdf").read_text()
    (tmp_path / "torpedo.sdf").write_text(text.replace("<izz>41.980233</izz>", "<izz>4.2</izz>"))
    for path, place in ((rov / "rov.xacro", "rov.xacro:10"), (tmp_path / "torpedo.sdf", "torpedo.sdf:10")):
        found = import_vehicle(path)
        (sentence,) = found.report.impossible
        assert sentence.startswith(f"{place}: the link ") and "at most the sum of the two others" in sentence
        assert sentence in found.vehicle.note and sentence in str(found.report)
        assert found.report.summary()["impossible"] == [sentence]
    for right in ("rov/rov.xacro", "lauv.xacro", "torpedo.sdf"):
        assert not import_vehicle(HERE / right).report.impossible


def test_what_is_not_taken_over_is_told() -> None:
    report = import_vehicle(HERE / "rov" / "rov.xacro").report
    left = " ".join(row.what for row in report.left)
    assert all(tag in left for tag in ("<visual>", "<collision>", "<debug>"))
    assert any("row 3, column 6 is 10.774" in sentence for sentence in report.differs)
    assert "controller" in str(report) and "Not taken over" in str(report)
