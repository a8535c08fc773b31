"""The variable step holds the discrete energy to round-off over 100 000 steps, and says where it cannot."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, partial
from types import SimpleNamespace
from typing import Any, NamedTuple, cast

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.run import native, xla
from coadjoint.kernels.trace.evaluate import evaluate, tabulate
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.methods import VariableStep
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.methods.variable_step import Pace, Paced, _Predict, _Search
from coadjoint.models import catalogue
from coadjoint.simulation.driver import Driver
from systems import generator, random_system
from two_form import PhaseVariation, tangents, two_form

MODELS = {
    "heavy_top": (1e-4, 1e-13),
    "simo_wong_top": (5e-3, 1e-13),
    "kirchhoff_ellipsoid": (0.02, 1e-13),
    "underwater_vehicle": (0.01, 1e-12),
}
"""dt and the limit of the relative change of the discrete energy."""


@lru_cache(maxsize=8)
def held(name: str, method: co.methods.Method, steps: int = 100_000):
    model = catalogue[name]
    body = model.make()
    return co.simulate(body, model.start(body), dt=MODELS[name][0], steps=steps, method=method, save_every=10)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("name", MODELS)
def test_discrete_energy_is_constant_over_100000_steps(name):
    run = held(name, VariableStep())
    print(run)
    told = run.summary()
    assert run.relative_change("discrete_energy") <= MODELS[name][1]
    assert told["steps_fixed"] == 0 and "no step fixed" in str(run) and not run.warnings
    dt = MODELS[name][0]
    assert 0.25 * dt < told["step_size_min"] < 0.999999 * dt and told["step_size_max"] < 2 * dt
    # What varies is the other energy, of (μ, π), at the order of the rule.
    assert run.relative_change("energy") > 1e-9


SOME = [pytest.param(name, marks=() if name == "heavy_top" else pytest.mark.long) for name in MODELS]


@pytest.mark.long
@pytest.mark.parametrize("name", SOME)
def test_momenta_are_kept_as_with_fixed_steps(name):
    run, fixed = held(name, VariableStep()), held(name, co.Simpson())
    changes = [one.relative_change("kelvin_noether") for one in (run, fixed)]
    print(f"{name}: {changes}")
    assert changes[0] <= max(3 * changes[1], 2e-13)
    assert run.largest("balance") <= 2e-15 and run.largest("newton_residual") <= 2e-15


def excess(name: str, rule: co.methods.Method) -> np.ndarray:
    """E_k − ½(ℋ_k + ℋ_{k+1}) over h² along fixed steps of the rule."""
    model = catalogue[name]
    body = model.make()
    run = co.simulate(body, model.start(body), dt=MODELS[name][0], steps=5_000, method=rule)
    E, H = run.monitors["discrete_energy"], run.monitors["energy"]
    return (E[:-1] - 0.5 * (H[1:] + H[:-1])) / MODELS[name][0] ** 2


@pytest.mark.long
@pytest.mark.parametrize("tau", [co.Cayley(), co.Exponential()], ids=repr)
def test_the_discrete_energy_of_simpson_stays_on_one_side(tau):
    """It must, for an h to exist everywhere; that of the midpoint rule crosses over."""
    assert np.all(excess("kirchhoff_ellipsoid", co.Simpson(tau)) < 0)
    assert np.all(excess("underwater_vehicle", co.Simpson(tau)) < 0)
    crossing = excess("kirchhoff_ellipsoid", co.Midpoint(tau))
    assert np.any(crossing < 0) and np.any(crossing > 0)


def test_the_excess_of_a_steady_turn_over_cayley_has_its_closed_form():
    """3K = −|ω|²⟨μ, ω⟩/16 for H = cay(hξ/2), because ξ = ω(1 + h²|ω|²/48)."""
    model = catalogue["free_rigid_body"]
    body = model.make()
    run = co.simulate(body, model.start(body, angular_velocity=(0, 0, 2.0)), dt=1e-3, steps=1, method=co.Simpson())
    found = (run.monitors["discrete_energy"][0] - run.monitors["energy"][0]) / 1e-6
    assert found == pytest.approx(-(2.0**2) * (3.0 * 2.0 * 2.0) / 16, rel=1e-5)


@pytest.mark.long
@pytest.mark.parametrize("name", ["underwater_vehicle", "kirchhoff_ellipsoid"])
def test_h_goes_with_the_cube_root_of_the_excess(name):
    """E − ℋ = 3h²K, and h³K is constant along the orbit up to O(h²), where K itself varies by its own size."""
    model = catalogue[name]
    body = model.make()
    seen = co.simulate(body, model.start(body), dt=MODELS[name][0], steps=2_000, method=VariableStep()).monitors
    E, H, h = (seen[key] for key in ("discrete_energy", "energy", "step_size"))
    K = (E[:-1] - 0.5 * (H[1:] + H[:-1])) / (3 * h[:-1] ** 2)

    def variation(values):
        return np.ptp(values[1:]) / np.abs(np.mean(values[1:]))

    print(f"{name}: h³K varies by {variation(h[:-1] ** 3 * K):.1e}, K by {variation(K):.1e}")
    assert variation(h[:-1] ** 3 * K) < 1e-3 and variation(K) > 0.5


@pytest.mark.long
def test_where_no_step_holds_the_energy_fixed_ones_are_counted_and_told():
    run = held("kirchhoff_ellipsoid", VariableStep(co.Midpoint()), 5_000)
    fixed = run.summary()["steps_fixed"]
    print(run)
    assert 0 < fixed < 5_000
    assert f"{fixed:,} of 5,000 steps" in str(run) and len(run.warnings) == 1 and f"{fixed:,} of" in run.warnings[0]


@pytest.mark.long
def test_energy_is_held_over_the_steps_that_are_not_fixed():
    model = catalogue["kirchhoff_ellipsoid"]
    body = model.make()
    method = VariableStep(co.Midpoint(), within=(0.5, 2.0))
    run = co.simulate(body, model.start(body), dt=0.02, steps=3_000, method=method)
    energy, memory = run.monitors["discrete_energy"], run.records.memory
    found = np.diff(memory.fixed, prepend=0.0) == 0
    assert 0 < np.sum(~found) < 3_000
    assert np.ptp(energy[found]) <= 1e-14 * abs(energy[0]) < 1e-6 * np.ptp(energy[~found])
    assert np.all(memory.ratio[~found] == 1.0)
    assert np.all((memory.ratio > 0.5) & (memory.ratio < 2.0))


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("off", [0.0, 1e-4])
def test_at_and_near_a_relative_equilibrium_all_steps_are_fixed(off):
    """A body that spins about a principal axis, oblique in its frame: any h holds E, and round-off must not choose."""
    turn = evaluate(co.SO3().exp, np.array([0.4, -0.7, 0.3]))
    body = co.System(
        co.SO3(), lambda xi, p: 0.5 * xi @ p.J @ xi, parameters={"J": turn @ np.diag([1.0, 2, 3]) @ turn.T}
    )
    method = VariableStep(co.Simpson(co.Exponential()))
    run = co.simulate(body, body.state(xi=turn[:, 2] + off * turn[:, 0]), dt=0.05, steps=500, method=method)
    assert run.summary()["steps_fixed"] == 499
    assert "499 of 500 steps (99.80%) fixed" in str(run) and "relative equilibrium" in run.warnings[0]
    assert run.final.t == pytest.approx(25.0, rel=1e-14)


@pytest.mark.long
def test_symplectic_in_extended_phase_space():
    """ω + δ₁E δ₂t − δ₂E δ₁t is kept by (g, n, μ, π, t) ↦ the next node on the surface E_k = E, and ω alone is not."""
    system, start = timeless("SO3")
    method, random = VariableStep(co.Midpoint()), generator("extended")
    program, constants, h = (
        StepProgram(replace_parameters(system, None), method),
        Constants(system.parameters, None),
        0.1,
    )
    step = tabulate(lambda s: xla.step(program, constants, s, h, certify=False).after, start_of(method, system, start))
    state = step(step(start_of(method, system, start)))
    pair = [tangents(system, state, random) for _ in range(2)]
    dE = random.normal(size=2)
    before, after, plain, size = evaluate(
        lambda s, a, b, e: carried(system, program, constants, s, h, a, b, e), state, *pair, dE
    )
    assert abs(after - before) <= 1e-12 * size
    assert abs(plain - before) > 1e-4 * size


def timeless(world: str) -> tuple[co.System, co.State]:
    """A random system whose Lagrangian does not take t."""
    timed, start = random_system(world)
    ell = timed.lagrangian

    def lagrangian(xi, n, nu, a, p):
        return ell(xi, n, nu, a, p, t=0.0)

    places = {"additional": timed.additional, "advected": timed.advected}
    return co.System(timed.group, lagrangian, **places, parameters=timed.parameters), start


def start_of(method, system, start):
    return method.begin(system, start, 0.1)


def carried(system, program, constants, state, h, d1: PhaseVariation, d2: PhaseVariation, dE):
    """The two-form before, after, after without its part of t and E, and the size of its terms."""
    group, Q, V = system.places

    def map_(g, n, a, mu, pi, E):
        here = state.replace(g=g, n=n, a=a, mu=mu, pi=pi, memory=state.memory._replace(energy=E))
        after = xla.step(program, constants, here, h, certify=False).after
        return (group.matrix(after.g), after.n, after.mu, after.pi, after.t), after

    at = (state.g, state.n, state.a, state.mu, state.pi, state.memory.energy)

    def through(d: PhaseVariation, dE):
        dg = jax.jvp(lambda f: group.compose(state.g, f), (group.identity(),), (group.tangent(d.eta),))[1]
        dn, da = d.w - Q.infinitesimal(group, d.eta, state.n), -V.infinitesimal(group, d.eta, state.a)
        (g, n, *_), (dg, dn, dmu, dpi, dt), after = jax.jvp(map_, at, (dg, dn, da, d.mu, d.pi, dE), has_aux=True)
        eta = group.vee(jnp.linalg.solve(g, dg))
        return PhaseVariation(eta, dn + Q.infinitesimal(group, eta, n), dmu, dpi), dt, after

    (e1, t1, after), (e2, t2, _) = through(d1, dE[0]), through(d2, dE[1])
    before, size = two_form(system, state, d1, d2)
    plain, size_after = two_form(system, after, e1, e2)
    return before, plain + dE[0] * t2 - dE[1] * t1, plain, size + size_after


@pytest.mark.long
def test_native_and_reference_steps_are_the_same():
    model, h = catalogue["simo_wong_top"], 0.02
    system = model.make()
    method = VariableStep()
    program, constants = StepProgram(replace_parameters(system, None), method), Constants(system.parameters, None)
    state = method.begin(system, model.start(system), h)
    chunk = native.run(program, constants, state, h, 20, 1, monitors=False)
    step = tabulate(lambda s: xla.step(program, constants, s, h, certify=False), state)
    for row in range(20):
        result = step(state)
        assert result.code == 0 and chunk.code == 0
        for ours, theirs in zip(*map(jax.tree.leaves, (chunk.records, result.record)), strict=True):
            # E changes by about 1e-7 of itself with h, so that round-off in E moves each h by 1e-9 of itself.
            assert np.allclose(
                ours[row], theirs, rtol=0, atol=2e-8 * (row + 1) * (1 + np.max(np.abs(theirs), initial=0))
            )
        state = result.after


@pytest.mark.long
def test_times_are_those_of_the_nodes_in_memory_and_in_a_store(tmp_path):
    model = catalogue["simo_wong_top"]
    top = model.make()
    one = co.simulate(top, model.start(top), dt=0.02, steps=300, method=VariableStep(), save_every=7)
    other = co.simulate(
        top,
        model.start(top),
        dt=0.02,
        steps=300,
        method=VariableStep(),
        save_every=7,
        store=tmp_path / "run",
    )
    time = one.dataset.time.values
    np.testing.assert_array_equal(time, one.records.t)
    np.testing.assert_array_equal(time, other.dataset.time.values)
    assert np.max(np.abs(time - 0.02 * one.steps_saved)) > 1e-6
    every = co.simulate(top, model.start(top), dt=0.02, steps=300, method=VariableStep()).dataset
    np.testing.assert_allclose(np.diff(every.time), every.step_size[:-1], rtol=1e-11)
    assert one.dataset.attrs["time_final"] == time[-1] == one.final.t


def test_what_does_not_fit_is_refused():
    for base in (
        co.LeftRectangle(),
        co.methods.LeftRight(),
        co.EnergyMomentum(),
        VariableStep(),
        co.Suzuki4(co.Midpoint()),
        co.Galerkin(),
    ):
        with pytest.raises(co.errors.ArgumentError, match="needs a symmetric rule of one stage"):
            VariableStep(base)
    for within in ((0.0, 2.0), (1.0, 2.0), (0.5, np.inf), 3.0):
        with pytest.raises(co.errors.ArgumentError, match="0 < low < 1 < high"):
            VariableStep(within=within)  # pyright: ignore[reportArgumentType]
    for changes in (
        {"forces": 1},
        {"internal": 1},
        {"depends_on_time": True},
        {"taken": "inputs"},
        {"taken": "internal"},
    ):
        given = {"forces": None, "internal": None, "depends_on_time": False, "taken": "", **changes}
        driven: Any = SimpleNamespace(**given, takes=lambda name, taken=given["taken"]: name == taken)
        with pytest.raises(co.errors.ArgumentError, match="forces, explicit time, inputs and internal states change"):
            Paced(co.Simpson()).require_fit(driven)
    sphere, start = timeless("SO3 on a sphere")
    with pytest.raises(co.errors.ArgumentError, match="VariableStep over Midpoint needs a flat space"):
        co.simulate(sphere, start, dt=0.1, steps=1, method=VariableStep(co.Midpoint()))
    model = catalogue["heavy_top"]
    with pytest.raises(co.errors.ArgumentError, match="by parts of a step"):
        top = model.make()
        co.simulate(top, model.start(top), dt=1e-4, steps=1, method=VariableStep(), until=lambda s: s.t - 1.0)
    tops = model.make().replace(mass=co.each([15.0, 16.0]))
    with pytest.raises(co.errors.ArgumentError, match="share their times"):
        co.simulate(tops, model.start(model.make()), dt=1e-4, steps=1, method=VariableStep())


@pytest.mark.long
def test_an_interrupted_run_goes_on_with_its_energy_and_its_last_step(tmp_path, monkeypatch):
    model = catalogue["simo_wong_top"]
    top = model.make()
    given = {"dt": 0.02, "steps": 3_000, "method": VariableStep(), "save_every": 7}
    whole, stretch, done = co.simulate(top, model.start(top), **given), Driver._stretch, []

    def interrupted(driver, position, speed):
        if len(done) == 4:
            raise KeyboardInterrupt
        done.append(position.steps)
        stretch(driver, position, 2_000.0)

    monkeypatch.setattr("coadjoint.simulation.store.PERIOD", 0.0)
    monkeypatch.setattr("coadjoint.simulation.store.BURDEN", 0.0)
    with monkeypatch.context() as cut, pytest.raises(KeyboardInterrupt):
        cut.setattr(Driver, "_stretch", interrupted)
        co.simulate(top, model.start(top), store=tmp_path / "run", **given)
    again = co.resume(tmp_path / "run", top)
    assert 0 < done[-1] < 3_000 and again.summary()["steps_fixed"] == 0
    for name in ("time", "xi", "mu", "step_size", "discrete_energy"):
        np.testing.assert_array_equal(again.dataset[name], whole.dataset[name])


def turned(inertia, backend="auto"):
    """The momentum after steps at a relative equilibrium, where h is fixed: μ₃ = J₃₃."""
    body = co.System(co.SO3(), lambda xi, p: 0.5 * xi @ p.inertia @ xi, parameters=co.Parameters(inertia=inertia))
    start = body.state(xi=[0.0, 0.0, 1.0])
    return co.trajectory(body, start, dt=0.1, steps=3, method=VariableStep(), backend=backend).final.mu[2]


def test_native_code_says_that_steps_that_may_fail_have_no_derivative():
    with co.float64(), pytest.raises(co.errors.ArgumentError, match="no derivative in native code"):
        jax.grad(lambda inertia: turned(inertia, "native"))(np.diag([1.0, 2.0, 3.0]))


@pytest.mark.long
def test_gradients_go_through_xla():
    with co.float64():
        slope = jax.grad(turned)(np.diag([1.0, 2.0, 3.0]))
    assert slope[2, 2] == pytest.approx(1.0, abs=1e-10)
    assert np.all(np.isfinite(slope))


class Node(NamedTuple):
    """A state of one freedom; t stands for what steps add up."""

    xi: Any
    memory: Any
    t: Any = 0.0
    mu: Any = 2.0
    pi: Any = 0.0
    nu: Any = 0.0

    def replace(self, **changes):
        return self._replace(**changes)


@dataclass(frozen=True)
class Line:
    """R = z − hc and E = αz + βh: along solutions dE/dh = αc + β. Whatever a step gives is made of its h."""

    c: float
    alpha: float
    beta: float

    def guess(self, system, state, h):
        return state.xi * h

    def record(self, system, state, h, z):
        return state.replace(xi=z, t=h)

    def equations(self, system, record, h):
        return record.xi - h * self.c

    def energy(self, system, record, h):
        return self.alpha * record.xi[0] + self.beta * h

    def chart(self, system, record, h):
        return 0.1 * h

    def advance(self, system, record, h):
        return record.replace(t=record.t + h)

    def blocks(self, system):
        return (1,)

    def sources(self, system, record, h):
        return h

    def relative(self, system, record, h):
        return 2 * h


def paced(ratio: float, energy: float = 0.0, known: float = 1.0) -> Node:
    memory = Pace(*(np.float64(x) for x in (ratio, energy, known, 5.0)))
    return Node(np.array([3.0]), memory, mu=np.array([2.0]), pi=np.zeros(1), nu=np.zeros(1))


@pytest.fixture
def in_float64():
    with co.float64():
        yield


@pytest.mark.usefixtures("in_float64")
def test_the_search_solves_the_equations_of_the_base_rule_with_that_of_the_energy_for_h():
    search, system = _Search(cast(Any, Line(2.0, 0.5, 1.0)), within=(0.5, 2.0)), cast(Any, None)
    assert search.blocks(system) == (1, 1) and _Predict(search.base).blocks(system) == (1,)
    assert search.guess(system, cast(Any, paced(0.8)), 0.5).tolist() == [3.0 * 0.5 * 0.8, 0.8]
    record: Any = search.record(system, cast(Any, paced(0.8, energy=0.7)), 0.5, np.array([4.0, 1.5]))
    assert (record.xi.tolist(), record.memory.ratio, record.t) == ([4.0], 1.5, 0.75)
    assert search.equations(system, record, 0.5).tolist() == [4.0 - 0.75 * 2.0, 0.5 * 4.0 + 0.75 - 0.7]
    first = record.replace(memory=record.memory._replace(known=np.float64(0.0)))
    assert search.equations(system, first, 0.5).tolist() == [4.0 - 0.75 * 2.0, 0.5]
    found, fixed = (search.advance_if(system, record, 0.5, np.float64(sound)).memory for sound in (1.0, 0.0))
    assert (found.ratio, found.fixed, fixed.ratio, fixed.fixed) == (1.5, 5.0, 1.0, 6.0)
    assert _Predict(search.base).advance_if(system, record, 0.5, np.float64(1.0)) is record


def test_a_ratio_out_of_bounds_or_without_an_energy_that_depends_on_it_is_beyond_the_chart():
    """dE/dh = αc + β vanishes for α = 1, c = 2, β = −2; the first step has its h by itself."""
    for line, inside in ((Line(2.0, 0.5, 1.0), True), (Line(2.0, 1.0, -2.0), False), (Line(2.0, -1.0, -2.0), True)):
        search = _Search(cast(Any, line), within=(0.5, 2.0))
        for ratio, known in ((1.5, 1.0), (0.4, 1.0), (2.1, 1.0), (1.5, 0.0)):
            at = evaluate(partial(search.chart, cast(Any, None)), paced(ratio, known=known), 0.5)
            usable = 0.5 < ratio < 2.0 and (inside or known == 0)
            assert at == pytest.approx(0.1 * 0.5 * ratio if usable else 1.0)


@pytest.mark.usefixtures("in_float64")
def test_a_paced_step_is_that_of_the_base_rule_over_its_own_length_and_the_first_gives_the_energy():
    step, system = Paced(cast(Any, Line(2.0, 0.5, 1.0))), cast(Any, None)
    record: Any = paced(0.8, energy=0.7)
    assert step.advance(system, record, 0.5).t == 0.4 and step.size(record, 0.5) == 0.4
    assert step.sources(system, record, 0.5) == 0.4 and step.relative(system, record, 0.5) == 0.8
    assert step.energy(system, record, 0.5) == 0.5 * 3.0 + 0.4 and step.chart(system, record, 0.5) == 0.1 * 0.4
    assert step.advance(system, record, 0.5).memory.energy == 0.7
    started = step.remember(system, record).memory
    assert tuple(started) == (1.0, 0.0, 0.0, 0.0)
    after: Any = step.advance(system, record.replace(memory=started), 0.5)
    assert tuple(after.memory) == (1.0, 0.5 * 3.0 + 0.5, 1.0, 0.0)
