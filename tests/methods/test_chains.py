"""Chains of links: runs by the structure of their coupling, momentum, resumed runs, and what is not coupled so."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError, LagrangianError
from coadjoint.kernels.newton.coupled import Coupled
from coadjoint.kernels.run import xla
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.simulation.problem import SimulationProblem

LINKS = Coupled(4, (3,), ((0, 1), (1, 2), (2, 3)))

LONG = 31
"""More links than native code writes out."""

WEIGHTS = np.array([1.0, 2.0, 1.5])


def chain(xi, a, p):
    """Rigid bodies on springs that turn a body back to where the one before it points."""
    return 0.5 * jnp.sum(p.inertia * xi * xi) + p.stiffness * jnp.sum(jnp.trace(a, axis1=1, axis2=2))


def bodies(count, coupling="chain", pairs=None, lagrangian=chain, stiffness=2.0, **more):
    """A chain of `count` bodies that turn about different axes."""
    system = co.System(
        co.Power(co.SO3(), count, coupling), lagrangian, advected=co.spaces.RelativePoses(pairs),
        parameters={"inertia": WEIGHTS, "stiffness": stiffness}, **more,
    )  # fmt: skip
    s = np.linspace(0, np.pi, count)
    return system, system.state(xi=np.stack([np.sin(s), 0.5 * np.cos(s), 0.2 + 0 * s], axis=1))


def spatial_momentum(system, records):
    def total(state):
        return jnp.sum(system.group.view(system.group.Ad_dual(system.group.inverse(state.g), state.mu)), axis=0)

    return records.each(total)


@pytest.mark.long
def test_a_long_chain_conserves_its_momentum_and_goes_on_to_the_bit():
    system, start = bodies(LONG)
    method = co.Midpoint()
    begun = method.begin_by_xla(system, method.begin(system, start, 0.05))
    program = StepProgram(replace_parameters(system, None), method, version="chain")

    def run(state, steps):
        return xla.run(program, Constants(system.parameters, None), state, 0.05, steps, 1, False)

    whole, first = run(begun, 60), run(begun, 25)
    momentum = spatial_momentum(system, whole.records)
    assert np.max(np.abs(momentum - momentum[0])) < 2e-14 * np.max(np.abs(momentum))
    assert whole.code == 0
    assert whole.iterations / whole.steps < 8
    # The factors of the last step belong to the state: in two pieces the run is the same to the bit.
    assert first.final.memory.h == 0.05
    rest = run(first.final, 35)
    for ours, theirs in zip(*map(jax.tree.leaves, (whole.final, rest.final)), strict=True):
        assert np.array_equal(ours, theirs)
    # They are no part of what is saved.
    assert whole.records.memory is None


@pytest.mark.long
def test_native_code_and_the_structure_of_the_coupling_find_the_same_motion():
    system, start = bodies(4, "ring", [(0, 1), (1, 2), (2, 3), (3, 0)])
    native, xla = (co.trajectory(system, start, dt=0.05, steps=20, backend=kind) for kind in ("native", "xla"))
    for ours, theirs in zip(*map(jax.tree.leaves, (native.final, xla.final)), strict=True):
        assert np.max(np.abs(ours - theirs), initial=0.0) < 1e-13


@pytest.mark.long
def test_native_code_takes_chains_of_small_links_as_far_as_it_compiles_soon():
    """30 links on SO(3), 60 that are not paired, 20 on a ring, 10 on SE(3); and the motion of 11 is that by XLA."""
    system, start = bodies(11)
    ours, theirs = (
        co.trajectory(system, start, dt=0.05, steps=20, backend=kind).final.replace(memory=None)
        for kind in ("auto", "xla")
    )
    for one, other in zip(*map(jax.tree.leaves, (ours, theirs)), strict=True):
        assert np.max(np.abs(one - other), initial=0.0) < 1e-13
    cases = [(30, "chain", True), (LONG, "chain", False), (60, (), True), (61, (), False)]
    for count, coupling, native in (*cases, (20, "ring", True), (21, "ring", False)):
        assert Coupled(count, (3,), co.Power(co.SO3(), count, coupling).pairs).native is native
    assert Coupled(10, (6,), co.Power(co.SE3(), 10).pairs).native
    assert not Coupled(11, (6,), co.Power(co.SE3(), 11).pairs).native


@pytest.mark.long
def test_a_long_chain_composed_of_substeps_is_of_order_four():
    system, start = bodies(LONG)

    def end(h):
        run = co.simulate(
            system, start, dt=h, duration=0.8, method=co.Suzuki4(co.Midpoint()), monitors=False, accuracy=False
        )
        assert run.plan.backend == "native"
        return run.final.mu

    exact, errors = end(0.0125), []
    for h in (0.2, 0.1):
        errors.append(np.max(np.abs(end(h) - exact)))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.2)


def dragged(motion, p):
    """A torque on the first link, and friction on all."""
    return co.Force(torque=(-0.1 * motion.xi).at[0].add(motion.inputs))


@pytest.mark.long
def test_a_long_chain_with_a_torque_and_friction_closes_its_balance_and_its_energy():
    """Theorem 7 to round-off; the energy changes by the work of the forces, to the order of the rule."""
    system, start = bodies(LONG, forces=dragged)
    torque = co.mechanics.Signal(lambda t: jnp.stack([0.3 * jnp.sin(t), 0.1 + 0 * t, 0.2 * t]))
    run = co.simulate(system, start, dt=0.02, steps=100, inputs=torque, accuracy=False)
    assert run.plan.backend == "native"
    assert run.largest("balance") < 1e-14
    assert run.largest("newton_residual") < 1e-14
    energy, t = run.dataset.energy.values, run.dataset.time.values
    xi = run.dataset.xi_step.values.reshape(len(t), LONG, 3)  # of the steps that start at the nodes, at their middle
    middle = t + 0.01
    applied = np.stack([0.3 * np.sin(middle), 0.1 + 0 * middle, 0.2 * middle], axis=1)
    power = np.einsum("ti,ti->t", applied, xi[:, 0]) - 0.1 * np.einsum("tni,tni->t", xi, xi)
    assert energy[-1] - energy[0] == pytest.approx(0.02 * np.sum(power[:-1]), rel=2e-3)
    assert abs(energy[-1] - energy[0]) > 0.01


@pytest.mark.long
def test_members_of_an_ensemble_of_long_chains_move_as_single_ones():
    values = np.array([1.5, 2.5])
    system, start = bodies(LONG, stiffness=co.each(values))
    together = co.simulate(system, start, dt=0.05, steps=40, monitors=False, accuracy=False)
    for member, value in enumerate(values):
        one, begin = bodies(LONG, stiffness=value)
        alone = co.simulate(one, begin, dt=0.05, steps=40, monitors=False, accuracy=False)
        for ours, theirs in ((together.final.mu[member], alone.final.mu), (together.final.a[member], alone.final.a)):
            assert np.max(np.abs(ours - theirs)) < 1e-12


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("stiffness", [2.0, co.each([2.0, 3.0])], ids=["alone", "together"])
def test_a_chain_that_native_code_takes_carries_its_factors_by_xla(stiffness):
    system, start = bodies(4, stiffness=stiffness)

    def begun(backend):
        run = SimulationProblem(system, start, co.Midpoint(), 0.05, 10, backend=backend).set_up()
        return run.position.state.memory

    assert begun("native") is None
    several = np.shape(start.t) if isinstance(stiffness, float) else (2,)
    for ours, one in zip(begun("xla"), LINKS.nothing(), strict=True):
        assert np.shape(ours) == (*several, *np.shape(one))


@pytest.mark.long
def test_its_motion_by_xla_is_that_of_native_code():
    system, start = bodies(4)
    ours, theirs = (
        co.simulate(system, start, dt=0.05, steps=30, backend=kind, monitors=False, accuracy=False).final
        for kind in ("native", "xla")
    )
    assert np.max(np.abs(ours.mu - theirs.mu)) < 1e-13


@pytest.mark.long
def test_the_card_tells_how_often_factors_were_computed():
    """Once in a slow motion; in a fast one as often as iterations went beyond eight with the same ones, at least."""
    system, start = bodies(4)
    slow, fast = (
        co.simulate(system, begun, dt=dt, steps=30, backend="xla", monitors=False, accuracy=False)
        for begun, dt in ((start, 0.01), (system.state(xi=6 * start.xi), 0.08))
    )
    assert slow.summary()["factor_renewals"] == 1
    assert fast.summary()["factor_renewals"] > 5
    assert (
        f"factors carry over from step to step, computed anew {fast.summary()['factor_renewals']} times"
        in fast.certificate.long()
    )


@pytest.mark.long
def test_a_pair_that_a_discrete_lagrangian_joins_is_named_too():
    def discrete(xi, h):
        return h * (0.5 * jnp.sum(xi**2) + 0.1 * xi[3] @ xi[17])

    system = co.System(co.Power(co.SO3(), 24), discrete_lagrangian=discrete)
    start = system.state(xi=0.1 * np.ones((24, 3)))
    with pytest.raises(ArgumentError, match="links 3 and 17 act on each other, but `coupling` of Power"):
        co.simulate(system, start, dt=0.05, steps=1, method=co.Variational(start="velocity"), accuracy=False)


def test_links_that_act_on_each_other_without_being_a_pair_are_named():
    def wrong(xi, a, p):
        return chain(xi, a, p)

    system, start = bodies(24, "chain", [(0, 1), (3, 17)], wrong)
    with pytest.raises(ArgumentError, match=r"links 3 and 17 act on each other, but `coupling` of Power"):
        co.trajectory(system, start, dt=0.05, steps=1)


@pytest.mark.long
def test_links_are_an_axis_of_what_the_lagrangian_and_forces_read():
    seen = {}

    def lagrangian(xi, a):
        seen.update(xi=xi.shape, down=a.down.shape)
        return 0.5 * jnp.sum(xi * xi) - jnp.sum(a.down[:, 2])

    def forces(motion):
        seen["motion"] = motion.xi.shape
        return co.Force(torque=-0.1 * motion.xi)

    system = co.System(co.Power(co.SO3(), 5), lagrangian, advected={"down": co.Defining()}, forces=forces)
    start = system.state(xi=np.ones((5, 3)), a0={"down": [0.0, 0.0, 1.0]})
    assert start.named.a.down.shape == (5, 3)
    assert np.array_equal(start.xi, np.ones(15))
    run = co.trajectory(system, start, dt=0.01, steps=2)
    assert seen == {"xi": (5, 3), "down": (5, 3), "motion": (5, 3)}
    assert np.max(np.abs(run.final.xi.reshape(5, 3) - run.final.xi[:3])) < 1e-15


def slings(count):
    """Rigid bodies with two points each on springs, and springs between neighbours' first points."""

    def lagrangian(xi, n, nu):
        own = 0.5 * jnp.sum(xi * xi * WEIGHTS) + 0.5 * jnp.sum(nu.first**2) + jnp.sum(nu.second**2)
        return own - jnp.sum(n.first**2) - 0.5 * jnp.sum((n.second - 0.3 * n.first) ** 2)

    points = {"first": co.Defining(), "second": co.Defining()}
    system = co.System(co.Power(co.SO3(), count), lagrangian, additional=points)
    s = np.linspace(0, 1, 3 * count).reshape(-1, 3)
    return system, system.state(xi=np.sin(9 * s), q={"first": s, "second": 1 - s}, qdot={"first": 0 * s, "second": s})


def test_two_additional_spaces_belong_to_each_link():
    system, start = slings(8)
    method = co.Midpoint()
    begun = method.begin(system, start, 0.05)
    assert begun.memory is None
    assert method.begin_by_xla(system, begun).memory.inverse.shape == (8, 9, 9)


def test_a_pair_that_is_missing_is_named_in_any_units():
    def light(xi, a, p):
        return 1e-12 * chain(xi, a, p)

    system, start = bodies(24, "chain", [(0, 1), (3, 17)], light)
    with pytest.raises(ArgumentError, match=r"links 3 and 17 act on each other"):
        co.Midpoint().begin(system, start, 0.05)


@pytest.mark.long
def test_links_that_act_on_each_other_only_where_they_move_are_named():
    def rare(xi, a, p):
        return chain(xi, a, p) + 0.1 * (xi[3] @ xi[17]) ** 2

    system, start = bodies(24, lagrangian=rare)
    with pytest.raises(ArgumentError, match=r"links 3 and 17 act on each other"):
        co.Midpoint().begin(system, start, 0.05)


def test_a_coupling_that_could_not_be_checked_is_told():
    def cracked(xi, a, p):
        return chain(xi, a, p) + jnp.sum(jnp.sqrt(a[:, 0, 0] - 1.0))

    system, start = bodies(24, "chain", None, cracked)
    with pytest.warns(UserWarning, match="was not checked, because"):
        co.Midpoint().begin(system, start, 0.05)


@pytest.mark.cases(2)
@pytest.mark.parametrize("joined", [0.0, 0.1], ids=["links alone", "links with kinetic energy together"])
@pytest.mark.parametrize("coupling", ["chain", "ring"])
def test_a_link_without_mass_is_named(coupling, joined):
    weights = np.ones((24, 3))
    weights[17, 1] = 0.0

    def lagrangian(xi):
        along = jnp.zeros_like(xi).at[3].set(xi[3] - xi[4])
        return 0.5 * jnp.sum(weights * xi * xi) + joined * jnp.sum(along**2)

    system = co.System(co.Power(co.SO3(), 24, coupling), lagrangian)
    with pytest.raises(LagrangianError, match=r"link 17 is singular: motion along \[0\.0, 1\.0, 0\.0\]"):
        co.simulate(system, system.state(xi=np.ones((24, 3))), dt=0.05, steps=1)


def test_a_chain_that_would_be_right_invariant_is_refused():
    with pytest.raises(ArgumentError, match="must be no power of a group where invariance"):
        co.System(co.Power(co.SO3(), 3), lambda xi: 0.5 * jnp.sum(xi * xi), invariance="right")
