"""Benchmarks of castfem: error against run time; the tables and figures of docs/ come from here."""
