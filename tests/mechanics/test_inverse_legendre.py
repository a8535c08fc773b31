"""Velocities from momenta: against closed forms, and what is said where they are not found."""

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import StepError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics import continuous, inverse_legendre
from coadjoint.mechanics.copies import replace_parameters


def velocities(system, state):
    def found(state, parameters):
        return inverse_legendre.velocities(replace_parameters(system, parameters), state)

    return evaluate(found, state, system.parameters)


def quartic(inertia):
    """ℓ = ½|ξ|² + ½ε ν² + ¼ν⁴ − ½n²: the inertia ε + 3ν² all but vanishes at each turn of the swing."""

    def lagrangian(xi, n, nu):
        return 0.5 * xi @ xi + 0.5 * inertia * nu @ nu + 0.25 * (nu @ nu) ** 2 - 0.5 * n @ n

    return co.System(co.SO3(), lagrangian, additional=co.Trivial(1))


def closed_form(inertia, momentum):
    """The real root ν of εν + ν³ = π, by Cardano's formula in hyperbolic functions."""
    scale = 2 * np.sqrt(inertia / 3)
    return scale * np.sinh(np.arcsinh(3 * momentum / (inertia * scale)) / 3)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("dt", [0.1, 0.03])
@pytest.mark.parametrize("inertia", [1e-2, 1e-4])
def test_energy_of_a_lagrangian_that_is_not_quadratic_is_that_of_the_closed_form(inertia, dt):
    system = quartic(inertia)
    start = system.state(q=[1.0], qdot=[0.5], xi=[0.3, 0.1, 0.0])
    run = co.simulate(system, start, dt=dt, duration=15)
    n, nu = run.records.n[:, 0], closed_form(inertia, run.records.pi[:, 0])
    energy = 0.5 * np.sum(run.records.mu**2, axis=1) + 0.5 * inertia * nu**2 + 0.75 * nu**4 + 0.5 * n**2
    np.testing.assert_allclose(run.monitors["energy"], energy, rtol=0, atol=1e-12)
    assert run.largest("legendre_residual") < 1e-12
    assert "Legendre  " in run.certificate.long() and not any(
        "inverse Legendre" in sentence for sentence in run.warnings
    )


def test_one_linear_solve_is_exact_where_the_lagrangian_is_quadratic():
    """With a full mass matrix and terms linear in the velocities; nothing has to converge, and no residual is kept."""
    seed = 5
    print(f"seed {seed}")
    random = np.random.default_rng(seed)
    root = random.normal(size=(6, 6))
    mass, drift = root @ root.T + np.eye(6), random.normal(size=(3, 3))

    def lagrangian(xi, n, nu, p):
        v = jnp.concatenate([xi, nu])
        return 0.5 * v @ p.mass @ v + (p.drift @ n) @ nu

    system = co.System(co.SO3(), lagrangian, additional=co.Defining(), parameters={"mass": mass, "drift": drift})
    xi, qdot = random.normal(size=3), random.normal(size=3)
    begun = system.state(q=random.normal(size=3), xi=xi, qdot=qdot)
    elsewhere = begun.replace(xi=10 * random.normal(size=3), nu=10 * random.normal(size=3))
    found = velocities(system, elsewhere)
    assert found.residual is None
    np.testing.assert_allclose(np.concatenate(found[:2]), np.concatenate([xi, begun.nu]), rtol=0, atol=1e-12)


def test_momenta_without_velocities_are_told_not_computed_with():
    """∂_νℓ = tanh ν never is 1.5: the residual tells, and the reference solution refuses the record."""

    def lagrangian(xi, n, nu):
        return 0.5 * xi @ xi + jnp.sum(jnp.log(jnp.cosh(nu)))

    system = co.System(co.SO3(), lagrangian, additional=co.Trivial(1))
    beyond = system.state(q=[0.0], qdot=[0.2]).replace(pi=np.array([1.5]), from_velocities=False)
    assert velocities(system, beyond).residual > 0.1
    with pytest.raises(StepError, match=r"inverse Legendre transform did not converge, with a residual of 3\.\de-01"):
        continuous.reference(system, beyond, [0.1])


@pytest.mark.long
def test_a_run_whose_node_velocities_are_not_found_says_that_its_energy_is_not_known(monkeypatch):
    monkeypatch.setattr(inverse_legendre, "TRIPS", 0)
    system = quartic(0.0101)
    run = co.simulate(system, system.state(q=[1.0], qdot=[0.5]), dt=0.1, duration=5)
    assert run.largest("legendre_residual") > inverse_legendre.SOLVED
    assert any("The energy is not known at every node" in sentence for sentence in run.warnings)
    assert "energy            not known, see the warning" in run.certificate.long()


ARM, INERTIA = np.array([0.1, 0.05, 0.4]), np.array([1.0, 1.7, 2.3])


def swinging():
    """ℓ = ½ξ·Jξ + ½|ν|² + ξ·(r×ν) + 0.05|ν|⁴ and ν ≈ 4 with ξ = −J⁻¹(r×ν), so that μ = Jξ + r×ν is round-off."""

    def lagrangian(xi, n, nu):
        return 0.5 * xi @ (INERTIA * xi) + 0.5 * nu @ nu + xi @ jnp.cross(ARM, nu) + 0.05 * (nu @ nu) ** 2

    system = co.System(co.SO3(), lagrangian, additional=co.Defining())
    nu = np.array([2.1, -3.0, 1.7])
    return system, system.state(q=[0.3, 0, 1.0], qdot=nu, xi=-np.cross(ARM, nu) / INERTIA)


@pytest.mark.cases(1)
@pytest.mark.parametrize("mu", [0.0, 1e-17, 1e-12, 1e-3])
def test_a_momentum_that_is_what_cancellation_left_has_velocities_to_round_off(mu):
    """The residual of μ counts beside what ξ and ν alone would give, r×ν ≈ 1.3, however small μ is."""
    system, there = swinging()
    assert np.max(np.abs(there.mu)) < 1e-15 < 10 < np.max(np.abs(there.pi))
    wanted = mu * np.array([0.3, -0.5, 1.0])
    begun = there.replace(mu=wanted, xi=1.2 * there.xi, nu=0.9 * there.nu, from_velocities=False)
    found = velocities(system, begun)
    assert found.residual <= 1e-14
    np.testing.assert_allclose(INERTIA * found.xi + np.cross(ARM, found.nu), wanted, rtol=0, atol=2e-15)
    if mu < 1e-10:
        np.testing.assert_allclose(found.nu, there.nu, rtol=0, atol=1e-11)
    stopped = system.state(q=there.q, qdot=[1e-9, 0, 0], xi=[0, 0, 1e-9]).replace(mu=wanted, pi=np.zeros(3))
    still = velocities(system, stopped.replace(from_velocities=False))
    assert still.residual <= 1e-14


@pytest.mark.cases(1)
@pytest.mark.parametrize("off", [1e-3, 1e-6])
@pytest.mark.parametrize("mu", [0.0, 1e-17, 1e-12])
def test_what_has_not_converged_beside_a_cancelled_momentum_is_told(mu, off, monkeypatch):
    monkeypatch.setattr(inverse_legendre, "TRIPS", 0)
    monkeypatch.setattr(inverse_legendre, "PLAIN_TRIPS", 0)
    system, there = swinging()
    wanted = mu * np.array([0.3, -0.5, 1.0])
    begun = there.replace(mu=wanted, xi=(1 + off) * there.xi, from_velocities=False)
    assert 0.1 * off < velocities(system, begun).residual < 10 * off
    begun = there.replace(mu=wanted, nu=(1 + off) * there.nu, from_velocities=False)
    assert 0.1 * off < velocities(system, begun).residual < 10 * off


@pytest.mark.long
def test_a_run_whose_momentum_is_zero_knows_its_energy():
    system, there = swinging()
    run = co.simulate(system, there, dt=0.01, steps=100)
    assert run.largest("legendre_residual") < 1e-13
    assert not any("energy is not known" in sentence for sentence in run.warnings)


@pytest.mark.parametrize(
    ("xi", "nu", "mu", "sizes"), [(2.0, 0.5, 0.0, (2, 6)), (0.1, 1.0, 0.0, (3, 10)), (2.0, 0.5, 7.0, (7, 6))]
)
def test_a_residual_is_relative_to_the_parts_of_momenta_that_cancel(xi, nu, mu, sizes):
    """μ = ξ + 3ν and π = 3ξ + 10ν, of which either part alone may be larger than the sum."""
    system = co.System(co.SO2(), lambda xi, n, nu: 0.5 * xi @ xi + 3 * xi @ nu + 5 * nu @ nu, additional=co.Trivial(1))
    state = system.state(q=[0.0], xi=[0.0]).replace(mu=np.array([mu]), pi=np.zeros(1))
    found = evaluate(lambda s: inverse_legendre._Problem(system, s).sizes(jnp.array([xi, nu])), state)
    assert found == pytest.approx(sizes)
