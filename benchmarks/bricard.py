"""Bricard's mechanism by Coadjoint, MuJoCo and Exudyn: problem A04 of IFToMM's library, 10 s from rest.

Five slender rods of 1 m and 1 kg and the ground lie along edges of a cube. Each of six hinges is at right angles to
both of its rods: 30 rows for 30 velocities, of which one follows from the others, so the linkage has one freedom.
González, Dopico, Lugrís and Cuadrado, Multibody System Dynamics 16 (2006) 179.

MuJoCo has the rods as a tree, and as its last hinge two equality constraints `connect` at points of the axis. Exudyn
has rigid bodies with Euler parameters on six `JointRevoluteZ`, generalised alpha, and a dense solver that accepts a
singular Jacobian: without that, and with constraints of index 2, it stops at the dependent row.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from itertools import product

import numpy as np
from scipy.integrate import solve_ivp

Contender = tuple[str, float, Callable[[], Callable[[], np.ndarray]]]
"""Its name, its step, s, and what prepares a run that is timed."""

CORNERS = np.array([(0, 0, 0), (1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1), (0, 0, 1)], float)
BARS = np.roll(CORNERS, -1, axis=0) - CORNERS
"""The rods 0 to 4 and the ground, 5, from corner to corner; hinge k joins rod k to rod k − 1."""
AXES = np.cross(np.roll(BARS, 1, axis=0), BARS)
DURATION, GRAVITY, MASS, ALONG, ACROSS = 10.0, 9.81, 1.0, 1e-4, 1 / 12
SAMPLES = np.linspace(0.1, DURATION, 100)
"""The times at which P₃, the third corner, is compared, s."""


@cache
def reference() -> np.ndarray:
    """P₃ at `SAMPLES` by the equation of the one freedom, to an error near 1e-11 m, (100, 3), m.

    The even hinges turn by α, the odd ones by β, and the loop is closed where cos(α/2) cos(β/2) = 1/2. The solution of
    dα/ds = tan(β/2), dβ/ds = −tan(α/2) runs along that curve, and M s̈ + ½M' ṡ² + V' = 0.
    """
    start, tight = [np.pi / 2, np.pi / 2, 0.0], {"rtol": 1e-12, "atol": 1e-13}
    run = solve_ivp(lambda _, x: rates(x), (0.0, DURATION), start, method="DOP853", t_eval=SAMPLES, **tight)
    return np.array([corners(state[:2])[2] for state in run.y.T])


def rates(state: np.ndarray) -> np.ndarray:
    """The rates of α, β and ṡ; `first` and `second` are derivatives of α and β by s."""
    half, speed = np.tan(state[:2] / 2), state[2]
    first = np.array([half[1], -half[0]])
    second = 0.5 * (1 + half[::-1] ** 2) * first[::-1] * [1, -1]
    R, at_rate, at_change, turning, changed = np.eye(3), *np.zeros((4, 3))
    inertia, bent, fallen = 0.0, 0.0, 0.0
    for k in range(5):
        axis = R @ AXES[k]
        changed = changed + axis * second[k % 2] + np.cross(turning, axis) * first[k % 2]
        turning = turning + axis * first[k % 2]
        R = R @ turn(AXES[k], state[k % 2] - np.pi / 2)
        arm = R @ BARS[k] / 2
        rate = np.cross(turning, arm)
        change = np.cross(changed, arm) + np.cross(turning, rate)
        J = ACROSS * np.eye(3) + (ALONG - ACROSS) * np.outer(2 * arm, 2 * arm)
        inertia += MASS * (at_rate + rate) @ (at_rate + rate) + turning @ J @ turning
        bent += MASS * (at_rate + rate) @ (at_change + change) + turning @ J @ changed
        fallen += MASS * GRAVITY * (at_rate + rate)[1]
        at_rate, at_change = at_rate + 2 * rate, at_change + 2 * change
    return np.array([*first * speed, -(bent * speed**2 + fallen) / inertia])


def corners(angles: np.ndarray) -> np.ndarray:
    """The first ends of the six rods and the last end of the sixth, which closes the loop, (7, 3), m."""
    R, ends = np.eye(3), [np.zeros(3)]
    for k in range(6):
        R = R @ turn(AXES[k], angles[k % 2] - np.pi / 2)
        ends.append(ends[-1] + R @ BARS[k])
    return np.array(ends)


def turn(axis: np.ndarray, angle: float) -> np.ndarray:
    """The rotation about a unit vector, (3, 3)."""
    K = np.cross(np.eye(3), axis)
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def frame(along: np.ndarray) -> np.ndarray:
    """Columns: along an edge, and two across."""
    across = np.roll(np.abs(along), 1)
    return np.stack([along, across, np.cross(along, across)], axis=1)


def off(found: np.ndarray) -> float:
    """The largest distance of P₃ from the reference, m."""
    return float(np.max(np.linalg.norm(found - reference(), axis=1)))


def by_coadjoint() -> Iterator[Contender]:
    import coadjoint as co
    from coadjoint.models.multibody import Body, Joint, Mechanism

    names = [*(f"rod_{k}" for k in range(5)), "ground"]
    made = Mechanism(
        bodies={
            names[k]: Body(
                mass=MASS,
                inertia=(ALONG, ACROSS, ACROSS),
                position=CORNERS[k] + BARS[k] / 2,
                rotation=frame(BARS[k]),
            )
            for k in range(5)
        },
        joints={f"hinge_{k}": Joint("revolute", names[k - 1], names[k], at=CORNERS[k], axis=AXES[k]) for k in range(6)},
        gravity=(0, -GRAVITY, 0),
    )
    start = made.state()
    third = {"P3": lambda state: state.q[3:6] + 0.5 * state.g[1, :, 0]}
    for name, method, steps in (
        ("Midpoint", co.Midpoint(), (500, 2000, 10000)),
        ("Suzuki4(Midpoint)", co.Suzuki4(co.Midpoint()), (300, 1000, 3000)),
    ):
        for count in steps:
            stepper = co.Stepper(made.system, start, dt=DURATION / count, method=method, observe=third)

            def prepare(stepper=stepper, count=count):
                stepper.reset()

                def run():
                    found = []
                    for _ in SAMPLES:
                        stepper.step(n=count // len(SAMPLES))
                        found.append(stepper.observation["P3"].copy())
                    return np.array(found)

                return run

            yield f"Coadjoint, {name}", DURATION / count, prepare


def by_mujoco() -> Iterator[Contender]:
    import mujoco

    def text(x: np.ndarray) -> str:
        return " ".join(f"{one:.17g}" for one in x)

    tree = ""
    for k in reversed(range(5)):
        moments = ACROSS + (ALONG - ACROSS) * np.abs(BARS[k])
        site = '<site name="P3" pos="0 0 0"/>' if k == 2 else ""
        tree = (
            f'<body name="rod_{k}" pos="{text(BARS[k - 1] if k else np.zeros(3))}"><joint axis="{text(AXES[k])}"/>'
            f'<inertial mass="{MASS}" pos="{text(BARS[k] / 2)}" diaginertia="{text(moments)}"/>{site}{tree}</body>'
        )
    ends = [BARS[4] - 0.1 * AXES[5], BARS[4] + 0.1 * AXES[5]]
    runs = [("RK4", 1000), ("RK4", 3000), ("RK4", 10000)]
    runs += [("implicitfast", 10000), ("implicitfast", 30000), ("implicitfast", 100000)]
    for (integrator, count), impedance in product(runs, ("0.9 0.95", "0.9999 0.9999")):
        dt = DURATION / count
        held = "".join(
            f'<connect body1="rod_4" anchor="{text(end)}" solref="{2 * dt} 1" solimp="{impedance} 0.001"/>'
            for end in ends
        )
        model = mujoco.MjModel.from_xml_string(
            f'<mujoco><option timestep="{dt}" gravity="0 {-GRAVITY} 0" integrator="{integrator}" tolerance="1e-14"/>'
            f'<compiler inertiafromgeom="false" balanceinertia="true"/>'
            f"<worldbody>{tree}</worldbody><equality>{held}</equality></mujoco>"
        )

        def prepare(model=model, count=count):
            data = mujoco.MjData(model)

            def run():
                found = []
                for _ in SAMPLES:
                    mujoco.mj_step(model, data, nstep=count // len(SAMPLES))
                    mujoco.mj_kinematics(model, data)
                    found.append(data.site("P3").xpos.copy())
                return np.array(found)

            return run

        yield f"MuJoCo, {integrator}, solimp {impedance}", dt, prepare


def by_exudyn() -> Iterator[Contender]:
    import exudyn
    from exudyn import itemInterface as items

    settings = exudyn.SimulationSettings()
    settings.timeIntegration.endTime = DURATION
    settings.timeIntegration.verboseMode, settings.solution.file.write = 0, False
    settings.timeIntegration.generalizedAlpha.spectralRadius = 0.9
    settings.timeIntegration.newton.relativeTolerance = 1e-10
    settings.linearSolver.solverType = exudyn.LinearSolverType.EigenDense
    settings.linearSolver.ignoreSingularJacobian = True
    settings.solution.sensors.writePeriod = SAMPLES[0]

    def built():
        mbs = exudyn.SystemContainer().AddSystem()
        bodies = []
        for k in range(5):
            node = mbs.AddNode(items.NodeRigidBodyEP(referenceCoordinates=[*(CORNERS[k] + BARS[k] / 2), 1, 0, 0, 0]))
            moments = ACROSS + (ALONG - ACROSS) * np.abs(BARS[k])
            body = items.ObjectRigidBody(physicsMass=MASS, physicsInertia=[*moments, 0, 0, 0], nodeNumber=node)
            bodies.append(mbs.AddObject(body))
            heavy = mbs.AddMarker(items.MarkerBodyMass(bodyNumber=bodies[k]))
            mbs.AddLoad(items.LoadMassProportional(markerNumber=heavy, loadVector=[0, -GRAVITY, 0]))
        bodies.append(mbs.AddObject(items.ObjectGround(referencePosition=list(CORNERS[5] + BARS[5] / 2))))
        for k in range(6):
            ends = [
                mbs.AddMarker(items.MarkerBodyRigid(bodyNumber=bodies[k - 1], localPosition=list(BARS[k - 1] / 2))),
                mbs.AddMarker(items.MarkerBodyRigid(bodyNumber=bodies[k], localPosition=list(-BARS[k] / 2))),
            ]
            turned = np.roll(frame(AXES[k]), -1, axis=1).tolist()
            mbs.AddObject(
                items.ObjectJointRevoluteZ(markerNumbers=ends, rotationMarker0=turned, rotationMarker1=turned)
            )
        third = {"bodyNumber": bodies[1], "localPosition": list(BARS[1] / 2), "storeInternal": True}
        place = exudyn.OutputVariableType.Position
        sensor = mbs.AddSensor(items.SensorBody(outputVariableType=place, writeToFile=False, **third))
        mbs.Assemble()
        return mbs, sensor

    for count in (1000, 3000, 10000):

        def prepare(count=count):
            settings.timeIntegration.numberOfSteps = count
            mbs, sensor = built()

            def run():
                mbs.SolveDynamic(settings)
                return mbs.GetSensorStoredData(sensor)[1:, 1:4]

            return run

        yield "Exudyn, generalised alpha", DURATION / count, prepare
