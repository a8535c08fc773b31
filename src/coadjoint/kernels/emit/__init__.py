"""Expressions as LLVM instructions: a step, its tangent and its adjoint."""

FEW_PASSES = "coadjoint.few_passes"
"""Metadata of a module that LLVM optimises by `machine.PASSES` alone: a step with multipliers of constraints, or of
chords in loops over links, whose expressions are already shared and simplified, compiles in half of the time and runs
as fast."""
