"""What the curves of figures hold: the numbers of the dataset, in its axes, with labels, units and limits."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray as xr

from coadjoint.errors import ArgumentError
from coadjoint.plotting import meshes, scene_of_runs
from coadjoint.plotting.attitude import _broken, _set_points, attitude
from coadjoint.plotting.budget import budget
from coadjoint.plotting.components import component_labels, momenta, variable, velocities
from coadjoint.plotting.conservation import _changes, _finish, relative
from coadjoint.plotting.decimation import CAPACITY, thin
from coadjoint.plotting.entries import Entry, entries
from coadjoint.plotting.film import Film
from coadjoint.plotting.plots import Plots, _ending, available
from coadjoint.plotting.sphere import _turned
from coadjoint.plotting.style import COLOURS, DASHES, canvas, time_axis
from coadjoint.plotting.trajectory import trajectory
from made_runs import VEHICLE, dataset

NODES = 12


def runs(*datasets: Any, labels: list[str] | None = None) -> list[Any]:
    return entries(list(datasets) or [dataset(NODES)], labels)


def curves(axes: Any) -> list[np.ndarray]:
    return [line.get_xydata() for line in axes.get_lines()]


# Trajectories.


def test_a_path_in_space_is_drawn_in_its_axes_with_its_start():
    run = dataset(NODES)
    figure = trajectory(runs(run), None, None)
    space, *panels = figure.axes
    path, start = (np.array(line.get_data_3d()) for line in space.get_lines())
    assert np.array_equal(path, run.q.values.T) and np.array_equal(start, run.q.values[:1].T)
    assert [axes.get_ylabel() for axes in panels] == ["$x$ (m)", "$y$ (m)", "$z$ (m)"]
    for component, axes in enumerate(panels):
        (curve,) = curves(axes)
        assert np.array_equal(curve, np.stack([run.time, run.q.values[:, component]], axis=1))


@pytest.mark.parametrize(
    ("z_down", "of_vehicle", "down"), [(None, True, True), (None, False, False), (True, False, True)]
)
def test_the_third_axis_points_down_for_vehicles_and_where_it_is_asked_for(z_down, of_vehicle, down):
    run = dataset(NODES) if of_vehicle else dataset(NODES, a_down=None, a_north=None)
    space, *panels = trajectory(runs(run), None, z_down).axes
    assert (space.get_zlim()[0] > space.get_zlim()[1]) == down == (space.get_ylim()[0] > space.get_ylim()[1])
    assert [axes.yaxis_inverted() for axes in panels] == [False, False, down]
    other = dataset(NODES, a_down=None, a_north=None)
    both = trajectory(runs(dataset(NODES), other), None, z_down).axes[-1]
    assert both.yaxis_inverted() == bool(z_down)


def test_a_path_in_the_plane_and_one_on_a_line():
    run = dataset(NODES, q=dataset(NODES).q.values[:, :2])
    plane, *panels = trajectory(runs(run), None, True).axes
    path, start = curves(plane)
    assert np.array_equal(path, run.q.values) and np.array_equal(start, run.q.values[:1])
    assert (plane.get_xlabel(), plane.get_ylabel(), len(panels)) == ("$x$ (m)", "$y$ (m)", 2)
    assert not panels[-1].yaxis_inverted()
    line = dataset(NODES, q=dataset(NODES).q.values[:, :1])
    (axes,) = trajectory(runs(line), None, True).axes
    assert axes.get_ylabel() == "$q_{1}$ (m)" and np.array_equal(curves(axes)[0][:, 1], line.q.values[:, 0])


def test_what_has_no_path_raises_what_to_draw_instead():
    with pytest.raises(ArgumentError, match="There is no position to draw"):
        trajectory(runs(dataset(NODES, q=None)), None, None)
    with pytest.raises(ArgumentError, match="`energy` holds no positions"):
        trajectory(runs(), "energy", None)
    with pytest.raises(ArgumentError, match=r"positions of one dimension, but they have \[2, 3\]"):
        trajectory(runs(dataset(NODES), dataset(NODES, q=dataset(NODES).q.values[:, :2])), None, None)


# Components.


def test_velocities_and_momenta_of_a_rigid_motion_have_a_panel_for_each_kind():
    run = dataset(NODES, group="SE3()", n=None, nu=None, pi=None)
    run.xi.attrs["units"] = "rad/s (3), m/s (3)"
    first, second = velocities(runs(run)).axes
    assert (first.get_ylabel(), second.get_ylabel()) == (
        "angular velocity, body\n(rad/s)",
        "linear velocity, body\n(m/s)",
    )
    for axes, columns in ((first, slice(0, 3)), (second, slice(3, 6))):
        for curve, series in zip(curves(axes), run.xi.values[:, columns].T, strict=True):
            assert np.array_equal(curve, np.stack([run.time, series], axis=1))
    assert len(momenta(runs(run)).axes) == 2
    plain = dataset(NODES)
    plain.attrs["invariance"] = "right"
    assert [axes.get_ylabel() for axes in velocities(runs(plain)).axes] == [
        "angular velocity, space\n(rad/s)",
        r"velocity $\nu$, space" + "\n(m/s)",
    ]


def test_components_are_named_by_axes_by_coordinates_or_by_numbers():
    (run,) = runs(dataset(NODES, g=np.zeros((NODES, 2, 2)), internal_levels=np.zeros((NODES, 2))))
    assert component_labels(run, "energy") == [""]
    assert component_labels(run, "q") == ["$q_x$", "$q_y$", "$q_z$"]
    assert component_labels(run, "xi") == [r"$\omega_x$", r"$\omega_y$", r"$\omega_z$"]
    assert component_labels(run, "g") == ["$g_{1,1}$", "$g_{1,2}$", "$g_{2,1}$", "$g_{2,2}$"]
    assert component_labels(run, "internal_levels") == ["$internal_{1}$", "$internal_{2}$"]
    named = run.dataset.assign_coords(q_0=["north", "east", "down"])
    assert component_labels(entries([named], None)[0], "q") == ["north", "east", "down"]
    elsewhere = dataset(NODES)
    elsewhere.attrs["group"] = "SE2()"
    assert component_labels(entries([elsewhere], None)[0], "xi") == [r"$\xi_{1}$", r"$\xi_{2}$", r"$\xi_{3}$"]


def test_a_variable_that_does_not_run_over_time_is_not_drawn():
    with pytest.raises(ArgumentError, match="`mass` does not run over time"):
        variable(runs(dataset(NODES).assign(mass=("body", [1.0, 2.0]))), "mass")
    with pytest.raises(ArgumentError, match="There is no variable `mass`"):
        variable(runs(), "mass")


# Energies.


def test_a_change_is_relative_to_the_start_or_absolute_where_that_is_zero():
    change, is_relative = relative(np.array([[3.0, 4.0], [3.0, 5.0], [6.0, 8.0]]))
    assert is_relative and change == pytest.approx([0.0, 0.2, 1.0])
    change, is_relative = relative(np.array([0.0, 3.0, -4.0]))
    assert not is_relative and change.tolist() == [0.0, 3.0, 4.0]


def test_changes_of_which_one_is_absolute_are_all_absolute():
    time = np.linspace(0, 1, NODES)
    first, second = dataset(NODES, energy=2.0 + time), dataset(NODES, energy=time)
    axes = _changes(runs(first, second), lambda run: "energy", "change", "E").axes[0]
    for curve in curves(axes):
        assert curve[:, 1] == pytest.approx(time[1:])
    assert axes.get_ylabel() == "change $|E(t) - E(0)|$ (J)"
    alone = _changes(runs(first), lambda run: "energy", "change", "E").axes[0]
    assert curves(alone)[0][:, 1] == pytest.approx(time[1:] / 2) and "- 1|$" in alone.get_ylabel()
    low, high = alone.get_ylim()
    assert high == pytest.approx(1.0) and low == pytest.approx(time[1] / 4)


def test_a_nearly_constant_error_is_shown_over_a_decade():
    axes = _changes(
        runs(dataset(NODES, energy=np.r_[1.0, [1.5] * (NODES - 1)])), lambda run: "energy", "change", "E"
    ).axes[0]
    assert axes.get_ylim() == pytest.approx((0.1, 1.0))


def test_a_value_below_the_round_off_of_the_largest_does_not_stretch_the_axis():
    energy = np.r_[0.0, [0.5] * (NODES - 2), 1e-30]
    axes = _changes(runs(dataset(NODES, energy=energy)), lambda run: "energy", "change", "E").axes[0]
    assert axes.get_ylim() == pytest.approx((1e-17, 1.0))


def test_an_energy_budget_shows_what_is_stored_what_was_put_in_and_the_gap():
    run = dataset(NODES)
    above, below = budget(runs(run)).axes
    stored, drag, thrust = (curve[:, 1] for curve in curves(above))
    assert np.array_equal(stored, run.energy.values - run.energy.values[0])
    assert np.array_equal(drag, run.work_drag) and np.array_equal(thrust, run.work_thrust)
    (gap,) = curves(below)
    assert gap[:, 1] == pytest.approx(run.energy_budget.values[1:] - 5.0)
    assert below.get_yscale() == "log" and below.get_ylim()[1] == pytest.approx(2 * gap[-1, 1])
    assert below.get_ylim()[0] == pytest.approx(min(gap[0, 1] / 2, gap[-1, 1] / 5))
    assert [text.get_text() for text in above.get_legend().get_texts()] == ["stored", "drag", "thrust"]
    assert [line.get_color() for line in above.get_lines()] == ["#222222", COLOURS[0], COLOURS[1]]
    under, *over = (line.get_linewidth() for line in above.get_lines())
    assert under > 1.5 * max(over)  # a single force covers what is stored


@pytest.mark.parametrize(("change", "itself"), [(0.00995, False), (0.01005, True)])
@pytest.mark.parametrize("driven", [True, False])
def test_an_energy_that_forces_change_by_more_than_a_hundredth_of_its_largest_value_is_drawn_itself(
    change, itself, driven
):
    energy = 8.0 - 8.0 * change * np.linspace(0, 1, NODES)
    budget_ = {} if driven else {"energy_budget": None}
    run = dataset(NODES, energy=energy, xi=None, nu=None, **budget_)
    other = dataset(NODES, energy=energy, xi=None, nu=None, **budget_)
    other.energy.attrs["units"] = "kJ"
    axes = Plots(run).energy(other).axes[0]
    shown = itself and driven
    assert axes.get_yscale() == ("linear" if shown else "log")
    expected = "energy $E(t)$ (J)" if shown else f"energy {'change' if driven else 'error'} $|E(t)/E(0) - 1|$"
    assert axes.get_ylabel() == expected
    first = curves(axes)[0][:, 1]
    np.testing.assert_allclose(first, energy if shown else 1.0 - energy[1:] / 8.0)
    assert len(curves(axes)) == 2


@pytest.mark.parametrize(("definition", "method", "name"), [
    (None, "LeftRectangle(Cayley())", "discrete_energy"), (None, "Midpoint(Cayley())", "energy"),
    ("legendre", "LeftRectangle(Cayley())", "energy"), ("discrete", "Midpoint(Cayley())", "discrete_energy"),
])  # fmt: skip
def test_the_left_rectangle_has_its_discrete_energy_unless_another_is_asked_for(definition, method, name):
    run = dataset(
        NODES, energy=2.0 + np.arange(NODES) / 1e3, discrete_energy=2.0 + np.arange(NODES) / 1e4, method=method
    )
    axes = Plots(run).energy(definition=definition).axes[0]
    assert curves(axes)[0][:, 1] == pytest.approx(run[name].values[1:] / 2.0 - 1.0)
    other = {"energy": "discrete_energy", "discrete_energy": "energy"}[name]
    Plots(run.drop_vars(other)).energy(definition=definition)
    with pytest.raises(ArgumentError, match="No energy was recorded") if definition else nullcontext():
        Plots(run.drop_vars(name)).energy(definition=definition)


# Inputs.


def test_the_numbers_of_an_input_have_a_colour_and_an_index_each_and_bounds_are_lines():
    run = dataset(NODES, inputs_jets=np.stack([np.arange(NODES), -np.arange(NODES)], axis=1), inputs_heading=None)
    run.inputs_jets.attrs["units"] = "N"
    figure = Plots(run).inputs(bounds={"jets": ([-9.0, -20.0], [30.0, np.inf])})
    depth, jets = figure.axes
    assert [axes.get_ylabel() for axes in figure.axes] == ["depth (m)", "jets (N)"]
    first, second, *bounds = jets.get_lines()
    assert [line.get_color() for line in (first, second)] == list(COLOURS[:2])
    assert first.get_drawstyle() == "steps-post" and np.array_equal(second.get_ydata(), run.inputs_jets.values[:, 1])
    assert [line.get_ydata()[0] for line in bounds] == [-20.0, -9.0, 30.0]
    legend = jets.get_legend()
    assert [text.get_text() for text in legend.get_texts()] == ["1", "2"]
    assert [line.get_color() for line in legend.get_lines()] == list(COLOURS[:2]) and depth.get_legend() is None
    linear = Plots(run).inputs(bounds={"jets": SimpleNamespace(lower=-1.0, upper=1.0, course="linear")}).axes[1]
    assert linear.get_lines()[0].get_drawstyle() == "default"
    for wrong, told in (
        (([1.0], [0.0, 2.0, 3.0]), "must give `jets`"),
        ((1.0, 0.0), "must not exceed"),
        (3.0, "must give"),
    ):
        with pytest.raises(ArgumentError, match=told):
            Plots(run).inputs(bounds={"jets": wrong})


# Attitudes.


@pytest.mark.parametrize(
    ("low", "high", "right"), [(-100, 101, True), (-60, 139, False), (-249, 249, True), (-250, 251, False)]
)
def test_angles_over_most_of_a_turn_have_marks_at_right_angles(low, high, right):
    (run,) = runs(dataset(5, euler_angles=np.zeros((5, 3)), inputs_heading=None))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("matplotlib.axes.Axes.get_ylim", lambda self: (low, high))
        figure = attitude([run], unwrap=True)
    for axes in figure.axes:
        marks = axes.yaxis.get_major_locator().tick_values(-100.0, 100.0)
        assert (90.0 in marks and 0.0 in marks and len(set(np.diff(marks))) == 1 and 90.0 in np.diff(marks)) == right


def test_an_attitude_is_in_degrees_and_breaks_where_it_jumps():
    angle = np.radians([170.0, 179.0, -179.0, -10.0, 169.0])
    (run,) = runs(dataset(5, euler_angles=np.stack([angle, angle, angle], axis=1)))
    time, degrees = _broken(run, angle)
    assert degrees == pytest.approx([170.0, 179.0, np.nan, -179.0, -10.0, 169.0], nan_ok=True)
    assert time == pytest.approx([0.0, 2.5, 5.0, 5.0, 7.5, 10.0])
    yaw = attitude([run], unwrap=True).axes[0]
    assert curves(yaw)[0][:, 1] == pytest.approx([170.0, 179.0, 181.0, 350.0, 529.0])


def test_a_set_point_is_drawn_of_the_angle_that_it_is_of():
    (run,) = runs()
    axes = canvas(2, 2).subplots(3, 1)
    for one, name in zip(axes, ("yaw", "pitch", "roll"), strict=True):
        _set_points(one, run, name, unwrap=False)
    assert [len(one.get_lines()) for one in axes] == [1, 0, 0]
    assert curves(axes[0])[0][:, 1] == pytest.approx(np.degrees(run.dataset.inputs_heading.values))


# Runs, members and points.


def test_runs_are_told_apart_by_what_differs_between_them():
    first, second = dataset(NODES), dataset(NODES, method="Trapezoid(Cayley())")
    assert [run.label for run in runs(first, second)] == ["Midpoint(Cayley)", "Trapezoid(Cayley)"]
    second.attrs.update(method=first.attrs["method"], dt=0.5)
    assert [run.label for run in runs(first, second)] == ["h = 0.909091 s", "h = 0.5 s"]
    assert [run.label for run in runs(first)] == ["Midpoint(Cayley)"]
    for one in (first, second):
        one.attrs.clear()
    assert [run.label for run in runs(first, second)] == ["run 1", "run 2"] and runs(first)[0].label == ""
    for labels in (["a"], "ab"):
        with pytest.raises(ArgumentError, match="`labels` must hold a text for each of the 2 runs"):
            runs(first, second, labels=labels)


def ensemble(size: int, failed: int | None = None) -> xr.Dataset:
    held = xr.concat([dataset(NODES) for _ in range(size)], "member").assign_coords(member=range(size))
    if failed is not None:
        held["q"] = held.q.where((held.member != failed) | (held.time < 4.0))
    return held


def test_few_members_are_curves_of_their_own_and_many_are_a_crowd():
    few = runs(ensemble(len(COLOURS)))
    assert [run.label for run in few] == [f"member {i}" for i in range(7)] and few[0].crowd == 1
    assert [run.place for run in runs(dataset(NODES), ensemble(2), dataset(NODES))] == [0, 1, 2, 3]
    many = runs(ensemble(len(COLOURS) + 1), labels=["fleet"])
    assert [run.label for run in many] == ["fleet, 8 members", *["_"] * 7]
    assert {run.place for run in many} == {0} and many[0].crowd == 8 and many[0].line["alpha"] == 0.35
    assert few[4].look["color"] == COLOURS[4] and few[4].look["linestyle"] == DASHES[0]


def test_a_member_ends_where_its_step_failed():
    found = runs(ensemble(2, failed=1))
    assert len(found[0].time) == NODES and found[1].time[-1] < 4.0 < found[0].time[len(found[1].time)]
    with pytest.raises(ArgumentError, match="No member of this ensemble has saved nodes"):
        runs(ensemble(2).where(False))


def test_what_has_no_nodes_is_not_drawn():
    for wrong in (3.0, xr.Dataset({"q": ("x", [1.0])})):
        with pytest.raises(ArgumentError, match="drawn of a run or of its dataset over time"):
            runs(wrong)
    with pytest.raises(ArgumentError, match="no saved nodes"):
        runs(dataset(NODES).isel(time=slice(0)))


def test_few_points_are_all_drawn_and_of_many_every_extreme():
    assert np.array_equal(thin(np.zeros(10), capacity=10), np.arange(10))
    series = np.zeros(1000)
    series[[333, 700]] = 5.0, -5.0
    kept = thin(series, np.arange(1000.0), capacity=40)
    assert {0, 333, 700, 999} <= set(kept) and len(kept) <= 42 and np.all(np.diff(kept) > 0)


def test_a_time_axis_is_as_long_as_the_longest_run():
    column = canvas(2, 2).subplots(2, 1)
    time_axis(column, [np.array([1.0, 3.0]), np.array([0.5, 2.0])])
    assert [axes.get_xlim() for axes in column] == [(0.5, 3.0), (0.5, 3.0)]
    assert column[0].get_xlabel() == "" and column[1].get_xlabel() == "time $t$ (s)"
    before = canvas(2, 2).subplots()
    time_axis([before], [np.array([1.0])])
    assert before.get_xlim() == (0.0, 1.0)


def test_figures_are_those_that_the_dataset_has_what_to_draw_for():
    bare = dataset(
        NODES, **dict.fromkeys(("energy", "discrete_energy", "kelvin_noether", "energy_budget", "q")), **VEHICLE
    )
    own = [name for name in available(bare) if name in ("energy", "trajectory", "budget", "velocities", "momenta")]
    assert own == ["velocities", "momenta"]
    assert "trajectory" in available(bare.assign(q_joint=("time", np.zeros(NODES))))
    with pytest.raises(AttributeError, match="There is no figure `portrait`"):
        _ = Plots(bare).portrait
    with pytest.raises(TypeError, match=r"as in plot\.energy\(\); there are: .*trajectory"):
        Plots(bare)()


def test_a_figure_is_a_picture_and_a_film_moves():
    assert [_ending("energy", e) for e in ("png", "pdf", "gif", "html")] == ["png", "pdf", "png", "png"]
    assert [_ending("animation", e) for e in ("png", "pdf", "gif", "html")] == ["gif", "gif", "gif", "html"]


def test_an_axis_of_errors_holds_all_curves_but_no_round_off_of_the_largest():
    for heights, limits in (((1e-3, 1e-9), (5e-10, 2e-3)), ((1e-3, 1e-30), (2e-20, 2e-3)), ((1.0, 0.9), (0.2, 2.0))):
        figure = canvas(2, 2)
        axes = figure.subplots()
        for height in heights:
            axes.plot([0.0, 1.0], [height, height], label=str(height))
        _finish(figure, axes, runs(dataset(NODES)), "error")
        assert axes.get_ylim() == pytest.approx(limits)


@pytest.mark.parametrize(("crowd", "most"), [(1, CAPACITY), (4, CAPACITY // 4), (100, CAPACITY // 10)])
def test_a_curve_of_a_crowd_has_its_share_of_points_and_not_less_than_a_tenth(crowd, most):
    series = np.random.default_rng(1).normal(size=9 * CAPACITY)
    entry = Entry(dataset(NODES), "one", crowd=crowd)
    assert np.array_equal(entry.thin(series), thin(series, capacity=most))


def test_what_is_not_there_is_no_path_and_a_run_of_one_node_no_film():
    with pytest.raises(ArgumentError, match="There is no variable `gone` to draw"):
        trajectory(runs(), "gone", False)
    with pytest.raises(ArgumentError):
        Film(runs(dataset(NODES).isel(time=[0])), 2)


def test_a_scene_of_a_package_above_is_that_of_runs_that_all_fit(monkeypatch):
    """Else that of bodies."""
    made: list[Any] = []
    names = {"fits": lambda run: len(run.time) > 5, "make": lambda shown, hull: made.append(len(shown))}
    monkeypatch.setattr(scene_of_runs, "import_string", names.get)
    monkeypatch.setattr(scene_of_runs, "SCENES", {"a": SimpleNamespace(fits="fits", make="make")})
    monkeypatch.setattr(scene_of_runs.bodies, "scene", lambda shown, solids, z_down: made.append("bodies"))
    for nodes in (9, 3):
        scene_of_runs.scene(runs(dataset(12), dataset(nodes), labels=["a", "b"]))
    assert made == [2, "bodies"]


@pytest.mark.parametrize("count", [4, 6])
def test_longitudes_of_a_map_begin_in_the_west(count):
    step = 360 / count
    assert _turned(step * np.arange(count)).tolist() == (-180 + step * np.arange(count)).tolist()


def test_pieces_of_a_scene_are_turned_and_moved_by_all_nodes_above_them():
    """A node 5 m up below one that turns x to y: v ↦ R(v + 5 e_z)."""
    corners = np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]])
    half = np.sqrt(0.5)
    piece = {"primitives": [{"attributes": {"POSITION": 0}}, {"attributes": {"POSITION": 0}, "mode": 1}]}
    nodes = [{"rotation": [0.0, 0.0, half, half], "children": [1]}, {"translation": [0.0, 0.0, 5.0], "mesh": 0}]
    scene: Any = meshes._Scene({"nodes": nodes, "meshes": [piece]}, [], Path("here"))
    scene.accessor = lambda number: corners
    scene.node(0, np.eye(4))
    ((vertices, faces),) = scene.parts
    np.testing.assert_allclose(vertices, [[0.0, 1.0, 5.0], [-2.0, 0.0, 5.0], [0.0, 0.0, 8.0]], atol=1e-12)
    assert faces.tolist() == [[0, 1, 2]]
    with pytest.raises(ValueError, match="below two others"):
        scene.node(1, np.eye(4))
