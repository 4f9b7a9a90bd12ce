"""Global search: runs over the whole ranges, proposed by Optuna.

The first half covers the ranges evenly (Sobol's sequence), the other half goes where the
tree-structured Parzen estimator [Akiba2019] (docs/references.md) expects improvement, including
constraints. Proposals are made in batches of fixed size, so that they depend neither on the number
of processes nor on an interruption. COBYQA continues from the two best local optima.
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

    apart: float = 0.2  #: smallest distance of two local optima, relative to the ranges
    batch: int = 4  #: runs per batch
    optima: int = 2  #: number of local optima that are refined
    seed: int = 12  #: seed of the random numbers


GLOBAL = GlobalSettings()

Evaluate = Callable[[list[Array]], list[list[float]]]
"""Scaled cost and margins at points (n,), fractions of the ranges."""


def check_installed(where: str) -> None:
    """Check that Optuna is installed, without importing it."""
    if importlib.util.find_spec("optuna") is None:
        raise InputError(
            f'{where}: optimise.method ("optuna"): Optuna is not installed; pip install '
            '"castfem[optimise]" (in a checkout tools/env.sh optimise), or method = "cobyqa"'
        )


def explore(evaluate: Evaluate, start: Array, count: int) -> list[Array]:
    """Evaluate points over the whole ranges; return the best of each region, best first.

    Args:
        evaluate: Makes the runs.
        start: First point, fractions of the ranges (n,).
        count: Number of points.
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
    """Return the points, best first, without a better one within a fifth of the ranges.

    Args:
        places: Points (r, n), fractions of the ranges.
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
