"""Every example runs, for a short time, and shows the physics that it says it shows."""

from __future__ import annotations

import re
import runpy
import shutil
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import matplotlib
import matplotlib.pyplot
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import make_interp_spline

import coadjoint as co

matplotlib.use("Agg")
EXAMPLES = Path(__file__).parents[2] / "examples"
ROS_2 = Path(__file__).parent / "ros2"


@pytest.fixture
def run_example(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Run a script as a user does, in an empty folder; returns its variables."""

    def run(name: str, duration: float, *more: float, folder: Path = EXAMPLES) -> dict[str, Any]:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", [f"{name}.py", *map(str, (duration, *more))])
        found = runpy.run_path(str(folder / f"{name}.py"), run_name="__main__")
        matplotlib.pyplot.close("all")
        return found

    return run


def test_every_example_has_a_test_is_short_and_says_how_to_run_it():
    scripts = sorted(EXAMPLES.glob("*.py"))
    tested = Path(__file__).read_text(encoding="utf-8")
    assert scripts
    for script in scripts:
        text = script.read_text(encoding="utf-8")
        assert f'"{script.stem}"' in tested, f"{script.name} has no test."
        assert f"Run as: python examples/{script.name}" in text
        assert len(text.splitlines()) <= 80


@pytest.mark.long
@pytest.mark.skipif(not (shutil.which("cmake") and shutil.which("cc")), reason="no C compiler is installed")
def test_a_program_in_c_steers_a_served_vehicle_by_its_filter(run_example):
    example = run_example("robot", 15)
    found = re.findall(r"[\d.e+-]+(?= m)", example["said"])
    depth, estimated, apart = map(float, found)
    assert abs(depth - 4.0) < 0.1 and abs(estimated - depth) < 0.05 and apart < 1e-12
    if shutil.which("c++") is not None:
        _steers_as_a_node_of_ros_2(Path("robot/dive").resolve(), example["filter"])


def _steers_as_a_node_of_ros_2(dive: Path, filter: Any) -> None:
    """The node says what its law makes of the filter in Python, against headers that stand in for those of ROS 2."""
    call = ["c++", "-std=c++17", "-Wall", "-Wextra", "-Werror", "-I", str(ROS_2), "-I", str(dive)]
    subprocess.run(["cc", "-std=c99", "-c", str(dive / "dive.c"), "-o", "dive.o"], check=True)
    call += [str(EXAMPLES / "robot" / "node.cpp"), "dive.o", str(dive / "dive_code.o"), "-o", "node", "-lm"]
    subprocess.run(call, check=True, capture_output=True)
    said = subprocess.run(["./node"], check=True, capture_output=True, text=True).stdout.splitlines()
    angle, before = 0.0, float(filter.state.q[2])
    for k, text in enumerate(said):
        filter.update({"depth": 3.0 + 0.001 * k, "attitude": [1.0, 0.0, 0.0, 0.0]})
        for _ in range(2):
            filter.predict(0.05, inputs={"stern_planes": angle, "rudder": 0.0, "propeller": 15.0})
        now = float(filter.state.q[2])
        angle, before = float(np.clip(0.3 * (4.0 - now) - 0.6 * (now - before) / 0.1, -0.2, 0.2)), now
        assert float(text) == pytest.approx(angle, abs=1e-12)
    assert len(said) == 20


@pytest.mark.long
def test_a_vehicle_in_a_current_is_carried_along_and_its_balance_closes(run_example):
    found = run_example("vehicle_in_current", 60)
    run, current = found["run"], found["current"]
    assert run.summary()["balance_max"] < 1e-13
    before, after = (np.linalg.norm(run.dataset.qdot.values[k, :2] - current[:2]) for k in (0, -1))
    assert after < 0.4 * before
    assert Path("vehicle_in_current.png").stat().st_size > 10_000


@pytest.mark.long
def test_a_falling_rod_keeps_its_energy_and_hangs_below_its_wall(run_example):
    found = run_example("falling_rod", 0.2)
    run, hanging, paths = found["run"], found["hanging"], found["paths"]
    energy = run.dataset.energy.values
    fallen = 1.1 * 9.81 * 0.1**2 * np.pi * 0.6 * 0.3  # about the energy of a fall to the vertical
    assert np.ptp(energy) < 1e-4 * fallen
    assert -0.6 < hanging.g[1][-1, 1] < -0.3 and paths[-1, -1, 1] < paths[0, -1, 1] - 0.1
    assert Path("falling_rod.png").stat().st_size > 10_000


@pytest.mark.long
def test_a_network_in_the_lagrangian_of_a_top_learns_a_magnet_and_keeps_the_momentum(run_example):
    found = run_example("learned_top", 40, folder=EXAMPLES.parent / "docs" / "figures")
    rows, test = found["rows"], found["test"]
    error = {name: np.max(np.abs(found[:41, 3:] - test[:41, 3:])) for name, found in rows.items()}
    drift = {name: np.ptp(np.sum(found[:, :3] * found[:, 3:], axis=1)) for name, found in rows.items()}
    assert error["learned ℓ"] < 0.2 * min(error["known ℓ"], error["neural ODE"])
    assert drift["learned ℓ"] < 1e-13 < drift["neural ODE"]


@pytest.mark.long
def test_a_top_advected_by_noise_keeps_its_casimirs_and_shows_its_strong_orders(run_example):
    found = run_example("stochastic_top", 200)
    assert found["orders"]["one direction"]["strong"] == pytest.approx(1, abs=0.15)
    assert found["orders"]["three directions"]["strong"] == pytest.approx(0.5, abs=0.15)
    assert all(np.ptp(values) < 1e-12 for values in found["casimirs"].values())
    assert Path("stochastic_top.png").stat().st_size > 10_000


@pytest.mark.long
def test_the_fast_heavy_top_comes_near_its_reference_with_the_order_of_the_last_method(run_example):
    found = run_example("fast_heavy_top", 0.2)
    assert found["method"].order == 4
    assert abs(found["order"] - 4) < 0.2
    assert found["errors"][1] < 1e-9
    assert found["momentum"] < 1e-12


@pytest.mark.long
def test_the_drop_of_a_fluid_moves_as_its_particles_do_and_keeps_its_circulation(run_example):
    found = run_example("fluid_drop", 2)
    run = found["run"]
    assert found["error"] < 1e-9
    assert max(run.relative_change(name) for name in ("kelvin_noether", "angular_momentum")) < 1e-12
    assert np.max(np.abs(np.linalg.det(run.records.g) - 1)) < 1e-12
    circulation = 2 * found["U0"][[1, 0], [0, 1]] @ [1, -1] / 2  # of ½ tr(USUᵀ) along the turn of the particles
    assert abs(run.monitors["kelvin_noether"][0, 0]) * np.sqrt(2) == pytest.approx(abs(circulation), rel=1e-12)
    assert Path("fluid_drop.png").stat().st_size > 10_000


@pytest.mark.long
def test_a_turbulent_sphere_keeps_its_casimirs_until_viscosity_takes_its_small_scales(run_example):
    found = run_example("turbulent_sphere", 0.3)
    assert found["change"] < 1e-14 and found["energy"] < 1e-4
    enstrophy = found["fields"].enstrophy_spectrum.sum("degree").values
    assert np.ptp(enstrophy[:2]) < 1e-12 * enstrophy[0] and np.all(np.diff(enstrophy[1:]) < -0.01)
    for ending in ("png", "gif", "nc"):
        assert Path(f"turbulent_sphere.{ending}").stat().st_size > 10_000


@pytest.mark.long
def test_the_papers_vehicle_keeps_its_momentum_where_runge_and_kutta_lose_it(run_example):
    curves = run_example("paper_vehicle", 50)["curves"]
    changes = {name: [np.max(np.abs(one / one[0] - 1)) for one in pair] for name, pair in curves.items()}
    assert len(changes) == 4
    for name, (energy, momentum) in changes.items():
        if name.startswith("Runge"):
            assert 1e-10 < momentum < 1e-8 and energy < 1e-10
        else:
            assert momentum < 1e-12, name
    left, midpoint, suzuki = (
        changes[name][0] for name in ("left rectangle: the paper's", "midpoint", "Suzuki, order 4")
    )
    assert suzuki < 1e-2 * midpoint < 1e-4 * left
    assert Path("paper_vehicle.png").stat().st_size > 10_000


@pytest.mark.long
def test_the_settings_of_the_older_paper_solve_its_printed_equations(run_example):
    found = run_example("paper_semidirect", 40)
    assert {name: len(rows) for name, rows in found["residuals"].items()} == {
        "semidirect product": 4, "heavy top": 4, "principal bundle": 1,
    }  # fmt: skip
    assert max(max(rows) for rows in found["residuals"].values()) < 1e-12
    assert max(found["apart"].values()) < 1e-11
    assert Path("paper_semidirect.png").stat().st_size > 10_000


@pytest.mark.long
def test_the_charged_particle_runs_round_its_circle(run_example):
    found = run_example("heisenberg", 20)
    assert found["error"] < 1e-4 * found["radius"]
    assert found["run"].relative_change("kelvin_noether") < 1e-13
    assert Path("heisenberg.png").stat().st_size > 10_000


@pytest.mark.long
def test_waves_of_alfven_have_the_frequencies_of_the_closed_form(run_example):
    found = run_example("alfven_waves", 8)
    assert found["error"] < 2e-4 and found["casimirs"] < 1e-13
    assert Path("alfven_waves.png").stat().st_size > 10_000


@pytest.mark.long
def test_particles_around_a_monopole_run_around_circles_with_half_their_solid_angle_as_phase(run_example):
    found = run_example("monopole", 4)
    for run, rho, geometric in found["circles"].values():
        assert np.ptp(run.momentum) < 1e-13
        assert abs(geometric - np.pi * (1 - np.cos(rho))) < 0.01
    assert found["apart"] < 1e-11
    assert Path("monopole.png").stat().st_size > 10_000


@pytest.mark.long
def test_the_spherical_pendulum_keeps_its_sphere_and_the_vertical_momentum(run_example):
    found = run_example("spherical_pendulum", 10)
    assert found["off_sphere"] < 1e-13
    bands = {
        name: np.max(np.abs(run.dataset.energy.values / run.dataset.energy.values[0] - 1))
        for name, run in found["runs"].items()
    }
    for run in found["runs"].values():
        assert run.relative_change("kelvin_noether") < 1e-13
    assert bands["Suzuki 4"] < 0.1 * bands["midpoint"] < 1e-3
    assert Path("spherical_pendulum.png").stat().st_size > 10_000


@pytest.mark.long
def test_a_fleet_of_plates_keeps_its_horizontal_momenta(run_example):
    found = run_example("falling_plates", 2)
    momenta = found["fleet"].dataset.kelvin_noether.transpose("member", "time", ...).values
    assert momenta.shape[0] == found["plates"]
    assert np.max(np.abs(momenta - momenta[:, :1])) < 1e-12
    assert Path("falling_plates.png").stat().st_size > 10_000


@pytest.mark.long
def test_a_cat_lands_on_its_feet_without_momentum(run_example):
    found = run_example("falling_cat", 0.5)
    assert found["momentum"] < 1e-15
    assert abs(abs(found["turn"][-1]) - 180) < 3
    assert Path("falling_cat.png").stat().st_size > 10_000


@pytest.mark.long
def test_remus_reaches_the_depth_that_it_is_told(run_example):
    found = run_example("remus_mission", 60)
    data = found["data"]
    assert abs(float(data.q[-1, 2]) - 10.0) < 0.3
    assert np.max(np.abs(data.internal_stern_planes.values)) <= np.radians(15)
    assert found["run"].summary()["energy_budget_error_max"] < 1e-5
    for name in ("remus_mission.png", "remus_energy.png"):
        assert Path(name).stat().st_size > 10_000


@pytest.mark.long
def test_a_fleet_of_remus_spreads_with_its_currents_and_holds_its_depth(run_example):
    found = run_example("remus_fleet", 60, 100)
    fleet, q = found["fleet"], found["found"].q
    assert not fleet.failures and found["hunting"].sum() == 0
    drift = fleet.system.parameters.water.velocity.values[:, 1]
    assert np.corrcoef(fleet.dataset.q[:, -1, 1], drift)[0, 1] > 0.9
    assert q.sel(statistic="std")[-1, 1] > 1.0 > 0.1 > q.sel(statistic="std")[-1, 2]
    assert Path("remus_fleet.png").stat().st_size > 10_000


@pytest.mark.long
def test_a_policy_learns_to_hold_a_station(run_example):
    found = run_example("learned_station", 6, 32)
    returns = [mean for _, mean in found["curve"]]
    assert returns[-1] > 0.75 * returns[0]
    still, drifting = (found["found"]["Hover", where][1] for where in ("still water", "0.3 m/s"))
    assert np.median(still[-1]) < 0.01 and np.median(drifting[-1]) < 0.05
    assert still.shape == (600, 64) and found["weights"].shape == (24, 8)
    assert Path("learned_station.png").stat().st_size > 10_000


@pytest.mark.long
def test_remus_crosses_a_jet_clear_of_the_column_and_with_less_energy_in_more_time(run_example):
    found = run_example("remus_crossing", 80)["found"]
    (time, most, _, q), (longer, least, _, deep) = found["least time"], found["least energy"]
    assert time < 0.5 * longer and least < 0.5 * most
    assert np.min(np.hypot(*(q[:, :2] - [52.0, -14.0]).T)) == pytest.approx(8.0, abs=0.1)
    assert np.max(deep[:, 2]) == pytest.approx(12.0, abs=1e-3) and np.max(q[:, 2]) < 11.0
    assert max(off for _, _, off, _ in found.values()) < 0.5
    assert Path("remus_crossing.png").stat().st_size > 10_000


@pytest.mark.long
def test_predictive_control_of_remus_keeps_nearer_to_a_path_than_the_shipped_controllers_in_the_same_time(run_example):
    found = run_example("remus_path", 60)
    ours, shipped = (found["found"][name] for name in ("predictive", "shipped"))
    assert all(answer.status == "solved" for answer in found["answers"])
    assert ours[0] == pytest.approx(shipped[0], abs=0.1)  # s
    assert ours[1] < shipped[1] and ours[2] < 1.5  # J, m
    assert ours[3] < 0.6 * shipped[3] < 0.3  # m
    rudder = np.array([float(answer.command["rudder"]) for answer in found["answers"]])
    assert np.max(np.abs(rudder)) <= np.radians(15) and np.max(np.abs(np.diff(rudder))) <= 0.25 + 1e-6  # 1 rad/s
    assert Path("remus_path.png").stat().st_size > 10_000


@pytest.mark.long
def test_the_best_sawtooth_comes_to_the_steady_glide_of_least_energy_with_the_length_of_its_dives(run_example):
    found = run_example("glider_sawtooth", 120)
    least, best, drag_and_lift = found["effort"](found["best"]), found["glide"], found["drag_and_lift"]
    around = [found["effort"](found["best"] + step) for step in (-0.001, 0.001)]
    assert least < min(around)
    above = np.array([row[0] - least for row in found["found"].values()])  # dives of 15, 30, 60 and 120 s
    assert np.all(above > 0) and above[-2:] / above[-3:-1] == pytest.approx(0.5, abs=0.03)
    energy, path, alpha = found["found"][120.0]
    assert path == pytest.approx(best, abs=2e-4) and energy == pytest.approx(least, rel=6e-3)
    assert np.tan(path) == pytest.approx(np.divide(*drag_and_lift(alpha)), rel=1e-3)
    assert Path("glider_sawtooth.png").stat().st_size > 10_000


@pytest.mark.long
def test_a_top_swings_up_and_keeps_the_momentum_about_the_vertical(run_example):
    found = run_example("top_swung_up", 0.8)
    run, vertical = found["run"], found["vertical"]
    assert run.a[0] == pytest.approx([-1.0, 0.0, 0.0]) and np.asarray(run.a[-1]) == pytest.approx([1, 0, 0], abs=1e-6)
    assert np.ptp(vertical) < 1e-12 and vertical[0] == pytest.approx(-0.32)
    assert np.asarray(run.mu[-1, 1:]) == pytest.approx([0.0, 0.0], abs=1e-6)
    assert Path("top_swung_up.png").stat().st_size > 10_000


@pytest.mark.long
def test_a_remotely_operated_vehicle_finds_the_tide_and_holds_its_station(run_example):
    found = run_example("rov_in_tide", 24)
    assert found["settled"].max() < 0.025 < 0.3 < np.linalg.norm(found["off"][0])  # m
    assert np.max(np.abs(found["known"][-20:, :2] - found["truth"][-20:, :2])) < 0.08  # of 0.3 m/s
    assert set(found["steering"].record.statuses) == {"solved"}
    assert np.all(found["thrusts"] >= found["low"]) and np.all(found["thrusts"] <= found["high"])
    assert Path("rov_in_tide.png").stat().st_size > 10_000


@pytest.mark.long
def test_splines_go_through_the_attitudes_and_join_smoothly(run_example):
    found = run_example("attitude_splines", 15)
    for optimum in found["found"].values():
        runs = [run.records for run in optimum.runs.values()]
        for run, R in zip(runs, found["attitudes"][1:], strict=True):
            assert np.asarray(run.g[-1]) == pytest.approx(R, abs=1e-7)
        for before, after in pairwise(runs):
            assert np.asarray(before.mu[-1]) == pytest.approx(np.asarray(after.mu[0]), abs=1e-10)
    assert Path("attitude_splines.png").stat().st_size > 10_000


@pytest.mark.long
def test_about_one_axis_they_are_the_splines_of_numbers_to_second_order(run_example):
    """Clamped splines of degree 3 and 7 through the angles; u is the second and the fourth derivative."""
    found = run_example("attitude_splines", 6)
    angles, fine = [0.0, 1.0, 0.4, 0.9], np.linspace(0.0, 3.0, 30001)
    attitudes = [co.attitude.zyx(angle, 0.0, 0.0) for angle in angles]
    rest = {"q": np.zeros(3), "qdot": np.zeros(3)}
    for system, degree, given in (("cubic", 3, {}), ("seventh", 7, rest)):
        clamped = [(k, 0.0) for k in range(1, degree // 2 + 1)]
        known = make_interp_spline([0, 1, 2, 3], angles, k=degree, bc_type=(clamped, clamped))
        least = np.trapezoid(0.5 * known(fine, nu=degree // 2 + 1) ** 2, fine)
        costs = [sum(found["spline"](found[system], attitudes, n, **given).costs.values()) for n in (10, 20)]
        errors = np.abs(np.array(costs) - least)
        assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.2) and errors[1] < 0.02 * least


@pytest.mark.long
def test_a_rolling_disk_stays_on_its_circle_and_does_not_slip(run_example):
    found = run_example("rolling_disk", 2)
    errors = list(found["errors"].values())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.1)
    assert np.log2(errors[2] / errors[3]) == pytest.approx(4, abs=0.1)
    assert found["slip"] < 1e-14
    assert np.mean(found["force"]) == pytest.approx(2 * 9.81, rel=0.05)
    assert Path("rolling_disk.png").stat().st_size > 10_000


@pytest.mark.long
def test_a_four_bar_linkage_closes_its_loop_while_its_crank_turns(run_example):
    found = run_example("four_bar", 1)
    assert found["opening"].max() < 1e-12
    assert found["linkage"].freedoms(found["start"]) == 1
    assert found["angles"].drive.values[-1] > 2 * np.pi and np.ptp(found["angles"].pivot.values) < np.pi
    assert Path("four_bar.png").stat().st_size > 10_000


@pytest.mark.long
def test_bricards_linkage_moves_with_one_freedom_and_comes_back(run_example):
    found = run_example("bricard", 5.5)
    assert found["linkage"].freedoms(found["start"]) == 1 and found["loop"] < 1e-12
    assert found["run"].relative_change("energy") < 1e-5
    corner, t = found["first"][:, 3], found["run"].records.t
    late = (t > 4) & (t < 5.5)
    back = np.linalg.norm(corner - corner[0], axis=1)[late].min()
    assert corner[0] == pytest.approx([1, -1, 1]) and corner[:, 1].min() == pytest.approx(-np.sqrt(3), abs=1e-3)
    assert back < 1e-3
    assert Path("bricard.png").stat().st_size > 10_000


@pytest.mark.long
def test_the_end_of_a_folded_chain_falls_as_that_of_a_continuum_and_faster_than_a_stone(run_example):
    found = run_example("falling_chain", 21)
    assert found["times"] == pytest.approx(found["smooth"], rel=0.03) and found["times"] < 0.92 * found["stone"]
    assert found["faster"] > 3
    assert found["run"].extrema["constraint_gap"][1] < 1e-13
    assert Path("falling_chain.png").stat().st_size > 10_000


@pytest.mark.long
def test_a_rattleback_turns_back_from_one_sense_alone(run_example):
    found = run_example("rattleback", 10)
    assert found["spins"][-5.0][-1] > 4.5 and found["spins"][5.0].min() > 4.5
    for run in found["runs"].values():
        assert run.relative_change("energy") < 3e-3 and run.extrema["constraint_rate"][1] < 1e-14
    assert Path("rattleback.png").stat().st_size > 10_000


@pytest.mark.long
def test_a_snakeboard_goes_where_its_momentum_equation_leads(run_example):
    """p = mv(1 + tan²φ) + (J_r/l)ψ̇ tan φ, ṗ = (ml tan φ v + J_rψ̇)φ̇/(l cos²φ), by SciPy."""
    found = run_example("snakeboard", 10)
    m, l, rotor = found["mass"], found["half"], found["rotor"]

    def slopes(t, y, k, n):
        spin, tan, turned = 1.2 * k * np.cos(k * t), np.tan(0.6 * np.sin(n * t)), 0.6 * n * np.cos(n * t)
        v = (y[0] - rotor / l * spin * tan) / (m * (1 + tan**2))
        return [
            (m * l * tan * v + rotor * spin) * (1 + tan**2) * turned / l,
            tan * v / l,
            v * np.cos(y[1]),
            v * np.sin(y[1]),
        ]

    for name, gait in {"drive": (1, 1), "turn": (2, 1), "park": (3, 2)}.items():
        end = solve_ivp(slopes, (0, 10), np.zeros(4), args=gait, rtol=1e-9, atol=1e-10).y[:, -1]
        turn, place = found["runs"][name].records.g
        assert place[-1] == pytest.approx(end[2:], abs=2e-3)
        assert [turn[-1, 0, 0], turn[-1, 1, 0]] == pytest.approx([np.cos(end[1]), np.sin(end[1])], abs=5e-3)
    assert Path("snakeboard.png").stat().st_size > 10_000


@pytest.mark.long
def test_a_double_spherical_pendulum_keeps_its_vertical_momentum_and_its_cone(run_example):
    found = run_example("double_spherical_pendulum", 4)
    assert np.ptp(found["momentum"]) < 1e-12 * abs(found["momentum"][0])
    assert np.ptp(found["height"], axis=0).max() < 1e-7
    assert found["run"].relative_change("energy") < 1e-5
    assert Path("double_spherical_pendulum.png").stat().st_size > 10_000


def double_pendulum(t, y):
    """Two slender rods of 1 kg and 1 m, by their angles to the vertical."""
    first, second, apart = y[0], y[1], y[0] - y[1]
    mass = [[4 / 3, 0.5 * np.cos(apart)], [0.5 * np.cos(apart), 1 / 3]]
    loads = [
        -0.5 * np.sin(apart) * y[3] ** 2 - 1.5 * 9.81 * np.sin(first),
        0.5 * np.sin(apart) * y[2] ** 2 - 0.5 * 9.81 * np.sin(second),
    ]
    return [*y[2:], *np.linalg.solve(mass, loads)]


@pytest.mark.long
def test_a_double_pendulum_moves_as_its_equations_in_angles_say_and_parts_from_its_neighbour(run_example):
    found = run_example("double_pendulum", 4)
    known = solve_ivp(double_pendulum, (0, 1), [2.0, 2.5, 0, 0], rtol=1e-10, atol=1e-10).y[:, -1]
    shoulder, elbow = (found[name][0, 100] for name in ("shoulder", "elbow"))
    assert found["time"][100] == pytest.approx(1.0)
    assert np.allclose([shoulder, shoulder + elbow], known[:2], atol=2e-4)
    assert found["apart"][-1] > 20 * found["APART"]
    assert np.max(found["run"].extrema["constraint_gap"]) < 1e-12
    assert Path("double_pendulum.png").stat().st_size > 10_000


@pytest.mark.long
def test_reaction_wheels_turn_a_satellite_while_its_total_momentum_stays_zero(run_example):
    found = run_example("satellite", 120)
    assert found["total"] < 1e-14 < 0.1 < np.abs(found["body"]).max()
    assert found["error"] < 0.05  # degrees
    assert np.abs(found["run"].dataset.inputs_torque.values).max() <= 0.05
    assert Path("satellite.png").stat().st_size > 10_000


@pytest.mark.long
def test_a_quadrotor_comes_to_its_path_and_stays_there(run_example):
    found = run_example("quadrotor", 6)
    assert found["distance"].max() < 0.4 and found["distance"][found["time"] > 3].max() < 0.02
    hover = found["p"].mass * 9.81
    assert found["run"].dataset.inputs_thrusts.values[-1].sum() == pytest.approx(hover, rel=0.01)
    assert Path("quadrotor.png").stat().st_size > 10_000
