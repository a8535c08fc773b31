"""Log messages of the library: loggers of the standard library, by the names of its modules.

    logging.basicConfig(level=logging.INFO)

A log message reports an action of the library; a warning asks the user for a change, and an error ends a request that
cannot be carried out. Nothing is shown unless the user's program configures logging.
"""

from __future__ import annotations

import logging

from coadjoint.errors import printable

logging.getLogger("coadjoint").addHandler(logging.NullHandler())


def logger(module: str) -> logging.Logger:
    """The logger of a module, of its `__name__` and below `coadjoint`; control characters in its messages become
    escapes."""
    found = logging.getLogger(module.replace("coadjoint_", "coadjoint.", 1))
    found.addFilter(_shown)
    return found


def phase(text: str, *values: object) -> None:
    """Report the phase that a long call begins: reading, tracing, compiling, running, drawing. The command line shows
    it; scripts see it at level DEBUG."""
    PHASES.debug(text, *values)


def _shown(record: logging.LogRecord) -> bool:
    said = record.getMessage()
    if (shown := printable(said)) != said:
        record.msg, record.args = shown, ()
    return True


PHASES = logger("coadjoint.phases")
"""The logger of phases."""
