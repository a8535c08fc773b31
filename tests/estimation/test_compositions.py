"""Filters by compositions: their predictions are the steps of a stepper, their tangents those of differences."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.estimation import Filter, GaussMarkov, Measurement, ModelProcess
from coadjoint.kernels.trace.evaluate import evaluate

H = 0.2
SUZUKI = co.Suzuki4(co.Midpoint(), negative_substeps="allow")


def rotor(motion, h, p):
    """A rotor that lags behind the turning of the body, so that it depends on errors of the motion."""
    late = jnp.exp(-h / 0.3)
    return {"rotor": motion.xi[:1] + (motion.internal.rotor - motion.xi[:1]) * late}


def body(internal=False):
    system = co.System(
        co.SO3(),
        lambda xi, n, nu, a, p: 0.5 * xi @ (p.inertia * xi) + nu @ nu + 0.2 * xi[0] * nu[1] - p.weight * n @ a,
        additional=co.Defining(),
        advected=co.Defining(),
        parameters={"inertia": [1.0, 2.0, 3.0], "weight": 0.5},
        forces=lambda motion, p: co.Force(
            torque=motion.inputs.torque - 0.1 * motion.xi * (1 + (motion.internal.rotor[0] if internal else 0.0)),
            force=-0.2 * motion.nu,
        ),
        internal=rotor if internal else None,
    )
    given = {"internal": {"rotor": [0.1]}} if internal else {}
    start = system.state(
        g=co.attitude.zyx(0.1, 0.2, 0.3), q=[1, 0.5, 0.2], xi=[0.3, -0.2, 0.5], qdot=[0.1, 0.2, -0.1], a0=[0, 0, 1],
        **given,
    )  # fmt: skip
    return system, start


def process_of(method, internal=False, **more):
    system, start = body(internal)
    inputs, noise = {"torque": np.zeros(3)}, {"torque": [0.1, 0.2, 0.3], "force": 0.2}
    return ModelProcess(system, start, method=method, inputs=inputs, noise=noise, **more), system, start


def by_differences(process, rows):
    """∂e⁺/∂e of steps, to order 4."""
    e, after, found = 1e-3, process.advanced(rows, H), []
    for column in np.eye(process.width):
        slope = np.zeros(process.width)
        for sign, weight in ((1, 8), (-1, -8), (2, -1), (-2, 1)):
            end = process.advanced(process.moved(rows, sign * e * column[None]), H)
            slope += weight * evaluate(process.differ, after[0], end[0])
        found.append(slope / (12 * e))
    return np.array(found).T


def spinning():
    """A free body alone, with a rotor that follows its motion."""
    system = co.System(
        co.SO3(),
        lambda xi, p: 0.5 * xi @ (p.inertia * xi),
        parameters={"inertia": [1.0, 2.0, 3.0]},
        forces=lambda motion, p: co.Force(torque=-0.1 * motion.xi * (1 + motion.internal.rotor[0])),
        internal=rotor,
    )
    return system, system.state(xi=[0.3, -0.2, 0.5], internal={"rotor": [0.1]})


def test_a_filter_predicts_by_suzuki_as_a_run_with_the_tangent_of_differences():
    system, start = spinning()
    process = ModelProcess(system, start, method=SUZUKI, noise={"torque": 0.2})
    rows = process.row(start)[None]
    assert process.between > process.width
    run = co.simulate(system, start, dt=H, steps=1, method=SUZUKI, accuracy=False, monitors=False)
    after, course = process.stepped(rows, H)
    assert np.array_equal(process.state(after[0]).mu, run.final.mu)
    Phi, _ = process.linearised(rows, after, H, course)
    assert np.allclose(by_differences(process, rows), Phi[0], rtol=0, atol=1e-11)


@pytest.mark.long
@pytest.mark.parametrize(
    "method",
    [
        SUZUKI,
        co.methods.KahanLi6(co.Trapezoidal(co.Exponential()), negative_substeps="allow"),
        co.methods.Yoshida4(co.methods.LeftRight(), negative_substeps="allow"),
        co.methods.LeftRight(),
        co.Galerkin(),
    ],
    ids=lambda method: method.title,
)
def test_a_filter_with_a_composition_predicts_bitwise_as_the_stepper_with_the_tangent_of_differences(method):
    process, system, start = process_of(method)
    stepper = co.Stepper(
        system, start, dt=H, method=method, inputs={"torque": np.zeros(3)}, accuracy=False,
        observe={"mu": lambda s: s.mu, "pi": lambda s: s.pi, "n": lambda s: s.n},
    )  # fmt: skip
    filter = Filter(process, start, measurements={"place": Measurement(lambda m: m.q, 0.01)}, deviations={"g": 0.1})
    for k in range(3):
        torque = {"torque": [0.1 * k, -0.2, 0.05]}
        rows = process.with_inputs(filter.rows, torque)
        Phi, Q = process.linearised(rows, process.advanced(rows, H), H)
        P = Phi[0] @ filter.P[0] @ Phi[0].T + Q[0]
        filter.predict(H, torque)
        assert np.allclose(filter.P[0], P, rtol=1e-12, atol=1e-14)
        for name, value in stepper.step(torque).items():
            assert np.array_equal(getattr(filter.state, name), value), name
    assert np.allclose(by_differences(process, rows), Phi[0], rtol=0, atol=1e-10)


@pytest.mark.long
@pytest.mark.parametrize("error", ["left", "right"])
def test_the_tangent_of_a_composition_goes_through_internal_states_and_drifts(error):
    drifting = {"weight": GaussMarkov(0.2, 5.0)}
    process, _, start = process_of(SUZUKI, internal=True, error=error, drifting=drifting)
    assert process.between > process.width
    filter = Filter(process, start, measurements={"place": Measurement(lambda m: m.q, 0.01)}, deviations={"g": 0.1})
    rows = process.with_inputs(filter.rows, {"torque": [0.1, 0.2, -0.1]})
    Phi, Q = process.linearised(rows, process.advanced(rows, H), H)
    assert np.allclose(by_differences(process, rows), Phi[0], rtol=0, atol=1e-10)
    P = Phi[0] @ filter.P[0] @ Phi[0].T + Q[0]
    filter.predict(H, {"torque": [0.1, 0.2, -0.1]})
    assert np.allclose(filter.P[0], P, rtol=1e-12, atol=1e-14)
    assert np.sqrt(Q[0, -1, -1]) == pytest.approx(0.2 * np.sqrt(1 - np.exp(-2 * H / 5.0)), rel=1e-12)


@pytest.mark.long
def test_a_composition_by_xla_has_the_steps_and_the_tangent_of_machine_code():
    native, _, start = process_of(SUZUKI, internal=True)
    by_xla, _, _ = process_of(SUZUKI, internal=True)
    by_xla._model.backend = "xla"
    rows = native.with_inputs(native.row(start)[None], {"torque": [0.1, 0.2, -0.1]})
    after, other = native.advanced(rows, H), by_xla.advanced(rows, H)
    assert np.allclose(other, after, rtol=0, atol=1e-13)
    (Phi, Q), (slopes, noise) = (one.linearised(rows, after, H) for one in (native, by_xla))
    assert np.allclose(slopes, Phi, rtol=0, atol=1e-12) and np.allclose(noise, Q, rtol=0, atol=1e-13)
