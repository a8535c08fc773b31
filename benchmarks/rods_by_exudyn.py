"""A cantilever that is let go, by Exudyn's geometrically exact beams in a plane: where its end is after 1 s.

Run as: python benchmarks/rods_by_exudyn.py [ELEMENTS,STEP …] by a Python that has `exudyn`; a line for each, with
seconds of processor time. The rod is that of `rods.planar(elements=…, length=1, EI=1, EA=400, GA=200, mass=1,
inertia=0.01, ends="clamped", gravity=2)`, the method the generalised-α method without damping (spectral radius 1).
"""

from __future__ import annotations

import sys
import time
from itertools import pairwise

import exudyn
import exudyn.itemInterface as items

STIFFNESS = {"bendingStiffness": 1.0, "axialStiffness": 400.0, "shearStiffness": 200.0}
MASS = {"massPerLength": 1.0, "crossSectionInertia": 0.01}


def end(elements: int, step: float) -> tuple[list[float], float]:
    """The position of the free end after 1 s, and seconds of the solver."""
    mbs, length = exudyn.SystemContainer().AddSystem(), 1.0 / elements
    nodes = [mbs.AddNode(items.Rigid2D(referenceCoordinates=[i * length, 0, 0])) for i in range(elements + 1)]
    for pair in pairwise(nodes):
        beam = items.ObjectBeamGeometricallyExact2D(nodeNumbers=list(pair), length=length, **STIFFNESS, **MASS)
        marker = mbs.AddMarker(items.MarkerBodyMass(bodyNumber=mbs.AddObject(beam)))
        mbs.AddLoad(items.LoadMassProportional(markerNumber=marker, loadVector=[0, -2.0, 0]))
    ground = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=mbs.AddNode(items.NodePointGround()), coordinate=0))
    for k in range(3):
        held = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=nodes[0], coordinate=k))
        mbs.AddObject(items.CoordinateConstraint(markerNumbers=[ground, held]))
    mbs.Assemble()
    settings = exudyn.SimulationSettings()
    settings.timeIntegration.numberOfSteps, settings.timeIntegration.endTime = round(1 / step), 1.0
    settings.timeIntegration.generalizedAlpha.spectralRadius = 1.0
    settings.timeIntegration.newton.useModifiedNewton = True
    settings.solutionSettings.writeSolutionToFile = False
    settings.linearSolverType = exudyn.LinearSolverType.EigenSparse
    began = time.process_time()
    mbs.SolveDynamic(settings)
    seconds = time.process_time() - began
    return list(map(float, mbs.GetNodeOutput(nodes[-1], exudyn.OutputVariableType.Position)[:2])), seconds


if __name__ == "__main__":
    for argument in sys.argv[1:] or ["8,0.01", "16,0.005", "32,0.005", "64,0.0025", "128,0.00125", "256,0.000625"]:
        elements, step = argument.split(",")
        print(argument, *end(int(elements), float(step)), flush=True)
