"""What a method and its stages must give: abstract members, and the true F of every stage of every shipped method."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import coadjoint as co
from coadjoint.audit.shipped import SHIPPED
from coadjoint.audit.systems import PROBLEMS
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.methods import Step, isospectral_midpoint, linked_stage
from coadjoint.methods import step as step_module
from coadjoint.methods.variable_step import Pace

MEMBERS = ("order", "stages", "equations", "advance", "sources", "relative")
H = 0.07
BODY, TOKAMAK = PROBLEMS["body in fluid"], PROBLEMS["guiding centre"]


@pytest.mark.parametrize("left_out", MEMBERS)
def test_a_method_without_one_of_its_members_cannot_be_made(left_out: str) -> None:
    given = {name: getattr(co.LeftRectangle, name) for name in MEMBERS}
    del given[left_out]
    with pytest.raises(TypeError, match=left_out):
        type("Incomplete", (co.methods.Method, Step), given)()


def test_the_midpoint_of_hamilton_keeps_the_momentum_of_turns():
    """μ + n × π, which spatial turns of (g, q) give, with π that depends on the place."""

    def hamiltonian(mu, n, pi):
        return 0.5 * mu @ mu + 0.5 * pi @ pi * (1 + n @ n) + 0.3 * mu[0] * n[0] * pi[1] + 0.5 * n[0] ** 2

    system = co.System(co.SO2(), hamiltonian=hamiltonian, additional=co.Defining())
    start = system.state(q=[0.7, -0.4], mu=[0.3], pi=[0.5, 0.6])
    quiet = {"monitors": False, "accuracy": False}
    method, h = co.HamiltonianMidpoint(), 0.1
    run = co.simulate(system, start, dt=h, steps=3, method=method, **quiet).records
    spin = run.n[:, 0] * run.pi[:, 1] - run.n[:, 1] * run.pi[:, 0]
    np.testing.assert_allclose(run.mu[:, 0] + spin, start.mu[0] + 0.7 * 0.6 + 0.4 * 0.5, atol=1e-14)
    assert np.ptp(run.mu) > 1e-2

    def left(state):
        z = np.array([0.4, 0.5, -0.3, 0.8, 0.6, 0.2])
        record = method.record(system, method.remember(system, state), h, z)
        after = state.replace(mu=2 * state.mu, pi=3 * state.pi)
        return method.equations(system, record, h), method.newton_residual(system, record, h, after)

    rows, residual = evaluate(left, start)
    momenta, velocities = np.max(np.abs(rows[:3])) / 1.8, np.max(np.abs(rows[3:])) / 0.5
    assert residual == pytest.approx(velocities, rel=1e-14) and velocities > momenta


def _hamiltonian_top():
    """A free rigid body by its ℋ, and a start with momentum."""
    system = co.System(co.SO3(), hamiltonian=lambda mu: 0.5 * mu @ (mu / np.array([1.0, 2.0, 3.0])))
    return system, system.state(mu=[0.3, -0.5, 0.4])


CASES = {
    **{
        one.name: lambda one=one, on=TOKAMAK if one.first_order else BODY: (
            one.make(co.Cayley()),
            one.adapt(on.system),
            on.start,
        )
        for one in SHIPPED
    },
    "HamiltonianMidpoint": lambda: (co.HamiltonianMidpoint(), *_hamiltonian_top()),
    "CommutatorFree": lambda: (co.methods.CommutatorFree(), BODY.system, BODY.start),
    "CrouchGrossman": lambda: (co.methods.CrouchGrossman(), BODY.system, BODY.start),
    "IsospectralMidpoint": lambda: (co.IsospectralMidpoint(carry_g=True), *_hamiltonian_top()),
}


@pytest.mark.cases(6)
@pytest.mark.parametrize("name", CASES)
def test_every_stage_of_a_shipped_method_gives_the_f_that_it_advances_by(name: str) -> None:
    method, system, start = CASES[name]()
    group, random = system.group, np.random.default_rng(7)
    begun = method.begin(system, start, H)
    if isinstance(begun.memory, Pace):
        begun = begun.replace(memory=begun.memory._replace(ratio=np.float64(1.3)))
    for stage in dict.fromkeys(stage for stage, _ in method.stages):

        def both(state, off, parameters, stage=stage):
            here = replace_parameters(system, parameters)
            z = stage.guess(here, state, H)
            record = stage.record(here, state, H, z + off[: len(z)])
            after = stage.advance(here, record, H)
            true = group.compose(group.inverse(record.g), after.g)
            return group.matrix(stage.relative(here, record, H)), group.matrix(true)

        given, true = evaluate(both, begun, 0.2 * random.normal(size=100), system.parameters)
        assert np.max(np.abs(true - np.eye(len(true)))) > 1e-3
        np.testing.assert_allclose(given, true, rtol=0, atol=1e-13)


@pytest.mark.parametrize("shipped", SHIPPED, ids=lambda shipped: shipped.name)
def test_every_stage_of_a_shipped_method_gives_its_discrete_energy(shipped) -> None:
    for stage, _ in shipped.make(co.Cayley()).stages:
        between = type(stage).__mro__[: type(stage).__mro__.index(Step)]
        assert {"nodes", "energy"} & {name for kind in between for name in vars(kind)}


def test_the_balance_of_a_step_is_relative_to_its_momentum_and_to_the_largest_that_it_was_given(monkeypatch):
    monkeypatch.setattr(step_module, "total_momentum", lambda system, state: state)
    monkeypatch.setattr(step_module, "momentum_scale", lambda system, record: 2.0)
    group = SimpleNamespace(Ad_dual=lambda F, m: F * m)
    given = np.array([1.0, -8.0]), np.array([3.0, 0.5])
    one: Any = SimpleNamespace(sources_to=lambda *_: given, relative=lambda *_: 0.5)
    before, after = np.array([2.0, 4.0]), np.array([4.5, -1.75])
    # ½ (2, 4) + ½ (1, −8) + (3, ½) = (4.5, −1.5) is off by ¼
    found = Step.balance(one, cast(Any, SimpleNamespace(group=group)), cast(Any, before), 0.1, cast(Any, after))
    assert found == pytest.approx(0.25 / (2.0 + 8.5))


def test_states_of_links_that_are_compared_differ_by_a_size_and_turn_by_a_tenth_at_most():
    random: Any = SimpleNamespace(normal=lambda size: np.ones(size))
    names = {name: np.array([1.0, -3.0]) for name in ("n", "mu", "pi", "xi", "nu")}
    state: Any = SimpleNamespace(**names, g=2.0, a=3.0, t=1.0, internal_due=None, replace=lambda **more: more)
    for size, turn in ((0.02, 0.02), (5.0, 0.1)):
        one: Any = SimpleNamespace(
            _memory=lambda count, numbers: numbers((count, 2)), count=3, group=SimpleNamespace(dim=2), driving=(),
            _turned=lambda g, a, eta: (g * eta, a * eta),
        )  # fmt: skip
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(linked_stage, "_each_driving", lambda state, function, flags: {"t": 0.0})
            patch.setattr(linked_stage, "evaluate", lambda function, *given: function(*given))
            found = linked_stage.StepOfLinks.nearby(one, state, random, size, 0.5)
        assert found["g"].tolist() == [2 * turn] * 2 and found["a"].tolist() == [3 * turn] * 2 and found["t"] == 1.5
        for name in names:
            assert found[name] == pytest.approx([1 + 2 * size, -3 + 4 * size])
        assert found["memory"].tolist() == np.ones((3, 2)).tolist()


def test_parts_of_steps_that_only_audits_read_have_their_closed_forms(monkeypatch):
    """Sources of Galerkin's method and of the projected midpoint, whose residual is relative by kinds, and work of
    an explicit time, of the elements 3 and ½ of a group with Ad*_F m = F m."""
    group: Any = SimpleNamespace(Ad_dual=lambda F, m: F * m, inverse=lambda F: 1 / F, dim=1)
    system: Any = SimpleNamespace(group=group, depends_on_time=True)
    momenta, h = {"mu": np.array([4.0]), "pi": np.array([1.0]), "nu": np.array([5.0])}, 0.1
    record: Any = SimpleNamespace(memory="shift", t=2.0, **momenta)
    of_galerkin: Any = SimpleNamespace(
        _curve=lambda *_: SimpleNamespace(first="Θ₀"), _sum=lambda curve, name: np.array([7.0]) * (name == "source"),
        difference_map=SimpleNamespace(tau=lambda group, theta: 3.0 * (theta == "Θ₀")),
    )  # fmt: skip
    assert np.concatenate(co.Galerkin.sources(of_galerkin, system, record, h)) == pytest.approx([3.0 * h * 7.0, 0.0])
    lift = SimpleNamespace(source=np.array([11.0]))
    projected: Any = SimpleNamespace(
        _shift=lambda *_: 0.5, _shifted=lambda *_: "shifted", _lift=lambda system, at, shift, h: lift,
        base=SimpleNamespace(sources=lambda system, at, h: (np.array([13.0]) * (at == "shifted"), None)),
        _end=lambda *_: ("end", SimpleNamespace(source=np.array([17.0]))),
        equations=lambda *_: np.array([1.0, -2.0, 0.25, 0.5]),
    )  # fmt: skip
    ahead, behind = co.methods.ProjectedMidpoint.sources(projected, system, record, h)
    assert ahead == pytest.approx([h * 11.0 + 2.0 * 13.0]) and behind == pytest.approx([-h * 17.0])
    node = {"mu": 2.0, "pi": 0.1, "torque": 90.0, "force": 70.0}
    projected.nodes = lambda *_: [(1.0, SimpleNamespace(**{name: np.array([x]) for name, x in node.items()}))]
    after: Any = SimpleNamespace(mu=np.array([3.0]), pi=np.array([2.0]))
    found = co.methods.ProjectedMidpoint.newton_residual(projected, system, record, h, after)
    assert float(found) == pytest.approx(max(2.0 / 9.0, 0.5 / 7.0), rel=1e-6)
    monkeypatch.setattr(isospectral_midpoint, "momenta_of", lambda system, z: (z, 2.0))
    timed: Any = SimpleNamespace(_hamiltonian=lambda system, record, t, mu, a: mu * t**2 + a * t)
    record.memory = SimpleNamespace(middle=5.0)
    work = co.IsospectralMidpoint.work(timed, system, record, h)
    assert np.asarray(work) == pytest.approx([h * (5.0 * 2 * 2.05 + 2.0)], rel=1e-6)
    system.depends_on_time = False
    assert co.IsospectralMidpoint.work(timed, system, record, h).shape == (0,)
