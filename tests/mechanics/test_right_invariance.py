"""Right-invariant systems: ξ = ġg⁻¹, n = gq, a = ga₀, and the momentum in the body is conserved."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import coadjoint as co
from coadjoint import theory
from coadjoint.errors import ArgumentError, GroupError

GL2 = co.MatrixGroup(np.eye(4).reshape(4, 2, 2), name="GL(2)")
WEIGHTS = np.array([1.0, 2.0, 1.5, 3.0])
START = {
    "g": [[1.1, 0.2], [-0.1, 0.9]],
    "xi": [0.3, -0.2, 0.4, 0.1],
    "q": [0.5, -0.4],
    "qdot": [0.2, 0.3],
    "a0": [0.7, 0.6],
}


def coupled(xi, n, nu, a):
    """Velocities that are coupled, in a field of n and a."""
    U = xi.reshape(2, 2)
    return 0.5 * xi @ (WEIGHTS * xi) + 0.5 * nu @ nu + 0.3 * nu @ (U @ a) - 0.5 * n @ n - 0.2 * (n @ a) ** 2


def right(**more) -> co.System:
    spaces = {"additional": co.Defining(), "advected": co.Defining()}
    return co.System(GL2, coupled, **spaces, invariance="right", name="coupled", **more)


def direct(duration: float) -> dict[str, np.ndarray]:
    """The equations written out in matrices, with U = ġg⁻¹ and ⟨M, U⟩ = tr MᵀU, by an explicit method:

    Ṁ = MUᵀ − UᵀM + ∂_nℓ nᵀ + ∂_aℓ aᵀ + π νᵀ, π̇ = ∂_nℓ − Uᵀπ, ġ = Ug, ṅ = ν + Un, ȧ = Ua.
    """

    def velocities(M, p, a):
        mass = np.diag(np.append(WEIGHTS, [1.0, 1.0]))
        for i in range(2):
            mass[2 * i : 2 * i + 2, 4 + i] = mass[4 + i, 2 * i : 2 * i + 2] = 0.3 * a
        both = np.linalg.solve(mass, np.append(M, p))
        return both[:4].reshape(2, 2), both[4:]

    def slope(t, y):
        M, g, (p, n, a) = y[:4].reshape(2, 2), y[4:8].reshape(2, 2), y[8:].reshape(3, 2)
        U, nu = velocities(M.ravel(), p, a)
        along_n, along_a = -n - 0.4 * (n @ a) * a, 0.3 * U.T @ nu - 0.4 * (n @ a) * n
        moving = M @ U.T - U.T @ M + np.outer(along_n, n) + np.outer(along_a, a) + np.outer(p, nu)
        return np.concatenate([moving.ravel(), (U @ g).ravel(), along_n - U.T @ p, nu + U @ n, U @ a])

    g = np.array(START["g"])
    U, n, nu, a = np.reshape(START["xi"], (2, 2)), g @ START["q"], g @ START["qdot"], g @ START["a0"]
    M, p = WEIGHTS.reshape(2, 2) * U + 0.3 * np.outer(nu, a), nu + 0.3 * U @ a
    y = solve_ivp(slope, (0, duration), [*M.ravel(), *g.ravel(), *p, *n, *a], "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    return {"mu": y[:4], "g": y[4:8].reshape(2, 2), "pi": y[8:10], "n": y[10:12], "a": y[12:]}


@pytest.mark.long
def test_a_run_follows_the_right_invariant_equations_written_out_in_matrices():
    system = right()
    method = co.methods.KahanLi6(co.Midpoint(co.Exponential()))
    run = co.simulate(
        system, system.state(**START), dt=0.05, duration=1.0, method=method, accuracy=False, monitors=False
    )
    for name, expected in direct(1.0).items():
        np.testing.assert_allclose(getattr(run.final, name), expected, atol=2e-9, err_msg=name)


J = np.array([1.0, 2.0, 3.5])
CENTRE = np.array([0.2, -0.1, 0.4])


def heavy_left(xi, a):
    return 0.5 * xi @ (J * xi) - CENTRE @ a


def heavy_right(xi, a):
    """With ω in space: the axes of inertia and the mass centre are carried along, gravity stays."""
    along = jnp.stack([xi @ a.x, xi @ a.y, xi @ a.z])
    return 0.5 * along @ (J * along) - a.centre[2]


class TestOneBodyBothWays:
    """A heavy body seen from itself and from space: ξ = R⁻¹ω, and Cayley's map goes along."""

    R = co.attitude.zyx(0.3, -0.2, 0.5)
    omega = np.array([0.4, 1.0, -0.3])

    def runs(self, **options):
        body = co.System(co.SO3(), heavy_left, advected=co.Defining(), name="heavy")
        carried = {name: co.Defining() for name in ("x", "y", "z", "centre")}
        space = co.System(co.SO3(), heavy_right, advected=carried, invariance="right", name="heavy")
        axes = dict(zip("xyz", np.eye(3), strict=True))
        first = body.state(g=self.R, xi=self.R.T @ self.omega, a0=[0, 0, 1])
        second = space.state(g=self.R, xi=self.omega, a0={**axes, "centre": CENTRE})
        return [
            co.simulate(s, at, dt=0.05, steps=200, accuracy=False, **options)
            for s, at in ((body, first), (space, second))
        ]

    @pytest.mark.long
    @pytest.mark.cases(1)
    @pytest.mark.parametrize("method", [co.Midpoint(), co.Trapezoidal(co.Exponential())], ids=["midpoint", "trapezoid"])
    def test_the_motions_are_the_same_to_round_off(self, method):
        body, space = self.runs(method=method)
        R = body.records.g
        np.testing.assert_allclose(space.records.g, R, atol=1e-12)
        np.testing.assert_allclose(space.records.xi, np.einsum("tij,tj->ti", R, body.records.xi), atol=1e-12)
        np.testing.assert_allclose(space.records.mu, np.einsum("tij,tj->ti", R, body.records.mu), atol=1e-12)
        np.testing.assert_allclose(space.monitors["energy"], body.monitors["energy"], atol=1e-13)
        np.testing.assert_allclose(space.dataset.xi_body, body.dataset.xi, atol=1e-12)
        np.testing.assert_allclose(space.dataset.a_z, R[:, :, 2], atol=1e-12)


@pytest.mark.long
def test_the_momentum_in_the_body_stays_where_no_parameter_takes_part():
    free = co.System(co.SO3(), lambda xi: 0.5 * xi @ (J * xi), invariance="right")
    start = free.state(g=co.attitude.zyx(0.1, 0.2, 0.3), xi=[0.5, -1.0, 0.2])
    run = co.simulate(free, start, dt=0.05, steps=100, accuracy=False)
    mu, R = run.records.mu, run.records.g
    body = np.einsum("tji,tj->ti", R, mu)
    assert np.max(np.abs(body - body[0])) < 1e-13
    assert np.max(np.abs(mu - mu[0])) > 0.5
    np.testing.assert_allclose(run.dataset.kelvin_noether, body, atol=1e-14)
    assert run.relative_change("energy") < 1e-3


def damped(invariance="right", quantities=None) -> co.System:
    """A body in a medium at rest that brakes it, as seen from space."""

    def brake(motion):
        return co.Force(torque=-0.3 * motion.xi)

    def energy(xi, a):
        return 0.5 * xi @ (J * xi) + 0.2 * (xi @ a) ** 2

    options = {"advected": co.Defining(), "forces": brake, "quantities": quantities or {}}
    return co.System(co.SO3(), energy, **options, invariance=invariance, name="damped")


@pytest.fixture(scope="module")
def system() -> co.System:
    def rate_along(state):
        """The rate about the axis a."""
        return state.xi @ state.a

    return damped(quantities={"rate_along": rate_along})


@pytest.fixture(scope="module")
def start(system):
    return system.state(g=co.attitude.zyx(0.1, 0.2, 0.3), xi=[0.5, -1.0, 0.2], a0=[1, 0, 0])


@pytest.fixture(scope="module")
def run(system, start):
    return co.simulate(system, start, dt=0.02, steps=100, accuracy=False)


def test_a_start_is_in_the_right_frame(system, start):
    R = start.g
    np.testing.assert_allclose(start.xi, [0.5, -1.0, 0.2])
    np.testing.assert_allclose(start.a, R @ [1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(start.mu, J * start.xi + 0.4 * (start.xi @ start.a) * start.a, atol=1e-15)
    assert (system.invariance, damped("left").invariance) == ("right", "left")


@pytest.mark.long
def test_datasets_and_the_card_name_the_frames(run):
    data = run.dataset
    assert "damped on SO3(), right-invariant" in str(run)
    assert (data.attrs["group"], data.attrs["invariance"]) == ("SO3()", "right")
    assert "xi_spatial" not in data
    assert data.xi.attrs["long_name"].startswith("ξ = ġg⁻¹")
    assert data.xi_body.attrs["long_name"] == "Ad_{g⁻¹} ξ, body frame"
    np.testing.assert_allclose(data.xi_body, np.einsum("tji,tj->ti", data.R, data.xi), atol=1e-14)
    assert "space" in run.plot.velocities().axes[0].get_ylabel()


def test_forces_and_quantities_read_the_right_velocity(run):
    xi, a = run.records.xi, run.records.a
    at_node = run.dataset.xi.values
    np.testing.assert_allclose(run.monitors["rate_along"], np.sum(at_node * a, axis=1), atol=1e-15)
    spent = -0.3 * np.sum(np.sum(xi[:-1] ** 2, axis=1)) * 0.02
    assert run.monitors["work_forces"][-1] == pytest.approx(spent, rel=1e-3)
    assert run.summary()["energy_budget_error_max"] < 2e-5
    assert run.summary()["kelvin_noether_budget_error_max"] < 1e-13


def test_a_stepper_does_the_same_to_the_bit(system, start):
    stepper = co.Stepper(system, start, dt=0.02)
    for _ in range(20):
        stepper.step()
    final = co.simulate(system, start, dt=0.02, steps=20, accuracy=False, monitors=False).final
    np.testing.assert_array_equal(stepper.state.g, final.g)
    np.testing.assert_array_equal(stepper.state.mu, final.mu)


@pytest.mark.long
def test_files_hold_the_run_to_the_bit_and_are_told_from_those_of_a_left_invariant_one(system, start, run, tmp_path):
    run.save(tmp_path / "run.nc")
    co.simulate(system, start, dt=0.02, steps=100, accuracy=False, store=tmp_path / "store")
    for final in (co.load(tmp_path / "run.nc", system).final, co.resume(tmp_path / "store", system).final):
        np.testing.assert_array_equal(final.g, run.final.g)
        np.testing.assert_array_equal(final.mu, run.final.mu)
    with pytest.raises(ArgumentError, match=r"run on SO3\(\), right-invariant, but the system .* lives on SO3\(\)\."):
        co.load(tmp_path / "run.nc", damped("left")).final  # noqa: B018


def test_printed_equations_hold_along_a_right_invariant_run(system):
    free = system.unforced
    run = co.simulate(free, free.state(xi=[0.5, -1.0, 0.2], a0=[1, 0, 0]), dt=0.02, steps=5, accuracy=False)
    found = theory.printed_equations(run)
    assert found.worst.largest < 1e-12, found
    assert str(found).startswith("right-invariant: products are those of the opposite group, g·h = hg")
    g, a = run.records.g, run.records.a
    np.testing.assert_allclose(a, np.einsum("kij,j->ki", g, a[0]), atol=1e-13)  # as it says, g_k a₀ from g = 1


def test_what_is_no_side_and_a_group_that_is_opposite_already_are_refused():
    with pytest.raises(ArgumentError, match='must be "left" or "right", but is \'both\''):
        damped("both")
    with pytest.raises(ArgumentError, match=r"must be the group itself, SO3\(\)"):
        co.System(co.groups.Opposite(co.SO3()), lambda xi: xi @ xi, invariance="right")
    with pytest.raises(GroupError, match="Opposite must be a Lie group"):
        co.groups.Opposite("SO3")  # type: ignore[arg-type]
    with pytest.raises(GroupError, match="must carry a left action"):
        co.System(co.SO3(), lambda xi, a: xi @ xi, advected=ByRight(), invariance="right")


class ByRight(co.Defining):
    """A right action, v ↦ g⁻¹v."""

    def act(self, group, g, x):
        return group.matrix(group.inverse(g)) @ x
