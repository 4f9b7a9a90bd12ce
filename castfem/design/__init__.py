"""Many runs of one case with a question: which values of its keys are best, and how sure is that?

fidelity    how well a run is computed, by one word; the idealised mould of a case
store       runs in a folder, found again by the case they are of
evaluator   all results of a case with some keys changed, run once
"""

from castfem.design.evaluator import Evaluator
from castfem.design.store import Evaluation

__all__ = ["Evaluation", "Evaluator"]
