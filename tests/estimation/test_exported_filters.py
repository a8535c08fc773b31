"""A filter as a C library gives the numbers of the filter, bitwise, and keeps its estimate where it fails."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest
from test_saved_filters import H, body

from c_library import built, needs_compiler, structure, written_while_it_runs
from coadjoint.errors import ArgumentError, FileError

__all__ = ["body"]


@pytest.fixture(scope="module")
def exported(body, tmp_path_factory):
    return body.export_c(tmp_path_factory.mktemp("c") / "dive", units={"gyroscope": "rad/s"}), body


@pytest.mark.long
def test_the_header_names_the_numbers_of_the_filter(exported):
    text = (exported[0] / "dive.h").read_text()
    for line in (
        "#define DIVE_ROW 21", "DIVE_ROW_MU = 10", "     20         bias                                 1",
        "     0..2       gyroscope                            3        rad/s", "DIVE_ERROR_BIAS = 6",
        "int dive_update_attitude(dive *self, const double value[4], dive_innovation *innovation);",
    ):  # fmt: skip
        assert line in text, text
    assert {one.name for one in exported[0].iterdir()} >= {"dive.c", "dive.h", "dive_code.o", "CMakeLists.txt"}
    with pytest.raises(FileError, match="exists already: choose another folder"):
        exported[1].export_c(exported[0])
    with pytest.raises(ArgumentError, match="triple that LLVM knows"):
        exported[1].export_c(exported[0], target="abacus", overwrite=True)
    with pytest.raises(ArgumentError, match="must begin with a letter"):
        exported[1].export_c(exported[0], name="2nd", overwrite=True)


@needs_compiler
def test_predictions_and_updates_in_c_are_those_of_the_filter(exported):
    folder, body = exported
    library, size, n = built(folder, "dive"), body.rows.size, body.P.shape[1]
    assert written_while_it_runs(folder) == []  # so each thread may have its own filter
    work = int((folder / "dive.h").read_text().partition("double work[")[2].partition("]")[0])
    double, whole = ctypes.c_double, ctypes.c_int64
    held = len(body._engine.coded.model.parameters) + 1
    fields = {"row": (double, size), "covariance": (double, n * n), "inputs": (double, 3), "rejected": (whole, 2)}
    one = structure(**fields, parameters=(double, held), work=(double, work))()
    innovation = structure(nis=(double, 1), used=(ctypes.c_int, 1))()
    at, found = ctypes.byref(one), ctypes.byref(innovation)
    library.dive_reset(at)
    random = np.random.default_rng(3)
    for k in range(20):
        if k % 2:
            one.inputs[:] = [0.0, 0.1 * k, -0.2]
        assert library.dive_predict(at, double(H)) == 0
        body.predict(H, {"torque": list(one.inputs)} if k % 2 else None)
        rate = random.normal(size=3) if k % 5 else np.full(3, 9.0)
        rate[0] = np.nan if k == 7 else rate[0]
        for name, value in (("gyroscope", rate), ("attitude", [1.0, 0.1, 0.0, 0.0])):
            known = body.update({name: value})[name]
            given = (double * len(value))(*value)
            assert getattr(library, f"dive_update_{name}")(at, given, found) == 0
            assert np.array_equal(innovation.nis[0], known.nis, equal_nan=True)
            assert innovation.used[0] == known.used + known.recovered
    assert bytes(one.row) == body.rows.tobytes() and bytes(one.covariance) == body.P.tobytes()
    before = bytes(one.row), bytes(one.covariance), list(one.rejected)
    one.inputs[:] = [1e300, 1e300, 0.0]
    assert library.dive_predict(at, double(H)) == 1 and library.dive_predict(at, double(-H)) == 3
    assert (bytes(one.row), bytes(one.covariance), list(one.rejected)) == before
