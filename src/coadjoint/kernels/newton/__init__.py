"""Newton's method: which unknowns are solved for in which order, and the increment of each."""
