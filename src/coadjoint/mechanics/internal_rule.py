"""The rule of an internal state as a class: the next state, and what else runs need of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any


class InternalRule(ABC):
    """The rule of an internal state, for `System(…, internal=rule)`: (motion, h, p) → the state after h.

    A plain function (motion, h [, p]) is a rule too, about which nothing else is known. A subclass gives `__call__`,
    and of the others what it can say; p are the parameters of the system.
    """

    @abstractmethod
    def __call__(self, motion: Any, h: Any, p: Any) -> Any:
        """The internal state after h (s), in the structure of the start's; jax.numpy only."""

    @property
    def title(self) -> str:
        """What it is, at the beginning of a sentence."""
        return "The rule `internal`"

    def warnings(self, h: Any, p: Any) -> list[str]:
        """A warning for each concern about steps of length h (s), before a run, one sentence each."""
        return []

    def failure(self, t: float, h: float) -> str | None:
        """Why the step of length h (s) from t has failed, as far as it knows."""
        return None

    def report(self, motion: Any, p: Any) -> dict[str, Any]:
        """What datasets hold of a node in addition to the state, by name, such as the current that a vehicle feels."""
        return {}

    def limits(self, p: Any) -> dict[str, tuple[float | None, float | None]]:
        """Lowest and highest value of parts of the internal state, by their names; None where there is no end."""
        return {}


class _Plain(InternalRule):
    """A function as a rule."""

    def __call__(self, motion: Any, h: Any, p: Any) -> Any:
        raise NotImplementedError


def declared(rule: Callable[..., Any] | None) -> InternalRule:
    """What a rule says of itself; a plain function, or none, says nothing."""
    return rule if isinstance(rule, InternalRule) else _Plain()
