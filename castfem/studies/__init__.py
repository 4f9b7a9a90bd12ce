"""Several runs: sweeps, errors of numbers, derivatives, best values."""
