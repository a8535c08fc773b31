"""The extended Kalman filter of errors on the group.

Sources: A. Barrau, S. Bonnabel, *The invariant extended Kalman filter as a stable observer*, IEEE Trans. Automat.
Control 62 (2017); Y. Bar-Shalom, X. R. Li, T. Kirubarajan, *Estimation with Applications to Tracking and Navigation*
(2001), 5.4 (NEES and NIS) and 5.2 (Joseph's form).
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree, Scalar
from coadjoint.c_sources import identifier, write_library
from coadjoint.checks import truth
from coadjoint.errors import ArgumentError, warn
from coadjoint.estimation.arguments import first_covariance, inputs_of_step
from coadjoint.estimation.c_library import sources
from coadjoint.estimation.engines import CodedFilter, FilterEngine
from coadjoint.estimation.filter_estimate import FilterEstimate
from coadjoint.estimation.filter_measurements import FilterMeasurements, all_series
from coadjoint.estimation.filtered import Filtered, filtered
from coadjoint.estimation.history import Past
from coadjoint.estimation.innovation import FilterMemory, Innovation
from coadjoint.estimation.measurements import Measurement, report_recovery
from coadjoint.estimation.process import Process
from coadjoint.estimation.resolution import FilterSample
from coadjoint.estimation.saved_filter import FilterInterface, to_bytes
from coadjoint.estimation.timetable import SAME, Timetable, require_radians, require_readings, require_times
from coadjoint.kernels.emit.kalman import CORRECT, PREDICT
from coadjoint.kernels.run.portable_code import exported_code, linked
from coadjoint.portable import Remade
from coadjoint.simulation.steppers.code_archive import save
from coadjoint.simulation.steppers.fields import Fields


class Filter(FilterEstimate, Remade):
    """A Kalman filter whose errors are those of a process: on the group, invariant under it.

        process = co.estimation.ModelProcess(vehicle, start, inputs=("thrust",), noise={"force": 0.5})
        filter = co.estimation.Filter(process, start, measurements={"depth": depth}, deviations={"q": 2.0, "nu": 0.1})
        filter.predict(0.1, {"thrust": 3.0})
        filter.update({"depth": 4.2})

    With x̂⁻ = Φ(x̂), P⁻ = ΦPΦᵀ + Q before and ν = y − h(x̂⁻), K = P⁻Hᵀ(HP⁻Hᵀ + R)⁻¹ at a measurement, x̂ goes to
    retract(x̂⁻, Kν), and P by Joseph's form, symmetric and positive. Derivatives are exact to round-off.

    Arguments:
        process: a `ModelProcess`, a `StrapdownProcess` or another `Process`.
        start: the state about which it begins, as the process takes it.
        measurements: name → `Measurement`.
        deviations: standard deviations of the errors at the start, name → one number or one for each coordinate; errors
            without a name are known exactly. Of a `ModelProcess` the names are g, q, xi, nu and those of `drifting`.
        covariance: P, (n, n), of the process's errors, instead of `deviations`.
        memory: the largest delay of a measurement for `update`, s, by default 0.
        members: the number of filters that run together, as for many seeds, by default None: one, whose arrays have no
            axis of members.
        accuracy: whether a sample of the predictions of a `ModelProcess` is judged, the first three and those after 4,
            8, … up to 4096, and of a log those at 16 nodes, each against steps of parts of it; by default True. It
            warns once where dt does not resolve the motion, or where the errors of the steps add up to more than the
            deviations that the filter claims, with a dt that would do.

    Raises ArgumentError for names and shapes that are not those of the process.
    """

    STANDING = ("_held", "_past", "_awaited")

    def __init__(
        self,
        process: Process,
        start: PyTree,
        *,
        measurements: Mapping[str, Measurement],
        deviations: Mapping[str, PyTree] | None = None,
        covariance: PyTree = None,
        memory: float = 0.0,
        members: int | None = None,
        accuracy: bool = True,
    ):
        checks.instance(process, "process", Process, "one such as ModelProcess")
        self.process, self.members = process, None if members is None else checks.whole(members, "members")
        checks.instance(measurements, "measurements", Mapping, "name → Measurement")
        row = process.row(start)
        require_times(float(process.time(row)), "The filter begins")
        P = first_covariance(process, row, deviations, covariance)
        count = 1 if self.members is None else self.members
        self.measurements = dict(measurements)
        self._measured = FilterMeasurements(process, self.measurements, self.members)
        rejected = np.zeros((count, max(len(self.measurements), 1)), np.int64)
        self._held = FilterMemory(np.repeat(row[None], count, axis=0), np.repeat(P[None], count, axis=0), rejected)
        self._past = Past(memory)
        self._awaited = set(process.awaited)
        self._engine = FilterEngine(process, list(self._measured.prepared.values()))
        for name in self._engine.unread:
            warn(f"No step and no measurement of this filter reads the input `{name}`: check its name.", stacklevel=2)
        judging = truth(accuracy, "accuracy") and process.parts is not None
        self._sample = FilterSample(process, process.parts) if judging and process.parts else None

    def predict(self, dt: Scalar, inputs: Mapping[str, PyTree] | None = None) -> None:
        """Advance by one step of dt, s; inputs: name → value, held over it; the others stay.

        Raises StepError where the model has no step from the estimate, ArgumentError for other names.
        """
        h = dt if type(dt) is float and 0.0 < dt < math.inf else checks.positive(dt, "dt")
        before, given = self._held, inputs_of_step(self.process, inputs, self._awaited)
        there = before._replace(rows=self.process.with_inputs(before.rows, given)) if given else before
        self._held, _ = self._engine.once(there, PREDICT, 0, h)
        self._awaited -= set(given)
        if self._sample is not None:
            self._warn(self._sample.of_prediction(before.rows, before.P, self.P, h, given))
        if self._past.kept:
            self._past.predicted(float(self.process.time(before.rows[0])), before, h, given)

    def _warn(self, sentence: str | None) -> None:
        """Warn, and judge no more steps after that or after the last one of the sample."""
        if sentence:
            warn(sentence, stacklevel=3)
        if sentence or (self._sample is not None and self._sample.steps.over):
            self._sample = None

    def update(self, measured: Mapping[str, PyTree], *, t: float | None = None) -> dict[str, Innovation]:
        """Process measurements, name → value, at the time t, s, by default that of the estimate.

        A value that contains a NaN is left out completely.

        A measurement that is late, t before the time of the estimate by at most `memory`, is processed at its time: the
        filter goes back to the step around t and repeats all later inputs and measurements.

        Returns an `Innovation` for each. If it raises, the filter is unchanged. Raises ArgumentError for unknown
        measurements, for other shapes and for times that are not kept, StepError where the covariance does not stay
        finite.
        """
        checks.instance(measured, "measured", Mapping, "name → value")
        if t is not None:
            checks.number(t, "t")
        values = {name: self._measured.value(name, value) for name, value in measured.items()}
        kept = self._held, self._past.copy() if self._past.kept else self._past
        try:
            if t is None or abs(t - self.t) <= SAME:
                return {name: self._take(name, value) for name, value in values.items()}
            return self._again(values, t)
        except BaseException:
            self._held, self._past = kept
            raise

    def _again(self, measured: Mapping[str, np.ndarray], t: float) -> dict[str, Innovation]:
        """Go back to t, process the measurements, and repeat the later ones."""
        steps = self._past.back(t, self.t)
        self._held = steps[0].held
        found: dict[str, Innovation] = {}
        for i, step in enumerate(steps):
            dt = step.dt
            if i == 0:
                early = t - step.t
                if early > SAME:
                    self.predict(early, step.inputs)
                found = {name: self._take(name, value) for name, value in measured.items()}
                dt -= max(early, 0.0)
            if dt > SAME:
                self.predict(dt, step.inputs)
            for name, value in step.taken:
                self._take(name, value)
        return found

    def _take(self, name: str, values: np.ndarray) -> Innovation:
        self._held, output = self._engine.once(self._held, CORRECT, self._measured.numbers[name], values)
        self._past.took(name, values)
        if self.members is None:
            nis, used = output[0].tolist()
            found, recovered = Innovation(nis, used > 0, used > 1), used > 1
        else:
            found = Innovation(output[:, 0], output[:, 1] > 0, output[:, 1] > 1)
            recovered = found.recovered.any()
        if recovered:
            report_recovery(name, self.measurements[name], self.t)
        return found

    # Leaving the process.

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
        """Write it to a file, such as `remus.filter`, from which `co.estimation.load_filter` continues without JAX.

        Raises FileError rather than replace a file, ArgumentError for many members and for functions without machine
        code.
        """
        return save(
            path, overwrite, lambda _: to_bytes(self._face("saved"), *self._coded("saved"), self._held), "filter"
        )

    def export_c(
        self,
        folder: str | os.PathLike[str],
        *,
        name: str | None = None,
        units: Mapping[str, str] | None = None,
        target: str | None = None,
        overwrite: bool = False,
    ) -> Path:
        """Write a C library without Python: NAME.h, NAME.c, NAME_code.o with the machine code, and CMakeLists.txt.

            filter.export_c("robot/dive", units={"depth": "m"})

        The library predicts, and updates by each measurement; the header has the names, places and shapes of all
        numbers, and the error codes. It begins with the present estimate. On the same processor its numbers are bitwise
        those of the filter.

        folder, name, units, target, overwrite: as of `co.Stepper.export_c`. Raises FileError rather than replace a
        file, ArgumentError for many members, for functions without machine code, and for an unknown target.
        """
        name = identifier(Path(folder).name if name is None else name, "folder" if name is None else "name")
        coded, face = self._coded("exported"), self._face("exported")
        header, source, parts = sources(face, coded, self._held, name, {"t": "s", **(units or {})})
        texts, code = {f"{name}.h": header, f"{name}.c": source}, exported_code(linked(parts), target)
        return write_library(folder, name, texts, overwrite, code)

    def _coded(self, done: str) -> CodedFilter:
        """The machine code of a single filter."""
        if self._engine.coded is None or self.members is not None:
            why = "runs without machine code" if self.members is None else f"has {self.members} members"
            raise ArgumentError(f"A filter that {why} cannot be {done}: only native code of one can leave the process.")
        return self._engine.coded

    def _face(self, done: str) -> FilterInterface:
        """Names and shapes of its numbers."""
        process = self.process
        row, inputs = Fields.of(process.row_shapes), {name: (size,) for name, size in process.input_sizes.items()}
        if "t" not in row.names:
            raise ArgumentError(f"A {type(process).__name__} names no numbers of its rows, so it cannot be {done}.")
        measured = Fields.of({name: (size,) for name, size in self._measured.sizes.items()})
        title = f"{type(process).__name__} with {', '.join(measured.names) or 'no measurements'}"
        return FilterInterface(title, row, Fields.of(inputs), measured, process.names, tuple(sorted(self._awaited)))

    def _follow(self, orders: np.ndarray, data: np.ndarray, size: int) -> np.ndarray:
        """Execute orders; returns their output, (members, size). If one fails, the filter is unchanged."""
        held, output = FilterMemory(*(part.copy() for part in self._held)), np.empty((len(self.rows), max(size, 1)))
        self._engine.follow(*held, np.ascontiguousarray(orders, np.int64), np.ascontiguousarray(data), output)
        self._held = held
        return output

    def run(
        self,
        measured: Mapping[str, tuple[PyTree, PyTree]],
        *,
        dt: float,
        until: float | None = None,
        inputs: Mapping[str, tuple[PyTree, PyTree]] | None = None,
        save_every: int = 1,
        covariances: bool = False,
    ) -> Filtered:
        """All measurements of a log in the order of their times, with steps of dt, at most, between them.

        measured: name → (times (K,) s, values (K, m), or (K, members, m)); NaN where nothing was measured. until: the
        last time, s, by default that of the last measurement. inputs: name → (times, values), each held until the next
        time. save_every: the interval of saved nodes, by default 1. covariances: whether P is kept, not only its
        diagonal.
        """
        checks.whole(save_every, "save_every", 1)
        known = self._measured.log(measured)
        logged = all_series(inputs, "inputs", self.process.input_sizes, self.members)
        table = Timetable(self.t, dt, until, known, logged)
        for name in self.process.awaited:
            require_readings(name, logged.get(name), table.times, float(dt), name in self._awaited)
        for name, one in known.items():
            require_radians(name, one, self._measured.prepared[name].space.angles)
        if doubt := self.process.doubt(self.rows[0], logged):
            warn(doubt, stacklevel=2)
        numbers = [self._measured.numbers[name] for name in known]
        sizes = self.process.input_sizes
        places = dict(zip(sizes, np.cumsum([0, *sizes.values()]).tolist(), strict=False))
        given = (len(self.process.example), self.process.width, len(self.rows))
        plan = table.orders(given, places, save_every, covariances, numbers)
        output = self._follow(plan.orders, plan.data, plan.size)
        self._past.forget()
        self._awaited -= set(logged)
        if self._sample is not None:
            self._warn(self._sample.of_log(table.times, plan, output[0], save_every, covariances))
        sizes = {name: one.space.dim for name, one in self._measured.prepared.items()}
        found = filtered(self.process, plan, output, covariances, self.members is None, save_every, sizes)
        for name, one in found.nis.items():
            for t in one.times[np.asarray(one.recovered).reshape(len(one.times), -1).any(axis=1)]:
                report_recovery(name, self.measurements[name], float(t))
        return found
