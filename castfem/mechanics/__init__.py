"""Mechanics of the slice: generalized plane strain, state at quadrature points, SNES."""
