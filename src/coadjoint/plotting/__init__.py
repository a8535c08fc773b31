"""Figures of datasets: `coadjoint.plotting.plots.Plots`, which runs carry as `run.plot`."""
