"""Figures, tables and words on finished runs."""
