"""Shipped vehicles: all load, each number knows where it is from, and they are what their sources say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import coadjoint_vehicles as vehicles


@pytest.mark.parametrize("name", vehicles.names())
def test_every_number_of_a_shipped_vehicle_names_its_source(name: str) -> None:
    vehicle = vehicles.load(name)
    assert vehicle.name and vehicle.description
    nameless = [key for key, found in vehicle.provenance.items() if not found.source or not found.unit]
    assert nameless == []
    assert all(len(citation) > 20 for citation in vehicle.sources.values())


SPDX = {"Apache-2.0", "MIT", "CC-BY-4.0"}
"""Licences of sources that NOTICE names."""


@pytest.mark.parametrize("name", vehicles.names())
def test_a_shipped_vehicle_and_each_of_its_sources_have_a_licence(name: str) -> None:
    vehicle = vehicles.load(name)
    declared = {key: text for key, text in vehicle.licences.items() if key in vehicle.sources}
    assert vehicle.licence == "Apache-2.0" and declared == vehicle.licences
    assert vehicle.sources.keys() == declared.keys()
    for text in declared.values():
        assert text.partition(",")[0] in SPDX or text == "none stated: numbers only"


def test_the_notice_names_the_licences_of_all_sources() -> None:
    notice = (Path(__file__).parents[3] / "vehicles" / "NOTICE").read_text("utf-8")
    assert all(licence in notice for licence in SPDX)


def test_remus_has_the_mass_of_its_ellipsoid_and_the_damping_of_its_time_constants() -> None:
    """D = (M₁/20 s, M₂/20 s, M₃/20 s, 2ζ√(M₄ W z_g), 2ζ√(M₅ W z_g), M₆/1 s), ζ = 0.3 in roll and 0.8 in pitch."""
    vehicle = vehicles.load("remus_100")
    assert vehicle.warnings == ()
    mass, z = 4 / 3 * np.pi * 1026 * 0.8 * 0.095**2, 0.02
    assert vehicle.mass == pytest.approx(mass, rel=1e-14)
    assert vehicle.buoyancy == pytest.approx(mass * 9.81, rel=1e-14)
    M = np.array([mass, mass, mass, 0.1120 + mass * z**2, 4.0278 + mass * z**2, 4.0278]) + np.diag(vehicle.added_mass)
    righting = np.sqrt(M[3:5] * mass * 9.81 * z)
    expected = [*(M[:3] / 20), 0.6 * righting[0], 1.6 * righting[1], M[5]]
    parts = {name: vehicle.part(name).parameters() for name in ("damping", "hull", "propeller")}
    np.testing.assert_allclose(parts["damping"]["linear"], expected, rtol=1e-14)
    assert parts["hull"]["axial_area"] == pytest.approx(np.pi / 4 * 0.19**2, rel=1e-14)
    assert parts["propeller"]["thrust"][1] == pytest.approx((0.1798 - 0.4566) / 0.6632, rel=1e-14)
    assert parts["propeller"]["torque"][1] == pytest.approx((0.0312 - 0.0700) / 0.6632, rel=1e-14)


def test_every_coefficient_of_added_mass_of_nps_is_in_si_as_in_its_simulator() -> None:
    """M_A + M_RB of MSS, from the prime numbers by hand: ½ρL³, ½ρL⁴, ½ρL⁵, and I about the origin."""
    vehicle = vehicles.load("nps_auv_ii")
    r3, r4, r5 = (0.5 * 1025 * 5.3**k for k in (3, 4, 5))
    M = np.asarray(vehicle.added_mass)
    assert M[0, 0] == pytest.approx(7.6e-3 * r3) and M[2, 2] == pytest.approx(2.4e-1 * r3)
    assert M[1, 5] == M[5, 1] == pytest.approx(-1.2e-3 * r4) and M[2, 4] == pytest.approx(6.8e-3 * r4)
    assert M[3, 3] == pytest.approx(1.0e-3 * r5) and M[3, 5] == pytest.approx(3.4e-5 * r5)
    assert np.count_nonzero(M) == 14
    about_origin = np.asarray(vehicle.inertia) + vehicle.mass * np.diag([0.061**2, 0.061**2, 0.0])
    assert about_origin == pytest.approx(np.array([[2038, 13.58, 13.58], [13.58, 13587, 13.58], [13.58, 13.58, 13587]]))
    assert vehicle.warnings == ()


NPS = {
    "X": "pp 7.0e-3 qq -1.5e-2 rr 4.0e-3 pr 7.5e-4 wq -2.0e-1 vp -3.0e-3 vr 2.0e-2 vv 5.3e-2 ww 1.7e-1",
    "Y": "pq 4.0e-3 qr -6.5e-3 p 3.0e-3 r 3.0e-2 vq 2.4e-2 wp 2.3e-1 wr -1.9e-2 v -1.0e-1 vw 6.8e-2",
    "Z": "pp 1.3e-4 pr 6.7e-3 rr -7.4e-3 q -1.4e-1 vp -4.8e-2 vr 4.5e-2 w -3.0e-1 vv -6.8e-2",
    "K": "pq -6.9e-5 qr 1.7e-2 p -1.1e-2 r -8.4e-4 vq -5.1e-3 wp -1.3e-4 wr 1.4e-2 v 3.1e-3 vw -1.9e-1",
    "M": "pp 5.3e-5 pr 5.0e-3 rr 2.9e-3 q -6.8e-2 vp 1.2e-3 vr 1.7e-2 w 1.0e-1 vv -2.6e-2",
    "N": "pq -2.1e-2 qr 2.7e-3 p -8.4e-4 r -1.6e-2 vq -1.0e-2 wp -1.7e-2 wr 7.4e-3 v -7.4e-3 vw -2.7e-2",
}
"""Healey and Lienard (1993) as its simulator has them, read again; a derivative by one velocity stands with u."""


def test_every_derivative_of_nps_has_the_sign_and_size_of_a_second_reading() -> None:
    vehicle = vehicles.load("nps_auv_ii")
    told = {key: value.value for key, value in vehicle.provenance.items() if key.startswith("manoeuvring.")}
    published = {key.partition(".")[2]: value for key, value in told.items()}
    again: dict[str, float] = {}
    for row, text in NPS.items():
        words = text.split()
        for letters, number in zip(words[::2], words[1::2], strict=True):
            again[f"{row}_{letters if len(letters) == 2 else 'u' + letters}"] = float(number)
    assert published == again


def test_derivatives_with_added_mass_leave_forces_and_lagrangian_together_as_published() -> None:
    """The Coriolis and Munk terms that ℓ makes and those left in the part are what the source says."""
    from coadjoint_vehicles.files.read_derivatives import added_mass_derivatives

    vehicle = vehicles.load("nps_auv_ii")
    part, own = vehicle.part("manoeuvring"), added_mass_derivatives(np.asarray(vehicle.added_mass))
    published = {
        key.partition(".")[2]: told.value for key, told in vehicle.provenance.items() if key.startswith("manoeuvring.")
    }
    assert len(published) == 52 and (published["X_wq"], published["M_uw"], published["N_uv"]) == (-0.2, 0.1, -7.4e-3)
    for name, value in published.items():
        power = 2 + (name[0] in "KMN") + sum(letter in "pqr" for letter in name[2:])
        scale = 0.5 * vehicle.fluid_density * vehicle.length**power
        total = part.coefficients.get(name, 0.0) * scale + own.get(name, 0.0)
        assert total == pytest.approx(value * scale, rel=1e-12), name
    remus = vehicles.load("remus_100_sgarioto").part("manoeuvring")
    assert "X_wq" not in remus.coefficients and "Y_wp" not in remus.coefficients  # all of these is added mass
    assert remus.coefficients["M_uw"] == pytest.approx(24.0 - (35.5 - 0.93))


def test_derivatives_of_an_added_mass_are_kirchhoffs_equations() -> None:
    from coadjoint_vehicles.files.read_derivatives import added_mass_derivatives

    rng = np.random.default_rng(3)
    A = rng.normal(size=(6, 6))
    M = A @ A.T
    V = dict(zip("uvwpqr", rng.normal(size=6), strict=True))
    total = dict.fromkeys("XYZKMN", 0.0)
    for name, value in added_mass_derivatives(M).items():
        total[name[0]] += value * V[name[2]] * V[name[3]]
    v, omega = np.array([V[k] for k in "uvw"]), np.array([V[k] for k in "pqr"])
    P, Pi = np.split(M @ np.concatenate([v, omega]), 2)
    wrench = np.concatenate([-np.cross(omega, P), -np.cross(omega, Pi) - np.cross(v, P)])
    assert np.array(list(total.values())) == pytest.approx(wrench, rel=1e-12)
    assert wrench @ [V[k] for k in "uvwpqr"] == pytest.approx(0.0, abs=1e-12)  # they do no work


def test_rexrov_is_turned_from_its_two_systems_of_axes() -> None:
    vehicle = vehicles.load("rexrov")
    assert vehicle.center_of_buoyancy == pytest.approx([0, 0, -0.3])  # above, in axes that point down
    assert vehicle.inertia[0] == pytest.approx([525.39, -1.44, -33.41])
    assert vehicle.added_mass[1, 3] == 409.44 and vehicle.added_mass[2, 5] == pytest.approx(10.7745)
    thrusters = vehicle.part("thrusters")
    assert thrusters.positions[0] == pytest.approx([-0.890895, -0.334385, -0.528822])
    assert np.linalg.norm(thrusters.directions, axis=1) == pytest.approx(np.ones(8), abs=1e-12)
    assert np.linalg.matrix_rank(np.vstack([thrusters.directions.T, np.cross(*_both(thrusters)).T])) == 6
    assert any("not symmetric: row 3, column 6 is 10.774" in sentence for sentence in vehicle.warnings)


def _both(thrusters):
    return thrusters.positions, thrusters.directions


def test_the_three_bluerovs_disagree_and_are_kept_apart() -> None:
    names = [name for name in vehicles.names() if name.startswith("bluerov2_heavy")]
    assert len(names) == 3 and "bluerov2" not in vehicles.names()
    sway = sorted(float(np.diag(vehicles.load(name).added_mass)[1]) for name in names)
    drag = sorted(float(vehicles.load(name).part("damping").quadratic[1]) for name in names)
    assert sway == pytest.approx([7.1206, 12.7, 24.86]) and drag == pytest.approx([21.66, 36.95, 217.0])
    net = {
        name: vehicle.mass * vehicle.gravity - vehicle.buoyancy for name in names for vehicle in [vehicles.load(name)]
    }
    assert net["bluerov2_heavy_blue"] == pytest.approx(2.0)
    assert net["bluerov2_heavy_diff_uv"] == pytest.approx(-1.985)


def test_the_paper_vehicle_from_its_file_is_that_of_table_1() -> None:
    from coadjoint.models import TABLE_1

    vehicle = vehicles.load("ono_fiori_peng")
    assert vehicle.mass == TABLE_1["mass"] and vehicle.buoyancy == pytest.approx(TABLE_1["buoyancy"], rel=1e-14)
    assert np.diag(vehicle.added_mass)[:3] == pytest.approx(TABLE_1["added_mass"])
    assert np.diag(vehicle.inertia) == pytest.approx(TABLE_1["inertia"])
    assert vehicle.center_of_buoyancy == pytest.approx(TABLE_1["center_of_buoyancy"])


def test_the_ellipsoid_has_lambs_added_mass_and_weighs_what_it_displaces() -> None:
    from coadjoint_vehicles.hydrodynamics import ellipsoid_added_mass

    vehicle = vehicles.load("ellipsoid")
    assert np.array_equal(vehicle.added_mass, ellipsoid_added_mass((0.5, 0.2, 0.3), 1000.0))
    assert vehicle.mass == pytest.approx(4 / 3 * np.pi * 1000 * 0.03, rel=1e-14)
    a, b, c = 0.5, 0.2, 0.3
    solid = vehicle.mass / 5 * np.array([b * b + c * c, c * c + a * a, a * a + b * b])
    assert np.diag(vehicle.inertia) == pytest.approx(solid, rel=1e-14)


def test_gliders_are_in_balance_with_what_moves_in_them() -> None:
    from coadjoint_vehicles.model.loads import loads

    for name, mass in (("slocum_graver", 50.0), ("lrauv_tethys", 148.3571)):
        vehicle = vehicles.load(name)
        assert loads(vehicle).mass == pytest.approx(mass)
        assert loads(vehicle).volume * vehicle.fluid_density == pytest.approx(mass, rel=1e-12)


def _planar(name: str, delta: float):
    """(v, r) ↦ (Y, N) at 1.5 m/s ahead with the rudder at `delta`, and the masses of sway and yaw."""
    from coadjoint.kernels.trace.evaluate import tabulate
    from coadjoint_vehicles.trim.under_way import Level

    level = Level(vehicles.load(name))
    names = [part.name for part in level.vehicle.commanded]
    commands = np.array([delta if found == "rudder" else 0.0 for found in names])
    push = tabulate(level.push, np.zeros(6), commands)
    rows = [1, 5]
    return lambda x: np.asarray(push(np.array([1.5, x[0], 0, 0, 0, x[1]]), commands))[rows], level.mass[
        np.ix_(rows, rows)
    ]


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("name", "growth", "turn"),
    [("remus_100_prestero", 0.995, 10.38), ("remus_100_sgarioto", 0.995, 10.38), ("remus_100", -0.194, 10.69)],
)
def test_sets_of_remus_turn_and_grow_as_the_page_says(name: str, growth: float, turn: float) -> None:
    """The whole sets are unstable in sway and yaw; only the composed one, with larger fins further aft, is not."""
    from scipy.optimize import fsolve

    ahead, M = _planar(name, 0.0)
    h = 1e-6
    slope = np.array([(ahead(e) - ahead(-e)) / (2 * h) for e in h * np.eye(2)]).T
    assert np.max(np.linalg.eigvals(np.linalg.solve(M, slope)).real) == pytest.approx(growth, abs=2e-3)
    steered, _ = _planar(name, np.radians(5.0))
    rate = fsolve(steered, [-0.08, 0.18], xtol=1e-12)[1]
    assert np.degrees(rate) == pytest.approx(turn, abs=0.03)


def test_the_rudder_of_prestero_has_the_slopes_of_his_code() -> None:
    rudder = vehicles.load("remus_100_prestero").part("rudder").coefficients
    assert rudder == {"Y_uu_rudder": -9.64, "N_uu_rudder": 6.15}
    fin = vehicles.load("remus_100").part("rudder")
    slope = 0.5 * 1026 * float(fin.area) * float(fin.lift_slope)
    assert slope / 9.64 == pytest.approx(2.21, abs=0.01) and 0.8 * slope / 6.15 == pytest.approx(2.77, abs=0.01)
