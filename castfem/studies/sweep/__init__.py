"""Sweeps: tables of cases, planned, checked, run in parallel, with a table of results."""
