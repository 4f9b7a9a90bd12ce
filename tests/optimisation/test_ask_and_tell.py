"""A study requests runs and gets their results: in any order, in parts, again, or invalid."""

from __future__ import annotations

from collections.abc import Mapping

import pytest
from known_results import HEAT, bowl, solve, study

from castfem.base.errors import InputError
from castfem.base.shown_quantity import Quantity
from castfem.studies.optimisation import Evaluation, RunRequest


def test_order_of_results_does_not_change_the_answer():
    """Requested run by run, in any order, by objects without a common state."""
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


def test_two_studies_alternate():
    """One is solved after earlier requests: no search waits within the minimiser."""
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


def test_changed_results_change_the_answer():
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


def test_error_of_the_search_is_raised_by_ask():
    """Results without the objective: ask reports them each time."""
    one = study()
    for run in one.ask():
        one.tell(run, Evaluation({HEAT: Quantity(1.0, "J/m", "heat")}))
    for _ in range(2):
        with pytest.raises(InputError, match=r'\("von_mises_max"\) is not a result of this case'):
            one.ask()


def test_requests_are_repeated_until_they_have_results():
    one = study()
    first = one.ask()
    assert len(first) > 1 and one.ask() == first
    one.tell(first[0], bowl(first[0]))
    assert one.ask() == first[1:]


def test_study_without_a_folder_runs_nothing():
    one = study()
    with pytest.raises(InputError, match="without a folder runs nothing"):
        one.run(one.ask())
