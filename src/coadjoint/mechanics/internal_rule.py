"""The rule of an internal state as a class: the next state, its limits, warnings and recorded quantities."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence

from coadjoint.arrays import PyTree, Scalar
from coadjoint.errors import must_give
from coadjoint.mechanics.inputs import Inputs
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.state import NodeMotion


class InternalRule(ABC):
    """The rule of an internal state, for `System(…, internal=rule)`: (motion, h, p) → the state after h.

    A plain function (motion, h [, p]) is a rule as well, without the other members. A subclass defines `__call__`, and
    those of the other members that apply; p are the parameters of the system, None where it has none.
    """

    @abstractmethod
    def __call__(self, motion: NodeMotion, h: Scalar, p: Parameters | None) -> PyTree:
        """The internal state after h (s), in the structure of the start's; jax.numpy only."""

    @property
    def title(self) -> str:
        """The subject of sentences about the rule."""
        return "The rule `internal`"

    def warnings(self, h: Scalar, p: Parameters | None) -> list[str]:
        """A warning for each concern about steps of length h, one number in s, before a run, one sentence each."""
        return []

    def driven(self, inputs: Inputs, begin: float, end: float, p: Parameters | None) -> list[str]:
        """A warning for each concern about the inputs of a run from `begin` to `end` (s), before it."""
        return []

    def concluded(self, stretches: Sequence[PyTree], p: Parameters | None) -> list[str]:
        """A warning for each concern about the internal states at the saved nodes of a run, after it.

        stretches: consecutive stretches of the run, states with leading axes (nodes, [members,] …).
        """
        return []

    def failure(self, t: Scalar, h: Scalar) -> str | None:
        """Why the step of length h (s) from t has failed, as far as it knows."""
        return None

    def report(self, motion: NodeMotion, p: Parameters | None) -> dict[str, PyTree]:
        """The quantities at a node that datasets hold in addition to the state, by name, such as the current at a
        vehicle."""
        return {}

    def limits(self, p: Parameters | None) -> dict[str, tuple[float | None, float | None]]:
        """The lowest and highest value of parts of the internal state, by their names; None for no limit."""
        return {}

    def command_limits(self, p: Parameters | None) -> dict[str, tuple[PyTree, PyTree]]:
        """Lowest and highest command of inputs by their names, to which it clips them; those without are left out."""
        return {}


class _Plain(InternalRule):
    """A function as a rule."""

    def __call__(self, motion: NodeMotion, h: Scalar, p: Parameters | None) -> PyTree:
        must_give(self, "__call__")


def declared(rule: Callable[..., PyTree] | None) -> InternalRule:
    """The declaration of a rule; that of a plain function, or of none, is empty."""
    return rule if isinstance(rule, InternalRule) else _Plain()
