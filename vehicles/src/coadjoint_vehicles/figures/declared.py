"""The figures of vehicles in `run.plot`; the drawing code is imported at the first use."""

from __future__ import annotations

from coadjoint.plotting.registries import AddedFigure

_FIGURES = "coadjoint_vehicles.figures"
FIGURES = {
    "mission": AddedFigure(
        f"{_FIGURES}.mission:mission",
        f"{_FIGURES}.fitting:of_vehicle",
        "A vehicle's run on one page: track, depth, angles, speeds, rates, actuators, energy, current.",
        rank=0,
    ),
    "track": AddedFigure(
        f"{_FIGURES}.navigation:track",
        f"{_FIGURES}.fitting:of_vehicle",
        "The path of a vehicle seen from above, north up, with its start, its end and `way_points` (k, 2 or 3), m.",
        rank=1,
        caption="The path of the vehicle seen from above, north up, with its start, its end and its way points.",
    ),
    "depth": AddedFigure(
        f"{_FIGURES}.navigation:depth",
        f"{_FIGURES}.fitting:of_vehicle",
        "The depth of a vehicle over time, downwards, with its set point.",
        rank=2,
    ),
    "speeds": AddedFigure(
        f"{_FIGURES}.motions:speeds",
        f"{_FIGURES}.fitting:of_vehicle",
        "Surge, sway and heave through the water with the set point of speed, and the rates of roll, pitch and yaw.",
        rank=3,
    ),
    "actuators": AddedFigure(
        f"{_FIGURES}.actuators:actuators",
        f"{_FIGURES}.fitting:of_actuators",
        "The value, the command and the limits of every actuator.",
    ),
    "current": AddedFigure(
        f"{_FIGURES}.motions:current",
        f"{_FIGURES}.fitting:of_current",
        "The velocity of the water where the vehicle is: north, east, down.",
    ),
    "trial": AddedFigure(
        "coadjoint_vehicles.trials.analysis:trial",
        "coadjoint_vehicles.trials.track:of_trial",
        "A standard manoeuvre, or several: tracks, courses over time and their figures of merit.",
        rank=1,
    ),
}
"""By the names that `run.plot` has them under."""
