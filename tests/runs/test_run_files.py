"""Run files: what they mean, and one sentence for each thing that is wrong with them."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from math import pi

import numpy as np
import pytest

from coadjoint.errors import ArgumentError, CoadjointError, FileError
from coadjoint.groups import attitude
from coadjoint.runs.run_file import read
from coadjoint.runs.running import execute
from coadjoint.runs.toml_text import to_toml
from files import TOP, TOP_OF_CATALOGUE, write


def refused(path, *changes) -> str:
    with pytest.raises(CoadjointError) as caught:
        read(path, changes)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_units_in_key_names_become_si(tmp_path):
    changes = ["run.steps=", "run.duration_min=0.5", "run.dt_ms=10", "initial.angular_velocity_deg_per_s=[0, 0, 90]"]
    file = read(write(tmp_path, TOP), changes)
    assert (file.run.duration, file.run.dt) == (30.0, 0.01)
    start = file.set_up().start
    assert np.allclose(start.xi, [0, 0, pi / 2], atol=1e-15)
    assert np.allclose(start.g, attitude.zyx(0, pi / 18, 0), atol=1e-15)


def test_yaw_pitch_and_roll_can_be_given_one_by_one(tmp_path):
    file = read(write(tmp_path, TOP_OF_CATALOGUE), ["initial.yaw_deg=30", "initial.roll=0.1"])
    start = file.set_up().start
    assert np.allclose(start.g, attitude.zyx(pi / 6, 0, 0.1), atol=1e-15)
    assert "leave one out" in refused(write(tmp_path, TOP_OF_CATALOGUE), "initial.yaw=1", "initial.euler_zyx=[0,0,0]")


def test_a_factory_gets_its_parameters_in_si(tmp_path):
    system = read(write(tmp_path, TOP), ["parameters.weight_kN=0.03"]).set_up().system
    assert system.parameters.weight == 30.0


def test_a_factory_may_bring_its_own_start(tmp_path):
    text = '[system]\nfactory = "top.py:with_start"\n[parameters]\nweight = 3\n[run]\ndt = 0.01\nsteps = 1\n'
    start = read(write(tmp_path, text)).set_up().start
    assert np.array_equal(start.xi, [0, 0, 50])
    with pytest.raises(ArgumentError, match=r"leave out section \[initial\]"):
        read(write(tmp_path, text), ["initial.xi=[0,0,1]"]).set_up()
    with pytest.raises(ArgumentError, match="needs `weight`"):
        read(write(tmp_path, text), ["parameters.weight="]).set_up()


def test_an_element_of_a_product_is_a_list_of_its_parts(tmp_path):
    changes = ["system.factory=top.py:rigid_motion", "initial=", "initial.g=[[[0,-1,0],[1,0,0],[0,0,1]],[1,2,3]]"]
    start = read(write(tmp_path, TOP), changes).set_up().start
    assert np.array_equal(start.g[1], [1, 2, 3])
    assert start.g[0][1][0] == 1


@pytest.mark.parametrize(
    ("written", "title"),
    [
        ({"name": "left-rectangle", "map": "exponential"}, "LeftRectangle(Exponential())"),
        ({"name": "Suzuki4", "base": "trapezoidal"}, "Suzuki4(Trapezoidal(Cayley()))"),
        ({"name": "variable step"}, "VariableStep(Simpson(Cayley()))"),
        ({"name": "variable-step", "base": "midpoint", "within": [0.5, 2.0]}, "VariableStep(Midpoint(Cayley()))"),
        ({"name": "energy momentum", "points": 2}, "EnergyMomentum(Cayley(), points=2)"),
        ({"name": "hamiltonian midpoint"}, "HamiltonianMidpoint(Cayley())"),
        ({"name": "LeftRight", "map": "squared cayley"}, "LeftRight(Squared(half=Cayley()))"),
        (
            {"name": "composition", "coefficients": [0.25, 0.5, 0.25]},
            "Composition(Midpoint(Cayley()))",
        ),
    ],
)
def test_methods_are_found_by_their_names(tmp_path, written, title):
    from coadjoint.runs.methods import method

    file = read(write(tmp_path, TOP), [f"method.{key}={value}" for key, value in written.items()])
    found = method(file.method)
    assert found.title == title
    assert "coefficients" not in written or found.coefficients == (0.25, 0.5, 0.25)
    with pytest.raises(ArgumentError, match="Composition needs coefficients, such as"):
        method(read(write(tmp_path, TOP), ["method.name=composition"]).method)


@pytest.mark.long
def test_substeps_backwards_are_allowed_where_forces_dissipate(tmp_path):
    changes = ["system.factory=top.py:damped", "method.name=Suzuki4", "run.steps=2", "output.figures=false"]
    path = write(tmp_path, TOP)
    with pytest.raises(ArgumentError, match="substeps that go backwards"):
        execute(read(path, changes), tmp_path / "refused", progress=False)
    done = execute(read(path, [*changes, "method.negative_substeps=allow"]), tmp_path / "allowed", progress=False)
    assert done.failure is None
    with pytest.raises(ArgumentError, match="negative_substeps belongs to a composition, such as Suzuki4"):
        execute(read(path, ["method.negative_substeps=allow"]), tmp_path / "midpoint", progress=False)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("run.dt=-0.01", "[run] dt must be positive, but is -0.01"),
        ("run.dt=0", "[run] dt must be positive"),
        ("run.dt=nan", "[run] dt must be positive, but is nan"),
        ("run.dt=quick", "[run] dt must be a number, but is 'quick'"),
        ("run.dt=true", "[run] dt must be a number, but is True"),
        ("run.dt=", "needs `dt`"),
        ("run.steps=0", "[run] steps must be a whole number from 1, but is 0"),
        ("run.steps=2.5", "[run] steps must be a whole number, but is 2.5"),
        ("run.steps=", "needs `duration` in s, or `steps`"),
        ("run.duration=1", "gives both `duration` and `steps`"),
        ("run.save_every=0", "save_every must be a whole number from 1"),
        ("run.stepz=3", "did you mean `steps`?"),
        ("run.duration_deg=3", "ends in a unit of angle, but `duration` measures time"),
        ("initial.xi=[[1],[2,3]]", "[initial] xi must hold numbers in rows of one length"),
        ("initial.xi=[[[1,2],[3]],[[1,2],[3,4]]]", "[initial] xi must hold numbers in rows of one length"),
        ("initail.xi=3", "did you mean `initial`?"),
        ("run=3", "must be section.key=value"),
        ("run.dt.more=3", "`dt` of 'run.dt.more=3' is none"),
        ("system.model=heavy_top", "needs either `model`"),
        ("system.factory=top.py", 'must be "file.py:function"'),
        ("method.name=Midpiont", "did you mean `Midpoint`?"),
        ("method.map=Kayley", "did you mean `Cayley`?"),
        ("method.start=fast", '"momentum" or "velocity"'),
        ("method.negative_substeps=yes", '[method] negative_substeps must be "refuse" or "allow", but is \'yes\''),
        ('output.figures=["enrgy"]', "has no figure `enrgy`"),
        ("output.format=jpeg", '"png", "pdf" or "svg"'),
    ],
)
def test_what_does_not_belong_in_a_run_file_is_told(tmp_path, change, words):
    sentence = refused(write(tmp_path, TOP), change)
    assert words in sentence


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("parameters.mas=3", "did you mean `mass`?"),
        ("initial.angular_velocty=[0,0,1]", "did you mean `angular_velocity`?"),
        ("initial.euler_zxz_m=[0,0,1]", "measures angle"),
        ("system.model=heavy_toop", "did you mean `heavy_top`?"),
    ],
)
def test_what_a_model_does_not_know_is_told(tmp_path, change, words):
    assert words in refused(write(tmp_path, TOP_OF_CATALOGUE), change)


def test_a_duration_is_a_whole_number_of_steps(tmp_path):
    sentence = refused(write(tmp_path, TOP), "run.steps=", "run.duration=0.0105")
    assert "10.5 steps" in sentence
    assert "write 0.01." in sentence


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[run\n", "is not valid TOML"),
        ("run = 3\n[system]\nmodel='heavy_top'", "must be a section"),
        ("[run]\ndt=1\nsteps=1", "needs a section [system]"),
        ("[system]\nmodel='heavy_top'", "needs a section [run]"),
        ("[system]\nmodel='heavy_top'\n[run]\ndt=1\ndt_ms=3\nsteps=1", "gives `dt` twice"),
        ("[system]\nmodel='heavy_top'\n[run]\ndt_ms='3'\nsteps=1", "must hold numbers"),
    ],
)
def test_files_that_are_no_run_files_are_told(tmp_path, text, words):
    assert words in refused(write(tmp_path, text))


def test_files_that_cannot_be_read_are_told(tmp_path):
    assert "There is no run file" in refused(tmp_path / "nothing.toml")
    assert "cannot be read" in refused(tmp_path)
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe")
    assert "not a text" in refused(tmp_path / "binary.toml")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (["system.factory=nix.py:top"], "There is no file"),
        (["system.factory=top.py:tip"], "did you mean `top`?"),
        (["system.factory=top.py:raises", "initial="], r"raised an error: KeyError: 'mass' \(line \d+\)\."),
        (["system.factory=top.py:number", "initial="], "must return a co.System"),
        (["parameters.wieght=3"], "did you mean `weight`?"),
        (["initial.a0=[0,1]"], r"`initial.a0` must have shape \(3,\), but has shape \(2,\)"),
        (["initial.euler_zyx=", "initial.rotation=[[1,0,0],[0,1,0],[0,0,2]]"], "must lie in SO3"),
        (["initial.euler_zyx=", "initial.g=[[1,0,0],[0,1,0],[0,0,-1]]"], "must lie in SO3"),
        (["initial.g=[[1,0,0],[0,1,0],[0,0,1]]"], "gives both `g` and `euler_zyx`"),
        (["initial.velocity_deg=3"], "has no key `velocity_deg`"),
    ],
)
def test_factories_and_starts_that_do_not_work_are_told(tmp_path, changes, words):
    file = read(write(tmp_path, TOP), changes)
    with pytest.raises(CoadjointError, match=words) as caught:
        execute(file, tmp_path / "out", progress=False)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_python_files_that_do_not_run_are_told_with_the_line(tmp_path):
    file = write(tmp_path, TOP)
    (tmp_path / "top.py").write_text("import coadjoint\n\ndef top(:\n")
    with pytest.raises(ArgumentError, match=r"SyntaxError: .* \(line 3\)"):
        read(file).set_up()
    (tmp_path / "top.py").write_text("import coadjoint\nimport no_such_module\n")
    with pytest.raises(ArgumentError, match=r"ModuleNotFoundError: .* \(line 2\)"):
        read(file).set_up()
    (tmp_path / "top.txt").write_text("")
    with pytest.raises(FileError, match=r"must end in \.py"):
        read(file, ["system.factory=top.txt:top"]).set_up()


def test_toml_is_written_as_it_reads():
    table = {"run": {"dt": 1e-3, "name": 'a "b"\n', "on": True, "x": [[1, 2.5], []]}, "two words": {"a": {"b": 1}}}
    assert tomllib.loads(to_toml(table)) == table


def test_reading_a_run_file_loads_no_jax(tmp_path):
    code = (
        "import sys; from coadjoint.runs.run_file import read; read(sys.argv[1]);"
        "heavy = {'jax', 'matplotlib', 'xarray', 'scipy'} & set(sys.modules);"
        "sys.exit(f'{heavy}' if heavy else 0)"
    )
    for text in (TOP, TOP_OF_CATALOGUE):
        command = [sys.executable, "-c", code, str(write(tmp_path, text))]
        done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
