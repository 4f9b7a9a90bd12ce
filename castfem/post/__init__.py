"""Figures, tables and texts on finished runs."""
