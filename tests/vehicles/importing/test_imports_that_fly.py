"""Files of other simulators as people have them: one part of thrusters, worlds, limits, motors, URDF of ROS 2."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coadjoint.cli.main import main
from coadjoint.errors import ArgumentError, FileError
from coadjoint_vehicles import Vehicle
from coadjoint_vehicles.importing import import_vehicle
from coadjoint_vehicles.importing.flying import doubts, first_mission
from coadjoint_vehicles.importing.workspace import package_folder, workspace_of
from coadjoint_vehicles.parts import Fin, Thrusters

LINK = """<link name="{name}"><pose>{pose}</pose><inertial><pose>{inner}</pose><mass>{mass}</mass>
<inertia><ixx>{i}</ixx><iyy>{i}</iyy><izz>{i}</izz></inertia></inertial>{more}</link>"""
JOINT = """<joint name="{name}_joint" type="revolute"><parent>body</parent><child>{name}</child>
<axis><xyz>1 0 0</xyz>{limit}</axis></joint>"""
THRUSTER = """<plugin filename="gz-sim-thruster-system" name="gz::sim::systems::Thruster">
<joint_name>{name}_joint</joint_name><thrust_coefficient>{C}</thrust_coefficient>
<propeller_diameter>0.1</propeller_diameter>{more}</plugin>"""
BOX = '<collision name="c"><geometry><box><size>0.5 0.3 0.2</size></box></geometry></collision>'
HYDRODYNAMICS = """<plugin filename="gz-sim-hydrodynamics-system" name="gz::sim::systems::Hydrodynamics">
<link_name>body</link_name><xDotU>-5</xDotU><yDotV>-9</yDotV><zDotW>-9</zDotW><kDotP>-.1</kDotP><mDotQ>-.2</mDotQ>
<nDotR>-.2</nDotR><xUabsU>-20</xUabsU><yVabsV>-30</yVabsV><zWabsW>-30</zWabsW><kPabsP>-1</kPabsP><mQabsQ>-1</mQabsQ>
<nRabsR>-1</nRabsR>{more}</plugin>"""
PLACES = {"fl": "0.2 0.1 0 0 0 0.785", "fr": "0.2 -0.1 0 0 0 -0.785", "rl": "-0.2 0.1 0 0 0 2.356"}
PLACES |= {"rr": "-0.2 -0.1 0 0 0 -2.356", "vl": "0 0.1 0.05 0 -1.571 0", "vr": "0 -0.1 0.05 0 -1.571 0"}


def model(more: str = "", *, limit: str = "", thruster: str = "", inner: str = "0 0 0 0 0 0", of: Any = PLACES) -> str:
    links = [LINK.format(name="body", pose="0 0 0 0 0 0", inner="0 0 -0.02 0 0 0", mass=30, i=1, more=BOX)]
    links += [LINK.format(name=n, pose=p, inner=inner, mass=0.01, i=1e-5, more="") for n, p in of.items()]
    joints = [JOINT.format(name=name, limit=limit) for name in of]
    jets = [THRUSTER.format(name=name, C=0.02 if i % 2 else -0.02, more=thruster) for i, name in enumerate(of)]
    hydrodynamics = HYDRODYNAMICS.format(more=more)
    return f'<model name="rov">{"".join(links)}{"".join(joints)}{hydrodynamics}{"".join(jets)}</model>'


def written(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f'<sdf version="1.9">{text}</sdf>')
    return path


def test_all_thrusters_of_a_model_are_one_part_and_the_report_begins_with_the_controllers_that_fit(tmp_path: Path):
    found = import_vehicle(written(tmp_path / "rov.sdf", model()))
    (part,) = [part for part in found.vehicle.parts if isinstance(part, Thrusters)]
    assert part.count == 6
    lines = str(found.report).splitlines()
    assert lines[1].startswith("6 thrusters, 0 fins; controllers that fit: manoeuvre, hover; not taken over: ")


def test_thrusters_of_different_limits_and_coefficients_are_one_part(tmp_path: Path):
    text = model(thruster="<use_angvel_cmd>true</use_angvel_cmd>", of={"fl": PLACES["fl"], "fr": PLACES["fr"]})
    text = text.replace(
        "<joint_name>fr_joint</joint_name>", "<joint_name>fr_joint</joint_name><max_thrust_cmd>50</max_thrust_cmd>"
    )
    part: Any = import_vehicle(written(tmp_path / "two.sdf", text)).vehicle.part("thrusters")
    assert np.shape(part.limit) == (2, 2)
    np.testing.assert_allclose(part.extremes[1], [1000, 50])
    assert part.directions[0] @ part.directions[1] == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize(
    ("thruster", "extremes"),
    [
        ("<min_thrust_cmd>0</min_thrust_cmd><max_thrust_cmd>40</max_thrust_cmd>", [0, 40]),
        ("<min_thrust_cmd>-10</min_thrust_cmd><max_thrust_cmd>0</max_thrust_cmd>", [-10, 0]),
    ],
)
def test_a_thruster_that_pushes_one_way_is_taken(tmp_path: Path, thruster: str, extremes: list[float]):
    part: Any = import_vehicle(
        written(tmp_path / "one.sdf", model(thruster=thruster, of={"fl": PLACES["fl"]}))
    ).vehicle.part("thrusters")
    np.testing.assert_array_equal(np.ravel(part.extremes), extremes)


def test_a_thruster_acts_at_the_origin_of_its_link_not_at_its_centre_of_mass(tmp_path: Path):
    part: Any = import_vehicle(written(tmp_path / "off.sdf", model(inner="0 0.1 0 0 0 0"))).vehicle.part("thrusters")
    np.testing.assert_allclose(part.positions[:2], [[0.2, -0.1, 0], [0.2, 0.1, 0]], atol=1e-15)


@pytest.mark.parametrize("ends", [("-1e16", "1e16"), ("-inf", "inf"), ("-1e+16", ""), ("-1e12", "1e12")])
def test_limits_that_are_infinite_are_none(tmp_path: Path, ends: tuple[str, str]):
    limit = f"<limit><lower>{ends[0]}</lower><upper>{ends[1]}</upper></limit>"
    part: Any = import_vehicle(written(tmp_path / "lim.sdf", model(limit=limit))).vehicle.part("thrusters")
    assert part.count == 6


ENDS = "<min_thrust_cmd>{}</min_thrust_cmd><max_thrust_cmd>{}</max_thrust_cmd>"


@pytest.mark.parametrize("more", ["", "<use_angvel_cmd>true</use_angvel_cmd>"])
def test_infinite_thrusts_are_no_limit_and_missing_ones_that_of_gazebo(tmp_path: Path, more: str):
    endless = import_vehicle(written(tmp_path / "e.sdf", model(thruster=more + ENDS.format("-inf", "inf"))))
    part: Any = endless.vehicle.part("thrusters")
    assert part.limit is None and "no limit" in " ".join(endless.report.doubts)
    missing = import_vehicle(written(tmp_path / "m.sdf", model(thruster=more)))
    (limit,) = (row for row in missing.report.taken if row.key == "thrusters.limit")
    assert "Gazebo" in limit.place and ".sdf" not in limit.place
    if not more:
        one: Any = import_vehicle(written(tmp_path / "o.sdf", model(thruster=ENDS.format("-inf", "50"))))
        assert list(one.vehicle.part("thrusters").limit) == [-1000, 50]
        assert "infinite" in " ".join(one.report.differs)


def test_an_argument_that_no_xacro_file_has_is_an_error_with_the_nearest(tmp_path: Path):
    (tmp_path / "r.xacro").write_text(
        '<robot name="r" xmlns:xacro="x"><xacro:arg name="mass" default="25"/><link name="b"/></robot>'
    )
    with pytest.raises(ArgumentError, match=r"r\.xacro has no argument of xacro `mas`: did you mean `mass`"):
        import_vehicle(tmp_path / "r.xacro", arguments={"mas": "26"})


def test_a_limit_that_is_no_number_is_an_error(tmp_path: Path):
    with pytest.raises(FileError, match="must be"):
        import_vehicle(written(tmp_path / "lim.sdf", model(limit="<limit><lower>nan</lower></limit>")))


BUOYANCY = '<plugin filename="gz-sim-buoyancy-system" name="gz::sim::systems::Buoyancy">{}</plugin>'
GRADED = BUOYANCY.format(
    "<graded_buoyancy><default_density>1027</default_density><density_change><above_depth>0</above_depth>"
    "<density>1.125</density></density_change></graded_buoyancy>"
)


def test_a_world_gives_density_of_layers_and_current_and_its_unknown_includes_are_told(tmp_path: Path):
    """1027 kg/m³, not 1000: whether the vehicle sinks or rises."""
    ground = '<model name="ground"><static>true</static></model><include><uri>model://sea</uri></include>'
    inside = f"<gravity>0 0 -9.81</gravity>{GRADED}{ground}"
    text = model("<default_current>0.5 0.2 -0.1</default_current>")
    one = import_vehicle(written(tmp_path / "in.sdf", f'<world name="w">{inside}{text}</world>'))
    world = written(tmp_path / "world.sdf", f'<world name="w">{inside}</world>')
    two = import_vehicle(written(tmp_path / "rov.sdf", text), world=world)
    for found in (one, two):
        assert found.vehicle.fluid_density == 1027.0 and found.vehicle.gravity == 9.81
        assert found.report.current == (0.5, -0.2, 0.1)
        assert "1.125" in " ".join(found.report.differs)
    assert any("model://sea" in row.why for row in one.report.left)


DUTY = """<plugin filename="libGenericMotorModelPlugin.so" name="gz::sim::systems::GenericMotorModel">
<jointName>{name}_joint</jointName><linkName>{name}</linkName><turningDirection>{turns}</turningDirection>
<timeConstantUp>0.02</timeConstantUp><timeConstantDown>0.02</timeConstantDown><momentConstant>0.01</momentConstant>
<motorType>force_polynomial</motorType><bidirectionalMotor>1</bidirectionalMotor>
<positiveThrustPolynomial>[0.0, 0.0, 50.0]</positiveThrustPolynomial>
<negativeThrustPolynomial>[0.0, 0.0, 40.0]</negativeThrustPolynomial></plugin>"""


def test_motor_models_are_thrusters_along_the_z_axis_of_their_links(tmp_path: Path):
    text = model(of={"fl": "0.2 0.1 0 0 1.5707963267948966 0", "fr": "0.2 -0.1 0 0 1.5707963267948966 0"})
    for name, turns in (("fl", "ccw"), ("fr", "cw")):
        begin = text.index(f"<joint_name>{name}_joint")
        start, end = text.rindex("<plugin", 0, begin), text.index("</plugin>", begin) + len("</plugin>")
        text = text[:start] + DUTY.format(name=name, turns=turns) + text[end:]
    part: Any = import_vehicle(written(tmp_path / "motors.sdf", text)).vehicle.part("thrusters")
    np.testing.assert_allclose(part.directions, [[1, 0, 0]] * 2, atol=1e-15)
    np.testing.assert_allclose(part.extremes, [[-40, -40], [50, 50]])
    np.testing.assert_allclose(part.torque, [-0.01, 0.01])
    assert part.lag == 0.02 and part.unit == "1"


URDF = """<robot name="rov"><link name="{ns}base"><inertial><origin xyz="0 0 -0.02"/><mass value="30"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
<visual><geometry><mesh filename="a.dae"/></geometry></visual>
<collision><origin xyz="0 0 0.1"/><geometry><box size="0.5 0.3 0.2"/></geometry></collision></link>
<link name="frame"/><joint name="frame_joint" type="fixed"><parent link="{ns}base"/><child link="frame"/>
<origin xyz="0.1 0 0"/></joint>{thrusters}<gazebo>{hydrodynamics}</gazebo></robot>"""
URDF_THRUSTER = """<link name="{name}"><inertial><mass value="0.01"/>
<inertia ixx="1e-5" ixy="0" ixz="0" iyy="1e-5" iyz="0" izz="1e-5"/></inertial></link>
<joint name="{name}_joint" type="continuous"><parent link="frame"/><child link="{name}"/>
<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="1 0 0"/><limit lower="-1e16" upper="1e16"/></joint>
<gazebo>{plugin}</gazebo>"""


def test_urdf_with_systems_of_gazebo_is_the_vehicle_of_its_sdf(tmp_path: Path):
    jets = ""
    for i, (name, pose) in enumerate(PLACES.items()):
        x, y, z, *rpy = pose.split()
        plugin = THRUSTER.format(name=name, C=0.02 if i % 2 else -0.02, more="")
        xyz = f"{float(x) - 0.1} {y} {z}"
        jets += URDF_THRUSTER.format(name=name, xyz=xyz, rpy=" ".join(rpy), plugin=plugin)
    text = URDF.format(ns="", thrusters=jets, hydrodynamics=HYDRODYNAMICS.format(more=""))
    (tmp_path / "rov.urdf").write_text(text.replace('name="base"', 'name="body"').replace('"base"', '"body"'))
    here = import_vehicle(tmp_path / "rov.urdf")
    there = import_vehicle(
        written(tmp_path / "rov.sdf", model().replace(BOX, BOX.replace("<geo", "<pose>0 0 0.1 0 0 0</pose><geo")))
    )
    for key in ("mass", "inertia", "center_of_mass", "volume", "center_of_buoyancy", "added_mass"):
        np.testing.assert_allclose(getattr(here.vehicle, key), getattr(there.vehicle, key), atol=1e-12, err_msg=key)
    for key in ("positions", "directions"):
        np.testing.assert_allclose(
            getattr(here.vehicle.part("thrusters"), key), getattr(there.vehicle.part("thrusters"), key), atol=1e-12
        )
    assert here.report.format == "URDF with systems of Gazebo"
    assert here.vehicle.provenance["body.mass"].note.startswith("rov.urdf:1")


def test_a_missing_include_is_named_and_not_a_missing_plugin(tmp_path: Path):
    text = '<robot name="r" xmlns:xacro="x"><xacro:include filename="$(find far)/a.xacro"/><link name="b"/></robot>'
    (tmp_path / "r.xacro").write_text(text)
    with pytest.raises(FileError, match=r"Missing: .*far/a\.xacro is not there.*--folder"):
        import_vehicle(tmp_path / "r.xacro")


def test_packages_are_found_in_the_whole_workspace(tmp_path: Path):
    for folder in ("src/group/one", "src/two"):
        (tmp_path / folder / "urdf").mkdir(parents=True)
        (tmp_path / folder / "package.xml").write_text("<package/>")
    file = tmp_path / "src/two/urdf/x.xacro"
    assert workspace_of(file) == tmp_path / "src"
    assert package_folder(tmp_path / "src", "one") == tmp_path / "src/group/one"
    assert package_folder(tmp_path / "src/two", "two") == tmp_path / "src/two"
    assert package_folder(tmp_path, "none") == tmp_path / "none"


def test_python_in_looks_is_skipped_and_elsewhere_comes_with_the_remedy(tmp_path: Path):
    body = URDF.format(ns="", thrusters="", hydrodynamics=HYDRODYNAMICS.format(more="")).replace('"base"', '"body"')
    odd = "${[1, 2][0]}"
    seen = body.replace('filename="a.dae"', f'filename="{odd}"')
    (tmp_path / "seen.xacro").write_text(seen)
    found = import_vehicle(tmp_path / "seen.xacro")
    assert any("how it looks" in row.what + row.why for row in found.report.left)
    (tmp_path / "mass.xacro").write_text(body.replace('<mass value="30"/>', f'<mass value="{odd}"/>'))
    with pytest.raises(FileError, match="run xacro on it first"):
        import_vehicle(tmp_path / "mass.xacro")


def test_arguments_stand_in_expressions_and_defaults_of_macros_hold_spaces(tmp_path: Path):
    body = URDF.format(ns="", thrusters="", hydrodynamics=HYDRODYNAMICS.format(more="")).replace('"base"', '"body"')
    said = """<robot name="rov"><xacro:arg name="m" default="20"/>
      <xacro:macro name="said" params="at:='0 0 -0.02' mass">
        <origin xyz="${at}"/><mass value="${mass}"/>
      </xacro:macro>"""
    body = body.replace('<robot name="rov">', said)
    call = '<xacro:said mass="${$(arg m) + math.sqrt(100)}"/>'
    body = body.replace('<origin xyz="0 0 -0.02"/><mass value="30"/>', call)
    (tmp_path / "a.xacro").write_text(body)
    vehicle = import_vehicle(tmp_path / "a.xacro").vehicle
    assert vehicle.mass == 30.0 and vehicle.center_of_mass[2] == pytest.approx(0.02)


def test_a_model_that_nothing_pushes_says_so_first(tmp_path: Path):
    found = import_vehicle(written(tmp_path / "dead.sdf", model(of={})))
    assert str(found.report).splitlines()[2].startswith("Warning: NOTHING PUSHES THIS VEHICLE")


def test_two_commands_lead_from_a_file_to_a_closed_loop(tmp_path: Path, capsys):
    path = written(tmp_path / "rov.sdf", model("<default_current>0.1 0 0</default_current>"))
    out, mission = str(tmp_path / "rov.toml"), str(tmp_path / "dive.toml")
    assert main(["import", str(path), "--out", out, "--mission", mission]) == 0
    assert "flies it" in capsys.readouterr().out and "velocity_m_s" in (tmp_path / "dive.toml").read_text()
    assert main(["run", mission, "--check"]) == 0
    assert main(["import", str(path), "--mission", str(tmp_path / "other.toml")]) == 2


@pytest.mark.long
def test_an_imported_vehicle_ends_at_its_depth_and_heading(tmp_path: Path):
    import json

    out, mission = str(tmp_path / "rov.toml"), str(tmp_path / "dive.toml")
    assert main(["import", str(written(tmp_path / "rov.sdf", model())), "--out", out, "--mission", mission]) == 0
    assert main(["run", mission, "--out", str(tmp_path / "dive")]) == 0
    found = json.loads((tmp_path / "dive/summary.json").read_text())["mission"]["tracking"]
    assert abs(found["depth"]["error_final"]) < 0.02 and abs(found["heading"]["error_final"]) < 0.5


INCLUDE = '<xacro:include filename="$(find far)/arm.xacro"/><xacro:arm side="left"/><xacro:arm side="right"/>'


def test_missing_includes_and_macros_are_the_first_warning_of_a_vehicle_that_flies_without_them(tmp_path: Path):
    body = URDF.format(ns="", thrusters="", hydrodynamics=HYDRODYNAMICS.format(more="")).replace('"base"', '"body"')
    (tmp_path / "rov.xacro").write_text(body.replace("</robot>", f"{INCLUDE}</robot>"))
    found = import_vehicle(tmp_path / "rov.xacro")
    first = str(found.report).splitlines()[2]
    assert first.startswith("Warning: 3 included files or macros are missing, and the vehicle lacks what they hold.")
    assert "arm.xacro is not there" in first and "--folder" in first


def test_a_mission_that_cannot_be_written_names_what_is_missing_below_the_report(tmp_path: Path, capsys):
    body = URDF.format(ns="", thrusters="", hydrodynamics=HYDRODYNAMICS.format(more="")).replace('"base"', '"body"')
    (tmp_path / "rov.xacro").write_text(body.replace("</robot>", f"{INCLUDE}</robot>"))
    given = ["--out", str(tmp_path / "rov.toml"), "--mission", str(tmp_path / "dive.toml")]
    assert main(["import", str(tmp_path / "rov.xacro"), *given]) == 2
    said = capsys.readouterr()
    assert "Taken over:" in said.out and not (tmp_path / "rov.toml").exists()
    assert "which has 0 thrusters, 0 fins: none of the controllers manoeuvre, cruise fits. 3 included" in said.err
    assert "--folder" in said.err


ENGINE = """<plugin filename="gz-sim-buoyancy-engine-system" name="gz::sim::systems::BuoyancyEngine">
<link_name>body</link_name><neutral_volume>0.002</neutral_volume><min_volume>0</min_volume><max_volume>0.003</max_volume>
<default_volume>0.001</default_volume></plugin>"""


def test_ballast_that_begins_beyond_neutral_is_in_the_first_mission_and_counts_for_the_weight(tmp_path: Path):
    found = import_vehicle(written(tmp_path / "rov.sdf", model().replace("</model>", f"{ENGINE}</model>")))
    (volume,) = found.report.starts.values()
    assert volume == pytest.approx(-0.001)
    tables = tomllib.loads(first_mission(found.vehicle, "rov.toml", found.report))
    assert tables["mission"]["ballast_m3"] == tables["initial"]["actuators"]["ballast_m3"] == pytest.approx(-0.001)


def test_a_torpedo_whose_thruster_has_no_limit_is_told_that_cruise_flies_it_with_one():
    fins = [Fin(f"fin{i}", area=0.01, lift_slope=3.0, stall=0.4, position=(-1, 0, 0), normal=n, limit=0.3)  # pyright: ignore
            for i, n in enumerate([(0, 1, 0), (0, 0, 1)])]  # fmt: skip
    screw = Thrusters("screw", {"linear": 1.0}, positions=[(-1, 0, 0)], directions=[(1, 0, 0)])
    body = {"mass": 20.0, "inertia": (1, 5, 5), "added_mass": (1, 20, 20, 0.1, 5, 5)}
    (said,) = doubts(Vehicle(name="torpedo", **body, parts=(*fins, screw)))  # pyright: ignore[reportArgumentType]
    assert said == "The files give `screw` no limit: add `limit` in the vehicle file, then cruise, attitude can fly it."


def test_a_static_model_is_a_warning_and_not_counted_as_looks(tmp_path: Path):
    text = model(of={}).replace('<model name="rov">', '<model name="rov"><static>true</static>')
    said = str(import_vehicle(written(tmp_path / "rov.sdf", text)).report).splitlines()
    assert said[2] == (
        "Warning: rov.sdf:1: <static> is true, so that the model does not move in the simulator; here it moves."
    )
    assert "elements of looks" not in said[1]
