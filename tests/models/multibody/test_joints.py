"""Each kind of joint leaves the freedoms that it should, and its reaction has no power."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics import reactions
from coadjoint.mechanics.reactions import site
from coadjoint.models.multibody import Body, Joint, Mechanism
from coadjoint.models.multibody.bonds import Bond
from coadjoint.models.multibody.data import counted
from mechanisms import ARM, FREEDOMS, JOINTS, MASS, MOMENTS, disk, pendulum, rod


def test_each_kind_of_joint_leaves_its_freedoms_and_its_reaction_has_no_power():
    """A·(ξ, ν) = φ̇ of each kind on one body: its rank, and the reaction Aᵀλ."""
    joints = {kind: Joint(kind, "ground", "rod", at=(0, 0, 0), **more) for kind, more in JOINTS.items()}
    system = Mechanism(bodies={"rod": rod(position=(0, 0, -ARM))}, joints=joints).system
    state = system.state(q=[0, 0, -ARM], a0={"pose": None, "gravity": [0, 0, -9.81]})

    def of(s):
        at = site(s)
        rows = jax.jacfwd(lambda v: reactions.rate(system, at, v[:3], v[3:]))(jnp.zeros(6))
        pushes = jax.jacfwd(lambda strength: jnp.concatenate(reactions.reaction(system, at, strength)))
        return [one.value(system, at) for one in system.constraints], rows, pushes(jnp.zeros(len(rows))).T

    gaps, all_rows, pushes = evaluate(of, state)
    assert pushes == pytest.approx(all_rows, abs=1e-14)
    for (one, part), gap, (kind, free) in zip(reactions.parts(system), gaps, FREEDOMS.items(), strict=True):
        rows = all_rows[part]
        assert one.name == kind and np.max(np.abs(gap)) < 1e-15, kind
        assert len(rows) == np.linalg.matrix_rank(rows) == 6 - free, kind


def test_a_pendulum_on_a_hinge_swings_as_in_minimal_coordinates():
    swing = pendulum()
    start = swing.state(coordinates={"hinge": 1.0}, speeds={"hinge": 12.0})
    run = co.simulate(swing.system, start, dt=0.01, steps=100, save_every=10, accuracy=False, monitors=False)
    turned = swing.joint_data(run.records)
    moment, weight = MOMENTS[1] + MASS * ARM**2, 9.81 * MASS * ARM
    exact = solve_ivp(lambda t, x: [x[1], -weight * np.sin(x[0]) / moment], (0, 1), [1, 12], rtol=1e-10, atol=1e-10)
    assert turned.hinge.values[0] == pytest.approx(1.0, abs=1e-15)
    assert exact.y[0, -1] > 2 * np.pi
    assert turned.hinge.values[-1] == pytest.approx(exact.y[0, -1], abs=0.02)
    assert turned.hinge_speed.values[-1] == pytest.approx(exact.y[1, -1], abs=0.05)


def test_bodies_are_placed_along_joints_with_their_velocities():
    """A crank with a slider on it that screws through: places and velocities against differences of places."""
    joints = {
        "crank": Joint("revolute", "ground", "arm", at=(0, 0, 0), axis=(0, 1, 0)),
        "slider": Joint("prismatic", "head", "arm", at=(0.3, 0.2, -1), axis=(0, 0, 1)),
        "screw": Joint("screw", "head", "nut", at=(0, 0, -1), axis=(1, 0, 0), pitch=0.5),
    }
    bodies = {"arm": rod(position=(0, 0, -ARM)), "head": rod(position=(0, 0, -1)), "nut": rod(position=(0.2, 0, -1))}
    arm = Mechanism(bodies=bodies, joints=joints)
    speeds = {"crank": 2.0, "slider": -0.5, "screw": 3.0}

    def at(t):
        return arm.state(coordinates={"crank": 0.7 + 2 * t, "slider": 0.1 - 0.5 * t, "screw": 4 + 3 * t}, speeds=speeds)

    before, now, after = (at(t) for t in (-1e-5, 0.0, 1e-5))
    arm.system.check(now)
    assert now.qdot == pytest.approx((after.q - before.q) / 2e-5, abs=1e-8)
    turning = np.einsum("nji,njk->nik", now.g, (after.g - before.g) / 2e-5)
    found = np.stack([turning[:, 2, 1], turning[:, 0, 2], turning[:, 1, 0]], axis=1)
    assert now.xi.reshape(3, 3) == pytest.approx(found, abs=1e-8)
    data = arm.joint_data(now)
    assert [float(data[name]) for name in joints] == pytest.approx([0.7, 0.1, 4 - 2 * np.pi], abs=1e-14)
    assert [float(data[f"{name}_speed"]) for name in joints] == pytest.approx([2, -0.5, 3], abs=1e-13)


def test_turns_are_counted_by_the_mean_speed():
    t = np.linspace(0, 3, 31)
    angle, speed = 2 * t + 5 * t**2, 2 + 10 * t
    wrapped = np.arctan2(np.sin(angle), np.cos(angle))
    assert counted(t, wrapped, speed) == pytest.approx(angle, abs=1e-12)


def test_a_strut_holds_nothing_and_its_spring_and_motor_act_along_it():
    """½k(l − l₀)², l̇ = d·ḋ/l, and the virtual work of its force."""
    strut = Joint("strut", "ground", "rod", at=(0.3, 0, 0), to=(0, 0, -ARM), stiffness=7.0, motor=True)
    made = Mechanism(bodies={"rod": rod(position=(0, 0, -ARM))}, joints={"strut": strut})
    assert made.system.constraints == ()
    R, x, v = np.asarray(co.attitude.zyx(0.2, 0.1, -0.3)), np.array([0.1, 0.4, -0.6]), np.array([0.5, -1, 2])
    state = made.state(poses={"rod": (R, x)}, velocities={"rod": v})
    length, rest = np.linalg.norm(x - [0.3, 0, 0]), np.hypot(0.3, ARM)
    turned = made.joint_data(state)
    assert float(turned.strut) == pytest.approx(length, abs=1e-15)
    assert float(turned.strut_speed) == pytest.approx((x - [0.3, 0, 0]) @ v / length, abs=1e-15)
    bond, p = made.bonds["strut"], made.system.parameters
    energy = evaluate(lambda s: bond.spring(s.named.n, s.named.a, p), state)
    assert energy == pytest.approx(3.5 * (length - rest) ** 2, abs=1e-14)


WRONG = {
    "no body": (lambda: Mechanism(bodies={}, joints={}), "at least one body"),
    "a body that is a number": (lambda: Mechanism(bodies={"a": 1.0}, joints={}), "must be a dictionary of names and"),
    "a name that is no word": (lambda: Mechanism(bodies={"a b": rod()}, joints={}), "must be words such as `crank`"),
    "a body called ground": (lambda: Mechanism(bodies={"ground": rod()}, joints={}), "other than ground"),
    "a joint called mass": (lambda: hung(mass=Joint("fixed", "ground", "rod", at=(0, 0, 0))), "other than mass"),
    "no mass": (lambda: Body(mass=0.0, inertia=(1, 1, 1)), "`mass` must be positive"),
    "no inertia": (lambda: Body(mass=1.0, inertia=(1, 1, 0)), "must be positive definite"),
    "moments of no body": (lambda: Body(mass=1.0, inertia=(1, 1, 3)), "must satisfy J₁ [+] J₂ ≥ J₃"),
    "a frame that is stretched": (lambda: Body(mass=1.0, inertia=(1, 1, 1), rotation=2 * np.eye(3)), "be a rotation"),
    "an unknown kind": (lambda: Joint("hinge", "ground", "rod"), '"revolute"'),
    "no axis": (lambda: Joint("revolute", "ground", "rod", at=(0, 0, 0)), "needs the argument `axis`"),
    "no direction": (lambda: hinge(axis=(0, 0, 0)), "must be a direction, but is zero"),
    "an option of others": (lambda: hinge(pitch=0.1), "takes no argument `pitch`"),
    "a spring where nothing slides": (
        lambda: Joint("spherical", "ground", "rod", at=(0, 0, 0), stiffness=1.0),
        "takes no argument `stiffness`",
    ),
    "a negative spring": (lambda: hinge(stiffness=-1.0), "`stiffness` must be a finite number from 0"),
    "a rest without a spring": (lambda: hinge(rest=0.1), "give its `stiffness`, too"),
    "a motor that is a number": (lambda: hinge(motor=1), "`motor` must be True or False"),
    "a screw without pitch": (
        lambda: Joint("screw", "ground", "rod", at=(0, 0, 0), axis=(0, 0, 1), pitch=0.0),
        "must not be 0",
    ),
    "axes that are not across": (
        lambda: Joint("universal", "ground", "rod", at=(0, 0, 0), axis=(0, 0, 1), across=(0, 1, 1)),
        "at a right angle to `axis`",
    ),
    "half a tooth": (lambda: Joint("gear", "one", "two", teeth=(1.5, 2)), "two whole numbers other than 0"),
    "points that coincide": (
        lambda: hung(rope=Joint("distance", "ground", "rod", at=(0, 0, 0), to=(0, 0, 0))),
        "must be apart",
    ),
    "a strut of no length": (
        lambda: hung(strut=Joint("strut", "ground", "rod", at=(0, 0, 0), to=(0, 0, 0))),
        "points of a `strut` joint must be apart",
    ),
    "a disk that lies flat": (
        lambda: hung(wheel=Joint("rolling", "ground", "rod", at=(0, 0, 1), axis=(0, 0, 1), normal=(0, 0, 1), radius=1)),
        "the disk lies flat",
    ),
    "an unknown body": (lambda: hung(pin=hinge("ground", "rud")), "rod"),
    "a body on itself": (lambda: hung(pin=hinge("rod", "rod")), "both ends are `rod`"),
    "a gear on a body": (lambda: hung(mesh=Joint("gear", "rod", "ground", teeth=(1, 2))), "mesh"),
    "a gear on a joint that slides": (
        lambda: hung(
            one=hinge(),
            two=Joint("prismatic", "ground", "rod", at=(0, 0, 0), axis=(0, 0, 1)),
            mesh=Joint("gear", "one", "two", teeth=(1, 2)),
        ),
        "or two that slide, but `one` is revolute and `two` prismatic",
    ),
    "a joint called as a method of parameters": (lambda: hung(replace=hinge()), "'replace' has a meaning of its own"),
    "a joint called as the contact of another": (
        lambda: Mechanism(bodies=disk().bodies, joints={**disk().joints, "wheel_contact": hinge(second="disk")}),
        "`wheel_contact`, which is a name that another joint makes",
    ),
    "a joint called as the angle of another": (
        lambda: hung(a=Joint("cylindrical", "ground", "rod", at=(0, 0, 0), axis=(0, 0, 1)), a_angle=hinge()),
        "`a_angle`, which is a name that another joint makes",
    ),
    "coordinates without names": (lambda: pendulum().state(coordinates=[1.0]), "must be a dictionary of names and val"),
    "an unknown joint": (lambda: pendulum().state(coordinates={"hing": 1.0}), "hinge"),
    "a coordinate of a ball joint": (
        lambda: hung(ball=Joint("spherical", "ground", "rod", at=(0, 0, 0))).state(speeds={"ball": 1.0}),
        "has no coordinates of its own",
    ),
    "two angles of a hinge": (lambda: pendulum().state(coordinates={"hinge": (1.0, 2.0)}), "coordinates` of `hinge"),
    "a pose of a body that is not there": (lambda: pendulum().state(poses={"rid": (np.eye(3), (0, 0, 0))}), "rod"),
    "half a pose": (lambda: pendulum().state(poses={"rod": np.eye(3)}), r"must be a pair \(R, x\)"),
}


def hinge(first="ground", second="rod", **options):
    return Joint("revolute", first, second, **{"at": (0, 0, 0), "axis": (0, 1, 0), **options})


def hung(**joints) -> Mechanism:
    return Mechanism(bodies={"rod": rod(position=(0, 0, -ARM))}, joints=joints)


@pytest.mark.parametrize("wrong", WRONG)
def test_a_wrong_mechanism_raises_an_error_that_says_why(wrong: str):
    make, sentence = WRONG[wrong]
    with pytest.raises(co.errors.ArgumentError, match=sentence):
        make()


def test_the_lowest_point_of_a_ball_is_below_its_centre_and_that_of_a_disk_turns_with_its_axis() -> None:
    """φ = q₃ − ρ of a ball in any attitude, q₃ − ρ sin θ of a disk whose axis leans by θ from the vertical."""
    p = co.Parameters(wheel={"first": np.zeros(3), "second": np.zeros(3), "radius": 0.3})
    axes = tuple(tuple(map(tuple, np.eye(3))) for _ in range(2))
    q, turn = np.array([1.0, 2.0, 0.7]), co.attitude.zyx(0.4, 0.5, -0.8)
    for ball, lowest in ((True, 0.3), (False, 0.3 * np.sqrt(1 - turn[2, 2] ** 2))):
        bond = Bond("wheel", "rolling", -1, 0, 0, axes, ball=ball)
        gap = evaluate(lambda n, E, bond=bond: bond.gap(n, SimpleNamespace(pose=E), p), (turn.T @ q)[None], turn[None])
        assert gap[-1] == pytest.approx(0.7 - lowest, abs=1e-14)


def test_the_point_of_a_joint_is_kept_in_the_axes_of_each_body():
    places = {"rod": (co.attitude.zyx(0.3, 0.2, 0.1), np.array([1.0, 2.0, 3.0])), "ground": (np.eye(3), np.zeros(3))}
    mechanism: Any = SimpleNamespace(reference=places.get)
    for first, second in (("rod", "ground"), ("ground", "rod")):
        numbers = Mechanism._numbers(mechanism, hinge(first, second, at=(2.0, -1.0, 0.5)))
        for name, point in ((first, numbers["first"]), (second, numbers["second"])):
            R, x = places[name]
            np.testing.assert_allclose(R @ point + x, [2.0, -1.0, 0.5], atol=1e-14)
