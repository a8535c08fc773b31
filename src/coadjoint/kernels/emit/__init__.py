"""Expressions as LLVM instructions: a step, its tangent and its adjoint."""
