"""Global search: runs over all of the ranges, proposed by Optuna.

The first half covers the ranges evenly (Sobol's sequence), the other half goes where the tree of
Parzen estimators [Akiba2019] (docs/references.md) expects improvement, constraints included.
Proposals are made in batches of fixed size, so that neither the number of processes nor a kill
changes them. COBYQA goes on from the two best local optima.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from castfem.base.errors import InputError
from castfem.base.types import Array


@dataclass(frozen=True, slots=True)
class GlobalSettings:
    """Settings of the search for several optima."""

    apart: float = 0.2  #: distance of two local optima, of the ranges
    batch: int = 4  #: runs at once
    optima: int = 2  #: optima that are followed
    seed: int = 12  #: of the random numbers


GLOBAL = GlobalSettings()

Evaluate = Callable[[list[Array]], list[list[float]]]
"""Scaled cost and margins at places, shares of the ranges (n,) each."""


def check_installed(where: str) -> None:
    """Look for Optuna without importing it."""
    if importlib.util.find_spec("optuna") is None:
        raise InputError(
            f'{where}: optimise.method ("optuna"): Optuna is not installed; pip install '
            '"castfem[optimise]" (in a checkout tools/env.sh optimise), or method = "cobyqa"'
        )


def explore(evaluate: Evaluate, start: Array, count: int) -> list[Array]:
    """Evaluate places over all of the ranges, and return the best of each region, best first.

    Args:
        evaluate: What runs give.
        start: The first place, shares of the ranges (n,).
        count: Number of places.
    """
    import optuna
    from scipy.stats import qmc

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    names = [str(i) for i in range(len(start))]
    even = qmc.Sobol(len(start), seed=GLOBAL.seed).random(2 ** int(np.ceil(np.log2(max(count, 2)))))
    first = [start, *even[: count // 2]]
    sampler = optuna.samplers.TPESampler(
        n_startup_trials=len(first), seed=GLOBAL.seed, multivariate=True
    )
    study = optuna.create_study(sampler=sampler)
    for place in first:
        study.enqueue_trial({name: float(u) for name, u in zip(names, place, strict=True)})
    places: list[Array] = []
    values: list[list[float]] = []
    while len(places) < count:
        batch = min(GLOBAL.batch if places else len(first), count - len(places))
        trials = [study.ask() for _ in range(batch)]
        new = [np.array([t.suggest_float(name, 0.0, 1.0) for name in names]) for t in trials]
        results = evaluate(new)
        for trial, (cost, *margins) in zip(trials, results, strict=True):
            for number, margin in enumerate(margins):
                trial.set_constraint(str(number), -margin)
            study.tell(trial, cost)
        places += new
        values += results
    return local_optima(np.array(places), np.array(values))


def local_optima(places: Array, values: Array) -> list[Array]:
    """Return the places, best first, that have no better one within a fifth of the ranges.

    Args:
        places: Shares of the ranges (r, n).
        values: Scaled cost and margins (r, 1 + m).
    """
    missed = np.max(np.maximum(-values[:, 1:], 0.0), axis=1, initial=0.0)
    rank = np.empty(len(places), dtype=int)
    rank[np.lexsort((values[:, 0], missed))] = np.arange(len(places))
    found: list[Array] = []
    for i in np.argsort(rank):
        near = np.max(np.abs(places - places[i]), axis=1) < GLOBAL.apart
        if rank[i] == np.min(rank[near]) and len(found) < GLOBAL.optima:
            found.append(places[i])
    return found
