"""Finite elements on DOLFINx and PETSc, independent of the physics: sections, solvers, ranks."""
