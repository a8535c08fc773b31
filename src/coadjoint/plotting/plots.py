"""Figures of a run's dataset."""

from __future__ import annotations

from typing import Any


class Plots:
    """Figures of a dataset."""

    def __init__(self, dataset: Any):
        self.dataset = dataset
