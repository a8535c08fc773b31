"""Makes mission.png and mission.gif of docs/missions.md and the README: python docs/figures/missions.py."""

from pathlib import Path

import coadjoint as co
from coadjoint.plotting.style import save
from coadjoint.runs.run_file import read
from coadjoint_vehicles.missions.craft import set_up

HERE = Path(__file__).parent

file = read(HERE.parents[1] / "examples" / "square.toml")
made = set_up(file)
run = co.simulate(made.system, made.start, dt=0.05, duration=360, save_every=4, inputs=made.inputs, until=made.until)
run.dataset.attrs.update(made.attributes)
save(run.plot.mission(), HERE / "mission.png", dpi=85)
run.plot.animation(path=HERE / "mission.gif", frames=70)
print(run)
