"""Studies of several runs: sweeps, errors, derivatives, calibration, optimisation."""
