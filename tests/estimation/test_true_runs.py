"""The NEES of a filter takes the run of a simulation as the truth."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import coadjoint as co
from coadjoint.estimation import Filter, GaussMarkov, Measurement, ModelProcess, RandomWalk

H = 0.1


def system(mass: float = 1.0, push: float = 0.0):
    return co.System(
        co.Translation(1),
        lambda xi, n, nu, p: 0.5 * xi @ xi + 0.5 * p.mass * nu @ nu,
        additional=co.Trivial(1),
        parameters={"mass": mass, "push": push},
        forces=lambda motion, p: co.Force(force=p.push - motion.nu),
    )


@cache
def simulated(mass: float = 1.0, push: float = 0.0, **given: Any) -> Any:
    one = system(mass, push)
    start = one.state(q=[0.5], qdot=[1.0])
    return co.simulate(one, start, **{"dt": 0.5 * H, "duration": 2.0, **given})


MORE: dict[str, Any] = {
    "push": {"drifting": {"push": GaussMarkov(0.5, 10.0)}},
    "gauge": {"biases": {"gauge": RandomWalk([0.1])}},
}


@cache
def found(members: int | None = None, every: int = 1, estimated: str | None = None) -> Any:
    start = system().state(q=[0.0], qdot=[0.5])
    process = ModelProcess(system(), start, noise={"force": 0.1}, **MORE.get(estimated or "", {}))
    known, spread = {"place": Measurement(lambda motion: motion.q, 0.1)}, {"q": 1.0, "nu": 1.0}
    spread |= {estimated: 0.5} if estimated else {}
    filter = Filter(process, start, measurements=known, deviations=spread, members=members)
    return filter.run({"place": ([1.0], [0.6])}, dt=H, until=2.0, save_every=every, covariances=True)


def by_hand(one, q, nu, *theta):
    """eᵀP⁻¹e of place, momentum of the mass 1, and parameters."""
    places = [one.names.index(name) for name in ("q", "pi")] + list(range(len(one.names) - len(theta), len(one.names)))
    estimate = np.stack([one.states.q[:, 0], one.states.pi[:, 0], *one.rows[:, one.rows.shape[1] - len(theta) :].T])
    e = np.stack([q, nu, *(np.broadcast_to(value, len(q)) for value in theta)]) - estimate
    P = one.covariances[:, places][:, :, places]
    return np.einsum("ik,kij,jk->k", e, np.linalg.inv(P), e)


def test_a_run_is_read_at_the_nodes_of_the_filter():
    run, one = simulated(), found(every=3)
    at = np.rint(one.t / (0.5 * H)).astype(int)
    nees, free = one.nees(run)
    assert free == 2 and nees == pytest.approx(by_hand(one, run.records.q[at, 0], run.records.pi[at, 0]), rel=1e-9)
    assert np.array_equal(one.nees(run.at(one.t))[0], nees) and nees[0] > 0.2


@pytest.mark.long
def test_a_run_of_another_mass_has_the_momenta_of_its_velocities_in_the_model_of_the_filter():
    run, one = simulated(mass=3.0), found()
    assert one.nees(run)[0] == pytest.approx(by_hand(one, run.records.q[::2, 0], run.records.pi[::2, 0] / 3), rel=1e-9)


@pytest.mark.long
def test_parameters_that_drift_are_those_of_the_run():
    run, one = simulated(push=0.7), found(estimated="push")
    nees, free = one.nees(run)
    assert free == 3
    assert nees == pytest.approx(by_hand(one, run.records.q[::2, 0], run.records.pi[::2, 0], 0.7), rel=1e-9)


def test_what_no_run_tells_is_given_beside_it():
    run, one, drift = simulated(), found(estimated="gauge"), np.linspace(0.1, 0.4, 21)
    q, pi = run.records.q[::2, 0], run.records.pi[::2, 0]
    assert gauge(0.3)[0] == pytest.approx(by_hand(one, q, pi, 0.3), rel=1e-9)
    assert gauge(drift[:, None])[0] == pytest.approx(by_hand(one, q, pi, drift), rel=1e-9)
    pushed = found(estimated="push").nees(run, known={"push": [0.2]})
    assert pushed[0] == pytest.approx(by_hand(found(estimated="push"), q, pi, 0.2), rel=1e-9) and pushed[1] == 3


def test_one_run_is_the_truth_of_all_members():
    run = simulated()
    both = np.stack([found().nees(run)[0]] * 3, axis=1)
    assert np.allclose(found(members=3).nees(run)[0], both, rtol=1e-12)


WRONG = {
    "a run that ends before the filter": (
        lambda: found().nees(simulated(duration=1.0)),
        "a run from 0 s to 1 s, but the filter has nodes from 0 s to 2 s: end both alike",
    ),
    "a dataset": (lambda: found().nees(simulated().dataset), "must be a run of co.simulate, states .*, or rows"),
    "states of more nodes": (lambda: found().nees(simulated().records), "21 states of the system of the filter"),
    "states of other times": (
        lambda: found().nees(simulated().at(0.9 * found().t)),
        "states of other times",
    ),
    "a run of another system": (lambda: found().nees(other()), "21 states of the system of the filter"),
    "a run, of a filter with biases": (
        lambda: found(estimated="gauge").nees(simulated()),
        "lacks `gauge`.*known=",
    ),
    "a bias that there is not": (
        lambda: found().nees(simulated(), known={"gauge": 0.1}),
        "no drifting number `gauge`",
    ),
    "a bias of two numbers": (lambda: gauge([0.1, 0.2]), r"`gauge` of `known` must be 1 numbers, or \(21, 1\)"),
    "what is known as a list": (
        lambda: found(estimated="gauge").nees(simulated(), known=[0.1]),  # pyright: ignore[reportArgumentType]
        "`known` must be a dictionary of names and numbers",
    ),
    "a bias that is NaN": (lambda: gauge(np.nan), "`gauge` of `known` must be finite numbers"),
    "what is known beside rows": (lambda: found().nees(found().rows, known={"gauge": 0.1}), "rows are complete"),
    "rows that are NaN": (lambda: found().nees(np.nan * found().rows), "must be finite at all nodes"),
}


def gauge(value: Any) -> Any:
    return found(estimated="gauge").nees(simulated(), known={"gauge": value})


def other():
    one = co.System(co.SO3(), lambda xi, p: 0.5 * p.inertia * xi @ xi, parameters={"inertia": 1.0})
    return co.simulate(one, one.state(xi=[0.1, 0.0, 0.0]), dt=H, duration=2.0)


@pytest.mark.parametrize("case", WRONG)
def test_a_truth_that_is_none_is_told(case):
    call, sentence = WRONG[case]
    with pytest.raises(co.errors.ArgumentError, match=sentence) as told:
        call()
    assert str(told.value).endswith(".") and len(str(told.value)) < 400
