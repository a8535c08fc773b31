"""An internal state in ℓ, ℋ or Λ: its mean over a step, with momenta that are continuous at the nodes."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.mechanics.continuous import reference

H = 0.02
RULES = {
    "midpoint": co.Midpoint(co.Exponential()),
    "trapezoidal": co.Trapezoidal(co.Exponential()),
    "pair": co.methods.LeftRight(co.Exponential()),
    "galerkin": co.Galerkin(co.Exponential()),
    "energy-momentum": co.EnergyMomentum(co.Exponential()),
}


def radius(t, numpy=np):
    """r(t) = 1 + ½ sin t, m."""
    return 1 + 0.5 * numpy.sin(t)


P = {"inertia": 2.0, "mass": 0.5}
PARAMETERS = co.Parameters(**P)


def _slide(motion, h, p):
    first, last = (radius(t, jnp) for t in (motion.t, motion.t + h))
    return {"radius": co.mechanics.Course(last, 0.5 * (first + last), first)}


def _kinetic(xi, p, *, internal):
    """ℓ = ½(I + m r²)ω² of a turntable on which a mass is moved along a radius."""
    return 0.5 * (p.inertia + p.mass * internal.radius**2) * xi @ xi


def _hamiltonian(mu, p, *, internal):
    return 0.5 * mu @ mu / (p.inertia + p.mass * internal.radius**2)


def _discrete(xi, p, h, *, internal):
    return h * _kinetic(xi, p, internal=internal)


def turntable(**functions):
    functions = functions or {"lagrangian": _kinetic}
    return co.System(co.SO2(), **functions, parameters=PARAMETERS, internal=_slide)


def skater(system, omega=1.0):
    return system.state(xi=[omega], internal={"radius": radius(0.0)})


def exact(r, momentum):
    """ω = μ/(I + m r²)."""
    return momentum / (P["inertia"] + P["mass"] * r**2)


def over_step(t):
    """r over the step from t."""
    return 0.5 * (radius(t) + radius(t + H))


@pytest.mark.cases(1)
@pytest.mark.parametrize("method", RULES.values(), ids=RULES)
def test_a_skater_keeps_the_momentum_and_turns_as_the_closed_form_says(method):
    system = turntable()
    run = co.simulate(system, skater(system), dt=H, steps=200, method=method)
    momentum = P["inertia"] + P["mass"]
    t = run.dataset.time.values
    np.testing.assert_allclose(run.dataset.mu[:, 0], momentum, rtol=1e-14)
    np.testing.assert_allclose(run.dataset.xi_step[:, 0], exact(over_step(t), momentum), rtol=1e-13)
    np.testing.assert_allclose(run.dataset.internal_radius, radius(t), rtol=1e-15)
    energy = 0.5 * momentum * exact(radius(t), momentum)
    np.testing.assert_allclose(run.dataset.energy, energy, rtol=1e-13)
    np.testing.assert_allclose(run.dataset.work_internal, energy - energy[0], atol=1e-13)
    assert run.summary()["energy_budget_error_max"] < 1e-13
    assert "internal" in next(line for line in run.certificate.long().splitlines() if line.startswith("energy budget"))


@pytest.mark.parametrize(
    ("functions", "method"),
    [
        ({"hamiltonian": _hamiltonian}, co.Midpoint(co.Exponential())),
        ({"discrete_lagrangian": _discrete}, co.Variational(co.Exponential())),
    ],
    ids=["hamiltonian", "discrete Lagrangian"],
)
def test_a_hamiltonian_and_a_discrete_lagrangian_read_the_same_internal_state(functions, method):
    system, reference = turntable(**functions), turntable()
    start = skater(reference).replace(from_velocities=False)
    path = co.trajectory(system, start, dt=H, steps=100, method=method).records
    np.testing.assert_allclose(path.xi[:, 0], exact(over_step(np.asarray(path.t)), 2.5), rtol=1e-12)


# A free body in the plane with a mass that an actuator moves along a circle about the body's own mass centre.
BODY, LUMP, INERTIA, ARM = 3.0, 1.0, 0.7, 0.8


def _circle(t, numpy=np):
    return ARM * numpy.stack([numpy.cos(t), numpy.sin(t)])


def _carry(motion, h, p):
    """The place in the middle of the coming step, and the velocity over it, which takes the mass from end to end."""
    first, last = _circle(motion.t, jnp), _circle(motion.t + h, jnp)
    return co.mechanics.jumped({"place": 0.5 * (first + last), "velocity": (last - first) / h})


def _body_and_lump(xi, n, nu, p, *, internal):
    x, y = internal.place
    v = nu + xi[0] * jnp.stack([-y, x]) + internal.velocity
    return 0.5 * p.body * nu @ nu + 0.5 * p.inertia * xi @ xi + 0.5 * p.lump * v @ v


def carrier():
    p = co.Parameters(body=BODY, lump=LUMP, inertia=INERTIA)
    return co.System(co.SO2(), _body_and_lump, additional=co.Defining(), parameters=p, internal=_carry)


def at_rest(system, h):
    """All at rest but the mass: with no momentum, (ω, ν) is what the mass's velocity asks for."""
    first, last = _circle(0.0), _circle(h)
    start = system.state(q=[0.0, 0.0], internal={"place": 0.5 * (first + last), "velocity": (last - first) / h})
    return start.replace(mu=np.zeros(1), pi=np.zeros(2), from_velocities=False)


def _gap(h):
    """|R(T)r + x − …| against the closed form, T = 2: the mass centre rests, and the body turns by −κ t."""
    system = carrier()
    run = co.simulate(system, at_rest(system, h), dt=h, duration=2.0)
    reduced = LUMP * BODY / (LUMP + BODY) * ARM**2
    turned = -reduced / (INERTIA + reduced) * 2.0
    c, s = np.cos(turned), np.sin(turned)
    R = np.array([[c, -s], [s, c]])
    first, last = _circle(0.0), _circle(2.0)
    expected = LUMP / (LUMP + BODY) * (first - R @ last)
    assert np.max(np.abs(run.dataset.mu)) < 1e-14 and np.max(np.abs(run.dataset.pi)) < 1e-14
    assert run.summary()["energy_budget_error_max"] < 1e-12
    return np.max(np.abs(run.final.g - R)) + np.max(np.abs(run.final.q - expected))


@pytest.mark.long
def test_a_mass_that_is_moved_turns_a_free_body_without_momentum_to_the_closed_forms_angle():
    coarse, fine = _gap(0.05), _gap(0.025)
    assert fine < 2e-4
    assert np.log2(coarse / fine) == pytest.approx(2.0, abs=0.1)


@pytest.mark.long
def test_both_backends_and_an_interrupted_run_agree(tmp_path):
    system = carrier()
    start = system.state(q=[0.1, 0.2], qdot=[0.3, 0.1], xi=[0.4], internal=at_rest(system, H).internal.asdict())
    native, xla = (co.simulate(system, start, dt=H, steps=60, backend=backend) for backend in ("native", "xla"))
    for a, b in zip(jax.tree.leaves(native.final), jax.tree.leaves(xla.final), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-11, atol=1e-13)
    stored = co.simulate(system, start, dt=H, steps=60, store=tmp_path / "run", save_every=7)
    np.testing.assert_array_equal(stored.final.ledger, native.final.ledger)
    np.testing.assert_array_equal(co.resume(tmp_path / "run", system).final.mu, native.final.mu)


@pytest.mark.long
def test_the_budget_of_a_mass_that_is_moved_closes_to_the_methods_order():
    """With a potential n·n ℋ is not kept within a step: the gap is that of the method."""

    def sprung(xi, n, nu, p, *, internal):
        return _body_and_lump(xi, n, nu, p, internal=internal) - 9.81 * n @ n

    p = co.Parameters(body=BODY, lump=LUMP, inertia=INERTIA)
    system = co.System(co.SO2(), sprung, additional=co.Defining(), parameters=p, internal=_carry)

    def gap(h):
        internal = at_rest(carrier(), h).internal.asdict()
        run = co.simulate(system, system.state(q=[0.5, 0.2], xi=[0.4], internal=internal), dt=h, duration=2.0)
        return run.summary()["energy_budget_error_max"]

    assert np.log2(gap(0.02) / gap(0.01)) == pytest.approx(2.0, abs=0.2)


@pytest.mark.long
def test_gradients_go_through_a_mass_that_is_moved():
    system = carrier()

    def angle(lump):
        path = co.trajectory(system.replace(lump=lump), at_rest(system, H), dt=H, steps=20)
        return path.final.g[1, 0]

    with co.float64():
        slope = jax.grad(angle)(LUMP)
        step = 1e-5
        difference = (angle(LUMP + step) - angle(LUMP - step)) / (2 * step)
    assert slope == pytest.approx(difference, rel=1e-6)


def test_an_internal_state_without_a_rule_stays_as_it_starts():
    system = co.System(co.SO2(), _kinetic, parameters=PARAMETERS)
    run = co.simulate(system, system.state(xi=[1.0], internal={"radius": 2.0}), dt=H, steps=10)
    assert run.final.mu[0] == pytest.approx(4.0, rel=1e-15)
    assert "work_internal" not in run.dataset


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: turntable().state(xi=[1.0]), "takes `internal`: give the internal state of the start"),
        (lambda: turntable().state(xi=[1.0], internal={"r": 1.0}), "radius"),
        (
            lambda: co.System(co.SO2(), _kinetic, parameters=PARAMETERS, forces={"internal": lambda motion, p: None}),
            "other than `time`, `inputs` and `internal`",
        ),
        (
            lambda: co.simulate(
                turntable(), skater(turntable()), dt=H, steps=2, method=co.methods.VariableStep(co.Simpson(co.Cayley()))
            ),
            "internal states change",
        ),
        (lambda: reference(turntable(), skater(turntable()), [0.0, 1.0]), "compare with small steps"),
        (lambda: co.System(co.SO2(), lambda xi, p, *, intern: xi @ xi, parameters=PARAMETERS), "must take (xi, p)"),
    ],
)
def test_what_cannot_read_an_internal_state_is_refused_in_one_sentence(make, words):
    with pytest.raises(co.errors.CoadjointError) as caught:
        make()
    assert words in str(caught.value) and "\n" not in str(caught.value)
