"""Weak forms and kinematic measures as UFL; no solver, no file, no communicator in here."""
