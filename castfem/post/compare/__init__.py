"""Finished runs side by side, and the tables of studies."""
