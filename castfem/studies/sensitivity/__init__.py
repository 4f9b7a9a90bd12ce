"""Derivatives of a run's results by keys of its case, carried along with the run.

Forward (direct) differentiation of the discrete run: after each step its linearised equations are
solved once more for each parameter, with the matrix of the step (docs/sensitivity.md). A run that
asks for none imports nothing of this.
"""
