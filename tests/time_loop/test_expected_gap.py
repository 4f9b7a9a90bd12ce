"""The gap with which a coupling window is tried first."""

from __future__ import annotations

from mpi4py import MPI

import numpy as np
from time_loop.billet_runs import billet, run_in_memory, shipped

from castfem.mechanics.state import MechanicalState
from castfem.simulation.simulation import build
from castfem.time_loop.loop import TimeLoop

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
    simulation = build(billet("taper_0", SHORT), MPI.COMM_SELF)
    assert simulation.mechanics is not None
    loop = TimeLoop(simulation)
    states: list[MechanicalState] = []
    for _ in range(3):
        loop.advance()
        state = loop.run_state.state.mechanical
        assert state is not None
        states.append(state)
    before, now = states[-2:]
    ahead = simulation.mechanics.going_on(now, 2.0 * now.time - before.time)
    owned = slice(0, len(now.rate))
    assert ahead.time == 2.0 * now.time - before.time
    assert np.abs(now.displacement - before.displacement).max() > 0.0
    for name, part in (("displacement", owned), ("scalars", ...), ("generalized_strains", ...)):
        one, two, three = (getattr(s, name)[part] for s in (before, now, ahead))
        np.testing.assert_allclose(three - two, two - one, rtol=1e-9, atol=1e-18)
    simulation.destroy()
