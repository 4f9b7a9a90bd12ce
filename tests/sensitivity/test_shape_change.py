"""What the shape gives the heat balance, against differences of what is assembled."""

from __future__ import annotations

from mpi4py import MPI

import numpy as np
import pytest
from sensitivity.test_mould_derivatives import short

from castfem.fem.compat import assemble_owned
from castfem.model.build.simulation import build
from castfem.studies.sensitivity.shape_change import ByMotion


@pytest.mark.parametrize("what", ["volume", "perimeter"])
def test_a_form_changes_as_the_slice_moves(what: str) -> None:
    """By displacement and by two generalized strains, both motions at once."""
    simulation = build(short(), MPI.COMM_SELF)
    section, shape = simulation.section, simulation.problem.shape
    assert shape is not None
    name, form = "heat.volume.moved", shape.volume
    if what == "perimeter":
        name, form = next(iter(simulation.zones.surface.forms().values()))
    rng, size = np.random.default_rng(0), len(shape.displacement.x.array)
    here = 1e-5 * rng.standard_normal(size), np.array([1e-3, 0.0, 0.0, 2e-3])
    moves = rng.standard_normal((2, size)), np.array([[0.5, 0, 0, 0], [-1.0, 0, 0, 2.0]])
    shape.take(*here)
    by_motion = ByMotion(section, shape, name, form)
    found = by_motion(*moves)
    assert shape.generalized_strains.value == pytest.approx(here[1], abs=0.0)
    compiled, step = section.compile(name, form), 1e-8
    for number in range(2):
        ends = []
        for sign in (1.0, -1.0):
            shape.take(
                *(at + sign * step * move[number] for at, move in zip(here, moves, strict=True))
            )
            ends.append(assemble_owned(compiled, section.owned))
        known = (ends[0] - ends[1]) / (2.0 * step)
        assert np.abs(found[number] - known).max() < 1e-6 * np.abs(known).max()
    by_motion.destroy()
    simulation.destroy()
