"""Files that released versions wrote stay readable, with the numbers that they held.

`tests/stored/VERSION.tar.gz` holds a run as netCDF, a streamed folder, a sweep, a saved stepper and a log, as that
version wrote them, and `expected.json`, the numbers that it read back.
"""

from __future__ import annotations

import json
import tarfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import coadjoint as co

ARCHIVES = sorted((Path(__file__).parents[1] / "stored").glob("*.tar.gz"))


def _run(path: Path) -> dict[str, object]:
    dataset = co.load(path).dataset
    return {"mu": dataset.mu.values[-1], "R": dataset.R.values[-1]}


def _sweep(path: Path) -> dict[str, object]:
    dataset = co.sweeps.load_sweep(path).dataset
    return {"mass": dataset["parameters.mass"].values, "mu": dataset.final_mu.values}


def _stepper(path: Path) -> dict[str, object]:
    return {"mu": co.load_stepper(path).step({"torque": [0.1, 0.2, 0.3]}, n=10)["mu"]}


def _log(path: Path) -> dict[str, object]:
    columns = co.vehicles.logs.read_log(path).columns
    return {name: columns[name][-1] for name in ("north", "depth", "heading", "u")}


READERS: dict[str, Callable[[Path], dict[str, object]]] = {
    "run.nc": _run,
    "folder": _run,
    "sweep": _sweep,
    "body.step": _stepper,
    "log.mcap": _log,
}


@pytest.mark.parametrize("archive", ARCHIVES, ids=lambda path: path.name.removesuffix(".tar.gz"))
@pytest.mark.parametrize("name", READERS)
def test_a_file_of_an_earlier_version_is_read_with_the_numbers_that_it_held(archive, name, tmp_path):
    with tarfile.open(archive) as packed:
        packed.extractall(tmp_path, filter="data")
    (folder,) = tmp_path.iterdir()
    expected = json.loads((folder / "expected.json").read_text())[name]
    read = READERS[name](folder / name)
    assert read.keys() == expected.keys()
    for key, value in expected.items():
        # A stepper may be compiled for another processor.
        np.testing.assert_allclose(read[key], value, rtol=1e-12, atol=1e-12, err_msg=key)
