"""A table of cases: planned and checked as a whole, run in parallel, gathered in one table."""
