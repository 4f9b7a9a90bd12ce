"""The same numbers on one rank and on several."""

from __future__ import annotations

from mpi4py import MPI

import numpy as np
import pytest

from castfem.fem.probes import LineProbes
from castfem.physics.thermal import flux_laws
from thermal.setups import ThermalSetup, constant_steel
from thermal.test_extremes import CAST, WALL, billet


def cooled(
    comm: MPI.Comm, cell: str = "quadrilateral", radius: float = 5e-3, until: float = 4.0
) -> ThermalSetup:
    curve = constant_steel(1725.15, 1775.65, datum=CAST)
    setup = ThermalSetup(billet(radius, cell), curve, CAST, comm=comm)
    law = flux_laws.Contact(1600.0, WALL, 0.15)
    setup.cool(("wide", law), ("narrow", law), *([("corner", law)] if radius else []))
    return setup.advance(until, 0.1)


@pytest.mark.mpi
@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_many_ranks_give_what_one_gives(cell: str) -> None:
    alone, together = cooled(MPI.COMM_SELF, cell), cooled(MPI.COMM_WORLD, cell)
    one = alone.section.gather(alone.state.point.temperature)
    many = together.section.gather(together.state.point.temperature)
    if MPI.COMM_WORLD.rank == 0:
        assert one is not None and many is not None
        assert np.abs(many / one - 1).max() < 1e-8
    assert together.state.removed == pytest.approx(alone.state.removed, rel=1e-8)
    assert together.worst_balance < 1e-9
    lines = {n: LineProbes(s.section).sample(s.state.point.temperature) for n, s in
             (("one", alone), ("many", together))}  # fmt: skip
    for name, profile in lines["one"].items():
        other = lines["many"][name]
        assert other.temperature == pytest.approx(profile.temperature, rel=1e-8)
        assert other.isotherm_depth(1725.15) == pytest.approx(
            profile.isotherm_depth(1725.15), rel=1e-8
        )


@pytest.mark.mpi
def test_gather_and_scatter_are_inverse() -> None:
    setup = ThermalSetup(billet(0.0), constant_steel(1725.15, 1775.65), CAST, comm=MPI.COMM_WORLD)
    section = setup.section
    values = np.arange(section.owned) + 1000.0 * section.comm.rank
    assert np.array_equal(section.scatter(section.gather(values)), values)
