"""Optimisation of a case by many runs, with the uncertainty of the optimum."""

from castfem.studies.optimisation.evaluator import Evaluator
from castfem.studies.optimisation.optimum import Optimum
from castfem.studies.optimisation.problem import RunRequest
from castfem.studies.optimisation.store import Evaluation
from castfem.studies.optimisation.study import Study
from castfem.studies.sweep.workers import serve

__all__ = ["Evaluation", "Evaluator", "Optimum", "RunRequest", "Study", "serve"]
