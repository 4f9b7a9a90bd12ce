"""Where the valleys of an objective are: runs all over the ranges, proposed by Optuna.

The first half fills the ranges evenly (Sobol's sequence), the other half goes where the tree of
Parzen estimators [Akiba2019] (docs/references.md) expects more, with regard to the constraints.
Proposals come a few at once, always as many, so that neither the number of processes nor a kill
changes them. From the best of each of the two best valleys COBYQA goes on.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable

import numpy as np

from castfem.base.errors import InputError
from castfem.base.types import Array

_AT_ONCE = 4
_SEED = 12
APART = 0.2  # of the ranges: between two valleys
_MOST = 2

Given = Callable[[list[Array]], list[list[float]]]
"""Of places, shares of the ranges (n,) each, their cost and margins, scaled."""


def check_installed(where: str) -> None:
    """Look for Optuna without importing it.

    Raises:
        InputError: It is not installed.
    """
    if importlib.util.find_spec("optuna") is None:
        raise InputError(
            f'{where}: optimise.method ("optuna"): Optuna is not installed; pip install '
            '"castfem[optimise]" (in a checkout tools/env.sh optimise), or method = "cobyqa"'
        )


def explore(given: Given, start: Array, count: int) -> list[Array]:
    """Look at runs all over the ranges, and return places from which to search on.

    Args:
        given: What runs give.
        start: Looked at first, shares of the ranges (n,).
        count: How many to look at.

    Returns:
        The best place of each valley, the best one first, one at least.
    """
    import optuna
    from scipy.stats import qmc

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    names = [str(i) for i in range(len(start))]
    even = qmc.Sobol(len(start), seed=_SEED).random(2 ** int(np.ceil(np.log2(max(count, 2)))))
    even = even[: count // 2]
    sampler = optuna.samplers.TPESampler(
        n_startup_trials=1 + len(even), seed=_SEED, multivariate=True
    )
    study = optuna.create_study(sampler=sampler)
    for place in (start, *even):
        study.enqueue_trial({name: float(u) for name, u in zip(names, place, strict=True)})
    places: list[Array] = []
    values: list[list[float]] = []
    while len(places) < count:
        most = count - len(places)
        asked = min(_AT_ONCE if places else 1 + len(even), most)
        trials = [study.ask() for _ in range(asked)]
        new = [np.array([t.suggest_float(name, 0.0, 1.0) for name in names]) for t in trials]
        found = given(new)
        for trial, (cost, *margins) in zip(trials, found, strict=True):
            for number, left in enumerate(margins):
                trial.set_constraint(str(number), -left)
            study.tell(trial, cost)
        places += new
        values += found
    return valleys(np.array(places), np.array(values))


def valleys(places: Array, values: Array) -> list[Array]:
    """Return the best place of each valley, the best one first.

    A place is the best of a valley if none that is nearer than a fifth of the ranges is better.

    Args:
        places: Shares of the ranges (r, n).
        values: Cost and margins (r, 1 + m), scaled.
    """
    missed = np.max(np.maximum(-values[:, 1:], 0.0), axis=1, initial=0.0)
    rank = np.empty(len(places), dtype=int)
    rank[np.lexsort((values[:, 0], missed))] = np.arange(len(places))
    found: list[Array] = []
    for i in np.argsort(rank):
        near = np.max(np.abs(places - places[i]), axis=1) < APART
        if rank[i] == np.min(rank[near]) and len(found) < _MOST:
            found.append(places[i])
    return found
