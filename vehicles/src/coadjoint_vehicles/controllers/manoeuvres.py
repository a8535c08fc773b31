"""The standard manoeuvres of sea trials, by the words of files and datasets."""

from __future__ import annotations

MANOEUVRES = ("turning_circle", "zigzag", "spiral", "stop", "pull_out")
TRIAL = "trial"
"""The attribute of a dataset that holds the manoeuvre of a trial, as JSON."""
