"""Wrong uses of constraints: one clear error each, raised before the first step."""

from __future__ import annotations

import random

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from pinned import PIN, body, hold, lagrangian, pinned, start


def made(constraint, **more):
    """A system with the body's spaces and one constraint."""
    return body(constraints={"pin": constraint}, **more)


def holonomic(function, size=None):
    return made(co.Holonomic(function, size))


def nonholonomic(rows, right=None):
    return made(co.Nonholonomic(rows, right))


def run(system, begun=None, **more):
    return co.simulate(system, start(system) if begun is None else begun, dt=0.01, steps=1, accuracy=False, **more)


def bare(**more):
    """A body on SO(3) alone."""
    return co.System(co.SO3(), lambda xi: 0.5 * xi @ xi, **more)


def short(n, a, p):
    return n + jnp.asarray(PIN, dtype=jnp.float32)


def impure(n, a, p):
    return n + p.pin + 1e-9 * random.random()


def planned(**more):
    system = pinned(forces=lambda motion, p: co.Force(torque=motion.inputs.torque))
    inputs = {"torque": co.control.Input((3,))}
    return co.control.Problem(
        system, start(system), dt=0.1, steps=3, inputs=inputs, cost=lambda motion, p: motion.xi @ motion.xi, **more
    )


def massless():
    return co.System(
        co.SO3(),
        lambda xi, n, nu, p: 0.5 * xi @ xi,
        additional=co.Defining(),
        parameters=co.Parameters(pin=PIN),
        constraints={"pin": co.Holonomic(lambda n, p: n + p.pin)},
    )


def forced():
    return made(co.Holonomic(hold), forces={"pin": lambda motion, p: co.Force()})


def discrete():
    return co.System(
        co.SO3(),
        discrete_lagrangian=lambda xi, h: h * 0.5 * xi @ xi,
        constraints={"axis": co.Nonholonomic(lambda: [[0, 0, 1]])},
    )


def with_quantity():
    system = pinned(quantities={"reaction_pin": lambda state: state.t})
    return run(system)


def without_quadrature():
    system = body(
        constraints={"slip": co.Nonholonomic(lambda n, a, p: np.eye(6)[:1])},
        discrete_lagrangian=lambda xi, n, s, a, p, h: h * lagrangian(xi, n, (s - n) / h, a, p),
    )
    return run(system, start(system, xi=[0, 0, 0], qdot=[0, 0, 0]), method=co.Variational())


def rest(system):
    return start(system, xi=[0, 0, 0], qdot=[0, 0, 0])


def at_rest(function, kind=co.Holonomic):
    system = made(kind(function))
    return run(system, rest(system))


def lifted():
    """The body whose pin is moved by an input."""
    return holonomic(lambda n, a, p, *, inputs: n + p.pin - inputs.lift * a, size=3)


USES = {
    "a list": (lambda: body(constraints=[co.Holonomic(hold)]), r"`constraints` must be a dictionary of names"),
    "nothing in the dictionary": (lambda: body(constraints={}), r"`constraints` must be a dictionary of names"),
    "a name of two words": (lambda: body(constraints={"a pin": co.Holonomic(hold)}), r"name of a constraint must be a"),
    "a name of the budget": (lambda: body(constraints={"time": co.Holonomic(hold)}), r"name of a constraint must be a"),
    "a plain function": (lambda: body(constraints={"pin": hold}), r"`pin` must be co\.Holonomic\(function\) or"),
    "a number as function": (lambda: co.Holonomic(3.0), r"`function` must be a function, but is 3\.0"),
    "rows that are no function": (lambda: co.Nonholonomic([[0, 0, 1]]), r"`rows` must be a function, but is \[\[0"),
    "a right side that is no function": (lambda: co.Nonholonomic(hold, right=[0]), r"`right` must be a function"),
    "no rows by size": (lambda: co.Holonomic(hold, size=0), r"`size` must be .*, but is 0"),
    "a text as size": (lambda: co.Holonomic(hold, size="3"), r"`size` must be .*, but is '3'"),
    "too few arguments": (
        lambda: holonomic(lambda n: n),
        r"`pin` of this system must take \(n, a, p\)",
    ),
    "velocities": (lambda: holonomic(lambda n, nu, a, p: n), r"must take \(n, a, p\)"),
    "an order of its own": (lambda: holonomic(lambda a, n, p: n), r"must take \(n, a, p\) in this order"),
    "an internal state": (lambda: holonomic(lambda n, a, p, *, internal: n), r"`pin` cannot take `internal`"),
    "inputs without a size": (lambda: holonomic(lambda n, a, p, *, inputs: n), r"give its number of rows as `size`"),
    "a matrix": (
        lambda: holonomic(lambda n, a, p: np.eye(3)),
        r"row of numbers, but returns the shape \(3, 3\)",
    ),
    "no numbers": (lambda: holonomic(lambda n, a, p: []), r"`pin` returns no numbers: leave it out"),
    "None": (lambda: holonomic(lambda n, a, p: None), r"`pin` must return real numbers, but returns nothing"),
    "a complex number": (lambda: holonomic(lambda n, a, p: n[0] + 1j), r"`pin` must return real numbers"),
    "an error inside": (lambda: holonomic(lambda n, a, p: n + p.nail), r"The constraint `pin` raised .*nail"),
    "a branch on values": (lambda: holonomic(lambda n, a, p: n if n[0] > 0 else a), r"`pin` cannot be .* by JAX"),
    "float32": (lambda: run(holonomic(short)), r"The constraint `pin` holds float32 numbers"),
    "a random number": (lambda: run(holonomic(impure)), r"The constraint `pin` must be pure"),
    "rows of another width": (
        lambda: nonholonomic(lambda n, a, p: [[0, 0, 1]]),
        r"`pin` must return the rows A .* in the shape \(1, 6\), but returns the shape \(1, 3\)",
    ),
    "a right side of another size": (
        lambda: nonholonomic(lambda n, a, p: np.eye(6)[:2], lambda n, a, p: n),
        r"right side of the constraint `pin` must return its numbers \(m,\) in the shape \(2,\)",
    ),
    "another size than is given": (lambda: holonomic(hold, 2), r"in the shape \(2,\), but returns the shape \(3,\)"),
    "the name of a force": (forced, r"A force and a constraint must have different names, but both are .*`pin`"),
    "a discrete Lagrangian alone": (discrete, r"Constraints need velocities at nodes"),
    "more rows than velocities": (
        lambda: bare(constraints={"all": co.Nonholonomic(lambda: np.ones((4, 3)))}),
        r"`all` has 4 rows, more than the 3 velocities",
    ),
    "nothing to hold": (
        lambda: run(bare(constraints={"pin": co.Holonomic(lambda: 0.0)}), bare().state()),
        r"row of the constraint `pin` must restrict the velocities",
    ),
    "a start off the place": (
        lambda: run(pinned(), start(pinned(), q=[0, 0, 1])),
        r"start must satisfy the constraint `pin`, but \|φ\| is 0\.5",
    ),
    "a start off in velocity": (
        lambda: run(pinned(), start(pinned(), qdot=[0, 0, 0])),
        r"velocities of the start must satisfy the constraint `pin`, but \|φ̇\| is 1\.6",
    ),
    "a start that slips": (
        lambda: run(nonholonomic(lambda n, a, p: np.eye(6)[:1])),
        r"velocities of the start .* `pin`, but \|A·\(ξ, ν\) − b\| is 1:",
    ),
    "a row of zeros": (
        lambda: at_rest(lambda n, a, p: np.zeros((1, 6)), co.Nonholonomic),
        r"Every row of the constraint `pin` must restrict the velocities",
    ),
    "no number at the start": (
        lambda: at_rest(lambda n, a, p: jnp.sqrt(-1 - n @ n)),
        r"derivatives of the constraint `pin` must be finite at the start",
    ),
    "an impossible place": (
        lambda: holonomic(lambda n, a, p: n @ n + 1.0).project(start(pinned())),
        r"No state .* near this one: the start must satisfy the constraint `pin`, but \|φ\| is .*contradict each other",
    ),
    "a steady motion": (
        lambda: co.stability.steady_motion(pinned(), start(pinned())),
        r"Steady motions would leave out the reactions of the constraints .* minimal coordinates, such as the angles",
    ),
    "a projection of a state of another system": (
        lambda: pinned().project(bare().state()),
        r"`state` must be a state of `lagrangian`, but is",
    ),
    "a projection by float32": (
        lambda: (lambda system: system.project(start(system)))(holonomic(short)),
        r"`pin` holds float32 numbers",
    ),
    "a dictionary of numbers": (
        lambda: holonomic(lambda n, a, p: {"x": n}),
        r"`pin` must return real numbers in one array, but returns a dictionary",
    ),
    "two constraints of one variable": (
        lambda: body(constraints={"step_pin": co.Holonomic(hold), "pin": co.Holonomic(hold)}),
        r"`pin` and `step_pin` would both have the variable `reaction_step_pin`",
    ),
    "a projection onto a constraint without derivative": (
        lambda: (lambda system: system.project(start(system)))(holonomic(lambda n, a, p: (n + p.pin) @ (n + p.pin))),
        r"^Every row of the constraint `pin` must restrict the velocities, but one has no derivative",
    ),
    "a projection without kinetic energy": (
        lambda: massless().project(massless().state(q=-PIN)),
        r"`pin` needs an invertible mass matrix ∂²ℓ/∂\(ξ, ν\)², but it is singular at the start",
    ),
    "a projection without the inputs that are read": (
        lambda: (lambda system: system.project(start(system)))(lifted()),
        r"A constraint reads `inputs`, but there are none: give `inputs` to system\.state, or take system\.driven",
    ),
    "a projection of other members": (
        lambda: pinned().replace(mass=co.each([1.0, 2.0])).project(start(pinned(), xi=co.each(np.ones((3, 3))))),
        r"The system has 2 members, but the state has 3",
    ),
    "an optimal start": (
        lambda: planned(free_start={"g": 0.1}),
        r"the start of an optimal motion is fixed, .* leave `free_start` out",
    ),
    "an optimal place of the pin": (
        lambda: planned(parameters={"pin": (PIN - 0.1, PIN + 0.1)}),
        r"Constraints read the parameter `pin`, so that the start would leave them",
    ),
    "a pin that changes from solution to solution": (
        lambda: planned(changing=("mass", "pin")),
        r"Constraints read the parameter `pin`, so that the start would leave them",
    ),
    "a projection of a number": (lambda: pinned().project(3), r"`state` must be a state of `lagrangian`, but is 3"),
    "an input that jumps": (
        lambda: run(lifted(), inputs={"lift": lambda motion: 0.0 * motion.t}),
        r"`pin` reads the input `lift`, a function of the motion, .* such as co\.Linear",
    ),
    "a table that jumps": (
        lambda: run(lifted(), inputs={"lift": co.Held([0.0, 0.5], [0.0, 0.1])}),
        r"`pin` reads the input `lift`, a co\.Held that jumps, so that its place would jump",
    ),
    "a command that jumps": (
        lambda: co.Stepper(lifted(), start(lifted()), dt=0.01, inputs=("lift",)),
        r"`pin` reads the input `lift`, a command held over steps",
    ),
    "a reaction as a monitor": (
        lambda: run(pinned(), outputs=[co.Output(what="reaction_pin")]),
        r"This run has no monitor `reaction_pin`",
    ),
    "a projection onto nothing": (lambda: body().project(start(body())), r"no constraints to project a state onto"),
    "a quantity with a reaction's name": (with_quantity, r"quantity `reaction_pin` must have a name of its own"),
    "a method without quadrature": (without_quadrature, r"no quadrature on which co\.Nonholonomic could hold"),
}


@pytest.mark.parametrize("use", USES)
def test_a_wrong_use_raises_one_clear_error(use):
    wrong, sentence = USES[use]
    with pytest.raises((co.errors.ArgumentError, co.errors.LagrangianError), match=sentence) as raised:
        wrong()
    assert "\n" not in str(raised.value)


def test_a_state_off_a_curved_constraint_is_projected_onto_it():
    """|n|² = ℓ², which one correction of n does not meet."""
    system = holonomic(lambda n, a, p: jnp.stack([n @ n - p.pin @ p.pin]))
    far = start(system).replace(n=1.3 * PIN + np.array([0.1, -0.2, 0.05]))
    near = system.project(far)
    assert near.n @ near.n == pytest.approx(PIN @ PIN, rel=1e-14) and np.linalg.norm(near.n - far.n) > 0.05
    assert abs(near.n @ near.nu) < 1e-12


def test_one_state_is_projected_for_every_member():
    system = pinned()
    fleet = system.replace(pin=co.each([PIN, 1.1 * PIN]))
    found = fleet.project(start(system))
    np.testing.assert_allclose(found.n, [-PIN, -1.1 * PIN], atol=1e-14)
    np.testing.assert_allclose(found.nu, np.cross(found.xi, found.n), atol=1e-13)


def test_velocities_that_jump_with_an_input_are_reported():
    def right(*, inputs):
        return inputs.slip

    blade = co.Nonholonomic(lambda: [[0.0, 0.0, 1.0]], right, size=1)
    sleigh = co.System(co.SE2(), lambda xi: 0.5 * xi @ xi, constraints={"blade": blade})
    begun = sleigh.state(xi=[1.0, 0.0, 0.5], inputs={"slip": 0.5})
    jumping = {
        "a co.Held that jumps": co.Held([0.0, 0.5], [0.5, 1.0]),
        "a function of the motion": lambda motion: motion.xi[0],
        "": co.Linear([0.0, 0.5], [0.5, 1.0]),
    }
    for kind, slip in jumping.items():
        found = [s for s in sleigh.driven({"slip": slip}).check(begun) if "velocities on it jump" in s]
        assert len(found) == bool(kind) and kind in "".join(found)
    assert [s for s in sleigh.check(begun) if "velocities on it jump" in s] == []  # of no input is it known how it runs
