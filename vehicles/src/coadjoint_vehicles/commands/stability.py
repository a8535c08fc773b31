"""The command `coadjoint stability`: steady flight of a vehicle, its modes, and whether it is stable."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from math import degrees, floor, isfinite, isinf, nan, radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import tyro

from coadjoint.arrays import PyTree
from coadjoint.cli import terminal
from coadjoint.cli.metavars import called
from coadjoint.errors import ArgumentError

if TYPE_CHECKING:
    from coadjoint.stability import Stability as Report
    from coadjoint_vehicles.model.vehicle import Vehicle
    from coadjoint_vehicles.parts.part import Part
    from coadjoint_vehicles.trim.flight import SteadyFlight
    from coadjoint_vehicles.trim.reading import Trim

MOST = 200
"""Speeds in a range, at most."""


@dataclass(frozen=True)
class Stability:
    """Find steady flight of a vehicle, its modes, and whether it is stable: `coadjoint stability remus_100`."""

    BEGINS: ClassVar[str] = "Reading {vehicle}."

    vehicle: Annotated[tyro.conf.Positional[str], called("VEHICLE")]
    """A vehicle that is shipped, or a TOML file of your own."""
    speed: Annotated[str, called("M_S[,M_S …]")] = "1.5"
    """Through the water, m/s; 0 is hanging at rest; several as `0.5,1,2` or `0.5:2.5:0.25` also draw a figure."""
    climb: Annotated[float, called("DEGREES")] = 0.0
    """Angle of the path above the horizon, degrees; 90 is vertical ascent."""
    depth: Annotated[float, called("METRES")] = 0.0
    """Depth, m."""
    rudder: Annotated[float | None, called("DEGREES")] = None
    """Turn, with the part `rudder` at this angle, degrees; positive to starboard."""
    turning: bool = False
    """Let the vehicle turn, where held actuators make it."""
    hold: Annotated[tyro.conf.UseAppendAction[tuple[str, ...]], tyro.conf.arg(metavar="NAME=VALUE")] = ()
    """An actuator that stays at a value, SI units; repeatable. The others move to hold the motion."""
    free: Annotated[tuple[str, ...], called("NAME …")] = ()
    """The actuators that may move, as in `--free stern_planes propeller`; by default all that are not held."""
    without: Annotated[tuple[str, ...], called("NAME …")] = ()
    """Parts to leave out, as in `--without stern_planes rudder`."""
    out: Annotated[Path | None, called("FILE")] = None
    """The figure, by default NAME_stability.png where there are several speeds."""
    json: bool = False
    """Print JSON, and nothing else."""

    def __call__(self) -> int:
        from coadjoint import checks
        from coadjoint_vehicles.files.registry import load_vehicle
        from coadjoint_vehicles.trim.flight import SteadyFlight

        speeds = speeds_from(self.speed)
        checks.number(self.climb, "--climb, in degrees,", -90, 90)
        vehicle = _without(load_vehicle(self.vehicle), self.without)
        hold = dict(map(_setting, self.hold))
        if self.rudder is not None:
            hold["rudder"] = radians(_setting(f"rudder={self.rudder}")[1])
        turning = self.turning or self.rudder is not None
        kinds = {"climb": radians(self.climb), "turning": turning, "depth": self.depth}
        flight = SteadyFlight(vehicle, hold=hold, free=self.free or None, **kinds)
        found, failures = _fly(flight, speeds)
        if not found:
            raise ArgumentError(next(iter(failures.values())))
        picture = self._draw(vehicle, found) if len(speeds) > 1 or self.out is not None else None
        if self.json:
            terminal.json(_summary(vehicle, found, failures, picture))
        elif len(speeds) == 1:
            terminal.fields(_card(flight, *found[speeds[0]]))
        else:
            _table(vehicle, found)
        if not self.json:
            for speed, failure in failures.items():
                terminal.complain(f"At {speed:g} m/s: {failure}")
            if picture is not None:
                terminal.line(f"Figure: {picture}.")
        return 0

    def _draw(self, vehicle: Vehicle, found: dict[float, tuple[Trim, Report]]) -> Path:
        from coadjoint.extending import stability_figure
        from coadjoint.plotting.style import save

        name = "".join(letter if letter.isalnum() else "_" for letter in vehicle.name.lower())
        path = self.out or Path(f"{name}_stability.png")
        return save(stability_figure(list(found), [report for _, report in found.values()]), path, dpi=160)


def speeds_from(text: str) -> list[float]:
    """Speeds from `1.5`, `0.5,1,2` or `first:last:step`; raises ArgumentError."""
    from coadjoint import checks

    try:
        if ":" in text:
            first, last, step = (float(part) for part in text.split(":"))
            count = floor((last - first) / step + 1e-9) + 1 if step > 0 else 0
            found = [round(first + k * step, 12) for k in range(min(count, MOST + 1))]
        else:
            found = [float(part) for part in text.split(",")]
    except (ValueError, OverflowError):  # the latter of an endless range
        found = []
    fits = found and len(found) <= MOST and all(0 <= speed < 1000.0 for speed in found)
    checks.expect(
        fits, text, "--speed", f"a speed in m/s, a list such as 0.5,1,2 or a range first:last:step of at most {MOST}"
    )
    return found


def _setting(text: str | tuple[str, ...]) -> tuple[str, float]:
    from coadjoint import checks

    text = text if isinstance(text, str) else text[0]
    name, _, value = text.partition("=")
    found = nan
    with suppress(ValueError):
        found = float(value)
    checks.expect(isfinite(found), text, "--hold", "NAME=VALUE with a finite number, as in propeller=15")
    return name.strip(), found


def _without(vehicle: Vehicle, names: tuple[str, ...]) -> Vehicle:
    for name in names:
        vehicle.part(name)
    return replace(vehicle, parts=tuple(part for part in vehicle.parts if part.name not in names))


def _fly(flight: SteadyFlight, speeds: list[float]) -> tuple[dict[float, tuple[Trim, Report]], dict[float, str]]:
    """Trim and stability at each speed where steady flight was found, and the reasons at the others."""
    from coadjoint.stability import stability
    from coadjoint_vehicles.trim.reading import trim

    found, failures, motion = {}, {}, None
    for speed in speeds:
        try:
            motion = flight.at(speed, near=motion)
        except ArgumentError as error:
            failures[speed] = str(error)
        else:
            found[speed] = trim(flight.vehicle, motion), stability(motion)
    return found, failures


def _card(flight: SteadyFlight, trimmed: Trim, report: Report) -> list[tuple[str, str]]:
    vehicle = flight.vehicle
    rows = [("vehicle", vehicle.name), ("motion", _motion(trimmed))]
    rows += [("attitude", f"pitch {_degrees(trimmed.pitch)}, roll {_degrees(trimmed.roll)}")]
    if trimmed.speed:
        rows.append(("flow", f"attack {_degrees(trimmed.attack)}, sideslip {_degrees(trimmed.sideslip)}"))
    for part in vehicle.commanded:
        over = ", beyond its limit" if part.name in trimmed.beyond else ""
        rows.append((part.name, _value(trimmed.actuators[part.name], part) + over))
    if trimmed.beyond:
        rows.append(("limits", _limits(flight, trimmed)))
    for mode in report.modes:
        name, _, does = str(mode).partition(": ")
        rows.append((name, does))
    if report.linear.zero_modes:
        rows.append(("zero modes", f"{report.linear.zero_modes}, of other momenta and symmetries"))
    if report.motion.system.forces is None:
        rows.append(("energy–Casimir", f"{report.energy.verdict}: {report.energy.reason}"))
    return [*rows, ("verdict", report.verdict)]


def _limits(flight: SteadyFlight, trimmed: Trim) -> str:
    """The needs of a motion, or held values, beyond the limits of actuators, in sentences."""
    needs, held = [], []
    for name, (value, limit) in trimmed.exceeded.items():
        part = flight.vehicle.part(name)
        beyond = f"at {_amount(value, part)}, beyond its limit of {_amount(limit, part)}"
        (held if name in flight.hold else needs).append(f"{name} {beyond}")
    what = "No turn within all limits was found: this one" if flight.looks_for_turns else "This motion"
    sentences = [f"{what} needs {' and '.join(needs)}."] if needs else []
    return " ".join([*sentences, *(f"{name.replace(' at ', ' is held at ', 1)}." for name in held)])


def _unit(part: Any) -> str:
    return part.command.unit if part.units is None else part.units.get("position", part.command.unit)


def _amount(value: float, part: Part) -> str:
    unit = _unit(part)
    return _degrees(value) if unit == "rad" else f"{value:.4g} {unit}"


def _motion(trimmed: Trim) -> str:
    if trimmed.speed < 1e-9:
        return "at rest"
    goes = "climbing" if trimmed.climb > 0 else "diving"
    path = "level" if abs(trimmed.climb) < 1e-9 else f"{goes} at {_degrees(abs(trimmed.climb))}"
    if abs(trimmed.climb) > radians(90) - 1e-6:
        spin = degrees(abs(trimmed.turn_rate))
        return f"{trimmed.speed:g} m/s, {goes} vertically" + (f", spinning at {spin:.3g}°/s" if spin else "")
    if isinf(trimmed.radius):
        return f"{trimmed.speed:g} m/s, straight, {path}"
    side = "starboard" if trimmed.turn_rate > 0 else "port"
    rate = degrees(abs(trimmed.turn_rate))
    return f"{trimmed.speed:g} m/s, turning to {side} at {rate:.3g}°/s, radius {trimmed.radius:.3g} m, {path}"


def _degrees(angle: float) -> str:
    return f"{round(degrees(angle), 2) + 0.0:.2f}°"


def _value(actual: PyTree, part: Any) -> str:
    if part.units is not None:
        return ", ".join(f"{key} {float(getattr(actual, key)):.4g} {unit}" for key, unit in part.units.items())
    unit = part.command.unit
    values = actual.ravel().tolist()
    if unit == "rad":
        return ", ".join(_degrees(value) for value in values)
    return ", ".join(f"{round(value, 9) + 0.0:.4g}" for value in values) + f" {unit}"


def _table(vehicle: Vehicle, found: dict[float, tuple[Trim, Report]]) -> None:
    plain = [part for part in vehicle.commanded if part.units is None]
    single = [part for part in plain if part.command is not None and part.command.shape in ((), (1,))]
    rows = []
    for speed, (trimmed, report) in found.items():
        first = report.modes[0] if report.modes else None
        values = [_value(trimmed.actuators[part.name], part) for part in single]
        stars = [
            value + ("!" if part.name in trimmed.beyond else "") for part, value in zip(single, values, strict=True)
        ]
        rows.append((f"{speed:g}", *stars, f"{report.growth_rate:.4f}", first.name if first else "", report.verdict))
    names = [part.name for part in single]
    terminal.table(("speed", *names, "growth (1/s)", "slowest or growing mode", "verdict"), rows)


def _summary(vehicle: Vehicle, found: Any, failures: dict[float, str], picture: Path | None) -> dict[str, object]:
    motions = []
    for speed, (trimmed, report) in found.items():
        angles = {key: getattr(trimmed, key) for key in ("climb", "pitch", "roll", "attack", "sideslip", "turn_rate")}
        motions.append(
            {
                "speed": speed,
                **angles,
                "radius": None if isinf(trimmed.radius) else trimmed.radius,
                "actuators": {name: _plain(value) for name, value in trimmed.actuators.items()},
                "beyond_limits": list(trimmed.beyond),
                "exceeded": {
                    name: {"value": value, "limit": limit, "unit": _unit(vehicle.part(name))}
                    for name, (value, limit) in trimmed.exceeded.items()
                },
                **report.summary(),
            }
        )
    failed = {f"{speed:g}": sentence for speed, sentence in failures.items()}
    return {"vehicle": vehicle.name, "motions": motions, "not_found": failed, "figure": picture and str(picture)}


def _plain(value: Any) -> PyTree:
    return {key: _plain(getattr(value, key)) for key in value} if hasattr(value, "asdict") else value.tolist()
