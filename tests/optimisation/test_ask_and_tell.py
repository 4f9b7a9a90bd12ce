"""A study asks for runs and is told their results: in any order, by parts, again, wrongly."""

from __future__ import annotations

from collections.abc import Mapping

import pytest
from known_results import HEAT, bowl, solve, study

from castfem.base.errors import InputError
from castfem.base.shown_quantity import Quantity
from castfem.studies.optimisation import Evaluation, RunRequest


def test_asks_tells_and_comes_to_the_same():
    """Asked run by run, in any order, by objects that know nothing of one another."""
    at_once = solve(study(constraints=["heat_removed >= 2 MJ/m"]), bowl)
    told_so_far: dict[RunRequest, Mapping[str, float]] = {}
    for _ in range(100):
        one = study(constraints=["heat_removed >= 2 MJ/m"])
        for run, values in told_so_far.items():
            one.tell(run, values)
        wanted = one.ask()
        if not wanted:
            break
        with pytest.raises(InputError, match="has not ended"):
            one.result()
        told_so_far.update({run: bowl(run) for run in reversed(wanted)})
    assert one.result() == at_once


def test_two_studies_are_asked_in_turn():
    """And one is solved that was asked before: no search waits within the minimiser."""
    one, other = study(), study()
    for _ in range(3):
        for each in (one, other):
            for run in each.ask():
                each.tell(run, bowl(run))

    def obtain(requests):
        for run in requests:
            one.tell(run, bowl(run))

    found = one.solve(obtain=obtain)
    while wanted := other.ask():
        for run in wanted:
            other.tell(run, bowl(run))
    assert other.result() == found


def test_results_that_are_told_anew_change_the_answer():
    one = study()
    while wanted := one.ask():
        for run in wanted:
            one.tell(run, bowl(run))
    before = one.result()

    def doubled(run):
        return {name: 2.0 * value for name, value in bowl(run).items()}

    for run in list(one._runs.results):
        one.tell(run, doubled(run))
    while wanted := one.ask():
        for run in wanted:
            one.tell(run, doubled(run))
    assert one.result().objective.value == pytest.approx(2.0 * before.objective.value)


def test_an_error_of_the_search_is_that_of_ask():
    """Results that lack the objective: ask says so, each time."""
    one = study()
    for run in one.ask():
        one.tell(run, Evaluation({HEAT: Quantity(1.0, "J/m", "heat")}))
    for _ in range(2):
        with pytest.raises(InputError, match=r'\("von_mises_max"\) is not a result of this case'):
            one.ask()


def test_what_was_asked_is_asked_again_until_it_is_told():
    one = study()
    first = one.ask()
    assert len(first) > 1 and one.ask() == first
    one.tell(first[0], bowl(first[0]))
    assert one.ask() == first[1:]


def test_a_study_without_a_folder_runs_nothing():
    one = study()
    with pytest.raises(InputError, match="without a folder runs nothing"):
        one.run(one.ask())
