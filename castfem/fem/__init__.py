"""Finite elements on DOLFINx and PETSc, whatever the physics: sections, solvers, ranks."""
