"""Every claim of every method, measured: `coadjoint audit`."""
