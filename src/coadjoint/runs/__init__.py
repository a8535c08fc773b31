"""Run files: a run as TOML, and the way from it to a folder of results."""
