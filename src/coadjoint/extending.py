"""The extension API: the names of the core on which a package above it, such as `coadjoint_vehicles`, is built.

Such a package has three sources, and a test holds that vehicles have no other: the `__all__` of public packages, as
`coadjoint.mechanics`; the names of this module; and the modules in `MODULES`, each of which serves one purpose. It adds
to the core by the tables of `coadjoint.extensions`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.lazy import lazy as _lazy

MODULES = (
    "coadjoint.arrays",
    "coadjoint.checks",
    "coadjoint.cli.metavars",
    "coadjoint.cli.terminal",
    "coadjoint.clocks",
    "coadjoint.csv_tables",
    "coadjoint.disk",
    "coadjoint.errors",
    "coadjoint.labelled",
    "coadjoint.overview",
    "coadjoint.paths",
    "coadjoint.sections",
    "coadjoint.texts",
    "coadjoint.units",
    "coadjoint.groups.attitude",
    "coadjoint.identification.channels",
    "coadjoint.mechanics.continuous",
    "coadjoint.mechanics.members",
    "coadjoint.models.descriptions.elements",
    "coadjoint.models.descriptions.frames",
    "coadjoint.models.descriptions.links",
    "coadjoint.models.descriptions.urdf",
    "coadjoint.models.quantities",
    "coadjoint.plotting.entries",
    "coadjoint.plotting.plots",
    "coadjoint.plotting.registries",
    "coadjoint.plotting.scene",
    "coadjoint.plotting.style",
    "coadjoint.runs.sections",
    "coadjoint.spaces.charts",
    "coadjoint.spaces.measured",
    "coadjoint.spaces.measured_spaces",
)
"""Types, checks, units, files, tables, clocks, errors, members, rates of motion, links and joints, figures."""

if TYPE_CHECKING:
    # named otherwise where they are defined
    __all__ = ["kernel_backend", "read_run_file", "shown_number", "simulate_setup"]

    from coadjoint.extensions import Registry as Registry
    from coadjoint.extensions import import_string as import_string
    from coadjoint.kernels.run import backend as kernel_backend
    from coadjoint.kernels.run import disk_cache as disk_cache
    from coadjoint.kernels.trace import while_loops as while_loops
    from coadjoint.kernels.trace.evaluate import evaluate as evaluate
    from coadjoint.kernels.trace.evaluate import tabulate as tabulate
    from coadjoint.kernels.trace.evaluate import traced as traced
    from coadjoint.kernels.untraceable import Untraceable as Untraceable
    from coadjoint.lazy import lazy as lazy
    from coadjoint.log import logger as logger
    from coadjoint.mechanics.copies import replace_parameters as replace_parameters
    from coadjoint.mechanics.discrete import Point as Point
    from coadjoint.mechanics.discrete import node as node
    from coadjoint.mechanics.internal import starting_values as starting_values
    from coadjoint.mechanics.start import legendre as legendre
    from coadjoint.mechanics.state import Origin as Origin
    from coadjoint.mechanics.work_balance import with_ledger as with_ledger
    from coadjoint.methods.increments import FullStep as FullStep
    from coadjoint.models.entry import MOVING as MOVING
    from coadjoint.plotting.decimation import thin as thin
    from coadjoint.portable import require_portable as require_portable
    from coadjoint.report.companion_files import keep_beside as keep_beside
    from coadjoint.report.folder import kept_inputs as kept_inputs
    from coadjoint.report.numbers import Sourced as Sourced
    from coadjoint.report.numbers import shown as shown_number
    from coadjoint.report.summary import to_json as to_json
    from coadjoint.roots import brent as brent
    from coadjoint.runs.initial import initial_values as initial_values
    from coadjoint.runs.run_file import read as read_run_file
    from coadjoint.runs.runnable import Runnable as Runnable
    from coadjoint.runs.running import Written as Written
    from coadjoint.runs.running import execute as execute
    from coadjoint.runs.running import simulate as simulate_setup
    from coadjoint.runs.setup import Setup as Setup
    from coadjoint.runs.toml_text import to_toml as to_toml
    from coadjoint.sealed import engine_of as engine_of
    from coadjoint.simulation.resume import StreamedRun as StreamedRun
    from coadjoint.simulation.steppers.base import StepperBase as StepperBase
    from coadjoint.simulation.steppers.fields import Fields as Fields
    from coadjoint.simulation.steppers.interface import Prepared as Prepared
    from coadjoint.spaces.named import named as named
    from coadjoint.stability.figure import stability_figure as stability_figure

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = _lazy(__name__)
