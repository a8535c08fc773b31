"""The goals that were set for speed, and what this run says about them."""

from __future__ import annotations

from typing import Any

from benchmarks.one import YARDSTICK
from benchmarks.tables import Table

Found = dict[str, Any]


def goals(found: Found) -> Table:
    """A row a goal that this run has measured: bound, measured, met or not."""
    rows: list[tuple[str, float, float, bool]] = []
    if "one" in found:
        rows += _one(found["one"]["rows"])
    if "many_1" in found:
        rows += _many(found["many_1"], "one core")
    if "many_2" in found:
        rows += _many(found["many_2"], "two cores")
    if "preparing" in found:
        rows += _preparing(found["preparing"])
    if "stepping" in found:
        rows += _stepping(found["stepping"])
    if "sweeps" in found:
        rows += _sweeps(found["sweeps"])
    if "environments" in found:
        rows += _environments(found["environments"])
    if "control" in found:
        rows += _control(found["control"])
    if "estimation" in found:
        rows += _estimation(found["estimation"])
    if "logs" in found:
        rows += _logs(found["logs"])
    if "orders" in found:
        rows += _orders(found["orders"])
    for name, part in found.get("gradients", {"methods": {}})["methods"].items():
        cost = part["rows"]["native run and its gradient"]["ratio"]
        rows.append((f"gradient, {name}: native run and gradient / native run", 5.0, cost, False))
        rows.append((f"gradient, {name}: relative difference from XLA's", 1e-10, part["difference"], False))
    text = [
        (name, f"{'≥' if least else '≤'} {bound:g}", f"{value:.3g}", _verdict(bound, value, least))
        for name, bound, value, least in rows
    ]
    return Table("Goals", ("", "bound", "measured", ""), text)


def _verdict(bound: float, value: float, least: bool) -> str:
    return "met" if (value >= bound if least else value <= bound) else "not met"


def _one(rows: Found) -> list[tuple[str, float, float, bool]]:
    native = rows["native: left rule"]["ratio"]
    return [
        ("one trajectory: native / hand-written", 1.2, native, False),
        ("one trajectory: native / hand-written, the aim", 1.0, native / rows[YARDSTICK]["ratio"], False),
        ("one trajectory: XLA / native", 20.0, rows["XLA: left rule"]["ratio"] / native, True),
    ]


def _control(found: Found) -> list[tuple[str, float, float, bool]]:
    solves, controllers = found["solves"], found["controllers"]
    first, flown = (solves[f"first: co.control{one}"]["ratio"] for one in ("", ", with the run and its certificate"))
    return [
        ("50 steps on SO(3) solved again / the solver alone", 1.2, solves["again: co.control"]["ratio"], False),
        ("50 steps on SO(3), first / a hand-written program", 3.0, first, False),
        ("the same, with its run and certificate", 3.0, flown, False),
        ("set-up of a controller, s", 0.15, controllers["set-up: co.control"]["seconds"], False),
        ("a call of a controller / IPOPT from the last plan", 1.0, controllers["a call: co.control"]["ratio"], False),
    ]


def _estimation(found: Found) -> list[tuple[str, float, float, bool]]:
    hours = [
        (f"an hour at 100 Hz by {label}, s", 3.0, 3600 / 0.01 * found[name][label]["seconds"], False)
        for name, label in (("model", "ModelProcess"), ("inertial unit", "StrapdownProcess"))
    ]
    calls = [
        (f"{name}, µs", 10.0, 1e6 * row["seconds"], False)
        for name, row in found["calls"].items()
        if name.endswith("Filter")
    ]
    logs = [
        (f"six parameters of 60 s, {name}, s", 5.0, row["seconds"], False)
        for name, row in found["identified"].items()
        if name.endswith("identify")
    ]
    return hours + calls + logs


def _logs(found: Found) -> list[tuple[str, float, float, bool]]:
    return [
        ("4·10⁵ messages of an MCAP file, s", 3.0, 4e5 * found["mcap"]["read_log"]["seconds"], False),
        ("a log of ArduPilot / pymavlink", 1.2, found["ardupilot"]["read_log"]["ratio"], False),
    ]


def _sweeps(found: Found) -> list[tuple[str, float, float, bool]]:
    return [
        ("a sweep by two workers / by one", 1.7, found["speed_up"], True),
        (
            "a sweep: orchestration, part of the time at tasks of ten seconds",
            0.02,
            found["statistics_1"]["orchestration"],
            False,
        ),
    ]


def _environments(found: Found) -> list[tuple[str, float, float, bool]]:
    many = found["many"].get("2048", {}).get("VectorEnv, next step")
    return [("2048 environments: million periods a second and core", 0.5, 1e-6 / many["seconds"], True)] if many else []


def _orders(found: Found) -> list[tuple[str, float, float, bool]]:
    from benchmarks.orders import cheapest

    rows = found["vehicle"]
    paper = rows[found["paper"]]["energy"]
    bounds = {
        "Suzuki-4 (midpoint)": 3e-9,
        "Kahan–Li-8 (midpoint)": 3e-11,
        "Suzuki-4 (pair)": 8e-9,
        "Kahan–Li-8 (pair)": 4e-11,
        "Kahan–Li-8 (pair), twice the solves": 1e-12,
    }
    told = [(f"energy over 500 s: {name}", bound, rows[name]["energy"], False) for name, bound in bounds.items()]
    fast = [row["ratio"] for row in rows.values() if row["energy"] <= 1e-4 * paper]
    told.append(("10⁴ times more accurate than the paper's rule: time / its time", 2.0, min(fast), False))
    best = {name: row["seconds"] for name, row in cheapest(found["top"]).items() if row}
    mine = [t for name, t in best.items() if name in found["ours"]]
    theirs = [t for name, t in best.items() if name not in found["ours"]]
    if mine and theirs:
        told.append(("heavy top to 1e-10 m: least time of the others / ours", 1.0, min(theirs) / min(mine), True))
    return told


def _many(found: Found, cores: str) -> list[tuple[str, float, float, bool]]:
    rows = []
    for steps, part in found["lengths"].items():
        where = f"ensemble of {found['members']}, {steps} steps, {cores}"
        if found["cores"] == 1:
            rows.append((f"{where}: native / hand-written", 0.35, part["rows"]["native, 1 thread"]["ratio"], False))
        elif "speed_up" in part:
            rows.append((f"{where}: one thread / two", 1.6, part["speed_up"], True))
            rows.append((f"{where}: one thread / two, hand-written", 1.6, part["speed_up_by_hand"], True))
        rows.append((f"{where}: XLA vmap / native", 20.0, part["xla_over_native"], True))
    return rows


def _preparing(found: Found) -> list[tuple[str, float, float, bool]]:
    rows = found["rows"]
    return [
        ("trace and compile, no cached code, s", 0.8, rows["kernel, empty"]["trace and compile"], False),
        ("trace and compile, cached code, s", 0.4, rows["kernel, filled"]["trace and compile"], False),
        (
            "co.simulate set-up with monitors, no cached code, s",
            0.8,
            rows["simulate, empty"]["co.simulate, set-up"],
            False,
        ),
        (
            "co.simulate set-up with monitors, cached code, s",
            0.4,
            rows["simulate, filled"]["co.simulate, set-up"],
            False,
        ),
        ("coadjoint reproduce, no cached code, s", 6.0, found["reproduce"]["empty"], False),
        ("coadjoint reproduce, cached code, s", 6.0, found["reproduce"]["filled"], False),
    ]


def _stepping(found: Found) -> list[tuple[str, float, float, bool]]:
    from benchmarks.stepping import YARDSTICK

    rows = [
        ("a control period of REMUS 100, µs", 4.0, 1e6 * found["one"][YARDSTICK]["seconds"], False),
        ("a saved stepper from its file to the first step, s", 0.2, found["saved"], False),
    ]
    for count, part in found["many"].items():
        bound = 0.8 if int(count) > 2048 else 0.9
        rows.append((f"{count} vehicles: million periods a second", bound, 1e-6 / part[YARDSTICK]["seconds"], True))
        rows += [
            (f"{count} vehicles: {name} / ours", 4.0, row["ratio"], True)
            for name, row in part.items()
            if name != YARDSTICK
        ]
    return rows
