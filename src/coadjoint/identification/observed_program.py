"""A step program that records the columns of a log."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.identification.channels import Channels
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.methods.program import StepProgram, StepStage


@dataclass(frozen=True)
class Observed:
    """`program` with the numbers of `channels` at the node where a step starts as its record."""

    program: StepProgram
    channels: Channels

    @property
    def stages(self) -> tuple[ObservedStage, ...]:
        return tuple(ObservedStage(stage, self.channels) for stage in self.program.stages)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.program, name)


@dataclass(frozen=True)
class ObservedStage:
    """A stage with such a record."""

    stage: StepStage
    channels: Channels

    def record(self, parameters: PyTree, state: PyTree, h: Scalar, z: Array) -> Any:
        return self.channels.of(replace_parameters(self.stage.skeleton, parameters.system), state)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stage, name)
