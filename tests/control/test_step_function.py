"""The exported step is that of `co.simulate`: its equations vanish on runs, and it leads to the next node."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
import paper_vehicle
from coadjoint.control.problem_parts import Input
from coadjoint.control.stage import Begun, step_graph
from coadjoint.control.step_functions import functions_of
from coadjoint.control.transcribe import begun


def vehicle():
    made = paper_vehicle.system(
        forces=lambda motion, p: co.Force(torque=motion.inputs.u - 0.3 * motion.xi, force=-0.1 * motion.nu)
    )
    return made, paper_vehicle.start(made)


def rotor():
    """A free body with a wheel of the reduced kind: ℓ that is not quadratic in ξ."""
    made = co.System(
        co.SO3(),
        lambda xi, p: 0.5 * xi @ p.J @ xi + 0.1 * (xi @ xi) ** 2,
        parameters={"J": np.diag([1.0, 2.0, 3.0])},
        forces=lambda motion, p: co.Force(torque=motion.inputs.u),
    )
    return made, made.state(xi=[0.3, -0.2, 0.5])


def lagging():
    """A torque that follows its command with a lag, by an internal state and its mean over the step."""

    def rule(motion, h, p):
        late = jnp.exp(-h / p.lag)
        x, u = motion.internal.torque, motion.ahead.u
        return {"torque": co.mechanics.Course(u + (x - u) * late, u + (x - u) * (1 - late) * p.lag / h)}

    made = co.System(
        co.SE3(),
        lambda xi, p: 0.5 * xi @ p.M @ xi,
        parameters={"M": np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), "lag": 0.3},
        forces=lambda motion, p: co.Force(torque=jnp.concatenate([motion.internal.torque, jnp.zeros(3)])),
        internal=rule,
    )
    return made, made.state(xi=[0.1, 0.2, -0.3, 0.5, 0.1, 0.0], internal={"torque": np.zeros(3)})


def pendulum():
    """A point on the sphere, driven along a fixed axis: a curved space of q."""
    made = co.System(
        co.SO3(),
        lambda xi, n, nu, p: 0.5 * xi @ p.J @ xi + 0.5 * p.m * nu @ nu - n[2],
        additional=co.Sphere(co.Defining()),
        parameters={"J": np.diag([1.0, 2.0, 3.0]), "m": 0.7},
        forces=lambda motion, p: co.Force(torque=motion.inputs.u),
    )
    return made, made.state(q=[0.6, 0.0, 0.8], qdot=[0.0, 0.3, 0.0], xi=[0.1, 0.0, 0.2])


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("build", "method"),
    [
        (vehicle, co.LeftRectangle()),
        (vehicle, co.Midpoint(co.Exponential())),
        (vehicle, co.Suzuki4(co.Trapezoidal(), negative_substeps="allow")),
        (rotor, co.Midpoint()),
        (rotor, co.Galerkin(degree=2)),
        (lagging, co.Midpoint()),
        (pendulum, co.Simpson()),
    ],
    ids=lambda x: getattr(x, "__name__", None) or x.title,
)
def test_the_equations_vanish_on_a_run_and_the_step_leads_to_its_next_node(build, method):
    system, start = build()
    h, steps = 0.05, 6
    rng = np.random.default_rng(7)
    torques = rng.normal(size=(steps, 3))
    signal = co.Held(h * np.arange(steps), torques)
    run = co.simulate(
        system, start, dt=h, steps=steps, method=method, inputs={"u": lambda motion: signal(motion.t + h / 2)},
        monitors=False,
    )  # fmt: skip
    beginning = begun(system, start, h, method, {"u": Input((3,))})
    graph = step_graph(beginning)
    live = graph.needed(graph.symbols.state)
    equations = functions_of(graph, [], live, [], [], [], [], [], {}).equations
    x = graph.numbers(run.records)[:, live]
    assert x[0] == pytest.approx(graph.numbers(beginning.state)[live], abs=0)
    size = len(graph.symbols.unknowns)
    if size == len(run.records.xi[0]) + len(run.records.nu[0]) and system.additional.flat:
        unknowns = np.concatenate([run.records.xi, run.records.nu], axis=1)
    else:
        unknowns = np.array([solved(equations, x[k], torques[k], size, h) for k in range(steps)])
    scale = np.max(np.abs(x))
    for k in range(steps):
        residual, following = (y.full().ravel() for y in equations(x[k], torques[k], unknowns[k], [], h))
        assert np.max(np.abs(residual)) < 1e-12 * scale
        assert following == pytest.approx(x[k + 1], abs=1e-12 * scale)
        wrong = equations(x[k], torques[k] + 1e-3, unknowns[k], [], h)[0].full()
        assert np.max(np.abs(wrong)) > 1e-6


def solved(equations, x, u, size, h):
    """z of a step by CasADi's Newton iteration."""
    import casadi as ca

    z = ca.MX.sym("z", size)
    newton = ca.rootfinder("newton", "newton", {"x": z, "g": equations(x, u, z, [], h)[0]}, {"abstol": 1e-14})
    return newton(x0=np.zeros(size))["x"].full().ravel()


def test_an_exported_step_is_saved_and_names_what_it_depends_on(tmp_path):
    import casadi as ca

    system, start = vehicle()
    step = co.control.step_function(system, start, 0.1, inputs={"u": Input((3,))}, parameters=("mass",))
    assert step.unknowns == 6 and step.h == 0.1 and len(step.start) == len(step.names)
    assert {name.partition("[")[0] for name in step.names} == {"t", "g", "n", "a", "mu", "pi"}
    assert step.function.size_in("p") == (1, 1)
    step.function.save(str(tmp_path / "step.casadi"))
    again = ca.Function.load(str(tmp_path / "step.casadi"))
    given = step.start, [0.1, 0.2, 0.3], np.full(6, 0.2), [120.0], 0.1
    for one, other in zip(step.function(*given), again(*given), strict=True):
        assert np.array_equal(one.full(), other.full())
    light, heavy = (step.function(*given[:3], [m], 0.1)[0].full() for m in (120.0, 130.0))
    assert np.max(np.abs(light - heavy)) > 1e-3


def test_a_method_that_chooses_its_steps_is_refused():
    system, start = vehicle()
    with pytest.raises(co.errors.ArgumentError, match="with fixed steps"):
        step_graph(Begun(system, co.methods.VariableStep(), 0.1, start))
