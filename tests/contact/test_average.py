"""Contact pressure as a mean over a length: what finer cells leave, and what ranks agree on."""

from __future__ import annotations

from mpi4py import MPI

import numpy as np
import pytest
from mechanics.casting import billet_mesh

from castfem.fem.section import Section
from castfem.physics.contact.facets import LENGTH, Facets, SurfaceMean

HALF = 0.0625
END = np.array([HALF - 5e-3, HALF])  # of the arc, where it goes over into the face


def surface(size: float, comm: MPI.Comm = MPI.COMM_SELF) -> Facets:
    """The surface of a quarter billet with cells of `size` (m) near the corner."""
    mesh = billet_mesh(
        corner_radius=5e-3, surface_size=size, core_size=2e-2, face_size=8e-3, order=2
    )
    section = Section(comm, mesh)
    return Facets(section, section.matching(("wide", "narrow", "corner")), 2)


def test_uniform_pressure_is_its_mean() -> None:
    facets = surface(1e-3)
    most, _ = SurfaceMean(facets).highest(np.full(facets.count, 3e6), facets.position)
    assert most == pytest.approx(3e6, rel=1e-12)


def test_the_mean_of_a_peak_stays_where_its_highest_point_grows() -> None:
    """A pressure like the root of the distance, as at the edge of a stamp: 2 sqrt(2 / L)."""
    points, means = [], []
    for size in (1.6e-3, 0.8e-3, 0.4e-3, 0.2e-3):
        facets = surface(size)
        distance = np.hypot(*(facets.position - END).T)
        pressure = 1.0 / np.sqrt(distance)
        points.append(pressure.max())
        mean, place = SurfaceMean(facets).highest(pressure, facets.position)
        means.append(mean)
        assert np.hypot(*(place - END)) < 2 * size
    exact = 2.0 * np.sqrt(2.0 / LENGTH)
    assert points[-1] > 2.0 * points[0]
    assert means[-1] == pytest.approx(exact, rel=0.06)
    errors = np.abs(np.array(means) / exact - 1.0)
    assert (np.diff(errors) < 0.0).all() and errors[1] < 0.15


def test_where_cells_are_long_three_of_them_count() -> None:
    """At mid-face: a facet that for a moment touches nothing is no loss of pressure there."""
    facets = surface(1e-3)
    x = facets.position[:, 0]
    top = facets.position[:, 1] > HALF - 1e-9
    pressure = np.where(top & (x > np.unique(x[top])[1]), 1e5, 0.0)  # but for the first facet
    around = SurfaceMean(facets).around(np.array([[0.0, HALF]]))
    assert 0.2e5 < (around @ pressure)[0] < 0.8e5


@pytest.mark.mpi
def test_ranks_agree() -> None:
    found = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        facets = surface(1e-3, comm)
        mean = SurfaceMean(facets)
        pressure = 1e6 * np.sin(300.0 * facets.position[:, 0]) ** 2
        start = mean.around(np.array([[0.0, HALF]])) @ mean.gathered(pressure)
        most, place = mean.highest(pressure, facets.position)
        found.append([most, *place, *start])
    assert found[1] == pytest.approx(found[0], rel=1e-9)
