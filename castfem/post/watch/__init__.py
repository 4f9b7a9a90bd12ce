"""Progress of running runs, read from the files they write."""
