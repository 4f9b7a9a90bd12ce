"""Derivatives of a run's results with respect to keys of its case, computed along with the run.

Forward (direct) differentiation of the discrete run: after each step its linearised equations are
solved once more for each parameter, with the matrix of the step (docs/sensitivity.md). A run
without derivatives imports nothing of this.
"""
