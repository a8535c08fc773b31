"""Lagrangians that are linear in the velocities: momenta of the place at every node, the two-form, exact momenta."""

from __future__ import annotations

import pickle
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import coadjoint as co
from coadjoint.audit.one_step import irreversibility
from coadjoint.audit.stepper import AuditStepper
from coadjoint.audit.systems import guiding_centre, predators
from coadjoint.errors import CoadjointError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics import continuous, phase_space

P = co.methods.ProjectedMidpoint
LOTKA, AT_ONE = predators()


def on_plane(lagrangian: Any, **more: Any) -> co.System:
    return co.System(co.Translation(0), lagrangian, additional=co.Trivial(2), **more)


def theta(system: co.System, q: np.ndarray) -> np.ndarray:
    state = system.state(q=q)
    return np.concatenate([state.mu, state.pi])


def test_momenta_stay_those_of_the_place_and_energy_stays_in_its_band():
    """Without the shifts the momenta leave ϑ by the parasitic mode, and the band of the energy is 1.4e-3."""
    run = co.simulate(LOTKA, AT_ONE, dt=0.05, steps=2500, method=P(), accuracy=False, monitors=False)
    x, y = run.records.q.T
    energy = x + y - 2 * np.log(x) - np.log(y)
    assert np.ptp(energy) < 2.9e-4
    assert np.ptp(energy[-500:]) == pytest.approx(np.ptp(energy[:500]), rel=1e-2)
    np.testing.assert_allclose(run.records.pi, np.stack([np.log(y) / x + y, x], axis=1), rtol=0, atol=1e-13)


def test_shifts_keep_the_momentum_of_turns_and_the_step_between_them_is_that_of_the_base():
    """Φ of any (λ_ξ, λ_n) keeps μ + n × π, g⁺ = gF_Φ F F_Φ⁻¹, and nodes are those of Φ's record."""
    system = co.System(
        co.SO2(), lambda xi, n, nu: n[0] ** 2 * nu[1] + n[0] * n[1] * xi[0] - 0.1 * (n @ n) ** 2,
        additional=co.Defining(),
    )  # fmt: skip
    step, h = P(), 0.1
    state = step.remember(system, system.state(q=[0.7, -0.4])).replace(mu=np.array([0.3]), pi=np.array([0.9, 0.5]))
    z = np.array([0.4, 0.5, -0.3, 0.8, 0.6, 0.2])

    def parts(state):
        record = step.record(system, state, h, z)
        shifted = step._shifted(system, record, h)
        after, nodes, base = step.advance(system, record, h), step.nodes(system, record, h), step.base
        seen = (
            nodes,
            base.nodes(system, shifted, h),
            step.quadrature(system, record, h),
            base.quadrature(system, shifted, h),
        )
        return record, shifted, after, step.relative(system, record, h), seen

    record, shifted, after, relative, (nodes, of_base, points, of_points) = evaluate(parts, state)
    momenta = [s.mu[0] + s.n[0] * s.pi[1] - s.n[1] * s.pi[0] for s in (record, shifted)]
    assert momenta[1] == pytest.approx(momenta[0], abs=1e-14) and abs(shifted.mu[0] - record.mu[0]) > 1e-2
    np.testing.assert_allclose(after.g, record.g @ relative, atol=1e-14)
    for found, expected in ((nodes, of_base), (points, of_points)):
        jax.tree.map(np.testing.assert_array_equal, found, expected)
    assert sum(weight for weight, _ in nodes) == sum(weight for weight, _ in points) == 1


@pytest.mark.long
def test_velocities_of_nodes_are_those_of_the_equations_of_motion():
    run = co.simulate(LOTKA, AT_ONE, dt=0.05, steps=100, method=P())
    x, y = run.records.q.T
    for name in ("nu", "qdot"):
        found = run.dataset[name].values
        np.testing.assert_allclose(found, np.stack([x * (y - 1), y * (2 - x)], axis=1), rtol=0, atol=1e-13)
    assert np.max(run.dataset.legendre_residual.values) < 1e-15


def weighted(xi, n, nu):
    return n[1] * nu[0] - 0.5 * n @ n


PLANE = on_plane(weighted)
PULLED = PLANE.with_forces(lambda motion: co.Force(force=-motion.nu * jnp.abs(motion.nu)))
SPIN = co.System(co.SO3(), lambda xi, a: xi[2] - a[0], advected=co.Defining())
HALF = on_plane(lambda xi, n, nu: 0.5 * nu[0] ** 2 + n[0] * nu[1] - n[1] ** 2)
LIGHT = on_plane(lambda xi, n, nu: n[0] * nu[0] - n @ n)
HELD = on_plane(lambda xi, n, nu, *, inputs: inputs.b * n[1] * nu[0] - n @ n)
GAUGED = on_plane(lambda xi, n, nu, p: p.k * n[1] * nu[0] - 0.5 * p.w * n @ n, parameters={"k": 2.0, "w": 3.0})
NO_NUMBER = PLANE.with_forces(lambda motion: co.Force(force=jnp.nan * motion.nu))
CANCELLED = PLANE.with_forces(lambda motion: co.Force(force=jnp.stack([motion.nu[1], -motion.nu[0]])))
VANISHING = on_plane(lambda xi, n, nu: n[0] ** 2 * nu[1] - n[0] - 0.1 * n[1])
ON_SPHERE = co.System(co.SO3(), lambda xi, n, nu: n @ xi, additional=co.Sphere())
REGULAR = co.System(co.SO3(), lambda xi: 0.5 * xi @ xi)
BY_MOMENTA = co.System(co.SO3(), hamiltonian=lambda mu: 0.5 * mu @ mu)


def run_of(system: co.System, method: Any, **start: Any) -> Any:
    return co.simulate(system, system.state(**start), dt=0.1, steps=1, method=method)


@cache
def gauged() -> co.Stepper:
    return co.Stepper(GAUGED, GAUGED.state(q=[1, 0.5]), dt=0.1, method=P(), changing=("k",))


WRONG = {
    "the default method": (lambda: run_of(PLANE, None, q=[1, 0]), "degenerate, linear in the velocities: integrate"),
    "another method": (lambda: run_of(PLANE, co.Trapezoidal(), q=[1, 0]), "method=co.methods.ProjectedMidpoint"),
    "velocities of its own": (
        lambda: run_of(PLANE, P(), q=[1, 0], qdot=[1, 0]), r"leave out `xi` and `qdot`, or give .* = \[0.0, -1.0\]",
    ),
    "momenta": (lambda: run_of(PLANE, P(), q=[1, 0], pi=[0, 0]), r"those of its place, .* leave out `mu` and `pi`"),
    "momenta of other places": (
        lambda: co.simulate(PLANE, PLANE.state(q=[1, 0]).replace(pi=np.ones(2), from_velocities=False), dt=0.1, steps=1,
                            method=P()),
        r"must be those of its place, .* differ from them by 1.0e\+00",
    ),
    "momenta of other places in a trajectory": (
        lambda: co.trajectory(PLANE, PLANE.state(q=[1, 0]).replace(pi=np.ones(2), from_velocities=False), dt=0.1,
                              steps=1, method=P()),
        "must be those of its place",
    ),
    "momenta of other places in a stepper": (
        lambda: gauged().reset(gauged().state.replace(pi=np.ones(2))),
        "The momenta of the state must be those of its place",
    ),
    "drag that is quadratic": (lambda: run_of(PULLED, P(), q=[1, 0]), "must be affine in them"),
    "a singular form": (lambda: run_of(LIGHT, P(), q=[1, 0]), "must be regular, but motion along .* does not enter"),
    "a form that vanishes on the way": (
        lambda: co.simulate(
            VANISHING, VANISHING.state(q=[0.3, 1]), dt=0.05, steps=200, method=P(), accuracy=False, monitors=False
        ),
        "or look for a place where ω = dϑ is singular",
    ),
    "an orbit": (lambda: run_of(SPIN, P(), a0=[0, 0, 1]), "on a coadjoint orbit, give ℋ.μ. and use co.Hamiltonian"),
    "momenta of inputs": (lambda: run_of(HELD, P(), q=[1, 0], inputs={"b": 2.0}), "must not depend on `inputs`"),
    "a mass in one direction": (lambda: run_of(HALF, P(), q=[0, 1]), "mass matrix .* is singular"),
    "velocities of another member": (
        lambda: run_of(PLANE, P(), q=co.each([[1, 0], [1, 0]]), qdot=co.each([[0, -1], [1, 0]])),
        r"leave out `xi` and `qdot`, or give .* = \[0.0, -1.0\]",
    ),
    "velocities of another member of a stepper": (
        lambda: co.Stepper(
            PLANE, PLANE.state(q=co.each([[1, 0], [1, 0]]), qdot=co.each([[0, -1], [1, 0]])), dt=0.1, method=P()
        ),
        "leave out `xi` and `qdot`",
    ),
    "a singular form of another member": (
        lambda: run_of(GAUGED.replace(k=co.each([1.0, 0.0])), P(), q=[1, 0]), "must be regular, but motion along",
    ),
    "a change that keeps momenta": (
        lambda: gauged().change(k=3.0, keep="momentum"), r"must be those of its place, .* differ from them by [1-9]",
    ),
    "other parameters in a trajectory of a stepper": (
        lambda: gauged().trajectory(gauged().state, parameters=GAUGED.replace(k=3.0).parameters),
        "The momenta of the state under these parameters must be those of its place",
    ),
    "a change in a saved stepper": (
        lambda: pickle.loads(pickle.dumps(gauged())).change(k=3.0, keep="momentum"),
        "`k` determines the momenta ϑ of a place, which a saved stepper does not know",
    ),
    "a force that is not a number": (lambda: run_of(NO_NUMBER, P(), q=[1, 0]), "`forces` must be finite at the start"),
    "a force that cancels the form": (lambda: run_of(CANCELLED, P(), q=[1, 0]), "must not cancel its two-form"),
    "a kinetic energy": (lambda: run_of(REGULAR, P(), xi=[1, 2, 3]), "that are linear in the velocities: use co.Mid"),
    "a Hamiltonian": (lambda: run_of(BY_MOMENTA, P(), mu=[1, 2, 3]), "needs a system with a `lagrangian`"),
    "a sphere": (lambda: run_of(ON_SPHERE, P(), q=[0, 0, 1]), "flat space of additional dynamics"),
    "a start from velocities": (lambda: run_of(PLANE, P(start="velocity"), q=[1, 0]), "starts from momenta"),
    "constraints": (
        lambda: run_of(PLANE.with_constraints({"rod": co.Holonomic(lambda n: n[0] - 1)}), P(), q=[1, 0]),
        "takes no constraints",
    ),
}  # fmt: skip


@pytest.mark.cases(5)
@pytest.mark.parametrize(("call", "says"), WRONG.values(), ids=WRONG)
def test_wrong_uses_raise_one_sentence(call, says):
    with pytest.raises(CoadjointError, match=says) as error:
        call()
    assert "\n" not in str(error.value)


def form(system: co.System, q: np.ndarray) -> np.ndarray:
    """dϑ at q on the plane."""
    state = system.state(q=q)
    return np.asarray(evaluate(lambda state: phase_space.two_form(system, state), state))


def skewed(xi, n, nu):
    """Lotka and Volterra's with a ϑ of which no component vanishes."""
    x, y = n
    return 0.5 * (jnp.log(y) / x * nu[0] - jnp.log(x) / y * nu[1]) - (x + y - 2 * jnp.log(x) - jnp.log(y))


WEIGHTS = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 4 / 5, -1 / 5, 4 / 105, -1 / 280]) / 0.01
PLACES = np.array([-4, -3, -2, -1, 1, 2, 3, 4]) * 0.01
"""Central differences of order 8."""


def defect(system: co.System, q: np.ndarray, h: float) -> float:
    """How far a step changes dϑ: |(∂q⁺/∂q)ᵀ ω(q⁺) ∂q⁺/∂q − ω(q)|."""
    starts = [q, *(q + place * axis for axis in np.eye(2) for place in PLACES)]
    many = co.simulate(system, system.state(q=co.each(starts)), dt=h, steps=1, method=P(), monitors=False)
    ends = many.dataset.q.values[:, -1]
    slope = np.stack([WEIGHTS @ ends[1 + 8 * i : 9 + 8 * i] for i in (0, 1)], axis=1)
    return float(np.max(np.abs(slope.T @ form(system, ends[0]) @ slope - form(system, q))))


@pytest.mark.long
def test_the_two_form_is_kept_exactly_in_one_gauge_and_to_order_5_in_others():
    q = np.array([1.3, 0.7])
    assert max(defect(LOTKA, q, h) for h in (0.4, 0.2)) < 1e-11
    coarse, fine = (defect(on_plane(skewed), q, h) for h in (0.4, 0.2))
    assert np.log2(coarse / fine) == pytest.approx(5, abs=0.4) and fine > 1e-9


@pytest.mark.long
def test_steps_are_reversible_and_differentiable_by_xla():
    assert P().symmetric and irreversibility(AuditStepper(P(), LOTKA, AT_ONE), 0.1) < 1e-13

    def native(x):
        return co.simulate(LOTKA, LOTKA.state(q=[x, 1]), dt=0.1, steps=50, method=P(), monitors=False).final.q

    def end(q):
        return co.trajectory(LOTKA, LOTKA.state(q=q), dt=0.1, steps=50, method=P()).final.q

    with co.float64():
        found, slope = jax.jvp(end, (jnp.ones(2),), (jnp.array([1.0, 0.0]),))
    np.testing.assert_allclose(found, native(1.0), rtol=0, atol=1e-12)
    np.testing.assert_allclose(slope, (native(1 + 1e-5) - native(1 - 1e-5)) / 2e-5, rtol=1e-7)


@pytest.mark.long
def test_steppers_ensembles_and_continued_runs_take_the_same_steps(tmp_path):
    run = co.simulate(LOTKA, AT_ONE, dt=0.05, steps=40, method=P())
    stepper = co.Stepper(LOTKA, AT_ONE, dt=0.05, method=P())
    for _ in range(40):
        stepper.step()
    np.testing.assert_array_equal(stepper.state.q, run.final.q)
    first = co.simulate(LOTKA, AT_ONE, dt=0.05, steps=20, method=P(), store=tmp_path / "first")
    assert co.resume(tmp_path / "first", LOTKA).steps == 20
    second = co.simulate(LOTKA, first.final, dt=0.05, steps=20, method=P())
    np.testing.assert_allclose(second.final.q, run.final.q, rtol=0, atol=1e-13)
    starts = LOTKA.state(q=co.each([[1.0, 1.0], [1.0, 0.5], [0.5, 2.0]]))
    many = co.simulate(LOTKA, starts, dt=0.05, steps=40, method=P())
    np.testing.assert_allclose(many.dataset.q.values[0, -1], run.final.q, rtol=0, atol=1e-13)


INERTIA = np.array([1.0, 1.3, 0.8])


def top_energy(mu, a):
    return 0.5 * mu @ (mu / INERTIA) + a @ np.array([0.1, 0.2, 0.7])


@pytest.mark.long
def test_the_phase_space_form_of_a_top_takes_the_steps_of_the_hamiltonian_midpoint():
    """ℓ = ⟨y, ξ⟩ − ℋ(y, a), y = μ a variable of its own: dϑ is canonical."""
    start = {"g": co.attitude.zyx(0.3, 0.5, -0.4), "a0": [0, 0, 1]}
    mu = np.array([0.5, -0.3, 2.5]) * INERTIA
    by_h = co.System(co.SO3(), hamiltonian=top_energy, advected=co.Defining())
    wanted = co.simulate(by_h, by_h.state(mu=mu, **start), dt=0.05, steps=40, method=co.HamiltonianMidpoint()).final
    by_l = co.System(
        co.SO3(), lambda xi, y, ydot, a: y @ xi - top_energy(y, a), additional=co.Trivial(3), advected=co.Defining()
    )
    run = co.simulate(by_l, by_l.state(q=mu, **start), dt=0.05, steps=40, method=P())
    for found, expected in ((run.final.q, wanted.mu), (run.final.a, wanted.a), (run.final.g, wanted.g)):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)
    assert np.ptp(run.dataset.kelvin_noether.values, axis=0).max() < 1e-13


def bent_top(xi, n, nu, a):
    """A ϑ whose every component depends on the place, on SO(3) with turning n and a: shifts turn g, n and a."""
    turn = n + 0.2 * jnp.cross(n, a) + 0.1 * (n @ n) * a
    return turn @ xi + 0.1 * (a @ n) * (jnp.cross(a, n) @ nu) - 0.5 * n @ (n / INERTIA) - 0.8 * a[2]


@pytest.mark.long
def test_order_momentum_and_balance_hold_on_a_group_whose_shifts_turn():
    system = co.System(co.SO3(), bent_top, additional=co.Defining(), advected=co.Defining())
    start = system.state(g=co.attitude.zyx(0.3, 0.5, -0.4), q=[0.5, -0.3, 1.2], a0=[0, 0.6, 0.8])
    wanted = continuous.reference(system, start, [2.0])
    for method, order, counts in ((P(), 2, (40, 80)), (co.Suzuki4(P()), 4, (20, 40))):
        runs = [co.simulate(system, start, dt=2 / k, steps=k, method=method) for k in counts]
        off = [np.max(np.abs(np.concatenate([run.final.n - wanted.n[0], np.ravel(run.final.g - wanted.g[0])])))
               for run in runs]  # fmt: skip
        assert np.log2(off[0] / off[1]) == pytest.approx(order, abs=0.15)
        assert np.ptp(runs[0].dataset.kelvin_noether.values, axis=0).max() < 1e-13
        assert np.max(runs[0].dataset.legendre_residual.values) < 1e-13


CIRCULATIONS = np.array([1.0, -0.6, 0.8])


def vortices(xi, n, nu, p):
    """ℓ = Σ ½Γ(y ẋ − x ẏ) − ℋ in the plane, with x and y of all vortices one after the other."""
    (x, y), (u, v) = n.reshape(2, -1), nu.reshape(2, -1)
    i, j = np.triu_indices(len(CIRCULATIONS), 1)
    apart = (x[i] - x[j]) ** 2 + (y[i] - y[j]) ** 2
    energy = -jnp.sum(p.gamma[i] * p.gamma[j] * jnp.log(apart)) / (4 * jnp.pi)
    return 0.5 * p.gamma @ (y * u - x * v) - energy


@pytest.mark.long
def test_point_vortices_keep_their_impulse_and_need_their_circulations():
    gamma = {"gamma": CIRCULATIONS}
    system = co.System(co.Translation(0), vortices, additional=co.Trivial(6), parameters=gamma)
    run = co.simulate(system, system.state(q=[0, 1, 0.2, 0, 0.1, 0.9]), dt=0.05, steps=4000, method=P())
    places = run.records.q.reshape(-1, 2, 3)
    linear, angular = places @ CIRCULATIONS, np.sum(places**2, axis=1) @ CIRCULATIONS
    assert np.ptp(linear, axis=0).max() < 1e-12 and np.ptp(angular) < 1e-12
    assert run.relative_change("energy") < 1e-3
    passive = system.replace(gamma=[1.0, 1.0, 0.0])
    with pytest.raises(CoadjointError, match="does not enter the equations"):
        co.simulate(passive, passive.state(q=[1, -1, 9, 0, 0, 9]), dt=0.1, steps=1, method=P())


@pytest.mark.long
def test_a_pair_of_vortices_turns_by_the_closed_form():
    def pair(xi, n, nu):
        x, y = n.reshape(2, 2)
        apart = (x[0] - x[1]) ** 2 + (y[0] - y[1]) ** 2
        return 0.5 * (y @ nu[:2] - x @ nu[2:]) + jnp.log(apart) / (4 * jnp.pi)

    # Γ = 1 at the distance 2: Ω = 1/(4π), and the implicit midpoint rule turns by arcsin(hΩ) a step.
    system = co.System(co.Translation(0), pair, additional=co.Trivial(4))
    final = co.simulate(system, system.state(q=[1, -1, 0, 0]), dt=0.5, steps=100, method=P()).final
    angle = 100 * np.arcsin(0.5 / (4 * np.pi))
    wanted = np.array([np.cos(angle), -np.cos(angle), np.sin(angle), -np.sin(angle)])
    np.testing.assert_allclose(final.q, wanted, rtol=0, atol=1e-12)


@pytest.mark.long
def test_lotka_and_volterra_by_their_bracket_and_by_a_one_form_agree():
    """{x, y} = xy is canonical in (ln x, ln y), a symplectic realisation; both converge to DOP853."""
    wanted = solve_ivp(
        lambda t, z: [z[0] * (z[1] - 1), z[1] * (2 - z[0])], (0, 5), [1, 1], method="DOP853", rtol=1e-13, atol=1e-14
    ).y[:, -1]
    canonical = co.System(
        co.Translation(0),
        lambda xi, n, nu: n[1] * nu[0] - (jnp.exp(n[0]) + jnp.exp(n[1]) - 2 * n[0] - n[1]),
        additional=co.Trivial(2),
    )
    for method, order, counts in ((P(), 2, (100, 200)), (co.Suzuki4(P()), 4, (50, 100))):
        for system, q, back in ((LOTKA, [1, 1], lambda q: q), (canonical, [0, 0], np.exp)):
            off = []
            for k in counts:
                run = co.simulate(
                    system, system.state(q=q), dt=5 / k, steps=k, method=method, monitors=False, accuracy=False
                )
                off.append(np.max(np.abs(back(run.final.q) - wanted)))
            assert np.log2(off[0] / off[1]) == pytest.approx(order, abs=0.15)


@pytest.mark.long
def test_a_million_steps_leave_energies_in_their_bands():
    """Lotka and Volterra, not reversible, in a gauge that keeps dϑ; a trapped ion, whose motion is reversible."""
    for (system, start), dt in ((predators(), 0.05), (guiding_centre(), 0.1)):
        run = co.simulate(system, start, dt=dt, steps=10**6, save_every=50, method=P(), accuracy=False)
        windows = run.dataset.energy.values[:-1].reshape(40, -1)
        band = np.ptp(windows[0])
        means = windows.mean(axis=1)
        assert np.ptp(windows) < 1.05 * band
        assert abs(np.polyfit(np.arange(40), means, 1)[0]) * 40 < 0.01 * band
        final = run.final
        np.testing.assert_allclose(theta(system, final.q), np.concatenate([final.mu, final.pi]), rtol=0, atol=1e-11)


@pytest.mark.long
def test_a_trapped_ion_keeps_its_toroidal_momentum_to_round_off():
    system, start = guiding_centre()
    run = co.simulate(system, start, dt=0.1, steps=20_000, method=P())
    R, Z, u = run.records.q.T
    assert u.min() < -0.3 < 0.3 < u.max() and np.ptp(Z) > 0.2  # a banana
    r2, p = (R - 1) ** 2 + Z**2, system.parameters
    momentum = -r2 / (2 * p.q * p.rho) + u * R / np.sqrt(1 + r2 / p.q**2)
    assert np.ptp(momentum) < 1e-13 * abs(momentum[0]) * 10
    assert np.ptp(run.dataset.kelvin_noether.values) < 1e-13
