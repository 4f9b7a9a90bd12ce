"""Staggered coupling of temperature and mechanics: coupling windows, iterations and sub-steps."""
