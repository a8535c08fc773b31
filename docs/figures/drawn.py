"""What a figure shows, as numbers: kept in its PNG, so that a figure drawn anew can be compared without pixels.

    python docs/figures/drawn.py              runs every script of SCRIPTS and writes its figures into docs/figures
    python docs/figures/drawn.py energy.py    runs one

Of every curve and cloud of points a few points are kept, and the labels of the axes. A script is any that writes a PNG;
it is run in a copy of its folder. The tests run them again and compare (tests/docs/test_drawn.py).
"""

from __future__ import annotations

import json
import os
import re
import runpy
import shutil
import struct
import sys
import tempfile
import zlib
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import numpy as np
from matplotlib.figure import Figure

from coadjoint.plotting.style import COLOURS

ROOT = Path(__file__).resolve().parents[2]
FIGURES = ROOT / "docs" / "figures"
SCRIPTS = {
    "docs/figures/overview.py": ["overview"],
    "docs/figures/when_rk4.py": ["when_rk4"],
    "docs/figures/energy.py": ["energy"],
    "docs/figures/actuators.py": ["thruster_curve", "glider_sawtooth"],
    "docs/figures/falling_cat.py": ["falling_cat"],
    "docs/figures/tutorial.py": ["leaf"],
    "docs/figures/integrable.py": ["integrable"],
    "docs/figures/phase_space.py": ["phase_space"],
    "docs/figures/controllers.py": ["controllers", "five_controllers"],
    "docs/figures/stability.py": ["stability"],
    "docs/figures/water.py": ["water"],
    "docs/figures/allan.py": ["allan"],
    "docs/figures/missions.py": ["mission"],
    "docs/figures/bag.py": ["bag"],
    "docs/figures/quickest_turn.py": ["quickest_turn"],
    "docs/theorems/figures.py": [
        "theorem_four_settings", "theorem_kelvin_noether", "theorem_moser_veselov", "theorem_poisson",
    ],
    "examples/paper_vehicle.py": ["paper_vehicle"],
    "examples/paper_semidirect.py": ["paper_semidirect"],
    "examples/heisenberg.py": ["heisenberg"],
    "examples/alfven_waves.py": ["alfven_waves"],
    "examples/fluid_drop.py": ["fluid_drop"],
    "examples/falling_rod.py": ["falling_rod"],
    "examples/spherical_pendulum.py": ["spherical_pendulum"],
    "examples/falling_plates.py": ["falling_plates"],
    "examples/satellite.py": ["satellite"],
    "examples/stochastic_top.py": ["stochastic_top"],
    "examples/quadrotor.py": ["quadrotor"],
    "examples/four_bar.py": ["four_bar"],
    "examples/bricard.py": ["bricard"],
    "examples/falling_chain.py": ["falling_chain"],
    "examples/rattleback.py": ["rattleback"],
    "examples/snakeboard.py": ["snakeboard"],
    "examples/vehicle_in_current.py": ["vehicle_in_current"],
    "examples/remus_mission.py": ["remus_mission"],
}  # fmt: skip
"""Script → the figures of docs/figures that it writes."""

POINTS = 9
KEYWORD = b"drawn"


def numbers(values: Any) -> list[float | None]:
    """At most POINTS of a list, evenly over its length, to six digits; None where there is none."""
    flat = np.ma.filled(np.ma.asarray(values, dtype=float), np.nan)
    at = np.unique(np.linspace(0, len(flat) - 1, min(POINTS, len(flat))).round().astype(int)) if len(flat) else []
    return [float(f"{flat[i]:.6g}") if np.isfinite(flat[i]) else None for i in at]


def extent(values: Any) -> list[float]:
    flat = np.asarray(np.ma.filled(np.ma.asarray(values, dtype=float), np.nan))
    flat = flat[np.isfinite(flat)]
    return [float(f"{flat.min():.6g}"), float(f"{flat.max():.6g}")] if len(flat) else []


def data(figure: Figure) -> list[dict]:
    """What each panel of a figure shows."""
    panels = []
    for axes in figure.axes:
        shown = [(line.get_xdata(orig=False), line.get_ydata(orig=False)) for line in axes.lines]
        clouds = [np.asarray(points.get_offsets(), float).T for points in axes.collections]
        shown += [tuple(cloud) for cloud in clouds if cloud.ndim == 2 and cloud.shape[1] > 1]
        curves = [
            {"n": len(x), "x": numbers(x), "y": numbers(y), "over": [extent(x), extent(y)]}
            for x, y in shown
            if len(x) > 1
        ]
        labels = [re.sub(r"\d[\d.,e+−-]*", "#", text) for text in (axes.get_xlabel(), axes.get_ylabel())]
        panels.append({"labels": labels, "log": [axes.get_xscale(), axes.get_yscale()], "curves": curves})
    return panels


def differences(old: list[dict], new: list[dict]) -> list[str]:
    """Where two figures show different things: of a curve on a linear axis more than a hundredth of its range, on a
    logarithmic one more than 0.2 decades, or 1.5 where it is round-off."""
    if len(old) != len(new):
        return [f"{len(old)} panels became {len(new)}"]
    found = []
    for k, (before, after) in enumerate(zip(old, new, strict=True)):
        if before["labels"] != after["labels"] or before["log"] != after["log"]:
            found.append(f"panel {k}: {before['labels']} {before['log']} became {after['labels']} {after['log']}")
        if len(before["curves"]) != len(after["curves"]):
            found.append(f"panel {k}: {len(before['curves'])} curves became {len(after['curves'])}")
            continue
        for j, (was, now) in enumerate(zip(before["curves"], after["curves"], strict=True)):
            if was["n"] != now["n"]:
                found.append(f"panel {k}, curve {j}: {was['n']} points became {now['n']}")
                continue
            for i, axis in enumerate("xy"):
                far = distance(was, now, axis, i, before["log"][i] == "log")
                if far > 1.0:
                    found.append(f"panel {k}, curve {j}: {axis} is {far:.1f} times the tolerance off")
    return found


def distance(was: dict, now: dict, axis: str, i: int, log: bool) -> float:
    """The largest difference of two curves along an axis, in parts of what is allowed."""
    if [value is None for value in was[axis]] != [value is None for value in now[axis]]:
        return np.inf
    a, b = (np.array([v for v in (*of[axis], *of["over"][i]) if v is not None]) for of in (was, now))
    if len(a) != len(b):
        return np.inf
    if log:
        small = np.maximum(np.abs(a), np.abs(b)) < 1e-11
        a, b = (np.log10(np.maximum(np.abs(of), 1e-18)) for of in (a, b))
        return float(np.max(np.abs(a - b) / np.where(small, 4.0, 0.2), initial=0.0))
    size = np.ptp(a) if np.ptp(a) > 1e-9 * np.max(np.abs(a), initial=0.0) else np.max(np.abs(a), initial=0.0)
    return float(np.max(np.abs(a - b), initial=0.0) / (0.01 * size + 1e-9))


def read(path: Path) -> list[dict] | None:
    """What is kept in a PNG of what it shows; None where nothing is."""
    content, at = path.read_bytes(), 8
    while at < len(content):
        (size,) = struct.unpack(">I", content[at : at + 4])
        kind, body = content[at + 4 : at + 8], content[at + 8 : at + 8 + size]
        if kind == b"zTXt" and body.startswith(KEYWORD + b"\0"):
            return json.loads(zlib.decompress(body[len(KEYWORD) + 2 :]))
        at += size + 12
    return None


def keep(path: Path, shown: list[dict]) -> None:
    """Write what a PNG shows into it, in front of its end."""
    content = path.read_bytes()
    body = KEYWORD + b"\0\0" + zlib.compress(json.dumps(shown, ensure_ascii=False).encode(), 9)
    chunk = struct.pack(">I", len(body)) + b"zTXt" + body + struct.pack(">I", zlib.crc32(b"zTXt" + body))
    path.write_bytes(content[:-12] + chunk + content[-12:])


@contextmanager
def watched(seen: list[list[dict]]):
    """Note what every figure shows that is written meanwhile."""
    write = Figure.savefig

    def noting(figure: Figure, *arguments: Any, **named: Any) -> Any:
        seen.append(data(figure))
        return write(figure, *arguments, **named)

    Figure.savefig = noting  # pyright: ignore[reportAttributeAccessIssue]
    try:
        yield
    finally:
        Figure.savefig = write


def draw(script: str, folder: Path) -> dict[str, tuple[Path, list[dict]]]:
    """Run a script in a copy of its surroundings in `folder`: its figures by name, with what they show.

    Curves without a colour of their own have those of the library's figures.
    """
    for part in ("docs", "examples"):
        shutil.copytree(ROOT / part, folder / part, ignore=shutil.ignore_patterns("*.png", "*.gif", "api", "recipes"))
    copy, before = folder / script, Path.cwd()
    seen: list[list[dict]] = []
    arguments, sys.argv = sys.argv, [str(copy)]
    os.chdir(copy.parent if script.startswith("examples") else folder)
    try:
        with watched(seen), matplotlib.rc_context({"axes.prop_cycle": matplotlib.cycler(color=COLOURS)}):
            runpy.run_path(str(copy), run_name="__main__")
    finally:
        os.chdir(before)
        sys.argv = arguments
    names = SCRIPTS[script]
    written = {name: next(folder.rglob(f"{name}.png")) for name in names}
    order = sorted(names, key=lambda name: written[name].stat().st_mtime_ns)
    if len(names) == 1:
        return {names[0]: (written[names[0]], seen[0])}
    return {name: (written[name], shown) for name, shown in zip(order, seen, strict=True)}


def small(path: Path) -> None:
    """Fewer colours and at most 1300 dots, where that makes a file smaller."""
    from PIL import Image

    with Image.open(path) as picture:
        plain = picture.convert("RGB")
    if plain.width > 1300:
        plain = plain.resize((1200, round(plain.height * 1200 / plain.width)), Image.Resampling.LANCZOS)
    target = path.with_suffix(".small")
    plain.quantize(128, dither=Image.Dither.NONE).save(target, format="PNG", optimize=True)
    if target.stat().st_size < path.stat().st_size:
        target.replace(path)


def main() -> None:
    asked = sys.argv[1:]
    for script in SCRIPTS:
        if asked and not any(script.endswith(name) for name in asked):
            continue
        with tempfile.TemporaryDirectory() as folder:
            for name, (path, shown) in draw(script, Path(folder)).items():
                small(path)
                keep(path, shown)
                shutil.copyfile(path, FIGURES / path.name)
                print(f"{script} → {name}.png", flush=True)


if __name__ == "__main__":
    main()
