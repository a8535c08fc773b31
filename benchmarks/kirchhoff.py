"""Bodies in an ideal fluid for 500 s: energy, impulse and its moment, beside simulators that engineers use.

With V = (ν, ω), the generalised mass M (6, 6) about the centre of buoyancy, and weight equal to buoyancy,
E = ½ V·MV − m g r_g·d, d down in the body; (P, Π) = MV. R P is conserved, and so is q × R P + R Π if r_g = 0, else its
vertical part.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np

import coadjoint as co
from benchmarks import peers
from coadjoint.models import catalogue

DURATION = 500.0
"""s."""
STEP = 0.05
"""s, of ours and of whoever can take it."""
LOST = 1e3
"""A relative energy error beyond which a program has lost the motion."""

_MIDPOINT = co.Midpoint()
METHODS = {
    "left rule": co.LeftRectangle(co.Cayley()),
    "midpoint": _MIDPOINT,
    "Suzuki-4 (midpoint)": co.Suzuki4(_MIDPOINT),
    "Kahan–Li-8 (midpoint)": co.methods.KahanLi8(_MIDPOINT),
    "energy–momentum": co.EnergyMomentum(),
}

OTHERS = {"mujoco": "MuJoCo", "python_vehicle_simulator": "PythonVehicleSimulator"}
"""Simulators by the names of their packages; the second is installed from its repository, `pip install -e .` there."""

Rows = np.ndarray
"""y = (R by rows, q, ω, ν) at nodes, (…, 18)."""


@dataclass(frozen=True)
class Fluid:
    """A body of the catalogue in an ideal fluid, with its start."""

    title: str
    system: co.System
    start: co.State

    @cached_property
    def mass(self) -> np.ndarray:
        """M, (6, 6), in the order ν, ω."""
        p: Any = self.system.parameters
        r = np.asarray(p.center_of_mass)
        hat = np.array([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]])
        rigid = np.block([[p.mass * np.eye(3), -p.mass * hat], [p.mass * hat, p.inertia - p.mass * hat @ hat]])
        return rigid + np.asarray(p.added_mass)

    @cached_property
    def righting(self) -> np.ndarray:
        """m g r_g, N m."""
        p: Any = self.system.parameters
        return p.mass * p.gravity * np.asarray(p.center_of_mass)

    @cached_property
    def y0(self) -> Rows:
        s = self.start
        return np.concatenate([s.g.ravel(), s.q, s.xi, s.nu])

    def invariants(self, y: Rows) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """E, R P and what is conserved of the moment, at the nodes."""
        R, q, V = y[:, :9].reshape(-1, 3, 3), y[:, 9:12], np.concatenate([y[:, 15:18], y[:, 12:15]], axis=1)
        momentum = V @ self.mass
        impulse, spin = (np.einsum("tij,tj->ti", R, part) for part in (momentum[:, :3], momentum[:, 3:]))
        energy = 0.5 * np.sum(V * momentum, axis=1) - R[:, 2] @ self.righting
        moment = np.cross(q, impulse) + spin
        return energy, impulse, moment[:, 2:] if np.any(self.righting) else moment

    def rate(self, y: Rows) -> Rows:
        """ẏ: Ṗ = P × ω, Π̇ = Π × ω + P × ν + m g r_g × d."""
        R, omega, nu = y[:9].reshape(3, 3), y[12:15], y[15:18]
        momentum = self.mass @ np.concatenate([nu, omega])
        P, Pi = momentum[:3], momentum[3:]
        torque = _cross(Pi, omega) + _cross(P, nu) + _cross(self.righting, R[2])
        V = self._inverse @ np.concatenate([_cross(P, omega), torque])
        return np.concatenate([np.stack([_cross(row, omega) for row in R]).ravel(), R @ nu, V[3:], V[:3]])

    @cached_property
    def _inverse(self) -> np.ndarray:
        return np.linalg.inv(self.mass)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def ellipsoid() -> Fluid:
    """Semi-axes 0.5, 0.2, 0.3 m, of the water's density."""
    entry = catalogue["kirchhoff_ellipsoid"]
    system = entry.make()
    return Fluid("an ellipsoid of the water's density", system, entry.start(system))


def remus() -> Fluid:
    """REMUS 100 without damping, fins and propeller, turning out of its course."""
    entry = catalogue["underwater_vehicle_general"]
    system = entry.make()
    start = entry.start(system, velocity=(1.5, 0.1, 0.0), angular_velocity=(0.1, 0.0, 0.05))
    return Fluid("REMUS 100 without damping", system, start)


@dataclass(frozen=True)
class Program:
    """A program with its step: `rows()` gives y at so many nodes, every step where that is possible."""

    name: str
    step: float
    rows: Callable[[], Rows]


def measure(quick: bool) -> dict[str, Any]:
    """For both bodies and every program, how far energy, impulse and moment went, and how fast it was."""
    duration = 50.0 if quick else DURATION
    found: dict[str, Any] = {"duration": duration, "bodies": {}, "ours": tuple(METHODS)}
    for body in (ellipsoid(), remus()):
        found["bodies"][body.title] = [_row(body, program, duration) for program in _programs(body, duration)]
    found["missing"] = [title for name, title in OTHERS.items() if find_spec(name) is None]
    return found


def _programs(body: Fluid, duration: float) -> Iterator[Program]:
    for name, method in METHODS.items():
        yield Program(name, STEP, _ours(body, method, duration))
    for h in (STEP, 0.02):
        yield Program("RK4 (NumPy)", h, lambda h=h: _rk4(body, h, duration))
    if find_spec("mujoco") and not np.any(body.righting):
        for integrator, h in (("RK4", STEP), ("RK4", 0.002), ("implicit", 0.002), ("Euler", 0.002)):
            yield Program(
                f"MuJoCo {integrator}", h, lambda i=integrator, h=h: peers.by_mujoco_in_fluid(body.y0, i, h, duration)
            )
    if find_spec("python_vehicle_simulator") and np.any(body.righting):
        for h in (0.02, 0.002):
            yield Program("PythonVehicleSimulator, as it is", h, lambda h=h: _by_pvs(body, h, duration, True))
        yield Program("the same with all of its terms", 0.02, lambda: _by_pvs(body, 0.02, duration, False))


def _ours(body: Fluid, method: co.methods.Method, duration: float) -> Callable[[], Rows]:
    def rows() -> Rows:
        s = co.simulate(body.system, body.start, dt=STEP, duration=duration, method=method, progress=False).records
        V = np.concatenate([s.pi, s.mu], axis=1) @ np.linalg.inv(body.mass)
        return np.concatenate([s.g.reshape(-1, 9), s.q, V[:, 3:], V[:, :3]], axis=1)

    return rows


def _rk4(body: Fluid, h: float, duration: float) -> Rows:
    y = body.y0.copy()
    rows = [y]
    for _ in range(round(duration / h)):
        k1 = body.rate(y)
        k2 = body.rate(y + 0.5 * h * k1)
        k3 = body.rate(y + 0.5 * h * k2)
        k4 = body.rate(y + h * k3)
        y = y + h / 6 * (k1 + 2 * (k2 + k3) + k4)
        rows.append(y)
    return np.array(rows)


def _by_pvs(body: Fluid, h: float, duration: float, as_it_is: bool) -> Rows:
    """Its REMUS 100 with drag, lift, damping and propeller taken away, by its own Euler steps.

    `as_it_is`: without the eight terms of the Coriolis matrix of added mass that it sets to zero, Munk's among them.
    """
    module: Any = import_module("python_vehicle_simulator.vehicles.remus100")
    tools: Any = import_module("python_vehicle_simulator.lib.gnc")
    kept = {name: getattr(module, name) for name in ("forceLiftDrag", "crossFlowDrag", "m2c")}
    module.forceLiftDrag = module.crossFlowDrag = lambda *_: np.zeros(6)
    if not as_it_is:
        module.m2c = lambda M, V: _Unwritable(kept["m2c"](M, V))
    try:
        vehicle = module.remus100()
        vehicle.T_surge = vehicle.T_sway = vehicle.T_heave = vehicle.T_yaw = np.inf
        vehicle.zeta_roll = vehicle.zeta_pitch = 0.0
        y = body.y0
        V, eta = np.concatenate([y[15:18], y[12:15]]), np.zeros(6)
        idle, rows = np.zeros(3), []
        for _ in range(round(duration / h) + 1):
            rows.append(np.concatenate([tools.Rzyx(*eta[3:]).ravel(), eta[:3], V[3:], V[:3]]))
            V, _ = vehicle.dynamics(eta, V, idle.copy(), idle, h)
            eta = tools.attitudeEuler(eta, V, h)
            if not np.all(np.isfinite(V)) or np.max(np.abs(V)) > 1e6:
                break
        return np.array(rows)
    finally:
        for name, function in kept.items():
            setattr(module, name, function)


class _Unwritable(np.ndarray):
    """A matrix whose entries stay what they are when they are assigned to."""

    def __new__(cls, matrix: np.ndarray):
        return np.asarray(matrix).view(cls)

    def __setitem__(self, key: Any, value: Any) -> None:
        return None


def _row(body: Fluid, program: Program, duration: float) -> dict[str, Any]:
    """The largest errors over all steps, the energy's in both halves, and its course; where it was lost, when."""
    row: dict[str, Any] = {"name": program.name, "step": program.step}
    with np.errstate(all="ignore"):
        y = program.rows()
        energy, impulse, moment = body.invariants(y)
        change = energy / energy[0] - 1
        wild = ~np.isfinite(change) | (np.abs(change) > LOST)
    if len(y) <= round(duration / program.step) or np.any(wild):
        end = int(np.argmax(wild)) if np.any(wild) else len(y)
        return {**row, "failed": end * program.step, "course": _course(change[:end], program.step)}
    half = len(change) // 2
    arm = float(np.max(np.linalg.norm(y[:, 9:12], axis=1)))
    return {
        **row,
        "energy": [float(np.max(np.abs(part))) for part in (change[:half], change[half:])],
        "end": float(change[-1]),
        "impulse": _drift(impulse) / float(np.linalg.norm(impulse[0])),
        "moment": _drift(moment) / float(np.linalg.norm(moment[0]) + arm * np.linalg.norm(impulse[0])),
        "course": _course(change, program.step),
    }


def _course(change: np.ndarray, step: float) -> list[tuple[float, float]]:
    """Up to 500 pairs of a time and the largest error so far."""
    every, worst = max(len(change) // 500, 1), np.maximum.accumulate(np.abs(change))
    return [(float(k * step), float(worst[k])) for k in range(every, len(change), every)]


def _drift(values: np.ndarray) -> float:
    return float(np.max(np.linalg.norm(values - values[0], axis=1)))
