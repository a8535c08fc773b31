"""What a fresh process needs before the vehicle moves: prints JSON of seconds.

python -m benchmarks.first_use kernel | simulate | xla
"""

from __future__ import annotations

import json
import sys
import time


def main(what: str) -> dict[str, float]:
    """Seconds of each part."""
    marks = [time.perf_counter()]

    def lap() -> float:
        marks.append(time.perf_counter())
        return marks[-1] - marks[-2]

    import coadjoint as co
    from coadjoint.kernels.run import native, xla
    from coadjoint.models import catalogue

    found = {"import": lap()}
    system = catalogue["underwater_vehicle"].make()
    start = catalogue["underwater_vehicle"].start(system)
    found["system and start"] = lap()
    method = co.LeftRectangle(co.Cayley(), start="velocity")
    if what == "simulate":
        run = co.simulate(system, start, dt=0.01, steps=1000, method=method)
        return {**found, "co.simulate, set-up": run.set_up_seconds, "co.simulate, whole": lap()}
    from coadjoint.mechanics.copies import replace_parameters
    from coadjoint.methods.program import Constants, StepProgram

    state = method.begin(system, start, 0.01)
    program = StepProgram(replace_parameters(system, None), method)
    constants = Constants(system.parameters, {})
    found["first state"] = lap()
    if what == "xla":
        xla.run(program, constants, state, 0.01, 1, 1, monitors=False)
        return {**found, "XLA: trace and compile": lap()}
    native.compile(program, constants, state, monitors=False)
    return {**found, "trace and compile": lap()}


if __name__ == "__main__":
    print(json.dumps(main(sys.argv[1])))
