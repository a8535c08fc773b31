"""What co.trajectory asks of native code: failed runs have no derivative, and one kernel is enough."""

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.program import Code
from coadjoint.kernels.run import native
from paper_vehicle import start, system

VEHICLE = system()


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("wrap", [lambda f: f, jax.jit], ids=["plain", "jit"])
def test_the_gradient_of_a_trajectory_that_fails_is_nan_and_its_code_tells_why(wrap):
    def last(spin):
        begun = start(VEHICLE, xi=spin * np.array([1.0, 0.0, 0.0]))
        path = co.trajectory(VEHICLE, begun, dt=0.05, steps=10, backend="native")
        return path.final.q[2], path.code

    with co.float64():
        (_, code), slope = wrap(jax.value_and_grad(last, has_aux=True))(1e3)
        (_, well), fine = wrap(jax.value_and_grad(last, has_aux=True))(1.0)
    assert int(code) != Code.CONVERGED
    assert np.isnan(slope)
    assert int(well) == Code.CONVERGED
    assert np.isfinite(fine)


def test_a_plain_trajectory_compiles_one_kernel(monkeypatch):
    load, made = native.load, []
    monkeypatch.setattr(native, "_kernels", type(native._kernels)())
    monkeypatch.setattr(native, "load", lambda *arguments: made.append(1) or load(*arguments))
    co.trajectory(VEHICLE, start(VEHICLE), dt=0.05, steps=2)
    assert len(made) == 1
