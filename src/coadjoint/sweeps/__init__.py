"""Many runs of one file, on one machine or a cluster: `coadjoint sweep` and `co.sweep`."""
