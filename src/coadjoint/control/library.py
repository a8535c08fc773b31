"""CasADi, which the extra `[control]` installs."""

from __future__ import annotations

from typing import Any

from coadjoint.checks import library

IPOPT = {
    "sb": "yes",
    "fixed_variable_treatment": "make_constraint",  # as parameters they cost it twice the iterations
    "option_file_name": "",
}
"""Options of IPOPT. Without the last it reads `ipopt.opt` in the working directory, which may name code to load."""

INTERRUPTED = ("NonIpopt_Exception_Thrown", "User_Requested_Stop")
"""The statuses of IPOPT after Ctrl-C, which CasADi raises as its own exception."""


def casadi() -> Any:
    """The module; raises ArgumentError if it is not installed."""
    return library("casadi", "Optimal control needs", "coadjoint[control]", "CasADi")
