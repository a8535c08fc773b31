"""Pictures of the player, as Chromium shows it without a graphics card: `python docs/figures/viewing.py`."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import jax
import numpy as np
from PIL import Image

import coadjoint as co
from coadjoint.models import catalogue
from coadjoint.models.falling_cat import halves
from coadjoint.plotting import bodies

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parents[1] / "tests"))
import chromium  # noqa: E402

MISSION = """
[vehicle]
name = "remus_100"
[mission]
way_points_m = [[40, 0, 4], [40, 40, 4], [0, 40, 2]]
speed_m_s = 1.5
[initial]
position_m = [0, 0, 2]
speed_m_s = 1.5
[water]
kind = "uniform"
velocity_m_s = [0.0, 0.2, 0.0]
[run]
dt = 0.05
duration_s = 90
[output]
figures = false
"""


def picture(browser: chromium.Chromium, page: Path, name: str, script: str) -> None:
    """Open a page, set it, and keep what is seen as a small PNG."""
    browser.open(page)
    browser.frames(3)
    browser.value(f"player.play(false), {script}, 0")
    browser.frames(3)
    seen = browser.picture(page.with_suffix(".png"))
    Image.open(seen).convert("RGB").quantize(96, dither=Image.Dither.NONE).save(HERE / name, optimize=True)


def mission(folder: Path) -> Path:
    """The page of REMUS 100 on its way by way points."""
    (folder / "square.toml").write_text(MISSION)
    return co.vehicles.load_mission(folder / "square.toml").run().plot.animation(path=folder / "mission.html")


def cat(folder: Path) -> Path:
    """The page of a cat in free fall that bends its spine."""
    entry = catalogue["falling_cat"]
    system = entry.make()
    run = co.simulate(system, entry.start(system, bend_rate=(6.0, 2.0)), dt=0.005, duration=1)
    R, front, rear = run.records.g, *jax.vmap(halves)(run.records.n)
    ahead, behind = np.asarray(R @ front), np.asarray(R @ rear)
    apart = 0.12 * (ahead[:, :, 0] + behind[:, :, 0])
    half = bodies.ellipsoid((0.12, 0.05, 0.05))
    solids = [
        bodies.Solid([half], place=side * apart, turn=turn, track=False)
        for side, turn in ((0.5, ahead), (-0.5, behind))
    ]
    run.plot.scene(bodies=solids, path=folder / "cat.html")
    return folder / "cat.html"


if __name__ == "__main__":
    browser = chromium.Chromium(*chromium.SOFTWARE)
    browser.size(840, 440)
    with tempfile.TemporaryDirectory() as made:
        follow = "player.camera.follow = 0, player.camera.zoom = 1.3, "
        follow += "player.camera.pitch = 0.22, player.camera.yaw = 2.4"
        picture(browser, mission(Path(made)), "view_mission.png", f"player.seek(52), {follow}")
        browser.prefer(prefers_color_scheme="dark")
        picture(browser, cat(Path(made)), "view_cat.png", "player.seek(0.35)")
    browser.close()
