"""Builders of the computing objects from a case."""
