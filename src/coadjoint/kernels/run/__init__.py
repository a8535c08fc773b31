"""Programs run: as machine code, for one or many, with gradients, or by XLA."""
