"""Andrews' squeezer by Coadjoint, MuJoCo and Exudyn: error of the crank after 0.03 s against processor time.

Run as: python benchmarks/mechanisms.py [coadjoint mujoco exudyn]; libraries that are missing are left out. It prints a
line for each step size: largest error of four angles, rad, and the processor time of stepping, s, the least of three.

MuJoCo has the seven bodies in four trees with three equality constraints `connect` at the pin, as stiff as its step
allows; Exudyn has bodies in the plane with ten `RevoluteJoint2D` and its generalised-alpha solver of index 2.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from mechanisms import ANDREWS, andrews

DURATION, TORQUE = 0.03, 0.033
FREE = {"K1": 0, "K3": 2, "K5": 4, "K7": 6}
"""The bodies on the ground, with the places of their angles among those of the reference."""
CHANGES = np.array(ANDREWS["end"]) - ANDREWS["start"]


def off(found: np.ndarray) -> float:
    """The largest error of the changes of the angles of `FREE`, to within a turn, rad."""
    return float(np.max(np.abs(np.angle(np.exp(1j * (found - CHANGES[list(FREE.values())]))))))


def least(once: Callable[[], np.ndarray]) -> tuple[float, float]:
    """The error of what `once` returns, and its least processor time of three, s."""
    seconds = []
    for _ in range(3):
        began = time.process_time()
        found = once()
        seconds.append(time.process_time() - began)
    return off(found), min(seconds)


def by_coadjoint() -> Iterator[tuple[str, float, float, float]]:
    import coadjoint as co

    made = andrews()
    start = made.state()
    for name, method, steps in (
        ("Midpoint", co.Midpoint(), (300, 1000, 3000)),
        ("Suzuki4(Midpoint)", co.Suzuki4(co.Midpoint()), (150, 300, 1000)),
    ):
        for count in steps:
            push = {"crank": TORQUE}
            steppers = [
                co.Stepper(made.system, start, dt=DURATION / count, method=method, inputs=push) for _ in range(4)
            ]
            steppers.pop().step(push, n=1)

            def once(steppers=steppers, count=count, push=push):
                stepper = steppers.pop()
                stepper.step(push, n=count)
                R = np.asarray(stepper.state.g)
                return np.arctan2(R[:, 1, 0], R[:, 0, 0])[[0, 2, 4, 6]]

            yield f"Coadjoint, {name}", DURATION / count, *least(once)


def by_mujoco() -> Iterator[tuple[str, float, float, float]]:
    import mujoco

    made = andrews()
    bodies, joints = made.bodies, made.joints

    def body(name: str, hinge: str, above: np.ndarray, inside: str = "") -> str:
        at, own = joints[hinge].at, bodies[name]
        place, center = at - above, own.position - at
        J = own.inertia[0, 0]
        site = f'<site name="{name}" pos="{text(joints["spring"].to - at)}"/>' if name == "K3" else ""
        return (
            f'<body name="{name}" pos="{text(place)}"><joint name="{name}" axis="0 0 1"/>'
            f'<inertial mass="{own.mass}" pos="{text(center)}" diaginertia="{J} {J} {J}"/>{site}{inside}</body>'
        )

    def text(x: np.ndarray) -> str:
        return " ".join(f"{one:.17g}" for one in x)

    trees = [("K1", "crank", "K2", "pin"), ("K5", "A5", "K4", "E"), ("K7", "A7", "K6", "F")]
    world = "".join(
        body(one, hinge, np.zeros(3), body(two, second, joints[hinge].at)) for one, hinge, two, second in trees
    )
    world += body("K3", "B", np.zeros(3)) + f'<site name="C" pos="{text(joints["spring"].at)}"/>'
    P, pin = joints["P3"].at, joints["pin"].at
    for integrator, steps in (("RK4", (3000, 10000)), ("implicitfast", (3000, 10000, 30000))):
        for count in steps:
            dt = DURATION / count
            held = "".join(
                f'<connect body1="K2" body2="{name}" anchor="{text(P - pin)}" solref="{2 * dt} 1"/>'
                for name in ("K3", "K4", "K6")
            )
            model = mujoco.MjModel.from_xml_string(
                f'<mujoco><option timestep="{dt}" gravity="0 0 0" integrator="{integrator}" tolerance="1e-14"/>'
                f'<compiler inertiafromgeom="false" boundmass="0" balanceinertia="true"/><worldbody>{world}</worldbody>'
                f'<equality>{held}</equality><actuator><motor joint="K1"/></actuator>'
                f'<tendon><spatial stiffness="4530" springlength="0.07785"><site site="C"/><site site="K3"/></spatial>'
                "</tendon></mujoco>"
            )

            def once(model=model, count=count):
                data = mujoco.MjData(model)
                data.ctrl[0] = TORQUE
                mujoco.mj_step(model, data, nstep=count)
                return np.array([data.joint(name).qpos[0] for name in FREE])

            yield f"MuJoCo, {integrator}", dt, *least(once)


def by_exudyn() -> Iterator[tuple[str, float, float, float]]:
    import exudyn
    from exudyn import itemInterface as items

    made = andrews()
    settings = exudyn.SimulationSettings()
    settings.timeIntegration.endTime = DURATION
    settings.timeIntegration.verboseMode, settings.solution.file.write = 0, False
    settings.timeIntegration.generalizedAlpha.spectralRadius = 0.9
    settings.timeIntegration.newton.relativeTolerance = 1e-10

    def built():
        mbs = exudyn.SystemContainer().AddSystem()
        ground = mbs.AddObject(items.ObjectGround())
        nodes, bodies = {}, {"ground": ground}
        for name, own in made.bodies.items():
            nodes[name] = mbs.AddNode(items.NodeRigidBody2D(referenceCoordinates=[*own.position[:2], 0.0]))
            bodies[name] = mbs.AddObject(
                items.ObjectRigidBody2D(physicsMass=own.mass, physicsInertia=own.inertia[2, 2], nodeNumber=nodes[name])
            )

        def marker(name: str, at: np.ndarray) -> int:
            place = at - (made.bodies[name].position if name != "ground" else 0)
            return mbs.AddMarker(items.MarkerBodyPosition(bodyNumber=bodies[name], localPosition=list(place)))

        for joint in made.joints.values():
            ends = [marker(joint.first, joint.at), marker(joint.second, joint.at if joint.to is None else joint.to)]
            if joint.kind == "strut":
                spring = {"stiffness": 4530.0, "referenceLength": 0.07785, "damping": 0.0}
                mbs.AddObject(items.ObjectConnectorSpringDamper(markerNumbers=ends, **spring))
            else:
                mbs.AddObject(items.ObjectJointRevolute2D(markerNumbers=ends))
        turning = mbs.AddMarker(items.MarkerBodyRigid(bodyNumber=bodies["K1"]))
        mbs.AddLoad(items.LoadTorqueVector(markerNumber=turning, loadVector=[0, 0, TORQUE]))
        mbs.Assemble()
        return mbs, nodes

    for count in (300, 1000, 3000, 10000):
        settings.timeIntegration.numberOfSteps = count
        found, seconds = np.zeros(4), []
        for _ in range(3):
            mbs, nodes = built()
            began = time.process_time()
            mbs.SolveDynamic(settings)
            seconds.append(time.process_time() - began)
            found = np.array([mbs.GetNodeOutput(nodes[n], exudyn.OutputVariableType.Coordinates)[2] for n in FREE])
        yield "Exudyn, generalised alpha", DURATION / count, off(found), min(seconds)


BY = {"coadjoint": by_coadjoint, "mujoco": by_mujoco, "exudyn": by_exudyn}

if __name__ == "__main__":
    print("| by | step (s) | largest error (rad) | processor time (s) |\n|---|---|---|---|")
    for library in sys.argv[1:] or BY:
        if find_spec(library):
            for name, dt, error, seconds in BY[library]():
                print(f"| {name} | {dt:.0e} | {error:.1e} | {seconds:.2g} |", flush=True)
