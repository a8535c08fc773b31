"""Figures and animations of vehicles: where it went, north up and depth down, with what it was told."""

from __future__ import annotations

import numpy as np
import pytest
import xarray
from matplotlib.colors import to_hex
from matplotlib.ticker import FixedLocator
from PIL import Image

from coadjoint.errors import ArgumentError
from coadjoint.plotting.entries import entries
from coadjoint.plotting.player import page
from coadjoint.plotting.plots import OWN, Plots, available, figure_names
from coadjoint.plotting.scene_of_runs import scene
from made_runs import VEHICLE, dataset

OF_VEHICLES = set(figure_names(films=False)) - set(OWN)


def line(axes, label):
    (found,) = [line for line in axes.get_lines() if line.get_label() == label]
    return found


def test_the_track_is_drawn_north_up_with_its_way_points():
    run = dataset()
    axes = Plots(run).track(way_points=[[3, 4], [5, 6]]).axes[0]
    assert np.array_equal(line(axes, "track").get_xdata(), run.q.values[:, 1])
    assert np.array_equal(line(axes, "track").get_ydata(), run.q.values[:, 0])
    assert np.array_equal(line(axes, "way points").get_xydata()[1:], [[4, 3], [6, 5]])
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("east (m)", "north (m)")


def test_the_depth_grows_downwards_beside_its_set_point():
    run = dataset()
    axes = Plots(run).depth().axes[0]
    assert axes.yaxis_inverted()
    assert np.array_equal(line(axes, "depth").get_ydata(), run.q.values[:, 2])
    assert np.array_equal(line(axes, "set point").get_ydata(), run.inputs_depth.values)


def test_speeds_are_those_through_the_water():
    run = dataset()
    above, below = Plots(run).speeds().axes
    sway = above.get_lines()[1].get_ydata()
    assert np.allclose(sway, run.nu.values[:, 1] - 0.2)
    assert np.allclose(below.get_lines()[2].get_ydata(), np.degrees(run.xi.values[:, 2]))


def test_actuators_stand_beside_what_they_were_told_and_near_limits():
    rudder, thrusters = Plots(dataset()).actuators().axes
    assert np.allclose(line(rudder, "command").get_ydata(), np.degrees(dataset().internal_controller_value_rudder))
    heights = sorted(np.ravel([curve.get_ydata()[0] for curve in rudder.get_lines() if curve.get_linewidth() == 0.8]))
    assert heights[0] == pytest.approx(np.degrees(-0.25))
    assert heights[-1] == pytest.approx(np.degrees(0.25))
    assert [text.get_text() for text in thrusters.get_legend().get_texts()] == ["thrusters 1", "2"]
    assert rudder.get_ylabel() == "rudder (°)"


def test_an_actuator_that_goes_to_both_sides_shows_both_limits():
    lopsided = dataset(internal_rudder=0.2 * np.sin(np.linspace(0, 3.4, 200)))
    rudder = Plots(lopsided).actuators().axes[0]
    limits = [line.get_ydata()[0] for line in rudder.get_lines() if line.get_color() == "#bb0000"]
    assert np.allclose(sorted(limits), np.degrees([-0.25, 0.25]))


def test_a_key_stays_within_its_figure_and_clear_of_powers_of_ten():
    parts = ("damping", "hull", "fins", "rudder", "propeller")
    works = {f"work_{name}": 1e9 * np.linspace(0, 1, 200) for name in parts}
    figure = Plots(dataset(work_drag=None, work_thrust=None, **works)).mission()
    figure.draw_without_rendering()
    (axes,) = [axes for axes in figure.axes if axes.get_ylabel().startswith("energy put in")]
    key, power = axes.get_legend().get_window_extent(), axes.yaxis.get_offset_text()
    assert [text.get_text() for text in axes.get_legend().get_texts()] == list(parts)
    assert key.x1 <= figure.bbox.x1
    assert power.get_text()
    assert power.get_window_extent().x1 <= key.x0


def test_ballast_is_drawn_in_litres():
    run = dataset(internal_pump=np.linspace(0, 2e-5, 200))
    run.internal_pump.attrs["units"] = "m³"
    pump = Plots(run).actuators().axes[-1]
    assert pump.get_ylabel() == "pump (L)"
    assert pump.get_lines()[0].get_ydata()[-1] == pytest.approx(0.02)


@pytest.mark.long
def test_an_ensemble_tells_how_many_are_drawn_and_whose_command_it_is():
    for members, name, of in ((20, "Midpoint(Cayley), 20 members", "the first"), (2, "member 0", "member 0")):
        many = xarray.concat([dataset()] * members, "member").assign_coords(member=np.arange(members))
        many = many.assign_attrs(method="Midpoint(Cayley)")
        drawn = [getattr(Plots(many), of)() for of in ("actuators", "mission", "track", "attitude", "budget")]
        for figure in drawn:
            (legend,) = figure.legends
            assert legend.get_texts()[0].get_text() == name
        line(Plots(many).actuators().axes[0], f"command of {of}")


def test_the_attitude_of_one_run_is_not_called_by_its_method():
    (legend,) = Plots(dataset()).attitude().legends
    assert [text.get_text() for text in legend.get_texts()] == ["angle", "set point"]
    assert not Plots(dataset(inputs_heading=None)).attitude().legends


def test_the_attitude_shows_the_heading_that_was_wanted():
    yaw = Plots(dataset()).attitude().axes[0]
    assert line(yaw, "set point").get_ydata()[-1] == pytest.approx(np.degrees(1.0))


def test_a_heading_that_was_wanted_stands_beside_the_one_that_was_reached():
    """A set point of 350° is reached by a turn to port, at −10°."""
    time = np.linspace(0, 10, 200)
    heading = np.radians(np.where(time < 5, -4 * time, 4 * time + 335))
    north = np.stack([np.cos(heading), -np.sin(heading), 0 * time], axis=1)
    run = dataset(a_north=north, inputs_heading=np.radians(np.where(time < 5, 340.0, 10.0)))
    (angles,) = [axes for axes in Plots(run).mission().axes if axes.get_ylabel() == "angle (°)"]
    reached = angles.get_lines()[3].get_ydata()
    wanted = line(angles, "set point").get_ydata()
    assert reached[-1] == pytest.approx(15)
    assert wanted[[0, -1]] == pytest.approx([-20, 10])


def test_a_run_of_no_vehicle_has_none_of_these():
    run = dataset(**VEHICLE)
    assert not OF_VEHICLES & set(available(run))
    for name in OF_VEHICLES:
        with pytest.raises(ArgumentError, match="`down` and `north`"):
            getattr(Plots(run), name)()


def test_a_vehicle_without_actuators_or_current_is_told_so():
    run = dataset(current=None, internal_rudder=None, internal_thrusters=None, internal_controller_value_rudder=None)
    assert available(run)[-4:] == ["mission", "track", "depth", "speeds"]
    with pytest.raises(ArgumentError, match="no actuators"):
        Plots(run).actuators()
    with pytest.raises(ArgumentError, match="still water"):
        Plots(run).current()


def test_a_gif_shows_the_vehicle_move(tmp_path):
    path = Plots(dataset()).animation(path=tmp_path / "dive.gif", frames=12)
    with Image.open(path) as pictures:
        assert pictures.n_frames == 12
        shown = []
        for number in (0, 11):
            pictures.seek(number)
            shown.append(np.asarray(pictures.convert("RGB"), dtype=int))
    assert np.count_nonzero(np.abs(shown[1] - shown[0]).sum(axis=2) > 50) > 200
    assert to_hex(shown[0][0, 0] / 255.0) == "#ffffff" or shown[0][0, 0].min() > 245
    assert [file.name for file in tmp_path.iterdir()] == ["dive.gif"]


def test_an_animation_as_a_page_is_the_scene_of_all_runs(tmp_path):
    path = Plots(dataset()).animation(dataset(100), path=tmp_path / "dive.html", labels=["a", "b"])
    assert path.read_text(encoding="utf-8") == page(scene(entries([dataset(), dataset(100)], ["a", "b"])))


@pytest.mark.parametrize(
    ("options", "words"),
    [({"path": "dive.avi"}, "must end in .gif, .mp4 or .html"), ({"path": "dive.gif", "frames": 1}, "from 2 to 1000")],
)
def test_an_animation_that_cannot_be_is_refused(options, words):
    with pytest.raises(ArgumentError, match=words):
        Plots(dataset()).animation(**options)


def test_the_set_points_of_guidance_stand_in_depth_and_angles():
    run = dataset().drop_vars(["inputs_depth", "inputs_heading"], errors="ignore")
    steps = np.arange(run.sizes["time"], dtype=float)
    for name, values in (("depth", 3 + steps), ("heading", 0.01 * steps)):
        run[f"internal_controller_value_memory_wanted_{name}"] = ("time", values)
    axes = Plots(run).depth().axes[0]
    # a node holds what was computed at the one before
    assert line(axes, "set point").get_ydata()[:-1] == pytest.approx(4 + steps[:-1])
    panels = {one.get_ylabel(): one for one in Plots(run).mission().axes}
    assert line(panels["angle (°)"], "set point").get_ydata()[0] == pytest.approx(np.degrees(0.01))


def test_way_points_are_numbered_and_panels_share_their_times():
    run = dataset().assign_attrs(way_points=[3.0, 4, 0, 5, 6, 0])
    axes = Plots(run).mission().axes
    numbers = {text.get_text(): text.xy for text in axes[0].texts}
    assert numbers == {"1": (4.0, 3.0), "2": (6.0, 5.0)}
    ticks = [tuple(one.get_xticks()) for one in axes[1:]]
    assert len(set(ticks)) == 1 and len(ticks[0]) > 2
    assert all(isinstance(one.xaxis.get_major_locator(), FixedLocator) for one in axes[1:])


def test_an_axis_of_actuators_says_their_names_and_the_unit_of_files():
    run = dataset()
    run["internal_screw"] = run["internal_rudder"].copy()
    run["internal_screw"].attrs.update(units="1/s")
    labels = [axes.get_ylabel() for axes in Plots(run).actuators().axes]
    assert "rudder (°)" in labels and "screw (rpm)" in labels
