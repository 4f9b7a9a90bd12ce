"""The gap with which a coupling window is tried first."""

from __future__ import annotations

from mpi4py import MPI

import numpy as np
from runs.billet_runs import billet, run_in_memory, shipped

from castfem.model.build.simulation import build

SHORT = 'casting.length="180 mm"'


def test_a_gap_that_opens_evenly_is_found_at_once() -> None:
    """What the tolerance of the coupling leaves is a fifth of it, with hardly a repetition."""
    found = []
    for settled in ("1 K", "0.01 K"):
        kept = run_in_memory(
            shipped("taper_0", SHORT, "coupling.interval=0.1 s", f"coupling.settled={settled}")
        )
        assert kept.summary is not None
        found.append((kept.value("surface_temperature_corner"), kept.summary.steps))
    (corner, steps), (settled_corner, _) = found
    assert abs(corner - settled_corner) < 0.2  # 0.7 with the gap of the begin
    assert steps["coupling iterations"] < 1.2 * steps["coupling windows"]


def test_a_slice_goes_on_as_it_moved() -> None:
    """Displacement, free scalars and the generalized strains that belong to them."""
    case = billet("taper_0", SHORT)
    before, now = (state.mechanical for state in run_in_memory(case).states[-2:])
    assert before is not None and now is not None
    simulation = build(case, MPI.COMM_SELF)
    assert simulation.mechanics is not None
    ahead = simulation.mechanics.going_on(now, 2.0 * now.time - before.time)
    simulation.destroy()
    assert ahead.time == 2.0 * now.time - before.time
    owned = slice(0, len(now.rate))
    for name, part in (("displacement", owned), ("scalars", ...), ("generalized_strains", ...)):
        one, two, three = (getattr(s, name)[part] for s in (before, now, ahead))
        assert np.abs(two - one).max() > 1e-7  # m, or of strain
        np.testing.assert_allclose(three - two, two - one, rtol=1e-9, atol=1e-18)
