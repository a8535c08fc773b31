"""Mechanisms as they print, and coordinates of joints in events, derivatives and saved runs."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.models import multibody
from coadjoint.plotting import bodies
from mechanisms import gears, pendulum

QUIET = {"accuracy": False, "monitors": False}


@pytest.fixture(scope="module")
def swing():
    return pendulum()


@pytest.fixture(scope="module")
def run(swing):
    return co.simulate(swing.system, swing.state(coordinates={"hinge": 1.0}), dt=0.01, steps=20, **QUIET)


def test_a_mechanism_prints_its_bodies_joints_rows_and_motors():
    shown = repr(pendulum(motor=True))
    assert shown == "<Mechanism mechanism: bodies rod; joints hinge (revolute); mass 1.3 kg; rows 5; motors hinge>"
    assert "joints one (revolute), two (revolute), mesh (gear)" in repr(gears(1, 2))


@pytest.mark.long
def test_the_coordinate_of_a_joint_is_a_function_of_a_state(swing, run):
    angle, data = swing.coordinate("hinge"), swing.joint_data(run)
    assert angle(run.final) == pytest.approx(float(data.hinge[-1]), abs=1e-13)
    assert angle.speed(run.final) == pytest.approx(float(data.hinge_speed[-1]), abs=1e-12)
    with pytest.raises(co.errors.ArgumentError, match="has no coordinates of its own"):
        gears(1, 2).coordinate("mesh")


@pytest.mark.long
def test_a_coordinate_ends_a_run_and_has_a_derivative(swing):
    angle, start = swing.coordinate("hinge"), swing.state(coordinates={"hinge": 1.0})
    ended = co.simulate(
        swing.system, start, dt=0.02, steps=40, until=lambda state: jnp.sin(angle(state) - 0.8), **QUIET
    )
    assert angle(ended.final) == pytest.approx(0.8, abs=1e-12)

    def end(mass):
        system = swing.system.replace(mass=jnp.reshape(mass, (1,)).astype(float))
        return angle(co.trajectory(system, start, dt=0.02, steps=3, accuracy=False).final)

    with co.float64():
        slope, around = float(jax.grad(end)(1.3)), float((end(1.301) - end(1.299)) / 2e-3)
    assert slope == pytest.approx(around, rel=1e-5)


def test_joint_data_of_a_saved_run_is_that_of_the_run(swing, run, tmp_path):
    run.save(tmp_path / "swing.nc")
    loaded = co.load(tmp_path / "swing.nc", swing.system)
    assert np.array_equal(swing.joint_data(loaded).hinge, swing.joint_data(run).hinge)
    with pytest.raises(co.errors.ArgumentError, match="must be a run of this mechanism"):
        gears(1, 2).joint_data(loaded)


@pytest.mark.long
def test_joint_data_of_streamed_runs_are_those_of_runs_in_memory(swing, tmp_path):
    starts = {
        "one": swing.state(coordinates={"hinge": 0.3}),
        "fleet": swing.state(coordinates={"hinge": co.each([0.2, 0.4])}),
    }
    for name, begun in starts.items():
        plain = co.simulate(swing.system, begun, dt=0.01, steps=20, save_every=10, accuracy=False)
        stored = co.simulate(
            swing.system, begun, dt=0.01, steps=20, save_every=10, accuracy=False, store=tmp_path / name
        )
        for found in (stored, co.load(tmp_path / name, swing.system)):
            assert swing.joint_data(found).equals(swing.joint_data(plain))


def test_a_scene_needs_the_mechanism_of_the_run(swing, run):
    assert "1 body over" in bodies.scene([entry(run)], bodies.linkage(swing)).description
    with pytest.raises(co.errors.ArgumentError, match=r"has 1 body, but is that of another, of 2 bodies"):
        run.plot.scene(bodies=bodies.linkage(gears(1, 2)))
    with pytest.raises(co.errors.ArgumentError, match=r"must be a multibody.Mechanism, but is .*System"):
        bodies.linkage(swing.system)


def entry(run):
    from coadjoint.plotting.entries import entries

    return entries([run.dataset], None)[0]


@pytest.mark.long
def test_contradicting_coordinates_are_named_with_the_freedoms():
    both = r"coordinates given for `one`, `two`: the mechanism has 1 freedom near"
    with pytest.raises(co.errors.ArgumentError, match=both):
        gears(20, 30).state(coordinates={"one": 1.0, "two": 1.0}, rates={"small": (0, 0, 1)})


def test_a_joint_of_a_file_that_names_no_link_is_named(tmp_path):
    link = '<link name="c"><inertial><mass value="1"/></inertial></link>'
    for parent, child, missing in (("b", "cc", "cc"), ("bb", "c", "bb")):
        joint = f'<joint name="j" type="revolute"><parent link="{parent}"/><child link="{child}"/></joint>'
        (tmp_path / "x.urdf").write_text(f'<robot name="a"><link name="b"/>{link}{joint}</robot>')
        with pytest.raises(co.errors.FileError, match=f"'j' names a link, but the file has no link '{missing}'"):
            multibody.read(tmp_path / "x.urdf")


def test_a_torsion_spring_beyond_half_a_turn_warns():
    sprung = pendulum(stiffness=1.0, rest=0.0)
    with pytest.warns(UserWarning, match=r"spring of the joint `hinge` .* at 4 rad it acts as at -2.283 rad"):
        state = sprung.state(coordinates={"hinge": 4.0})
    sprung.joint_data(state)
    turned = np.array([[3.0], [3.3]])
    with pytest.warns(UserWarning, match="at 3.3 rad it acts as at -2.983"):
        sprung.bonds["hinge"].warn_of_turns(turned, sprung.system.parameters.hinge)


def test_the_label_of_a_reaction_fits_its_panel(run):
    label = run.plot.variable("reaction_hinge").axes[0].get_ylabel()
    assert "constraint" in label and max(map(len, label.split("\n"))) <= 30
