"""Variational integrators on Lie groups from a reduced Lagrangian."""
