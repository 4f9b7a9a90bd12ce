"""A problem that nothing refers to is freed, with its matrices and MPI communicators."""

from __future__ import annotations

import gc
import weakref

from mechanics.setups import SliceSetup, box, mapped


def test_a_problem_that_is_left_is_freed() -> None:
    """PETSc calls back what solves it; Python's collector does not see that."""
    setup = SliceSetup(mapped(2, 2, box(0.1, 0.1)))
    setup.step(1.0, 10.0)
    problem = setup.problem
    left = [weakref.ref(one) for one in (problem, problem.solver, problem.bordered)]
    del setup, problem
    gc.collect()
    assert [reference() for reference in left] == [None, None, None]
