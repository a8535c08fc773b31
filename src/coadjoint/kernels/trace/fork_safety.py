"""Processes that were forked after XLA had begun: XLA waits in them for threads that a fork does not have."""

from __future__ import annotations

import os

from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.jaxprs import xla_has_begun

_begun = False
_forked = False


def require_own_xla() -> None:
    """Raise ArgumentError where XLA, begun before a fork, would wait forever; native code runs there."""
    if _forked:
        raise ArgumentError(
            "This process was forked after XLA had begun in its parent, and XLA would wait in it forever: use "
            'backend="native", which runs in a fork, or start processes by multiprocessing.get_context("spawn") or '
            '"forkserver".'
        )


def _before() -> None:
    global _begun
    _begun = xla_has_begun()


def _in_child() -> None:
    global _forked
    _forked = _forked or _begun


if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=_before, after_in_child=_in_child)
