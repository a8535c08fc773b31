"""Short chains by XLA carry factors from step to step: runs on the disk, and steppers."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.run import xla


def bodies(stiffness):
    """Four rigid bodies on springs that turn a body back to where the one before it points."""

    def lagrangian(xi, a, p):
        springs = jnp.sum(jnp.trace(a, axis1=1, axis2=2))
        return 0.5 * jnp.sum(np.array([1.0, 2.0, 1.5]) * xi * xi) + p.stiffness * springs

    system = co.System(
        co.Power(co.SO3(), 4, "chain"),
        lagrangian,
        advected=co.spaces.RelativePoses(),
        parameters={"stiffness": stiffness},
    )
    s = np.linspace(0, np.pi, 4)
    return system, system.state(xi=np.stack([np.sin(s), 0.5 * np.cos(s), 0.2 + 0 * s], axis=1))


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("stiffness", [2.0, co.each([2.0, 3.0])], ids=["alone", "together"])
def test_a_run_goes_on_from_its_folder_to_the_bit(stiffness, tmp_path, monkeypatch):
    """Records and checkpoints of runs that carry factors: of one that was cut, and of one that has ended."""
    system, start = bodies(stiffness)
    given = {"dt": 0.05, "steps": 2000, "save_every": 100, "backend": "xla", "accuracy": False}
    whole = co.simulate(system, start, **given)
    name = "run" if isinstance(stiffness, float) else "run_ensemble"
    run, calls = getattr(xla, name), iter(range(3))

    def cut(*args, **keywords):
        if next(calls, None) is None:
            raise KeyboardInterrupt
        return run(*args, **keywords)

    with monkeypatch.context() as at:
        at.setattr(xla, name, cut)
        with pytest.raises(KeyboardInterrupt, match=r"goes on from the last checkpoint"):
            co.simulate(system, start, **given, store=tmp_path / "run")
    for _ in range(2):
        again = co.resume(tmp_path / "run", system)
        assert again.dataset.drop_attrs().identical(whole.dataset.drop_attrs())


@pytest.mark.long
def test_a_trajectory_by_xla_carries_its_factors_as_a_run_does():
    system, start = bodies(2.0)
    run = co.simulate(system, start, dt=0.05, steps=40, backend="xla", monitors=False, accuracy=False)
    path = co.trajectory(system, start, dt=0.05, steps=40, backend="xla")
    np.testing.assert_array_equal(path.final.mu, run.final.mu)
    native = co.trajectory(system, path.final, dt=0.05, steps=40, backend="native")
    again = co.trajectory(system, path.final, dt=0.05, steps=40, backend="xla")
    np.testing.assert_allclose(native.final.mu, again.final.mu, rtol=0, atol=1e-13)


@pytest.mark.long
def test_the_end_of_a_trajectory_within_jit_begins_the_next_one():
    """Without factors as the start has none: jax.lax.scan takes states of one structure alone."""
    system, start = bodies(2.0)
    begun = co.Midpoint().begin(system, start, 0.05)

    def path(state, _):
        return co.trajectory(system, state, dt=0.05, steps=2, backend="xla").final, None

    with co.float64():
        end = jax.eval_shape(lambda state: jax.lax.scan(path, state, length=3)[0], begun)
    assert jax.tree.structure(end) == jax.tree.structure(begun)


@pytest.mark.long
def test_a_stepper_by_xla_carries_its_factors_as_a_run_does_and_takes_states_without_them():
    system, start = bodies(2.0)
    ours, native = (co.Stepper(system, start, dt=0.05, backend=kind) for kind in ("xla", "native"))
    run = co.simulate(system, start, dt=0.05, steps=40, backend="xla", monitors=False, accuracy=False)
    ours.step(n=40)
    assert np.array_equal(ours.state.mu, run.final.mu)
    here = ours.state
    for stepper in (ours, native):
        ends = [stepper.trajectory(here, n=3, backend=kind).final for kind in ("auto", "native", "xla")]
        for state in (run.final, here):
            stepper.reset(state)
            stepper.step(n=3)
            ends.append(stepper.state)
        for end in ends:
            np.testing.assert_allclose(end.mu, ends[0].mu, rtol=0, atol=1e-13)
