"""Commands about vehicles: `coadjoint vehicles`, `import`, `stability`, `identify`, `serve`."""
