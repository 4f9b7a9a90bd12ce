"""Results of a run: what is evaluated of a slice, and how it is reported."""
