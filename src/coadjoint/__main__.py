"""`python -m coadjoint` is the command `coadjoint`."""

from coadjoint.cli.main import run

run()
