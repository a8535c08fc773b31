"""Formats of files in which packages above write a run, by the ending of the file's name."""

from __future__ import annotations

from coadjoint.extensions import Registry

FORMATS: Registry[str] = Registry("FORMATS")
"""By ending, such as ".csv": "module:function", (dataset, **options) → the text of the file."""

LAST_RECORD = ("last_record", "run_parameters")
"""Variables of a netCDF file that hold what a run goes on from; a dataset in memory is without them."""
