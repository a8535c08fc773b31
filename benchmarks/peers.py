"""Other programs on the same problems: diffrax, MuJoCo, Exudyn, Lielab; each only where it is installed."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

from benchmarks.bodies import Body
from benchmarks.problems import NODES, Problem

Path = Callable[[], np.ndarray]


def version(name: str) -> str | None:
    """The version of an installed program, None where there is none."""
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None


# diffrax


def jax_rate(t: Any, y: Any, body: Body) -> Any:
    """ẏ of `bodies` in jax.numpy."""
    import jax.numpy as jnp

    M, J, b = (jnp.array(values) for values in (body.mass, body.inertia, body.moment))
    R, omega, nu = y[:9].reshape(3, 3), y[12:15], y[15:18]
    cross = jnp.cross
    omega_dot = (cross(J * omega, omega) + cross(M * nu, nu) + cross(b, R[2])) / J
    nu_dot = (cross(M * nu, omega) + body.weight * R[2]) / M
    return jnp.concatenate([cross(R, omega).ravel(), R @ nu, omega_dot, nu_dot])


def by_diffrax(problem: Problem, solver: str, tolerance: float) -> Callable[[], tuple[np.ndarray, int]]:
    """A compiled adaptive solution at the nodes, with the number of steps; float64 as everywhere here."""
    import diffrax
    import jax

    def rate(t: Any, y: Any, arguments: Any) -> Any:
        return jax_rate(t, y, problem.body)

    @jax.jit
    def solve(y0: Any, times: Any) -> Any:
        return diffrax.diffeqsolve(
            diffrax.ODETerm(rate), getattr(diffrax, solver)(), 0.0, problem.duration, None, y0,
            saveat=diffrax.SaveAt(ts=times), max_steps=10**6,
            stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance),
        )  # fmt: skip

    def run() -> tuple[np.ndarray, int]:
        with jax.enable_x64(True):
            found = solve(problem.y0, problem.times)
            return np.asarray(found.ys), int(found.stats["num_steps"])

    return run


# MuJoCo

_TOP = """<mujoco><option timestep="{h!r}" gravity="0 0 -9.81" integrator="{integrator}">
<flag contact="disable"/></option>
<worldbody><body><joint type="ball"/><inertial pos="0 1 0" mass="15" diaginertia="0.234375 0.46875 0.234375"/></body>
</worldbody></mujoco>"""

# The drag, lift and Magnus coefficients are zero: what is left of the ellipsoid model is potential flow.
_ELLIPSOID = """<mujoco><option timestep="{h!r}" gravity="0 0 0" integrator="{integrator}" density="1000" viscosity="0">
<flag contact="disable"/></option><worldbody><body><freejoint/><geom type="ellipsoid" size="0.5 0.2 0.3" density="1000"
fluidshape="ellipsoid" fluidcoef="0 0 0 0 0"/></body></worldbody></mujoco>"""


def by_mujoco(problem: Problem, integrator: str, h: float, fluid: bool) -> tuple[Path, Callable[[], object]]:
    """(rows y at the nodes, the same run in one call to be timed) with MuJoCo's own model of the problem."""
    mujoco: Any = import_module("mujoco")

    # Runs that blow up are reported as such; no log file is wanted.
    mujoco.set_mju_user_warning(lambda message: None)
    model = mujoco.MjModel.from_xml_string((_ELLIPSOID if fluid else _TOP).format(h=h, integrator=integrator))
    data = mujoco.MjData(model)
    steps = round(problem.duration / h)

    def begin() -> None:
        mujoco.mj_resetData(model, data)
        data.qvel[:] = [*problem.start.qdot, *problem.start.xi] if fluid else problem.start.xi

    def path() -> np.ndarray:
        begin()
        rows = [_row(mujoco, data)]
        for _ in range(NODES):
            mujoco.mj_step(model, data, nstep=steps // NODES)
            rows.append(_row(mujoco, data))
        return np.array(rows)

    def whole() -> None:
        begin()
        mujoco.mj_step(model, data, nstep=steps)

    return path, whole


def by_mujoco_in_fluid(y0: np.ndarray, integrator: str, h: float, duration: float) -> np.ndarray:
    """Rows y at every step of MuJoCo's ellipsoid in an ideal fluid, up to where it stops being finite."""
    mujoco: Any = import_module("mujoco")
    mujoco.set_mju_user_warning(lambda message: None)
    model = mujoco.MjModel.from_xml_string(_ELLIPSOID.format(h=h, integrator=integrator))
    # MuJoCo starts a run that blew up anew, unless it is told not to.
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    data = mujoco.MjData(model)
    data.qvel[:] = [*(y0[:9].reshape(3, 3) @ y0[15:18]), *y0[12:15]]
    rows = [_row(mujoco, data)]
    for _ in range(round(duration / h)):
        mujoco.mj_step(model, data)
        rows.append(_row(mujoco, data))
        if not np.all(np.isfinite(rows[-1])):
            break
    return np.array(rows)


def _row(mujoco: Any, data: Any) -> np.ndarray:
    """y of a free or of a ball joint; the latter has no place."""
    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, data.qpos[-4:] / np.linalg.norm(data.qpos[-4:]))
    free = len(data.qpos) == 7
    q, v = (data.qpos[:3], R.reshape(3, 3).T @ data.qvel[:3]) if free else (np.zeros(3), np.zeros(3))
    return np.concatenate([R, q, data.qvel[-3:], v])


# Exudyn


def by_exudyn(problem: Problem, explicit: bool, h: float) -> Path:
    """The heavy top in Exudyn: explicit Lie-group RK4, or the generalised-α method with constraints of index 2."""
    exu: Any = import_module("exudyn")
    from exudyn import itemInterface as items

    system, body, settings = _exudyn_top(exu, problem, explicit)
    sensors = [
        system.AddSensor(
            items.SensorBody(bodyNumber=body, storeInternal=True, writeToFile=False, outputVariableType=kind)
        )
        for kind in (exu.OutputVariableType.RotationMatrix, exu.OutputVariableType.AngularVelocityLocal)
    ]
    system.Assemble()
    settings.timeIntegration.numberOfSteps = round(problem.duration / h)
    settings.timeIntegration.endTime = problem.duration
    settings.solution.sensors.writePeriod = problem.duration / NODES
    kind = exu.DynamicSolverType.RK44 if explicit else exu.DynamicSolverType.GeneralizedAlpha

    def path() -> np.ndarray:
        if not system.SolveDynamic(settings, solverType=kind):
            raise RuntimeError("Exudyn's solver failed.")
        R, omega = (system.GetSensorStoredData(sensor)[:, 1:] for sensor in sensors)
        nothing = np.zeros((len(R), 3))
        return np.concatenate([R, nothing, omega, nothing], axis=1)

    return path


def _exudyn_top(exu: Any, problem: Problem, explicit: bool) -> tuple[Any, Any, Any]:
    """The pivot is the body's reference point, held by three constraints; the weight acts at the mass centre."""
    from exudyn import itemInterface as items
    from exudyn.rigidBodyUtilities import AngularVelocity2EulerParameters_t

    p: Any = problem.system.parameters
    omega = list(problem.start.xi)
    system = exu.SystemContainer().AddSystem()
    if explicit:
        node = items.NodeRigidBodyRotVecLG(referenceCoordinates=[0] * 6, initialVelocities=[0, 0, 0, *omega])
    else:
        unit = [1, 0, 0, 0]
        rates = list(AngularVelocity2EulerParameters_t(omega, unit))
        node = items.NodeRigidBodyEP(referenceCoordinates=[0, 0, 0, *unit], initialVelocities=[0, 0, 0, *rates])
    number = system.AddNode(node)
    J, r = np.diag(p.inertia), list(p.center_of_mass)
    rigid = items.ObjectRigidBody(physicsMass=float(p.mass), physicsInertia=[*J, 0, 0, 0], nodeNumber=number)
    body = system.AddObject(rigid)
    center = system.AddMarker(items.MarkerBodyPosition(bodyNumber=body, localPosition=r))
    system.AddLoad(items.LoadForceVector(markerNumber=center, loadVector=[0, 0, -float(p.mass * p.gravity)]))
    ground = system.AddNode(items.NodePointGround())
    fixed = system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=ground, coordinate=0))
    for i in range(3):
        moving = system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=number, coordinate=i))
        system.AddObject(items.ObjectConnectorCoordinate(markerNumbers=[fixed, moving]))
    settings = exu.SimulationSettings()
    settings.timeIntegration.verboseMode = 0
    settings.solution.file.write = False
    settings.timeIntegration.generalizedAlpha.useNewmark = True
    settings.timeIntegration.generalizedAlpha.useIndex2Constraints = True
    settings.timeIntegration.explicit.useLieGroupIntegration = True
    settings.timeIntegration.explicit.eliminateConstraints = True
    return system, body, settings


# Lielab


def by_lielab(problem: Problem, tolerance: float) -> Path:
    """The heavy top by Lielab's default Munthe-Kaas method, of order 8(7); only the last row is filled."""
    domain: Any = import_module("lielab.domain")
    integrate: Any = import_module("lielab.integrate")
    J, b = np.array(problem.body.inertia), np.array(problem.body.moment)

    def rate(t: float, y: Any) -> Any:
        R, omega = y[0].get_matrix(), y[1].serialize()
        omega_dot = (np.cross(J * omega, omega) + np.cross(b, R[2])) / J
        return domain.CompositeAlgebra([domain.so.from_vector(R @ omega), domain.rn.from_vector(omega_dot)])

    def path() -> np.ndarray:
        options = integrate.IVPOptions()
        options.abstol = options.reltol = tolerance
        options.method, options.rebase_every_step = integrate.IVPMethod.MuntheKaas, True
        start = domain.CompositeManifold([domain.SO(np.eye(3)), domain.RN.from_vector(problem.start.xi)])
        span = np.array([0.0, problem.duration])
        found = integrate.solve_ivp(integrate.HomogeneousIVPSystem(rate), span, start, options)
        rows = np.full((NODES + 1, 18), np.nan)
        R, omega = found.y[-1][0].get_matrix(), found.y[-1][1].serialize()
        rows[-1] = np.concatenate([R.ravel(), np.zeros(3), omega, np.zeros(3)])
        return rows

    return path
