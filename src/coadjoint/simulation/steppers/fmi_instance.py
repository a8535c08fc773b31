"""A saved stepper as the slave of a co-simulation by FMI 2.0, which runs inside a functional mock-up unit.

Imports NumPy, llvmlite and PythonFMU, but not JAX.
"""

from __future__ import annotations

import ctypes
import math
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from pythonfmu import DefaultExperiment, Fmi2Causality, Fmi2Slave, Fmi2Variability, Real
from pythonfmu.enums import Fmi2Status

from coadjoint.checks import CLOSE
from coadjoint.checks import steps as whole_steps
from coadjoint.errors import CoadjointError
from coadjoint.log import logger
from coadjoint.simulation.steppers.fields import variables
from coadjoint.simulation.steppers.file import to_bytes
from coadjoint.simulation.steppers.stepping import load_stepper, opened
from coadjoint.texts import Table

_LOG = logger(__name__)

FILE = "stepper.step"
"""The saved stepper among the resources of a unit."""


_held: list[Table] = []


def hold(names: dict[str, object]) -> None:
    """Hold the globals of a unit's script, which PythonFMU 0.7, running it for every instance, releases once too often.

    Without this they are freed with the first instance, and Python crashes later. With the list's own reference alone
    it may abort at its end, where that of the script's module is missing.
    """
    _held.append(names)
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(names))


class FmiInstance(Fmi2Slave):
    """Commands are inputs, observations are outputs, and a communication step is an integer multiple of dt."""

    def __init__(self, **given: object):
        super().__init__(**given)
        self._told: list[str] = []
        with self._logging():
            self.stepper = load_stepper(Path(str(self.resources)) / FILE)
        face = self.stepper.face
        self.description = f"{face.title}, in steps of {face.dt:g} s"
        self.default_experiment = DefaultExperiment(start_time=self.stepper.t, step_size=face.dt)
        self._commands = _row(self.stepper.command)
        for i, name in enumerate(variables(face.commands)):
            self._register(name, Fmi2Causality.input, partial(self._commands.item, i), partial(self._take, i))
        for i, name in enumerate(variables(face.observations)):
            self._register(name, Fmi2Causality.output, lambda i=i: _row(self.stepper.observation)[i])

    def _register(self, name: str, causality: object, getter: object, setter: object = None) -> None:
        more = {"variability": Fmi2Variability.continuous, "getter": getter, "setter": setter}
        self.register_variable(Real(name, causality=causality, **more), nested=False)

    def _take(self, place: int, value: float) -> None:
        self._commands[place] = value

    def setup_experiment(self, start_time: float, stop_time: float | None, tolerance: float | None) -> None:
        """Log a warning if the master's time differs from the stepper's, in which the motion continues."""
        if not math.isclose(start_time, self.stepper.t, rel_tol=CLOSE, abs_tol=CLOSE * self.stepper.face.dt):
            self.log(
                f"The stepper goes on from t = {self.stepper.t:g} s, not from {start_time:g} s.", Fmi2Status.warning
            )

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Hold the inputs over `step_size`, s; False, with a message in the log, if that fails."""
        dt = self.stepper.face.dt
        steps = whole_steps(step_size, dt)
        if steps is None:
            return self._failed(
                f"A communication step must be a whole number of steps of {dt!r} s, but is {step_size!r} s."
            )
        try:
            with self._logging():
                self.stepper.step(self._commands if self._commands.size else None, n=steps)
        except CoadjointError as error:
            return self._failed(str(error))
        for sentence in self._told:
            self.log(sentence, Fmi2Status.warning)
        self._told.clear()
        return True

    @contextmanager
    def _logging(self) -> Iterator[None]:
        """Collect warnings for the log, which does not exist yet at the start."""
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            yield
        self._told += [str(one.message) for one in told]

    def _failed(self, sentence: str) -> bool:
        """Log with the master, which may drop it, and with Python; False, of which PythonFMU makes "discard"."""
        self.log(sentence, Fmi2Status.error)
        _LOG.error("%s", sentence)
        return False

    def to_xml(self, model_options: Table | None = None) -> Element:
        """The model's description: starts to the last bit, and outputs as unknowns of the start (FMI 2.0, 2.2.8)."""
        root = super().to_xml(model_options or {})
        if outputs := list(root.iter("Unknown")):
            first = SubElement(next(root.iter("ModelStructure")), "InitialUnknowns")
            for output in outputs:
                SubElement(first, "Unknown", dict(output.attrib))
        for real, start in zip(root.iter("Real"), self._commands, strict=False):  # inputs come first
            real.set("start", repr(float(start)))
        return root

    # Its state, for masters that repeat a communication step.

    def _get_fmu_state(self) -> dict[str, object]:
        here = self.stepper.clone()
        for (_, value), (_, _, place) in zip(here.command.items(), here.face.commands.places(), strict=True):
            value[...] = self._commands[place].reshape(value.shape)
        return {"stepper": here}

    def _set_fmu_state(self, state: Mapping[str, object]) -> None:
        self.stepper.restore(state["stepper"])
        self._commands[:] = _row(self.stepper.command)

    @staticmethod
    def _fmu_state_to_bytes(state: Mapping[str, object]) -> bytes:
        return to_bytes(state["stepper"])

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> dict[str, object]:
        return {"stepper": opened(state)}


def _row(values: Mapping[str, np.ndarray]) -> np.ndarray:
    """Named arrays, one after the other in one row of numbers."""
    return np.concatenate([np.zeros(0), *map(np.ravel, values.values())])
