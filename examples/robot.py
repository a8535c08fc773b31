"""A robot's program in C: a vehicle and a filter without Python, which steer REMUS 100 to 4 m over UDP.

Run as: python examples/robot.py [duration in s: 15]
It exports both as C libraries into the folder `robot`, builds examples/robot with CMake, serves the vehicle as
`coadjoint serve` does, and prints what the program says. Needs CMake and a C compiler.
"""

import subprocess
import sys
from pathlib import Path
from threading import Thread

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint_vehicles import Craft
from coadjoint_vehicles.serving import Loop, Served, Service

duration = float(sys.argv[1]) if len(sys.argv) > 1 else 15.0
DT, PERIODS = 0.05, round(duration / 0.1)

craft = Craft(vehicles.load("remus_100"))
start = craft.start(position=(0, 0, 3.0), speed=1.5, actuators={"propeller": 15.0})
commands = {"stern_planes": 0.0, "rudder": 0.0, "propeller": 15.0}

stepper = co.Stepper(craft.system, start, dt=DT, inputs=commands, observe={"q": lambda s: s.q})
process = co.estimation.ModelProcess(craft.system, start, inputs=commands, noise={"torque": 0.02, "force": 0.2})
gauge = co.estimation.Measurement(lambda motion: motion.q[2], deviation=0.03)
compass = co.estimation.Measurement(
    lambda motion: motion.g, space=co.SO3(), deviation=0.01, error_side="body", coordinates="wxyz"
)
filter = co.estimation.Filter(
    process,
    start,
    measurements={"depth": gauge, "attitude": compass},
    deviations={"g": 0.01, "q": 0.1, "xi": 0.01, "nu": 0.05},
    accuracy=False,
)

folder = Path("robot")
folder.mkdir(exist_ok=True)
units = {"stern_planes": "rad", "rudder": "rad", "propeller": "rev/s", "q": "m", "depth": "m"}
stepper.export_c(folder / "remus", units=units, overwrite=True)
filter.export_c(folder / "dive", units=units, overwrite=True)
source = Path(__file__).parent / "robot"
configure = ["cmake", "-S", str(source), "-B", str(folder / "build"), f"-DLIBRARIES={folder.resolve()}"]
for call in ([*configure, "-DCMAKE_BUILD_TYPE=Release"], ["cmake", "--build", str(folder / "build")]):
    subprocess.run(call, check=True, capture_output=True)

loop = Loop("127.0.0.1", 0)  # as `coadjoint serve remus_100 --rate 20 --speed 1.5` on port 9010
service = Service(Served(craft, start, dt=DT), craft.start)
server = Thread(target=loop.run, args=(service,), kwargs={"answers": PERIODS}, daemon=True)
server.start()
program = [str(folder / "build" / "robot"), str(loop.address[1]), str(PERIODS)]
said = subprocess.run(program, check=True, capture_output=True, text=True).stdout
print(said, end="")
