"""Formats of files in which packages above write a run, by the ending of the file's name."""

from __future__ import annotations

from coadjoint.extensions import Registry

FORMATS: Registry[str] = Registry("FORMATS")
"""By ending, such as ".csv": "module:function", (dataset, **options) → the text of the file."""
