"""What a stepper says of a step that failed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from coadjoint.kernels.program import Code


def failed_step(where: str, code: int, dt: float, remedies: tuple[str, str], commands: Mapping[str, np.ndarray]) -> str:
    """What happened in a step that ended with this code, and the remedy."""
    unsolved, beyond = remedies
    if bad := [name for name, value in commands.items() if not np.all(np.isfinite(value))]:
        return f"{where} could not be taken: the command `{bad[0]}` is not finite."
    again = "then reset or restore the stepper"
    if code == Code.NOT_CONVERGED:
        return f"{where} did not converge with dt = {dt:g}; {unsolved}, {again}."
    if code == Code.BEYOND_CHART:
        return f"{where} left the chart of the difference map: {beyond}, {again}."
    functions = "the Lagrangian or Hamiltonian, forces and `until`"
    return f"{where} gave numbers that are not finite; {unsolved}, or check {functions} there."
