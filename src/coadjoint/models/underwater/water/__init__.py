"""The water that a craft moves through: currents and density."""
