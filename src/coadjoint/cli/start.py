"""The entry of the command `coadjoint`, which imports nothing itself, so that Ctrl-C ends it without a traceback."""

from __future__ import annotations

import gc
import signal
import sys
from contextlib import suppress

from coadjoint.before_jax import STAND_INS
from coadjoint.cli.termination import status, stoppable, word
from coadjoint.postponed import postpone

SELDOM = 100_000
"""How many more objects are made than freed between two collections: imports and traces make millions that stay."""


def run() -> int:
    """Run the command and return the exit status; see `coadjoint.cli.main.main`."""
    gc.set_threshold(SELDOM)
    postpone("jax", STAND_INS)
    postpone("xarray")
    postpone("pandas")
    found = _run()
    gc.freeze()  # Python's last collections would search, for a tenth of the time, what ends with the process.
    exec("")  # Python ends by SIGINT, whatever the status, if the last text that it executed was interrupted.
    with suppress(ValueError):  # not in the main thread
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # While Python ends, Ctrl-C would show a traceback.
    return found


def _run() -> int:
    with stoppable() as came:
        try:
            from coadjoint.cli.main import main

            return main(alone=True)
        except KeyboardInterrupt:
            pass
        except Exception:  # imports may turn an interrupt into this
            if not came:
                raise
        sys.stderr.write(f"{word(came)}.\n")
        return status(came)
