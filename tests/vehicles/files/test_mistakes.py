"""Mistakes in a vehicle file: each is refused, or told, in one sentence that names file, key and remedy."""
# ruff: noqa: E501 — a mistake a line

from __future__ import annotations

import re
import warnings

import numpy as np
import pytest

import coadjoint_vehicles as vehicles
from coadjoint.errors import ArgumentError, FileError
from coadjoint.units import unit_of
from coadjoint_vehicles.files.file import vehicle_from_text
from coadjoint_vehicles.files.registry import vehicle_text

REMUS, NPS, REXROV, LRAUV = (vehicle_text(name) for name in ("remus_100", "nps_auv_ii", "rexrov", "lrauv_raanan"))
MASS = 'mass = { value = 31.029384975800244, unit = "kg", source = "PVS"'
INERTIA = "value = [0.1120, 4.0278, 4.0278]"
MATRIX = "value = [0.8389, 29.4376, 29.4376, 0.0336, 3.4262, 3.4262]"
FULL = """value = [[0.8389, 0, 0, 0, 0, 0], [0, 29.4376, 0, 0, 0, {}], [0, 0, 29.4376, 0, 0, 0],
    [0, 0, 0, 0.0336, 0, 0], [0, 0, 0, 0, 3.4262, 0], [0, {}, 0, 0, 0, 3.4262]]"""
CENTER = 'center_of_mass = { value = [0, 0, 20], unit = "mm"'
LINEAR = "linear = { value = [1.5934142487900123"
NPS_LIMIT = 'limit = { value = 25, unit = "1/s"'
RUDDER = 'name = "rudder"\nposition = { value = [-0.8, 0, 0]'
PLANES = 'name = "stern_planes"\nposition = { value = [-0.8, 0, 0]'

REFUSED = {
    "a part in mm taken for m": (REMUS, RUDDER, RUDDER.replace("-0.8", "-800"), r"`rudder` must be a point of the vehicle"),
    "no TOML": (REMUS, "[body]", "[body", r"not valid TOML"),
    "a section that is none": (REMUS, "[body]", "[bodies]", r"no key `bodies`: did you mean `body`\?"),
    "a missing section": (REMUS, "[added_mass]\nmatrix", "[controllers]\nmatrix", r"no key `controllers`: did you mean `controller`\?"),
    "a misspelt key": (REMUS, "center_of_mass", "centre_of_mass", r"\[body\] needs center_of_mass = \{ value"),
    "a misspelt key of a part": (
        REMUS, "axial_drag = {", "axialdrag = {",
        r"hull needs axial_drag = \{.*\}, but has `axialdrag`: did you mean `axial_drag`\?$"),
    "a number of 401 digits": (REMUS, "value = 1026", f"value = {10**400}", r"fluid_density = 1000+….* larger than anything"),
    "a number of 5000 digits": (REMUS, "value = 1026", "value = " + 5000 * "9", r"a number that is too long to be read"),
    "a unit of commands that is none": (
        NPS, 'command_unit = "1/s"', 'command_unit = "bananas"', r'command_unit has the unit "bananas", in which'),
    "a limit in another unit than its command": (
        NPS, NPS_LIMIT, NPS_LIMIT.replace("1/s", "m"), r'limit measures 1/s, but its unit is "m"'),
    "an unknown key": (REMUS, "neutral = true", "neutral = true\nbouyancy = 3", r"no key `bouyancy`: did you mean `buoy"),
    "a bare number": (REMUS, MASS, "mass = 31 #", r"\[body\] mass must say its unit.*write mass = \{ value = 31, unit ="),
    "no unit": (REMUS, 'value = 1.6, unit = "m"', "value = 1.6", r'length has no unit: add unit = "m"'),
    "a wrong unit": (REMUS, MASS, MASS.replace("kg", "m"), r'mass measures kg, but its unit is "m"'),
    "an unknown unit": (REMUS, MASS, MASS.replace("kg", "kgs"), r"`kgs` is not known"),
    "a unit beside the value": (REMUS, MASS, MASS.replace("unit", "units"), r"mass has no key `units`: did you mean `unit`"),
    "a text for a number": (REMUS, "value = 1026", 'value = "1026"', r"fluid_density must be a number, but is '1026'"),
    "no finite number": (REMUS, "value = 1026", "value = nan", r"fluid_density must be finite, but is nan"),
    "a true": (REMUS, "value = 1026", "value = true", r"fluid_density must be a number, but is True"),
    "a negative mass": (REMUS, "value = 31.0", "value = -31.0", r"\[body\] mass must be positive, but is -31"),
    "no water": (REMUS, "value = 1026", "value = 0", r"fluid_density must be positive, but is 0"),
    "a vector of two": (REMUS, "value = [0, 0, 20]", "value = [0, 20]", r"center_of_mass must be 3 numbers in brackets"),
    "a crooked matrix": (REMUS, MATRIX, "value = [[1, 2], [3]]", r"matrix must hold numbers in rows of one length"),
    "a matrix of five": (REMUS, MATRIX, "value = [1, 2, 3, 4, 5]", r"matrix must be six numbers, or six rows of six"),
    "added mass with the sign of derivatives": (
        REMUS, MATRIX, "value = [-0.8, -29, -29, -0.03, -3, -3]", r"change the sign of all: added mass is positive"),
    "added mass that is not symmetric": (REMUS, MATRIX, FULL.format(5, -5), r"row 2, column 6 is 5, but row 6, column 2"),
    "added mass without a definite sign": (REMUS, MATRIX, FULL.format(50, 50), r"no negative eigenvalue, but has -"),
    "inertia of the wrong sign": (REMUS, INERTIA, "value = [0.1, -4, 4]", r"inertia must be positive about every axis"),
    "inertia about another point": (
        REMUS, INERTIA + ', unit = "kg m^2", source = "PVS", note = "of the ellipsoid, rounded" }\n' + CENTER,
        'value = [0.01, 4, 4], unit = "kg m^2", source = "PVS" }\ninertia_about = "origin"\n' + CENTER,
        r"about the mass centre, after what the offset of the mass centre takes away"),
    "inertia about nothing": (
        REMUS, CENTER, 'inertia_about = "center"\n' + CENTER, r"one of 'center_of_mass', 'origin', but is 'center'"),
    "two volumes": (REMUS, "neutral = true", 'neutral = true\nvolume = { value = 1, unit = "L" }', r"`volume` and `neutral`"),
    "no volume": (REMUS, "neutral = true", "", r"needs one of `volume`, `buoyancy` and `neutral = true`, but has none"),
    "a source that is none": (REMUS, MASS, MASS.replace("PVS", "PVC"), r"source 'PVC', which \[sources\] does not have.*PVS"),
    "a licence of no source": (REMUS, "[licences]", '[licences]\nME = "MIT"', r"\[licences\] names ME, which \[sources\] does not have"),
    "axes that nobody knows": (REMUS, 'axes = "FRD"', 'axes = "FSD"', r"axes must be one of 'FRD', 'FLU', but is 'FSD'"),
    "no axes": (REMUS, 'axes = "FRD"\n', "", r"\[vehicle\] needs `axes = "),
    "a kind that is none": (REMUS, 'kind = "propeller"', 'kind = "propellor"', r"Did you mean 'propeller'\?"),
    "two parts of one name": (REMUS, 'name = "rudder"', 'name = "stern_planes"', r"name is that of another part too"),
    "a name of two words": (REMUS, 'name = "rudder"', 'name = "my rudder"', r"name must be one word"),
    "a name that is taken": (REMUS, 'name = "rudder"', 'name = "water"', r"The name `water` is taken"),
    "a part with a single bracket": (
        REMUS.split("[[part]]")[0], "[added_mass]", '[part]\nkind = "hull"\n[added_mass]', r"begins with \[\[part\]\]"),
    "a key of another kind": (REMUS, "wake_fraction", "wake", r"propeller needs wake_fraction"),
    "a stall in metres": (
        REMUS, 'stall = { value = 20, unit = "deg"', 'stall = { value = 20, unit = "m"', r'stall measures rad, but its unit'),
    "a fin along the hull": (REMUS, "normal = { value = [0, 1, 0]", "normal = { value = [1, 0, 0]", r"must not point along"),
    "a normal that is not of unit length": (
        REMUS, "normal = { value = [0, 1, 0]", "normal = { value = [0, 2, 0]", r"must be a unit vector"),
    "a lift beyond theory": (REMUS, "lift_slope = { value = 3.12", "lift_slope = { value = 31.2", r"must be below 2π per rad"),
    "a thrust of three numbers": (REMUS, "thrust = { value = [0.4566,", "thrust = { value = [0, 0.4566,", r"shape \(2,\)"),
    "a unit for several things": (
        REMUS, '3.4262], unit = "SI"', '3.4262], unit = "kg"', r'unit = "SI" or "prime"'),
    "a controller that is none": (REMUS, 'kind = "cruise"', 'kind = "cruiser"', r"Did you mean 'cruise'\?"),
    "a controller without what it needs": (REMUS, 'kind = "cruise"', 'kind = "sawtooth"', r"\[controller\] needs volume = "),
    "a controller's misspelt key": (
        REMUS, 'kind = "cruise"', 'kind = "cruise"\nperiode = { value = 1, unit = "s" }', r"did you mean `period`"),
    "a derivative that is none": (NPS, "X_pp = 0.007", "X_pz = 0.007", r"'X_pz' of the derivatives `manoeuvring`"),
    "an acceleration among derivatives": (NPS, "X_pp = 0.007", "X_udot = 0.007", r"'X_udot' of the derivatives"),
    "a prime unit without a length": (
        NPS, 'length = { value = 5.3, unit = "m", source = "MSS" }\n\n[added', "\n[added", r'unit "prime", for which \[body\]'),
    "a curve that is none": (NPS, "quadratic", "cubic", r"curve has no key `cubic`"),
    "directions that are missing": (REXROV, "directions = ", "direction = ", r"needs directions = "),
    "a panel file that is missing": (
        REMUS, "matrix = { " + MATRIX + ', unit = "SI"', 'wamit = "hull.1"\naxes = "z_up"\nulen = { value = 1, unit = "m"',
        r"There is no file hull\.1"),
}  # fmt: skip

TOLD = {
    "heavy": (REMUS, "neutral = true", 'buoyancy = { value = 280, unit = "N", source = "PVS" }', r"-8\.0 %: it sinks"),
    "light": (REMUS, "neutral = true", 'volume = { value = 33, unit = "L", source = "PVS" }', r"it floats up"),
    "upside down": (REMUS, "value = [0, 0, 20]", "value = [0, 0, -20]", r"20 mm below its centre of mass: it turns over"),
    "nothing to right it": (REMUS, "value = [0, 0, 20]", "value = [0, 0, 0]", r"nothing rights it in roll and pitch"),
    "a bad trim": (REMUS, "value = [0, 0, 20]", "value = [20, 0, 20]", r"trim of 45° nose down"),
    "a heel": (REMUS, "value = [0, 0, 20]", "value = [0, -20, 20]", r"heel of 45° to port"),
    "FLU taken for FRD": (REMUS, 'axes = "FRD"', 'axes = "FLU"', r"was the file written with z up, FLU"),
    "surge and sway exchanged": (REMUS, MATRIX, "value = [29.4376, 0.8389, 29, 0.03, 3.4, 3.4]", r"in sway.*axes exchanged"),
    "sway and heave exchanged": (
        REMUS.replace(MATRIX, "value = [0.8389, 29.4376, 19.4376, 0.0336, 3.4262, 3.4262]"),
        "width = { value = 0.19", "width = { value = 0.40", r"are sway and heave exchanged\?"),
    "roll and yaw exchanged": (REMUS, INERTIA, "value = [4.0278, 4.0278, 0.1120]", r"about z, 0\.112 .*axes exchanged"),
    "inertia that no body has": (REMUS, INERTIA, "value = [0.1, 1, 4]", r"no distribution of mass has them"),
    "inertia in g m²": (REMUS, INERTIA, "value = [112, 4028, 4028]", r"radius of gyration.*is more than its size"),
    "inertia in t m²": (REMUS, INERTIA, "value = [0.0001, 0.004, 0.004]", r"are tiny for a size"),
    "a slight asymmetry": (REMUS, MATRIX, FULL.format(0.1, 0.1001), r"not symmetric: row 2, column 6 is 0\.1, but"),
    "added mass in g": (REMUS, MATRIX, "value = [838, 29437, 29437, 33, 3426, 3426]", r"times the water that it displaces"),
    "no added mass": (REMUS, MATRIX, "value = [0, 0, 0, 0, 0, 0]", r"no added mass at all"),
    "water in g/cm³ taken for kg/m³": (REMUS, "value = 1026", "value = 1.026", r"its water has 1\.026 kg/m³"),
    "gravity of the moon": (REMUS, "value = 9.81,", "value = 1.62,", r"gravity is 1\.62 m/s²"),
    "a length in cm": (REMUS, "value = 1.6, ", "value = 160, ", r"is tiny for a length of 160 m"),
    "length and diameter exchanged": (
        REMUS.replace('value = 0.19, unit = "m", source = "PVS" }\n\n[added', 'value = 1.6, unit = "m" }\n\n[added'),
        'length = { value = 1.6, unit = "m", source = "PVS" }\ndiameter',
        'length = { value = 0.19, unit = "m" }\ndiameter', r"are they exchanged\?"),
    "millimetres taken for metres": (
        REMUS, CENTER, 'center_of_mass = { value = [0, 0, 20], unit = "m"', r"20 m from the origin.*millimetres\?"),
    "linear damping that drives": (REMUS, LINEAR, "linear = { value = [-1.6", r"linear of `damping` has -1\.6 in surge: it drives"),
    "coupled damping that drives": (
        REXROV, "linear = { value = [74.82, 69.48, 728.4, 268.8, 309.77, 105]",
        "linear = { value = [[75, 0, 0, 0, 0, 0], [0, 69, 0, 0, 0, 200], [0, 0, 728, 0, 0, 0], [0, 0, 0, 269, 0, 0], "
        "[0, 0, 0, 0, 310, 0], [0, 200, 0, 0, 0, 105]]", r"has a negative eigenvalue: in some motions it puts energy in"),
    "a derivative that drives ahead": (
        LRAUV, '"X_u|u|" = -', '"X_u|u|" = ', r"X_u\|u\| of `.*` is positive: it drives in surge instead of braking"),
    "a derivative that drives in sway": (
        LRAUV, '"Y_v|v|" = -', '"Y_v|v|" = ', r"Y_v\|v\| of `.*` is positive: it drives in sway instead of braking"),
    "fins in front": (
        REMUS.replace(RUDDER, RUDDER.replace("-", "")), PLANES, PLANES.replace("-", ""), r"`rudder` stand in front"),
    "stall in degrees taken for radians": (
        REMUS, 'stall = { value = 20, unit = "deg"', 'stall = { value = 20, unit = "rad"', r"beyond 90°: degrees taken for"),
    "a limit in degrees taken for radians": (
        REMUS, 'limit = { value = 15, unit = "deg"', 'limit = { value = 15, unit = "rad"', r"turns to 859°, beyond 90°"),
    "rpm taken for 1/s": (REMUS, 'value = 1525, unit = "rpm"', 'value = 1525, unit = "1/s"', r"revolutions a minute, rpm\?"),
    "a propeller turned round": (REMUS, "value = [0.4566, -0.4", "value = [-0.4566, -0.4", r"pushes astern at positive"),
    "thrust that grows with the advance": (REMUS, "value = [0.4566, -0.4", "value = [0.4566, 0.4", r"grows with its advance"),
    "a lag in ms taken for s": (REMUS, "lag = { value = 0.1,", "lag = { value = 100,", r"milliseconds taken for seconds"),
    "a fin in cm²": (REMUS, "area = { value = 0.0133,", "area = { value = 133,", r"has 133 m² on a vehicle of 1\.6 m"),
    "a part in cm taken for m": (REMUS, RUDDER, RUDDER.replace("-0.8", "-80"), r"`rudder` is 80 m from the origin"),
    "thrusters that push nowhere ahead": (
        NPS, "directions = { value = [[1, 0, 0]]", "directions = { value = [[0, 0, 1]]", r"span no forward force"),
    "a number without a source": (REMUS, 'value = 1.0, unit = "s", source = "PVS"', 'value = 1.0, unit = "s"',
        r"no source is given for propeller\.lag"),
    "a source that nobody names": (REMUS, "[sources]", '[sources]\nME = "a book that nobody reads"', r"has ME, which no number"),
}  # fmt: skip


@pytest.mark.parametrize(("command", "one"), [("1/s", 1 / 60), ("rad/s", np.pi / 30), ("rpm", 1.0)])
def test_a_limit_may_be_in_another_unit_of_its_command(command: str, one: float) -> None:
    text = changed(NPS, 'command_unit = "1/s"', f'command_unit = "{command}"')
    made = vehicle_from_text(changed(text, NPS_LIMIT, NPS_LIMIT.replace("1/s", "rpm")))
    np.testing.assert_allclose(getattr(made.part("propellers"), "limit"), 25 * one * np.array([-1, 1]))  # noqa: B009


def test_a_file_of_notepad_begins_with_a_byte_order_mark_and_is_read(tmp_path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(REMUS, encoding="utf-8-sig")
    assert vehicles.read(path).mass == vehicles.load("remus_100").mass


@pytest.mark.parametrize(
    ("text", "size"),
    [("mL", 1e-6), ("µm", 1e-6), ("μm", 1e-6), ("°", np.pi / 180), ("°/s", np.pi / 180), ("µs", 1e-6)],
)
def test_units_of_small_things_are_known(text: str, size: float) -> None:
    assert unit_of(text, "a number")[0] == pytest.approx(size, rel=1e-15)


def changed(text: str, old: str, new: str) -> str:
    assert old in text, f"{old!r} is not in the file."
    return text.replace(old, new)


@pytest.mark.parametrize("mistake", REFUSED)
def test_a_mistake_is_refused_in_one_sentence(mistake: str) -> None:
    text, old, new, sentence = REFUSED[mistake]
    with pytest.raises((ArgumentError, FileError)) as caught:
        vehicle_from_text(changed(text, old, new), "mine.toml")
    said = str(caught.value)
    assert re.search(sentence, said), said
    assert "mine.toml" in said and "\n" not in said and said.endswith((".", "?")), said


@pytest.mark.parametrize("text", ["x" * 5000, "CLA" + " " * 5000])
def test_a_long_text_is_cut_in_the_sentence_that_shows_it(text: str) -> None:
    with pytest.raises(ArgumentError, match="has the source") as caught:
        vehicle_from_text(REMUS.replace('"PVS"', f'"{text}"', 1), "mine.toml")
    assert len(str(caught.value)) < 600


@pytest.mark.parametrize("mistake", TOLD)
def test_what_is_doubtful_is_told(mistake: str) -> None:
    text, old, new, sentence = TOLD[mistake]
    told = vehicle_from_text(changed(text, old, new), "mine.toml").warnings
    assert any(re.search(sentence, said) for said in told), told
    assert all("\n" not in said and said.endswith((".", "?")) for said in told), told


def test_sound_vehicles_are_not_doubted() -> None:
    assert vehicles.load("remus_100").warnings == () == vehicles.load("nps_auv_ii").warnings


def test_a_file_of_ones_own_warns_when_it_is_read(tmp_path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(changed(REMUS, "value = [0, 0, 20]", "value = [0, 0, -20]"), encoding="utf-8")
    with pytest.warns(UserWarning, match=r"mine\.toml: its centre of buoyancy is 20 mm below"):
        vehicle = vehicles.load(path)
    assert len(vehicle.warnings) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        path.write_text(REMUS, encoding="utf-8")
        assert vehicles.read(path).mass == vehicles.load("remus_100").mass


def test_files_that_cannot_be_read_are_named(tmp_path) -> None:
    with pytest.raises(FileError, match=r"There is no vehicle file .*nothing\.toml"):
        vehicles.load(tmp_path / "nothing.toml")
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileError, match="not a text in UTF-8"):
        vehicles.load(tmp_path / "bytes.toml")
    with pytest.raises(FileError, match="cannot be read"):
        vehicles.read(tmp_path)
    with pytest.raises(ArgumentError, match="did you mean `remus_100`"):
        vehicles.load("remus100")
    with pytest.raises(ArgumentError, match="the name of a vehicle or the path of its file, but is 3"):
        vehicles.load(3)  # pyright: ignore[reportArgumentType]


def test_the_section_pilot_is_told_its_new_name():
    with pytest.raises(ArgumentError, match=r"\[pilot\] is called \[controller\]"):
        vehicle_from_text(vehicle_text("remus_100") + '\n[pilot]\nkind = "cruise"\n', "mine.toml")
