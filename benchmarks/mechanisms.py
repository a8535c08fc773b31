"""Andrews' squeezer and Bricard's mechanism by Coadjoint, MuJoCo and Exudyn: errors against processor time.

Run as: python -m benchmarks.mechanisms [coadjoint mujoco exudyn]; libraries that are missing are left out. For each
mechanism and step it prints the largest error, of four angles of the squeezer after 0.03 s, rad, or of a point of
Bricard's mechanism during 10 s, m; and the processor time of stepping, s, the least of three runs.

MuJoCo has the squeezer's seven bodies in four trees with three equality constraints `connect` at the pin, as stiff as
its step allows; Exudyn has bodies in the plane with ten `JointRevolute2D` and its generalised-alpha solver.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from itertools import product
from pathlib import Path

import numpy as np

from benchmarks import bricard
from benchmarks.bricard import Contender

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from mechanisms import ANDREWS, andrews

DURATION, TORQUE = 0.03, 0.033
FREE = {"K1": 0, "K3": 2, "K5": 4, "K7": 6}
"""The bodies on the ground, with the places of their angles among those of the reference."""
CHANGES = np.array(ANDREWS["end"]) - ANDREWS["start"]


def off(found: np.ndarray) -> float:
    """The largest error of the changes of the angles of `FREE`, to within a turn, rad."""
    return float(np.max(np.abs(np.angle(np.exp(1j * (found - CHANGES[list(FREE.values())]))))))


def least(prepare: Callable[[], Callable[[], np.ndarray]]) -> tuple[np.ndarray, float]:
    """What a run returns, and its least processor time of three, s."""
    found, seconds = np.zeros(0), []
    for _ in range(3):
        run = prepare()
        began = time.process_time()
        found = run()
        seconds.append(time.process_time() - began)
    return found, min(seconds)


def by_coadjoint() -> Iterator[Contender]:
    import coadjoint as co

    made = andrews()
    start = made.state()
    for name, method, steps in (
        ("Midpoint", co.Midpoint(), (300, 1000, 3000)),
        ("Suzuki4(Midpoint)", co.Suzuki4(co.Midpoint()), (150, 300, 1000)),
    ):
        for count in steps:
            push = {"crank": TORQUE}
            stepper = co.Stepper(made.system, start, dt=DURATION / count, method=method, inputs=push)

            def prepare(stepper=stepper, count=count, push=push):
                stepper.reset()

                def run():
                    stepper.step(push, n=count)
                    R = np.asarray(stepper.state.g)
                    return np.arctan2(R[:, 1, 0], R[:, 0, 0])[[0, 2, 4, 6]]

                return run

            yield f"Coadjoint, {name}", DURATION / count, prepare


def by_mujoco() -> Iterator[Contender]:
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
    runs = [("RK4", 3000), ("RK4", 10000), ("implicitfast", 3000), ("implicitfast", 10000), ("implicitfast", 30000)]
    for (integrator, count), impedance in product(runs, ("0.9 0.95", "0.9999 0.9999")):
        dt = DURATION / count
        held = "".join(
            f'<connect body1="K2" body2="{name}" anchor="{text(P - pin)}" solref="{2 * dt} 1"'
            f' solimp="{impedance} 0.001"/>'
            for name in ("K3", "K4", "K6")
        )
        model = mujoco.MjModel.from_xml_string(
            f'<mujoco><option timestep="{dt}" gravity="0 0 0" integrator="{integrator}" tolerance="1e-14"/>'
            f'<compiler inertiafromgeom="false" boundmass="0" balanceinertia="true"/><worldbody>{world}</worldbody>'
            f'<equality>{held}</equality><actuator><motor joint="K1"/></actuator>'
            f'<tendon><spatial stiffness="4530" springlength="0.07785"><site site="C"/><site site="K3"/></spatial>'
            "</tendon></mujoco>"
        )

        def prepare(model=model, count=count):
            data = mujoco.MjData(model)
            data.ctrl[0] = TORQUE

            def run():
                mujoco.mj_step(model, data, nstep=count)
                return np.array([data.joint(name).qpos[0] for name in FREE])

            return run

        yield f"MuJoCo, {integrator}, solimp {impedance}", dt, prepare


def by_exudyn() -> Iterator[Contender]:
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

        def prepare(count=count):
            settings.timeIntegration.numberOfSteps = count
            mbs, nodes = built()

            def run():
                mbs.SolveDynamic(settings)
                place = exudyn.OutputVariableType.Coordinates
                return np.array([mbs.GetNodeOutput(nodes[name], place)[2] for name in FREE])

            return run

        yield "Exudyn, generalised alpha", DURATION / count, prepare


MECHANISMS = {
    "Andrews' squeezer, rad": (off, {"coadjoint": by_coadjoint, "mujoco": by_mujoco, "exudyn": by_exudyn}),
    "Bricard's mechanism, m": (
        bricard.off,
        {"coadjoint": bricard.by_coadjoint, "mujoco": bricard.by_mujoco, "exudyn": bricard.by_exudyn},
    ),
}

if __name__ == "__main__":
    for title, (error, by) in MECHANISMS.items():
        print(f"| {title}: by | step (s) | largest error | processor time (s) |\n|---|---|---|---|")
        for library in sys.argv[1:] or by:
            if find_spec(library):
                for name, dt, prepare in by[library]():
                    found, seconds = least(prepare)
                    print(f"| {name} | {dt:.0e} | {error(found):.1e} | {seconds:.2g} |", flush=True)
