"""What is left of a run that an interrupt, such as Ctrl-C, has ended, and how one goes on with it."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from coadjoint.errors import Interrupted
from coadjoint.simulation.plan import Memory, Sink


class Loop(Protocol):
    """What drives a run, or an ensemble."""

    taking: bool

    def append_last(self, position: Any) -> None: ...

    def undo(self, position: Any) -> None: ...


def interrupted(run: Any, loop: Loop, sink: Sink) -> Interrupted:
    """What to raise for a run whose loop was interrupted; its records end where it stands.

    Records in memory are cut there, and the node where it stands is added. On the disk a checkpoint is written, unless
    the interrupt came while records were written: then the run goes on from the last one.
    """
    position, plan = run.position, run.plan
    if isinstance(run.memory, Memory):
        how = _in_memory(run, loop, sink)
    else:
        whole = position.ended or not loop.taking
        if whole:
            sink.finish(position, complete=False)
        how = f"co.resume({str(run.memory.folder)!r}, system) goes on from the last checkpoint there"
        run = run if whole else None
    here = float(np.max(position.state.t) if plan.h > 0 else np.min(position.state.t))
    where = f"step {position.steps:,} of {plan.steps:,} (t = {here:.6g} s)"
    where = f"after the end of the run, {where}, before it was judged" if position.ended else f"at {where}"
    return Interrupted(f"Interrupted {where}; {how}.", run)


def _in_memory(run: Any, loop: Loop, sink: Sink) -> str:
    """Cut a run where it stands, and say how one goes on."""
    position, plan = run.position, run.plan
    kept = "what was computed is in `.run` of this exception"
    if position.ended:
        return kept
    run.memory.cut(position.steps)
    loop.undo(position)
    loop.append_last(position)
    left = plan.steps - position.steps
    return f"{kept} (`error`), and co.simulate(system, error.run.final, dt={plan.h:g}, steps={left}) goes on"
