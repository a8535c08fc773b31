"""Wrong members of groups, spaces and difference maps of one's own, and the sentences that tell of them."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import pytest

from coadjoint.errors import GroupError

NEARLY = 1 + 1e-8
"""A wrong digit that only a comparison finds."""


def scaled(right, self, *given):
    """The last argument too large by 1e-8."""
    return right(self, *given[:-1], jax.tree.map(lambda x: NEARLY * x, given[-1]))


def flipped(right, self, *given):
    return right(self, *given[:-1], jax.tree.map(lambda x: -x, given[-1]))


def result_scaled(right, self, *given):
    return jax.tree.map(lambda x: NEARLY * x, right(self, *given))


def transposed(right, self, *given):
    return jax.tree.map(jnp.transpose, right(self, *given))


def swapped(right, self, g, h):
    return right(self, h, g)


def shifted(right, self, *given):
    return 1e-8 + right(self, *given)


def nothing(right, self, *given):
    return given[0]


def short(right, self, *given):
    return jax.tree.map(lambda x: x[:-1], right(self, *given))


def broken(right, self, *given):
    raise ValueError("no such thing\nat all")


def text(right, self, *given):
    return "fast"


def changed(base: type, name: str, error) -> Any:
    """An object like those of the base, with a wrong member."""
    right = getattr(base, name)

    def member(self, *given):
        return error(right, self, *given)

    return type("Wrong", (base,), {name: member})()


def sentence_of(function) -> str:
    with pytest.raises(GroupError) as caught:
        function()
    message = str(caught.value)
    assert "\n" not in message and len(message) < 400 and message.endswith(".")
    return message
