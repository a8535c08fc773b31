"""Vehicles without the library: Fossen's equations in body axes from the numbers of their files, by SciPy's DOP853."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

import coadjoint_vehicles

FILES = Path(coadjoint_vehicles.__file__).parent / "files" / "data"
NODES, WEIGHTS = np.polynomial.legendre.leggauss(64)
FACTORS = {"mm": 1e-3, "deg": np.pi / 180, "rpm": 1 / 60, "L": 1e-3}
T200 = np.array([
    (1100, -4.07), (1144, -3.59), (1208, -2.58), (1324, -1.16), (1444, -0.15), (1468, -0.04), (1472, 0.0), (1528, 0.0),
    (1532, 0.04), (1592, 0.51), (1692, 1.69), (1800, 3.42), (1868, 4.79), (1896, 5.22), (1900, 5.25),
]).T * [[1.0], [9.80665]]  # fmt: skip
"""Pulse width, µs, and thrust, N, at 16 V: rows of the table of Blue Robotics that docs/vehicles.md names."""


def read(name: str) -> dict[str, Any]:
    """Sections of a vehicle file by name, numbers in SI units."""
    whole = tomllib.loads((FILES / f"{name}.toml").read_text(encoding="utf-8"))

    def plain(section: dict[str, Any]) -> dict[str, Any]:
        given = {key: value for key, value in section.items() if isinstance(value, dict)}
        return {key: np.asarray(v["value"], float) * FACTORS.get(v["unit"], 1.0) for key, v in given.items()}

    added = plain(whole["added_mass"])
    H = np.eye(6)
    H[:3, 3:] = -hat(added.get("about", np.zeros(3)))
    found = {"body": plain(whole["body"]), "added_mass": H.T @ np.diag(added["matrix"]) @ H}
    return found | {part["name"]: plain(part) for part in whole["part"]}


class Body:
    """State: q (3), R (9), ν = (v, ω) (6), actuators; `actuated`: names of parts and how many actuators each has.

    `changes`: numbers by the names that they have as parameters of the library.
    """

    file: str
    actuated: tuple[tuple[str, int], ...]

    def __init__(self, changes: Mapping[str, float] | None = None) -> None:
        self.numbers = read(self.file)
        for name, value in (changes or {}).items():
            path, _, index = name.rstrip("]").partition("[")
            *section, key = path.split(".")
            place = self.numbers[section[0]] if section else self.numbers
            where = tuple(map(int, index.split(","))) if index else ()
            place[key] = np.array(place[key])
            place[key][where] = value
            if len(where) == 2:
                place[key][where[::-1]] = value
        body = self.numbers["body"]
        m, c = float(body["mass"]), hat(body["center_of_mass"])
        M = np.block([[m * np.eye(3), -m * c], [m * c, np.diag(body["inertia"]) - m * c @ c]])
        self.M = M + self.numbers["added_mass"]
        self.inverse, self.rho = np.linalg.inv(self.M), float(body["fluid_density"])
        self.weight = m * float(body["gravity"])
        lags = [np.broadcast_to(self.numbers[name]["lag"], count) for name, count in self.actuated]
        self.lags = np.concatenate(lags)
        self.rates = np.full(len(self.lags), np.inf)

    def force(self, nu: np.ndarray, down: np.ndarray, actuators: np.ndarray) -> np.ndarray:
        raise NotImplementedError

    def limited(self, commands: np.ndarray) -> np.ndarray:
        raise NotImplementedError

    def rate(self, state: np.ndarray, commands: np.ndarray, push: np.ndarray) -> np.ndarray:
        R, nu, actuators = state[3:12].reshape(3, 3), state[12:18], state[18:]
        v, omega = nu[:3], nu[3:]
        P = self.M @ nu
        turning = np.concatenate([cross(omega, P[:3]), cross(omega, P[3:]) + cross(v, P[:3])])
        nu_dot = self.inverse @ (self.force(nu, R[2], actuators) + push - turning)
        moved = np.clip((self.limited(commands) - actuators) / self.lags, -self.rates, self.rates)
        return np.concatenate([R @ v, (R @ hat(omega)).reshape(-1), nu_dot, moved])

    def run(
        self, start: np.ndarray, time: np.ndarray, commands: np.ndarray, late: float, pushes: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """The state at the times, and `late` s before each of them; commands (times, actuators), and pushes, (times, 6)
        N and N m, held from each time to the next."""
        states, before, state = [start], [start], start
        pushes = np.zeros((len(time), 6)) if pushes is None else pushes
        for i in range(len(time) - 1):
            span = (time[i], time[i + 1])
            given, push = commands[i], pushes[i]
            solved = solve_ivp(
                lambda t, x, given=given, push=push: self.rate(x, given, push), span, state, method="DOP853",
                rtol=1e-7, atol=1e-8, t_eval=sorted({span[1] - late, span[1]}),
            )  # fmt: skip
            before.append(solved.y[:, 0])
            state = solved.y[:, -1]
            states.append(state)
        return np.stack(states), np.stack(before)


class Remus(Body):
    """REMUS 100: rudder, stern planes, rad, and revolutions of the propeller, 1/s. `cubic`: c of a rudder that turns
    the flow as one at δ − c δ³ would."""

    file = "remus_100"
    actuated = (("rudder", 1), ("stern_planes", 1), ("propeller", 1))

    def __init__(self, changes: Mapping[str, float] | None = None, cubic: float = 0.0) -> None:
        super().__init__(changes)
        self.cubic = cubic

    def force(self, nu: np.ndarray, down: np.ndarray, actuators: np.ndarray) -> np.ndarray:
        v, omega, p, n = nu[:3], nu[3:], self.numbers, actuators[2]
        angles = actuators[0] - self.cubic * actuators[0] ** 3, actuators[1]
        tau = np.concatenate([np.zeros(3), cross(p["body"]["center_of_mass"], self.weight * down)])
        tau -= np.exp(-p["damping"]["fading"] * np.linalg.norm(v)) * p["damping"]["linear"] * nu
        hull = p["hull"]
        tau[0] -= 0.5 * self.rho * hull["axial_drag"] * hull["axial_area"] * abs(v[0]) * v[0]
        x = 0.5 * hull["length"] * NODES
        across = np.stack([v[1] + omega[2] * x, v[2] - omega[1] * x])
        drag = -0.5 * self.rho * hull["crossflow_drag"] * hull["width"] * np.linalg.norm(across, axis=0) * across
        drag *= 0.5 * hull["length"] * WEIGHTS
        tau += [0, *drag.sum(axis=1), 0, -drag[1] @ x, drag[0] @ x]
        for name, angle in zip(("rudder", "stern_planes"), angles, strict=True):
            force = self._fin(p[name], v + cross(omega, p[name]["position"]), angle)
            tau += np.concatenate([force, cross(p[name]["position"], force)])
        screw = p["propeller"]
        J = (1 - screw["wake_fraction"]) * max(v[0], 0.0) / screw["diameter"] if n > 0 else 0.0
        K = self.rho * screw["diameter"] ** 4 * abs(n)
        tau[0] += (1 - screw["thrust_deduction"]) * K * (screw["thrust"][0] * n + screw["thrust"][1] * J)
        tau[3] += screw["torque_fraction"] * K * screw["diameter"] * (screw["torque"][0] * n + screw["torque"][1] * J)
        return tau

    def _fin(self, fin: dict[str, Any], w: np.ndarray, angle: float) -> np.ndarray:
        """Lift across the flow and drag along it, in the plane of hull and normal; below and above stall."""
        along, across = w[0], w @ fin["normal"]
        alpha, slope = np.arctan2(across, along) + angle, fin["lift_slope"]
        stalled = 0.5 * (1 + np.tanh(50 * (np.sin(alpha) ** 2 - np.sin(fin["stall"]) ** 2)))
        plain = slope * np.sin(alpha) * np.cos(alpha)
        lift = (1 - stalled) * plain + stalled * np.sin(2 * alpha)
        aspect = 2 * slope / (2 * np.pi - slope)
        drag = (1 - stalled) * plain**2 / (np.pi * aspect) + stalled * 2 * np.sin(alpha) ** 2
        speed = np.hypot(along, across)
        ahead = lift * across - drag * along
        aside = -(lift * along + drag * across)
        return 0.5 * self.rho * fin["area"] * speed * (ahead * np.array([1.0, 0, 0]) + aside * fin["normal"])

    def limited(self, commands: np.ndarray) -> np.ndarray:
        limits = np.array([self.numbers[name]["limit"] for name, _ in self.actuated])
        return np.clip(commands, -limits, limits)


class BlueRov(Body):
    """BlueROV2 Heavy, von Benzon: pulse widths of eight thrusters, µs. `weak`: what is left of a thrust that
    pushes astern."""

    file = "bluerov2_heavy_von_benzon"
    actuated = (("thrusters", 8),)

    def __init__(self, changes: Mapping[str, float] | None = None, weak: float = 1.0) -> None:
        super().__init__(changes)
        self.weak = weak

    def force(self, nu: np.ndarray, down: np.ndarray, actuators: np.ndarray) -> np.ndarray:
        p, body = self.numbers, self.numbers["body"]
        lift = -self.rho * float(body["volume"] * body["gravity"]) * down
        tau = np.concatenate([self.weight * down + lift, cross(body["center_of_buoyancy"], lift)])
        tau -= p["damping"]["linear"] * nu + p["damping"]["quadratic"] * np.abs(nu) * nu
        thrusts = np.interp(actuators, *T200)
        thrusts = np.where(thrusts < 0, self.weak, 1.0) * thrusts
        return tau + p["thrusters"]["allocation"] @ thrusts

    def limited(self, commands: np.ndarray) -> np.ndarray:
        return np.clip(commands, T200[0, 0], T200[0, -1])


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a × b; np.cross takes ten times as long."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def hat(w: np.ndarray) -> np.ndarray:
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def columns(states: np.ndarray) -> dict[str, np.ndarray]:
    """What sensors would say of states."""
    R = states[:, 3:12].reshape(-1, 3, 3)
    angles = {
        "roll": np.arctan2(R[:, 2, 1], R[:, 2, 2]),
        "pitch": -np.arcsin(R[:, 2, 0]),
        "heading": np.arctan2(R[:, 1, 0], R[:, 0, 0]),
    }
    position = dict(zip(("north", "east", "depth"), states[:, :3].T, strict=True))
    return position | angles | dict(zip("uvwpqr", states[:, 12:18].T, strict=True))
