"""What figures show of a dataset, and that they show it whole."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import matplotlib
import numpy as np
import pytest
import xarray
from PIL import Image

from coadjoint.errors import ArgumentError, FileError
from coadjoint.plotting.plots import Plots, available, figure_names, save_figures
from coadjoint.plotting.style import save
from made_runs import VEHICLE, dataset


def drawn_together() -> list[str]:
    """All figures but that of a sea trial, which is of one run of a mission that makes one."""
    return [name for name in figure_names(films=False) if name != "trial"]


def curves(figure, axes=0):
    return [line.get_xydata() for line in figure.axes[axes].get_lines()]


def test_energy_error_is_relative_to_the_start_and_logarithmic():
    run = dataset()
    figure = Plots(run).energy()
    (curve,) = curves(figure)
    expected = np.abs(run.energy.values / run.energy.values[0] - 1)[1:]
    assert np.allclose(curve[:, 1], expected, rtol=1e-12, atol=1e-16)
    assert figure.axes[0].get_yscale() == "log"


def test_the_left_rectangle_shows_the_energy_of_the_discrete_velocities():
    run = dataset(method="LeftRectangle(Cayley())")
    (curve,) = curves(Plots(run).energy())
    (legendre,) = curves(Plots(run).energy(definition="legendre"))
    assert curve[:, 1].max() == pytest.approx(1e-3 / 5, rel=1e-3)
    assert legendre[:, 1].max() == pytest.approx(1e-6 / 5, rel=1e-3)


def test_exact_zeros_do_not_reach_the_logarithmic_axis():
    steps = np.where(np.arange(200) % 2, 1e-15, 0.0)
    (curve,) = curves(Plots(dataset(group_defect=steps)).group_defect())
    assert len(curve) == 100
    assert np.all(curve[:, 1] == 1e-15)


def test_a_quantity_kept_exactly_is_named_not_lost():
    kept, moved = dataset(energy=np.full(200, 5.0)), dataset()
    figure = Plots(kept).energy(moved, labels=["kept", "moved"])
    assert [line.get_label() for line in figure.axes[0].get_lines()] == ["kept (exactly 0)", "moved"]
    alone = Plots(kept).energy()
    assert "exactly 0" in alone.axes[0].texts[0].get_text()


def test_a_quantity_that_starts_at_zero_is_shown_absolutely():
    time = np.linspace(0, 10, 200)
    figure = Plots(dataset(kelvin_noether=1e-12 * time[:, None])).kelvin_noether(dataset())
    first, second = curves(figure)
    assert first[-1, 1] == pytest.approx(1e-11)
    assert second[:, 1].max() == pytest.approx(1e-12, rel=1e-3)
    assert "I(t) - I(0)" in figure.axes[0].get_ylabel()


@pytest.mark.long
def test_a_long_run_is_thinned_without_losing_its_worst_moment():
    nodes = 1_000_000
    energy = np.full(nodes, 5.0) + 1e-9 * np.sin(np.arange(nodes))
    energy[123_457] = 5.5
    (curve,) = curves(Plots(dataset(nodes, energy=energy, energy_budget=None)).energy())
    assert len(curve) < 5000
    assert curve[:, 1].max() == pytest.approx(0.1)


def test_yaw_breaks_at_half_a_turn_and_unwrapped_counts_turns():
    run = dataset()
    broken = curves(Plots(run).attitude())[0]
    steps = np.abs(np.diff(broken[:, 1]))
    assert np.count_nonzero(np.isnan(broken[:, 1])) == 3
    assert np.nanmax(steps) < 180
    whole = curves(Plots(run).attitude(unwrap=True))[0]
    assert whole[-1, 1] == pytest.approx(np.degrees(20.0))


def test_trajectory_shows_the_path_and_every_coordinate():
    run = dataset()
    figure = Plots(run).trajectory(z_down=True)
    space, *coordinates = figure.axes
    assert space.name == "3d"
    x, y, z = space.get_lines()[0].get_data_3d()
    assert np.array_equal(np.stack([x, y, z], axis=1), run.q.values)
    assert space.zaxis_inverted()
    assert coordinates[2].yaxis_inverted()
    for axis, axes in enumerate(coordinates):
        assert np.array_equal(axes.get_lines()[0].get_ydata(), run.q.values[:, axis])
        assert axes.get_ylabel() == f"${'xyz'[axis]}$ (m)"


def test_of_a_vehicle_a_dive_is_drawn_as_a_dive_and_a_turn_to_starboard_as_one():
    space, *coordinates = Plots(dataset()).trajectory().axes
    assert space.zaxis_inverted() and coordinates[2].yaxis_inverted()
    assert space.yaxis_inverted()  # one axis alone turned round would be a mirror image
    space, *coordinates = Plots(dataset(**VEHICLE)).trajectory().axes
    assert not (space.zaxis_inverted() or space.yaxis_inverted() or coordinates[2].yaxis_inverted())


def test_only_where_no_force_acts_a_change_of_energy_is_called_an_error():
    assert Plots(dataset(energy_budget=None)).energy().axes[0].get_ylabel().startswith("energy error")
    assert Plots(dataset()).energy().axes[0].get_ylabel().startswith("energy change")


def test_an_energy_that_forces_change_is_drawn_itself_on_a_linear_axis():
    energy = np.linspace(0.0, 5.0, 200)
    figure = Plots(dataset(energy=energy)).energy(dataset())
    assert np.array_equal(curves(figure)[0][:, 1], energy) and figure.axes[0].get_yscale() == "linear"
    assert Plots(dataset(energy=energy, energy_budget=None)).energy().axes[0].get_yscale() == "log"


def test_inputs_are_held_between_nodes_and_stand_against_their_bounds():
    torque = np.stack([np.sin(np.arange(200)), np.cos(np.arange(200))], axis=1)
    run = dataset(inputs_torque=torque, inputs_rudder=np.linspace(0, 1, 200))
    figure = Plots(run).inputs(bounds={"torque": ([-2.0, -np.inf], 2.0)})
    names = [axes.get_ylabel() for axes in figure.axes]
    lines = figure.axes[names.index("torque")].get_lines()
    assert names == ["depth (m)", "heading (rad)", "torque", "rudder"] and "inputs" in available(run)
    assert [line.get_ydata()[0] for line in lines[2:]] == [-2.0, 2.0]
    assert np.array_equal(lines[1].get_ydata(), torque[:, 1]) and lines[0].get_drawstyle() == "steps-post"
    for bounds, words in (
        ({"pull": (0, 1)}, "no input `pull`"),
        ({"torque": (4, -4)}, "lower bounds of `torque`"),
        ({"torque": ([-4, -3, 2], 4)}, "must give `torque`"),
        ({"torque": 3}, "must give `torque` \\(lower, upper\\)"),
    ):
        with pytest.raises(ArgumentError, match=words):
            Plots(run).inputs(bounds=bounds)
    bare = dataset(inputs_depth=None, inputs_heading=None)
    assert "inputs" not in available(bare)
    with pytest.raises(ArgumentError, match="no inputs to draw"):
        Plots(bare).inputs()


@pytest.mark.parametrize("size", [1, 2, 5])
def test_positions_of_other_dimensions_are_drawn_too(size):
    figure = Plots(dataset(q=np.ones((200, size)))).trajectory()
    assert len(figure.axes) == size + (size == 2)


def test_velocities_of_rigid_motions_separate_turning_from_moving():
    run = dataset(group="SE3()", nu=None, pi=None, q=None)
    run["xi"].attrs["units"] = "rad/s (3), m/s (3)"
    figure = Plots(run).velocities()
    assert [axes.get_ylabel().split("\n")[1] for axes in figure.axes] == ["(rad/s)", "(m/s)"]
    assert [len(axes.get_lines()) for axes in figure.axes] == [3, 3]


@pytest.mark.parametrize(
    ("figure", "missing", "words"),
    [
        ("trajectory", {"q": None}, "There is no position to draw"),
        ("attitude", {"euler_angles": None}, "There is no attitude to draw"),
        ("energy", {"energy": None, "discrete_energy": None}, "No energy was recorded"),
        ("kelvin_noether", {"kelvin_noether": None}, "No Kelvin–Noether quantity was recorded"),
        ("group_defect", {"group_defect": None}, "No group defect was recorded"),
    ],
)
def test_a_run_without_what_is_drawn_is_told_so_in_one_sentence(figure, missing, words):
    run = dataset(**missing)
    assert figure not in available(run)
    with pytest.raises(ArgumentError, match=words):
        getattr(Plots(run), figure)()


def test_runs_in_one_figure_are_told_apart_by_what_differs():
    runs = [dataset(method="Midpoint(Cayley())"), dataset(method="Trapezoidal(Cayley())")]
    labels = [line.get_label() for line in Plots(runs[0]).energy(runs[1]).axes[0].get_lines()]
    assert labels == ["Midpoint(Cayley)", "Trapezoidal(Cayley)"]
    halved = [line.get_label() for line in Plots(dataset(101)).energy(dataset(201)).axes[0].get_lines()]
    assert halved == ["h = 0.1 s", "h = 0.05 s"]


def ensemble(members):
    runs = [dataset(energy=5.0 + 1e-6 * (1 + k) * np.sin(np.linspace(0, 10, 200))) for k in range(members)]
    made = xarray.concat(runs, dim="member", combine_attrs="drop_conflicts")
    return made.assign_coords(member=np.arange(members))


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("members", [3, 40])
def test_an_ensemble_shows_every_member(members):
    figure = Plots(ensemble(members)).energy()
    highest = [curve[:, 1].max() for curve in curves(figure)]
    assert np.allclose(highest, 2e-7 * (1 + np.arange(members)), rtol=1e-2)
    labels = figure.axes[0].get_legend_handles_labels()[1]
    assert labels == (["member 0", "member 1", "member 2"] if members == 3 else ["Midpoint(Cayley), 40 members"])
    for name in drawn_together():
        getattr(Plots(ensemble(members)), name)()


def test_a_member_that_failed_is_shown_as_far_as_it_went():
    runs = ensemble(3).copy(deep=True)
    for name in runs.data_vars:
        runs[name].values[1, 50:] = np.nan
        runs[name].values[2, :] = np.nan
    figure = Plots(runs).velocities()
    ends = {line.get_xdata()[-1] for line in figure.axes[0].get_lines()}
    assert ends == {10.0, runs.time.values[49]}


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda p: p.energy(dataset(), labels=["one"]), "a text for each of the 2 runs"),
        (lambda p: p.energy(3), "was given int"),
        (lambda p: p.energy(definition="mean"), '"discrete" or "legendre"'),
        (lambda p: p.variable("speed"), "no variable `speed`"),
        (lambda p: p.trajectory(variable="energy"), "holds no positions"),
        (lambda p: p.energy(path="energy.xyz"), "must end in"),
    ],
)
def test_bad_arguments_are_refused_in_one_sentence(call, words):
    with pytest.raises(ArgumentError, match=words) as caught:
        call(Plots(dataset()))
    assert "\n" not in str(caught.value)


@pytest.mark.cases(2)
@pytest.mark.parametrize("name", [*figure_names(films=False), "variable"])
@pytest.mark.parametrize("group", ["SO3()", "SE3()"])
def test_nothing_is_cut_off_at_the_edge_of_a_figure(name, group):
    plots, labels = Plots(dataset(group=group)), ["LeftRectangle(Exponential)", "Midpoint(Cayley)", "a third run"]
    others = [dataset(group=group), dataset(group=group)]
    figure = plots.variable("xi", *others, labels=labels) if name == "variable" else None
    figure = figure or getattr(plots, name)(*others, labels=labels)
    figure.draw_without_rendering()
    width, height = figure.get_size_inches()
    box = figure.get_tightbbox()
    assert box.x0 >= -0.01
    assert box.y0 >= -0.01
    assert box.x1 <= width + 0.01
    assert box.y1 <= height + 0.01
    fonts = {text.get_fontsize() for axes in figure.axes for text in axes.get_xticklabels()}
    assert min(fonts) >= 7


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("ending", ["png", "pdf", "svg"])
def test_figures_are_written_whole(tmp_path, ending):
    names = save_figures([dataset()], tmp_path, ending=ending)
    assert sorted(names) == sorted(f"{name}.{ending}" for name in drawn_together())
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(names)
    assert all(path.stat().st_size > 3000 for path in tmp_path.iterdir())


@pytest.mark.long
def test_a_figure_is_drawn_once_when_it_is_written_and_keeps_its_layout(tmp_path, monkeypatch):
    """matplotlib draws a figure with a layout twice, the first time for the layout alone: the picture is the same."""
    figure = Plots(dataset()).energy()
    engine, drawn = figure.get_layout_engine(), []
    draw = type(figure).draw
    monkeypatch.setattr(type(figure), "draw", lambda self, renderer: drawn.append(1) or draw(self, renderer))
    figure.savefig(tmp_path / "twice.png")
    assert len(drawn) == 2
    save(figure, tmp_path / "once.png")
    assert len(drawn) == 3
    assert figure.get_layout_engine() is engine
    with Image.open(tmp_path / "once.png") as once, Image.open(tmp_path / "twice.png") as twice:
        assert once.tobytes() == twice.tobytes()


def test_a_figure_that_cannot_be_written_leaves_nothing(tmp_path, monkeypatch):
    def full(self, path, **_):
        path.write_bytes(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("coadjoint.plotting.style.PlotFigure.savefig", full)
    with pytest.raises(FileError, match="No space left on device"):
        Plots(dataset()).energy(path=tmp_path / "energy.png")
    assert not list(tmp_path.iterdir())
    with pytest.raises(FileError, match="does not exist"):
        Plots(dataset()).energy(path=tmp_path / "nowhere" / "energy.png")


def test_the_users_own_settings_are_left_alone():
    with matplotlib.rc_context({"font.size": 13.0, "axes.grid": False}):
        before = dict(matplotlib.rcParams)
        figure = Plots(dataset()).trajectory()
        assert dict(matplotlib.rcParams) == before
    assert figure.axes[1].yaxis.label.get_fontsize() == 8


@pytest.mark.long
def test_drawing_needs_neither_pyplot_nor_jax_nor_a_display():
    code = (
        "import sys; sys.path.insert(0, sys.argv[1]);"
        "from made_runs import dataset; from coadjoint.plotting.plots import Plots;"
        "Plots(dataset()).trajectory();"
        "assert not {'matplotlib.pyplot', 'jax'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code, str(Path(__file__).parents[1])], check=True, env={"PATH": ""})
