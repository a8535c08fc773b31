"""The command `coadjoint vehicles`: the list of shipped vehicles, and the data sheet of one."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import tyro

from coadjoint.cli import terminal
from coadjoint.cli.metavars import called
from coadjoint.errors import ArgumentError
from coadjoint.texts import Table

if TYPE_CHECKING:
    from coadjoint_vehicles.model.vehicle import Quantity, Vehicle
    from coadjoint_vehicles.parts.part import Part


@dataclass(frozen=True)
class Vehicles:
    """List the vehicles that are shipped, show one, or print a mission of it to start from.

    `coadjoint vehicles show remus_100`, `coadjoint vehicles mission remus_100 > dive.toml`, `coadjoint vehicles mission
    remus_100 --manoeuvre zigzag_20 > zigzag.toml`.
    """

    BEGINS: ClassVar[str] = "Reading the vehicles."

    action: Annotated[
        tyro.conf.Positional[Literal["list", "show", "mission", "new"]], called("[{list,show,mission,new}]")
    ] = "list"
    """The action; `new` prints a commented vehicle file to start from."""
    name: Annotated[tyro.conf.Positional[str], called("[VEHICLE]")] = ""
    """A vehicle: the name of a shipped one, or the path of a TOML file."""
    toml: bool = False
    """Print its file, as a start for your own, and nothing else."""
    manoeuvre: Annotated[
        Literal["turning_circle", "zigzag_10", "zigzag_20", "spiral", "stop", "pull_out"] | None,
        called("{turning_circle,zigzag_10,zigzag_20,spiral,stop,pull_out}"),
    ] = None
    """A mission of this standard manoeuvre, with `mission`."""
    json: bool = False
    """Print JSON, and nothing else."""

    def __call__(self) -> int:
        if self.manoeuvre is not None and self.action != "mission":
            raise ArgumentError(f"--manoeuvre belongs to `mission`: coadjoint vehicles mission {self.name or 'NAME'}.")
        if self.action == "list":
            if self.name or self.toml:
                raise ArgumentError(f"To show one vehicle write: coadjoint vehicles show {self.name or 'NAME'}.")
            rows = registry()
            if self.json:
                terminal.json(rows)
            else:
                show_shelf(rows)
        elif self.action == "new":
            from coadjoint_vehicles.files.example import EXAMPLE

            if self.name or self.json:
                raise ArgumentError("`coadjoint vehicles new` prints a file of TOML and takes nothing else.")
            terminal.text(EXAMPLE)
        elif not self.name:
            raise ArgumentError("Which vehicle? `coadjoint vehicles` lists them; the path of your own file works too.")
        elif self.toml and self.json:
            raise ArgumentError("The file is TOML, not JSON: leave --toml or --json out.")
        elif self.action == "mission":
            if self.json:
                raise ArgumentError("A mission is TOML, not JSON: leave --json out.")
            from coadjoint_vehicles.missions.example import example, standard_manoeuvre

            one = self.manoeuvre
            terminal.text(example(self.name) if one is None else standard_manoeuvre(self.name, one))
        elif self.toml:
            terminal.text(text_of(self.name))
        elif self.json:
            terminal.json(described(loaded(self.name)))
        else:
            show(loaded(self.name))
        return 0


def registry() -> list[Table]:
    """Every shipped vehicle: name, mass, length, kinds of parts, controller, first source, description."""
    from coadjoint_vehicles.files.registry import load_vehicle, vehicle_names

    return [_row(name, load_vehicle(name)) for name in vehicle_names()]


def loaded(name: str) -> Vehicle:
    """A shipped vehicle, or that of a path; its warnings are part of the text. Raises ArgumentError, FileError."""
    from coadjoint_vehicles.files.registry import load_vehicle

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return load_vehicle(name)


def text_of(name: str) -> str:
    """The file of a vehicle, unchanged."""
    from pathlib import Path

    from coadjoint_vehicles.files.registry import is_path, vehicle_text

    if is_path(name):
        loaded(name)
        return Path(name).read_text(encoding="utf-8-sig")
    return vehicle_text(name)


def described(vehicle: Vehicle) -> Table:
    """The data sheet of a vehicle, for JSON."""
    from coadjoint_vehicles.files.summary import summary

    return {
        "name": vehicle.name,
        "description": vehicle.description,
        "note": vehicle.note,
        "summary": summary(vehicle)._asdict(),
        "driven": {name: _listed(found) for name, found in _driven(vehicle).items()},
        "parts": [_part(part) for part in vehicle.parts],
        "sensors": [_sensor(one) for one in vehicle.sensors],
        "controller": _controller(vehicle),
        "numbers": {key: number._asdict() for key, number in vehicle.provenance.items()},
        "sources": dict(vehicle.sources),
        "licence": vehicle.licence,
        "licences": dict(vehicle.licences),
        "warnings": list(vehicle.warnings),
    }


def show_shelf(rows: list[Table]) -> None:
    """A table of all vehicles."""
    columns = ("vehicle", "mass (kg)", "length (m)", "parts", "controller", "source")
    shown = []
    for row in rows:
        length = "" if row["length"] is None else f"{row['length']:g}"
        shown.append(
            (row["name"], f"{row['mass']:.5g}", length, ", ".join(row["parts"]), row["controller"], row["source"])
        )
    terminal.table(columns, shown)


def show(vehicle: Vehicle) -> None:
    """Derived quantities of a vehicle, its parts, every number with unit, source and note, and its warnings."""
    found = described(vehicle)
    derived = found["summary"]
    speed, height = derived["terminal_speed"], derived["metacentric_height"]
    fields = [
        ("name", vehicle.name),
        ("description", vehicle.description),
        ("note", vehicle.note),
        ("licence", vehicle.licence),
        ("mass", f"{derived['mass']:.6g} kg, displaces {derived['displaced_mass']:.6g} kg of water"),
        ("net weight", _net(derived["net_weight"], derived["mass"] * vehicle.gravity)),
        ("metacentric height", _height(height)),
        ("terminal speed", _terminal(vehicle, speed)),
        ("passivity", _passivity(vehicle)),
        ("controller", "" if found["controller"] is None else _told_controller(found["controller"])),
    ]
    terminal.fields([(name, text) for name, text in fields if text])
    if found["parts"]:
        terminal.line("")
        rows = [(part["name"], part["kind"], part["command"] or "") for part in found["parts"]]
        terminal.table(("part", "kind", "command"), rows)
    if found["sensors"]:
        terminal.line("")
        rows = [(one["name"], one["kind"], f"{one['rate']:g}", ", ".join(one["reads"])) for one in found["sensors"]]
        terminal.table(("sensor", "kind", "rate (Hz)", "reads"), rows)
    terminal.line("")
    rows = [
        (key, _value(number), number.unit, number.source, number.note) for key, number in vehicle.provenance.items()
    ]
    terminal.table(("number", "value", "unit", "source", "note"), rows)
    if vehicle.sources:
        terminal.line("")
        rows = [(key, citation, vehicle.licences.get(key, "")) for key, citation in vehicle.sources.items()]
        terminal.table(("source", "citation", "licence"), rows)
    for sentence in vehicle.warnings:
        terminal.line(f"\nWarning: {sentence}")


def _row(name: str, vehicle: Vehicle) -> Table:
    controller = _controller(vehicle)
    return {
        "name": name,
        "mass": _total(vehicle),
        "length": None if vehicle.length is None else float(vehicle.length),
        "parts": sorted({_kind(part) for part in vehicle.parts}),
        "controller": "" if controller is None else controller["kind"],
        "source": _cited(vehicle),
        "description": vehicle.description,
    }


def _total(vehicle: Vehicle) -> float:
    from coadjoint_vehicles.model.loads import loads

    return loads(vehicle).mass


def _cited(vehicle: Vehicle) -> str:
    """The source of its mass, in short: an author or a repository."""
    return vehicle.sources.get(vehicle.provenance["body.mass"].source, "").partition(",")[0]


def _kind(part: Any) -> str:
    from coadjoint_vehicles.files.kinds import kind_of

    return kind_of(part)


def _sensor(one: Any) -> Table:
    reads = [f"{name} ({unit})" for name, unit in zip(one.names, one.units, strict=True)]
    return {"name": one.name, "kind": one.kind, "rate": float(one.rate), "latency": float(one.latency), "reads": reads}


def _part(part: Part) -> dict[str, object]:
    command = part.command
    shape = "" if command is None or command.shape == () else f" × {command.shape[0]}"
    return {"name": part.name, "kind": _kind(part), "command": None if command is None else f"{command.unit}{shape}"}


def _controller(vehicle: Vehicle) -> Table | None:
    if vehicle.controller is None:
        return None
    return {"kind": _kind(vehicle.controller), "inputs": dict(vehicle.controller.inputs)}


def _told_controller(controller: Table) -> str:
    inputs = ", ".join(f"{name} ({unit})" for name, unit in controller["inputs"].items())
    return f"{controller['kind']}; set points: {inputs}"


def _net(net: float, weight: float) -> str:
    if abs(net) <= 1e-9 * weight:
        return "0 N, it hovers"
    return f"{net:.4g} N, it {'sinks' if net > 0 else 'floats up'}"


def _height(height: float) -> str:
    if abs(height) < 1e-9:
        return "0 mm, the centres of buoyancy and mass coincide in height: no righting moment"
    side = "above" if height > 0 else "below"
    return f"{1000 * height:.4g} mm, the centre of buoyancy {side} the centre of mass"


def _terminal(vehicle: Vehicle, speed: float | None) -> str:
    from coadjoint_vehicles.files.summary import without_terminal_speed

    if speed is None:
        return without_terminal_speed(vehicle)
    return f"{speed:.4g} m/s ahead, with all forward propulsion at its limit"


def _driven(vehicle: Vehicle) -> Table:
    """Energy put in by its parts: in any motion up to 1 m/s, and going ahead."""
    from coadjoint_vehicles.trim.passivity import driven

    return {"anywhere": driven(vehicle), "ahead": driven(vehicle, ahead=True)}


def _listed(found: Any) -> Table | None:
    import numpy as np

    if found is None:
        return None
    return {key: np.asarray(value).tolist() for key, value in found._asdict().items()}


def _passivity(vehicle: Vehicle) -> str:
    import numpy as np

    from coadjoint_vehicles.trim.passivity import pushed
    from coadjoint_vehicles.trim.under_way import Level

    found = _driven(vehicle)
    worst = found["anywhere"]
    if worst is None and pushed(Level(vehicle)):
        return "not judged: its propulsion pushes it at rest, with actuators off"
    if worst is None:
        return "its parts only brake, in all motions up to 1 m/s that were tried, with actuators off"
    v, omega = (", ".join(f"{x:.2g}" for x in np.round(part, 3) + 0.0) for part in worst[2:4])
    where = "going ahead too" if found["ahead"] is not None else "not going ahead"
    return (
        f"its parts drive it in {worst.share:.0%} of the motions up to 1 m/s, {where}; most at v = ({v}) m/s, "
        f"ω = ({omega}) rad/s, by {worst.power:.3g} W, {worst.rate:.2g} of its energy a second"
    )


def _value(number: Quantity) -> str:
    import numpy as np

    if isinstance(number.value, str):
        return number.value
    found = np.asarray(number.value, dtype=float)
    if found.ndim == 2:
        return "; ".join(" ".join(f"{number:g}" for number in row) for row in found)
    return " ".join(f"{number:.6g}" for number in np.atleast_1d(found))
