"""Optimisation of a case by many runs: which values of its keys are best, and how sure is that?

problem            variables, constraints and inputs of [optimise]
fidelity           levels of fidelity, the idealised mould
store, evaluator   runs in a folder, each case run once
responses          objective and margins of the runs
search             COBYQA and SLSQP;  global_search  by Optuna
local_model        quadratics about an optimum: intervals, binding constraints
numerical_error    by other levels;  check_level  the optimum by the level of the check
spread             by uncertain inputs, with polynomial_fit;  front  of two results
workflow, study    search, checks and answer, by ask and tell
optimum            the answer, made by assemble
"""

from castfem.studies.optimisation.evaluator import Evaluator
from castfem.studies.optimisation.optimum import Optimum
from castfem.studies.optimisation.problem import RunRequest
from castfem.studies.optimisation.store import Evaluation
from castfem.studies.optimisation.study import Study
from castfem.studies.sweep.workers import serve

__all__ = ["Evaluation", "Evaluator", "Optimum", "RunRequest", "Study", "serve"]
