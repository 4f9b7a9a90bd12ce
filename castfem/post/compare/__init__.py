"""Comparison of finished runs, and the tables of studies."""
