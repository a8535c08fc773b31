"""Inputs that nothing reads, such as misspelt ones, are named by filters and by identification."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

import coadjoint as co
from coadjoint.estimation import Filter, Measurement, ModelProcess
from coadjoint.identification import Log, identify


def test_inputs_that_no_function_reads_are_named():
    slider = co.System(
        co.Translation(1),
        lambda xi, p: 0.5 * xi @ xi,
        parameters={"drag": 0.5},
        forces=lambda motion, p: co.Force(torque=-p.drag * motion.xi + motion.inputs.push),
    )
    start = slider.state(xi=[1.0], inputs={"push": np.zeros(1), "pull": np.zeros(1)})
    process = ModelProcess(slider, start, inputs={"push": [0.0], "pull": [0.0]})
    with pytest.warns(UserWarning, match="No step and no measurement of this filter reads the input `pull`"):
        Filter(process, start, measurements={}, deviations={"xi": 0.1})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        seen = {"pull": Measurement(lambda motion: motion.xi + motion.inputs.pull, 0.1)}
        Filter(process, start, measurements=seen, deviations={"xi": 0.1})
    t = np.arange(0.0, 3.05, 0.1)
    speed = np.exp(-0.5 * t) + 1e-3 * np.random.default_rng(3).normal(size=t.size)
    log = Log(t, {"speed": speed}, inputs={name: np.zeros((t.size, 1)) for name in ("push", "pull")})
    given: Any = {"start": start, "parameters": ["drag"], "measured": {"speed": lambda s: s.xi[0]}, "dt": 0.1}
    found = identify(slider.replace(drag=0.8), log, **given)
    assert found.warnings == ("No function of the system reads `pull` of the log: check its name.",)
