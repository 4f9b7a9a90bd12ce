"""Many runs of one case with a question: which values of its keys are best, and how sure is that?

fidelity    how well a run is computed, by one word; the idealised mould of a case
store       runs in a folder, found again by the case they are of
evaluator   all results of a case with some keys changed, run once
question    what a case asks for by [optimise];  outputs  what a run means for it
ideal_taper where a search for tapers begins
search      COBYQA behind the runs that are there;  descent  SLSQP, with their derivatives
noise       how far runs that differ by next to nothing lie apart
vicinity    what lies round an optimum
binding     which constraints hold it;  checked  where it is by the level of the check
numerical   its numerical error, by the other levels of fidelity
unknown     what of its error was not checked
front       two results weighed;  spread, inputs  what is not known exactly
carried     derivatives that runs carry for it;  response  quadratics through both
beyond      whether a wider range may meet what cannot be met
digits      with how many of them the answer is printed
inquiry     the way through all of these
study       ask, tell, result;  optimum  the answer, made by `verdict`
"""

from castfem.studies.optimisation.evaluator import Evaluator, serve
from castfem.studies.optimisation.optimum import Optimum
from castfem.studies.optimisation.question import Wanted
from castfem.studies.optimisation.store import Evaluation
from castfem.studies.optimisation.study import Study

__all__ = ["Evaluation", "Evaluator", "Optimum", "Study", "Wanted", "serve"]
