"""Wrong uses over all packages, each of which raises one sentence before anything is computed."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint import spaces, theory
from coadjoint.errors import CoadjointError, FileError
from coadjoint.identification import Log
from coadjoint.identification.synthetic import synthetic_log
from coadjoint.mechanics.inputs import inputs_from
from coadjoint.models import kirchhoff, manakov
from coadjoint.simulation.steppers.fmu import save_fmu
from coadjoint.spaces.named import Named
from coadjoint.stability import steady_motion
from coadjoint.texts import DEEPEST, read_table

SO3 = co.SO3()
BODY = co.System(SO3, lambda xi, p: 0.5 * p.inertia * xi @ xi, parameters={"inertia": 2.0})
BARE = co.System(SO3, lambda xi: 0.5 * xi @ xi)
POINT = co.System(SO3, lambda xi, n, nu: 0.5 * xi @ xi + 0.5 * nu @ nu, additional=co.Defining())
TURNING = co.System(SO3, lambda xi, n, nu: 0.5 * xi @ xi + jnp.sum(nu * nu), additional=spaces.GroupItself())
ROUND = co.System(SO3, lambda xi, n, nu: 0.5 * xi @ xi + 0.5 * nu @ nu, additional=co.Sphere())
NESTED = co.System(
    SO3, lambda xi, p: 0.5 * p.mass * xi @ xi, parameters={"mass": 1.0, "hull": {"a": 1.0, "b": 2.0}}
)  # fmt: skip
TIMED = co.System(SO3, lambda xi, *, t: 0.5 * (1 + t) * xi @ xi)
PUSHED = co.System(
    SO3, lambda xi: 0.5 * xi @ xi, forces=lambda motion: co.Force(torque=jnp.sin(motion.t) * jnp.ones(3))
)
Case = tuple[Callable[[], Any], str]

GROUPS: dict[str, Case] = {
    "no factor": (lambda: co.DirectProduct(), "needs at least one factor"),
    "a factor that is a number": (lambda: co.DirectProduct(SO3, 3), "must be a Lie group such as co.SO3"),
    "a half that is no map": (lambda: co.difference_maps.Squared(3), "Squared must be a difference map such as co.C"),
    "no space": (lambda: spaces.Several({}), "must hold at least one space, but is empty"),
    "spaces in a list": (lambda: spaces.Several([co.Defining()]), "must be a dictionary of spaces"),
    "a space that is a number": (lambda: spaces.Several({"a": 3}), "must map names to spaces, .*, but has 'a': 3"),
    "a space whose name is no word": (lambda: spaces.Several({"a b": co.Defining()}), "must map names to spaces"),
    "a change in place": (lambda: setattr(Named(a=1), "a", 2), "make a copy with replace"),
    "another name": (lambda: Named(a=1).replace(b=2), "no `b` to replace; there is: a"),
    "a name that is a number": (lambda: Named(a=1).replace(c=1), "no `c` to replace"),
    "a velocity of a group by its algebra": (
        lambda: TURNING.state(q=np.eye(3), qdot=[1, 2, 3]),
        r"`qdot` must have the structure of an element of .*, arrays of shape \(3, 3\), but holds 3 numbers",
    ),
    "points in words": (lambda: POINT.state(q="east"), "`q` must hold 3 numbers, but is 'east'"),
}  # fmt: skip
MECHANICS: dict[str, Case] = {
    "a keyword of a system": (lambda: co.System(SO3, lambda xi: xi @ xi, aditional=3), "do you mean `additional`"),
    "a keyword of a state": (lambda: BODY.state(omega=[0, 0, 1]), "System.state takes no argument `omega`: it takes g"),
    "inputs of members": (
        lambda: BODY.state(xi=[0, 0, 1], inputs={"u": co.each([1.0, 2.0])}), "`inputs` has one value for all members",
    ),
    "members in a copy of a state": (
        lambda: BARE.state().replace(mu=co.each(np.eye(3))), "`mu` must be of one member: give co.each to system.state",
    ),
    "a keyword of a run": (lambda: co.simulate(BARE, BARE.state(), dt=0.1, step=3), "do you mean `steps`"),
    "a keyword of a trajectory": (lambda: co.trajectory(BARE, BARE.state(), h=0.1), "no argument `h`: it takes system"),
    "a keyword of a stepper": (lambda: co.Stepper(BARE, BARE.state(), dt=0.1, input=()), "do you mean `inputs`"),
    "a time of several numbers": (lambda: BODY.state(t=[0.0, 1.0]), "`t` must be one number, but has shape"),
    "members of several times": (lambda: BODY.state(t=co.each([0.0, 1.0])), "one time axis"),
    "q without a space": (lambda: BODY.state(q=[1.0]), "no additional dynamics: leave out `q`"),
    "a0 without advected ones": (lambda: BODY.state(a0=[1.0]), "no advected parameters: leave out `a0`"),
    "other parameters of none": (lambda: BARE.replace(mass=1.0), "no parameters to replace"),
    "inputs without names": (lambda: inputs_from({1: 0.0}), "The names in `inputs` must be texts, but are 1"),
    "a steady motion in time": (lambda: steady_motion(TIMED, TIMED.state()), "a system that does not depend on time"),
    "a steady push in time": (lambda: steady_motion(PUSHED, PUSHED.state()), "do not depend on time by themselves"),
    "a steady motion on a sphere": (
        lambda: steady_motion(ROUND, ROUND.state(q=[0, 0, 1.0])), "needs a flat space of additional dynamics",
    ),
    "no energy of momenta": (lambda: BARE.reduced_hamiltonian(*4 * (np.zeros(3),)), "has no Hamiltonian; pass `ha"),
    "a body of Clebsch with two equal moments": (
        lambda: kirchhoff.clebsch(mass=(1.0, 2.0), inertia=(1.0, 1.0, 2.0)), "`inertia` must have J₁ ≠ J₂",
    ),
    "a rate of another size": (
        lambda: manakov.start(manakov.body(moments=(1.0, 2.0, 3.0)), angular_velocity=[1.0]),
        r"must be skew, \(3, 3\), or its 3 entries below the diagonal, but has shape \(1,\)",
    ),
    "a part of parameters by a number": (
        lambda: NESTED.replace(hull=1.0), "`hull` is several numbers, a, b: replace it by a dictionary of some",
    ),
    "a parameter by a dictionary": (lambda: NESTED.replace(mass={"a": 1.0}), "`mass` is one array of numbers"),
}  # fmt: skip
RUNS: dict[str, Case] = {
    "members of a trajectory": (
        lambda: co.trajectory(BODY.replace(inertia=co.each([1.0, 2.0])), BODY.state(), dt=0.1, steps=1), "map co.traj",
    ),
    "a store that is a number": (
        lambda: co.simulate(BODY, BODY.state(), dt=0.1, steps=1, store=3), "`store` must be the path of a folder",
    ),
    "a unit of no stepper": (lambda: save_fmu(3, "a.fmu"), "`stepper` must be a co.Stepper, but is 3"),
    "an event that is a number": (lambda: co.Event(3.0), "must be a function of the state, but is 3.0"),
    "a log of a body": (
        lambda: synthetic_log(SimpleNamespace(system=BODY, records=None)), "is not a vehicle on SO",
    ),
    "breaks before the log": (
        lambda: Log(np.arange(4.0), {"a": np.zeros(4)}, breaks=(0,)), "`breaks` of a log must be samples from 1 to 3",
    ),
}  # fmt: skip
THEORY: dict[str, Case] = {
    "records of other steps": (
        lambda: theory.equations_of(BODY, co.Midpoint(), BODY.state(), 0.1), "must have shape",
    ),
}  # fmt: skip


@pytest.mark.parametrize(
    ("call", "says"),
    [pytest.param(*case, id=name) for part in (GROUPS, MECHANICS, RUNS, THEORY) for name, case in part.items()],
)
def test_a_wrong_use_raises_one_sentence(call, says):
    with pytest.raises((CoadjointError, AttributeError), match=says) as error:
        call()
    assert "\n" not in str(error.value)


def test_a_file_may_have_tables_as_deep_as_the_limit_and_no_deeper():
    deep = ".".join("a" * (DEEPEST - 1))
    assert read_table(f"{deep} = 1", "f.toml")["a"]
    with pytest.raises(FileError, match="nested too deeply: it has more than 64 tables"):
        read_table(f"{deep}.a = 1", "f.toml")
