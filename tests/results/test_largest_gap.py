"""The largest gap of a section is that of points and vertices, the probes' among them."""

from __future__ import annotations

from mpi4py import MPI

import numpy as np
import pytest

from castfem.physics.contact.state import ContactSummary
from castfem.runs.results.mechanical import with_vertices

NOWHERE = np.zeros(2)
PLACES = np.array([[0.0, 0.06], [0.06, 0.06], [0.06, 0.0]])


def of_points(gap: float) -> ContactSummary:
    return ContactSummary(
        pressure=0.0, mean_pressure=0.0, penetration=0.0, gap=gap, force=np.zeros(2), axial=0.0,
        length=0.0, share=0.0, sticking=None, points=(0, 0, 0), highest=NOWHERE,
        highest_mean=NOWHERE, widest=np.array([0.05, 0.05]),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("points", "vertices", "gap", "at"),
    [
        (0.459e-3, [0.0, 0.489e-3, 0.1e-3], 0.489e-3, (0.06, 0.06)),  # the corner's own vertex
        (0.459e-3, [0.0, 0.4e-3, 0.1e-3], 0.459e-3, (0.05, 0.05)),
        (0.459e-3, [np.inf, 0.4e-3, 0.1e-3], 0.459e-3, (0.05, 0.05)),  # no wall: no gap
        (0.0, [-1e-6, -2e-6, -1e-6], 0.0, (0.05, 0.05)),
        (0.459e-3, [], 0.459e-3, (0.05, 0.05)),  # a rank without surface
    ],
)
def test_the_larger_counts(
    points: float, vertices: list[float], gap: float, at: tuple[float, float]
) -> None:
    places = PLACES[: len(vertices)]
    found = with_vertices(MPI.COMM_SELF, of_points(points), np.array(vertices), places)
    assert found.gap == gap and tuple(found.widest) == at
