"""Ids for `gymnasium.make`: "coadjoint_vehicles.environments.ids:coadjoint/HoldStation-v0" and those of other tasks.

env = gymnasium.make("coadjoint_vehicles.environments.ids:coadjoint/Dock-v0", vehicle="bluerov2_heavy_blue")
envs = gymnasium.make_vec("coadjoint/Dock-v0", num_envs=64, vehicle="bluerov2_heavy_blue")
"""

from __future__ import annotations

import gymnasium

from coadjoint_vehicles.environments.make import TASKS

IDS = {f"coadjoint/{kind.__name__}-v0": name for name, kind in TASKS.items()}
"""Id → name of the task."""

for _id, _task in IDS.items():
    if _id not in gymnasium.registry:
        gymnasium.register(
            _id,
            entry_point="coadjoint_vehicles.environments.make:environment",
            vector_entry_point="coadjoint_vehicles.environments.make:vector_environment",
            kwargs={"task": _task},
        )
