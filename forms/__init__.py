"""Weak forms and kinematic measures in UFL, without solver, files or communicator."""
