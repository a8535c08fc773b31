"""`python -m coadjoint` is the command `coadjoint`."""

import sys

from coadjoint.cli.start import run

sys.exit(run())
