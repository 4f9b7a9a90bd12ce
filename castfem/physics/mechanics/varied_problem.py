"""The slice of a run with other numbers, on its mesh: for results that are read off both sides."""

from __future__ import annotations

from castfem.physics.mechanics.definition import Slice
from castfem.physics.mechanics.problem import MechanicalProblem


class VariedProblem(MechanicalProblem):
    """The equilibrium of another slice, of which states can be measured; it is not solved.

    It shares fields, forms and matrices with the run: destroy the run's alone.

    Args:
        run: The equilibrium whose mesh, fields and forms it takes.
        slice_: Of the same planes, supports and kinds of interactions, with other numbers.

    Raises:
        InputError: One of the interactions has no derivatives.
    """

    def __init__(self, run: MechanicalProblem, slice_: Slice) -> None:
        vars(self).update(vars(run))  # nothing is built or compiled a second time
        self.slice = slice_
        self.interactions = run.interactions.of_slice(slice_.interactions, slice_)
