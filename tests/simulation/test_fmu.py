"""Functional mock-up units: a stepper inside another simulator does what it does here, to the bit."""

import subprocess
import sys
import zipfile

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from c_library import needs_compiler
from coadjoint.errors import ArgumentError, FileError

fmpy = pytest.importorskip("fmpy", reason="FMPy, which reads functional mock-up units, is not installed")
pytest.importorskip("pythonfmu", reason="PythonFMU, which writes them, is not installed")

DT = 0.01
INERTIA = np.diag([1.0, 2.0, 3.0])


SYSTEM = co.System(
    co.SO3(),
    lambda xi: 0.5 * xi @ INERTIA @ xi,
    forces=lambda motion: co.Force(torque=motion.inputs.torque - motion.inputs.drag * motion.xi),
)
START = SYSTEM.state(xi=[0.3, 1.0, -0.2])


def stepper(**more):
    observe = {"rate": lambda s: s.xi, "momentum": lambda s: jnp.linalg.norm(s.mu)}
    inputs = {"torque": [0.1 + 0.2, 0.0, 0.0], "drag": 0.05}
    return co.Stepper(SYSTEM, START, dt=DT, inputs=inputs, **{"observe": observe, **more})


@pytest.fixture(scope="module", params=["python", pytest.param("c", marks=needs_compiler)])
def saved(tmp_path_factory, request):
    one = stepper()
    one.step(n=7)
    place, units = tmp_path_factory.mktemp("units") / "a body.fmu", {"rate": "rad/s", "torque": "N m"}
    return one, co.simulation.save_fmu(one, place, units=units, python=request.param == "python")


def compiled(saved):
    """Whether a unit needs no Python."""
    return not any(name.endswith(".py") for name in zipfile.ZipFile(saved[1]).namelist())


class Slave:
    """The unit as a master has it, by FMI's own functions; `told` is its log."""

    def __init__(self, path, folder, begin=7 * DT):
        self.described = fmpy.read_model_description(str(path))
        self.references = {v.name: v.valueReference for v in self.described.modelVariables}
        self.told = []
        callbacks = fmpy.fmi2.fmi2CallbackFunctions()
        callbacks.logger = fmpy.fmi2.fmi2CallbackLoggerTYPE(lambda *given: self.told.append(given[-1].decode()))
        callbacks.allocateMemory = fmpy.fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        callbacks.freeMemory = fmpy.fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
        self.fmu = fmpy.fmi2.FMU2Slave(
            guid=self.described.guid,
            unzipDirectory=fmpy.extract(str(path), str(folder)),
            modelIdentifier=self.described.coSimulation.modelIdentifier,
        )
        self.fmu.instantiate(callbacks=callbacks, loggingOn=True)
        self.fmu.setupExperiment(startTime=begin)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        self.t = begin

    def step(self, length, **inputs):
        for name, value in inputs.items():
            self.fmu.setReal([self.references[name]], [value])
        self.fmu.doStep(currentCommunicationPoint=self.t, communicationStepSize=length)
        self.t += length
        return self.seen

    @property
    def seen(self):
        return self.fmu.getReal([self.references[name] for name in ("rate[1]", "rate[2]", "rate[3]", "momentum")])

    def close(self):
        self.fmu.terminate()
        self.fmu.freeInstance()


@pytest.fixture
def slave(saved, tmp_path):
    made = Slave(saved[1], tmp_path)
    yield made
    made.close()


def test_a_unit_is_valid_and_names_its_inputs_outputs_starts_and_step(saved):
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(saved[1])) == []
    described = fmpy.read_model_description(str(saved[1]))
    inputs = {v.name: float(v.start) for v in described.modelVariables if v.causality == "input"}
    assert inputs == {"torque[1]": 0.1 + 0.2, "torque[2]": 0.0, "torque[3]": 0.0, "drag": 0.05}
    assert [v.name for v in described.modelVariables if v.causality == "output"] == [
        "rate[1]", "rate[2]", "rate[3]", "momentum",
    ]  # fmt: skip
    assert described.modelName == "a_body"
    assert float(described.defaultExperiment.stepSize) == DT
    units = {v.name: v.unit for v in described.modelVariables}
    assert units["rate[2]"] == "rad/s" and units["torque[3]"] == "N m" and units["drag"] is None
    declared = {unit.name: unit.baseUnit for unit in described.unitDefinitions}
    assert [getattr(declared["N m"], base) for base in ("kg", "m", "s", "rad")] == [1, 2, -2, 0]
    assert [getattr(declared["rad/s"], base) for base in ("kg", "m", "s", "rad")] == [0, 0, -1, 1]
    assert float(described.defaultExperiment.startTime) == pytest.approx(7 * DT)


def test_fmpy_simulates_a_unit_as_a_run_goes(saved):
    found = fmpy.simulate_fmu(str(saved[1]), start_time=7 * DT, stop_time=0.5, step_size=DT, output_interval=DT)
    inputs = {"torque": np.array([0.1 + 0.2, 0.0, 0.0]), "drag": 0.05}
    run = co.simulate(SYSTEM, START, dt=DT, duration=0.5, inputs=inputs)
    rates = np.stack([found[f"rate[{i}]"] for i in (1, 2, 3)], axis=1)
    assert np.allclose(rates, run.dataset["xi"].values[7:], rtol=0, atol=1e-13)


def test_a_unit_moves_as_the_stepper_to_the_bit(saved, slave):
    here = saved[0].clone()
    assert np.array_equal(slave.seen, [*here.observation["rate"], here.observation["momentum"]])
    for k in range(20):
        torque = [0.1 * np.cos(k), 0.2, -0.05 * k]
        seen = here.step({"torque": torque}, n=3)
        assert slave.step(3 * DT, **{f"torque[{i + 1}]": torque[i] for i in range(3)}) == [
            *seen["rate"],
            seen["momentum"],
        ]


def test_a_master_takes_a_step_back_and_repeats_it_also_from_bytes(slave):
    state = slave.fmu.getFMUState()
    first = slave.step(DT, drag=0.3)
    kept = slave.fmu.serializeFMUState(state)
    slave.fmu.setFMUState(state)
    assert slave.step(DT) != first  # the command went back, too
    slave.fmu.setFMUState(state)
    assert slave.step(DT, drag=0.3) == first
    slave.fmu.setFMUState(slave.fmu.deSerializeFMUstate(kept))
    assert slave.step(DT, drag=0.3) == first


@pytest.mark.parametrize(
    ("length", "inputs", "said"),
    [
        (1.5 * DT, {}, "whole number of steps of 0.01 s, but is 0.015 s"),
        (0.0, {}, "whole number of steps"),
        (DT, {"drag": float("nan")}, "must be finite"),
    ],
)
def test_what_cannot_be_stepped_is_told_in_the_log_and_leaves_the_unit_where_it_is(
    saved, slave, length, inputs, said, caplog
):
    before = slave.seen
    with pytest.raises(fmpy.fmi1.FMICallException) as raised:
        slave.step(length, **inputs)
    if compiled(saved):
        assert raised.value.status == 3
    else:  # discard, which PythonFMU makes of failures, and at which masters may stop without a word
        assert raised.value.status == 2 and any(said in line for line in caplog.messages)
    assert any(said in line for line in slave.told)
    assert slave.seen == before


def test_another_start_than_the_steppers_time_is_told(saved, tmp_path):
    slave = Slave(saved[1], tmp_path)
    slave.fmu.setupExperiment(startTime=3.0)
    slave.close()
    assert any("goes on from t = 0.07 s, not from 3 s" in line for line in slave.told)


def test_a_unit_runs_without_jax_and_leaves_no_object_with_fewer_references_than_holders(saved):
    """PythonFMU releases the globals of its script once too often, at which Python may abort at its end."""
    script = f"""
import gc, sys, fmpy
for _ in range(2):
    times = {{"start_time": {7 * DT}, "stop_time": 0.1, "step_size": {DT}, "output_interval": {DT}}}
    found = fmpy.simulate_fmu({str(saved[1])!r}, **times)
assert "jax" not in sys.modules
unit = sys.modules.get("coadjoint.simulation.steppers.fmi_instance")
for names in unit._held if unit else []:
    assert sys.getrefcount(names) - 2 >= len(gc.get_referrers(names)), gc.get_referrers(names)
print(len(found))
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout.split()[-1]) == 4


def test_a_unit_holds_no_more_than_the_stepper_the_script_and_pythonfmu(saved, tmp_path):
    before = set(sys.modules), sys.path.copy()
    co.simulation.save_fmu(saved[0], tmp_path / "other.fmu")
    assert not [name for name in set(sys.modules) - before[0] if "other" in name]
    assert sys.path == before[1]
    names = zipfile.ZipFile(saved[1]).namelist()
    own = [name for name in names if name.startswith("resources/") and "/pythonfmu/" not in name]
    assert sorted(name.rpartition(".")[2] for name in own) == ([] if compiled(saved) else ["py", "step", "txt"])


def test_what_cannot_be_a_unit_is_refused_in_a_sentence(tmp_path, saved, monkeypatch):
    path = tmp_path / "body.fmu"
    with pytest.raises(ArgumentError, match="holds one vehicle, but this stepper has 4"):
        co.simulation.save_fmu(stepper(members=4), path)
    with pytest.raises(ArgumentError, match="`drag` is a command and is observed"):
        co.simulation.save_fmu(stepper(observe={"drag": lambda s: s.xi[0]}), path)
    with pytest.raises(ArgumentError, match="names are ASCII, but `ω` is not"):
        co.simulation.save_fmu(stepper(observe={"ω": lambda s: s.xi[0]}), path)
    assert not list(tmp_path.iterdir())
    with pytest.raises(FileError, match="exists already"):
        co.simulation.save_fmu(saved[0], saved[1])
    for units, sentence in (({"depth": "m"}, "no command or observation `depth`"), ({"rate": "furlong"}, "not known")):
        with pytest.raises(ArgumentError, match=sentence):
            co.simulation.save_fmu(saved[0], path, units=units)
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(ArgumentError, match="install a C compiler, such as gcc"):
        co.simulation.save_fmu(saved[0], path, python=False)
    monkeypatch.setitem(sys.modules, "pythonfmu.builder", None)
    with pytest.raises(ArgumentError, match=r"coadjoint\[fmu\]"):
        co.simulation.save_fmu(saved[0], path)


def test_a_unit_of_long_steps_says_so_in_the_log(tmp_path):
    """A spin of 8 rad/s in steps of 0.3 s is found when the unit is loaded."""
    body = co.System(co.SO3(), lambda xi: 0.5 * xi @ INERTIA @ xi)
    with pytest.warns(UserWarning, match="does not resolve this motion"):
        fast = co.Stepper(body, body.state(xi=[0.3, 8.0, 0.3]), dt=0.3, observe={"rate": lambda s: s.xi})
    slave = Slave(co.simulation.save_fmu(fast, tmp_path / "fast.fmu"), tmp_path, 0.0)
    for k in range(3):
        slave.fmu.doStep(currentCommunicationPoint=0.3 * k, communicationStepSize=0.3)
    slave.close()
    assert sum("dt = 0.3 does not resolve this motion" in line for line in slave.told) == 1


def test_units_that_version_0_1_0_wrote_find_what_they_import():
    from coadjoint.simulation.steppers.slave import StepperSlave, hold

    from coadjoint.simulation.steppers.fmi_instance import FmiInstance

    assert StepperSlave is FmiInstance and callable(hold)
