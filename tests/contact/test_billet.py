"""A solidifying billet in a mould: liquid at first, with friction, on one and several ranks."""

from __future__ import annotations

from typing import Any

from mpi4py import MPI

import numpy as np
import pytest
from mechanics.casting import STEEL, CastSetup, billet_mesh

from castfem.physics.contact.friction import Coulomb
from castfem.physics.contact.settings import Contact
from castfem.physics.contact.state import ContactCheckpoint
from castfem.physics.contact.summary import summary
from castfem.physics.machine import Machine, Steady
from castfem.physics.mechanics.slice_definition import Ferrostatic
from castfem.physics.mechanics.surface_gap import SurfaceGap
from castfem.physics.mould import Mould, RectangleCavity, Taper, same

SPEED, HALF = 0.06, 0.0625


def cast(comm: MPI.Comm, taper: float, cell: str = "quadrilateral", **settings: Any) -> CastSetup:
    """Set up a quarter billet in a tapered mould, without taking a step."""
    mesh = billet_mesh(
        corner_radius=5e-3, surface_size=2.5e-3, core_size=2e-2, face_size=1e-2, cell=cell, order=2
    )
    mould = Mould(RectangleCavity(0.125, 0.125, 5e-3), 0.6, same(Taper.single(taper, 0.6)))
    slice_ = settings.pop("slice", {})
    contact = Contact(mould, ("wide", "narrow", "corner"), lambda t: SPEED * t, **settings)
    return CastSetup(mesh, comm, interactions=(contact,), **slice_)


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("cell", "method", "large"),
    [("quadrilateral", "penalty", False), ("quadrilateral", "nitsche", False),
     ("triangle", "penalty", True)],
)  # fmt: skip
def test_results_are_independent_of_ranks(cell: str, method: str, large: bool) -> None:
    settings: dict[str, Any] = {
        "method": method,
        "friction": Coulomb(0.2),
        "slice": {"large_strain": large},
    }
    serial = cast(MPI.COMM_SELF, 0.01, cell, **settings).advance(1.5, 0.25)
    parallel = cast(MPI.COMM_WORLD, 0.01, cell, **settings).advance(1.5, 0.25)
    states = []
    for setup in (serial, parallel):
        contact, state = setup.problem.contact, setup.state.contact
        states.append(
            (contact.arrays(state), summary(contact, state, setup.state.generalized_strains))
        )
    (one, first), (many, second) = states
    for name in ("force", "axial", "length", "pressure"):
        assert getattr(second, name) == pytest.approx(getattr(first, name), rel=1e-6)
    assert second.points == first.points
    assert parallel.state.contact.withdrawal_resistance == pytest.approx(
        serial.state.contact.withdrawal_resistance, rel=1e-6
    )
    if MPI.COMM_WORLD.rank == 0:
        for name in ("contact_place", "contact_status", "contact_gap", "contact_friction"):
            scale = np.abs(one[name]).max()
            assert np.abs(one[name] - many[name]).max() <= 1e-6 * scale, name


@pytest.mark.mpi
def test_checkpoint_restores_the_state() -> None:
    setup = cast(MPI.COMM_WORLD, 0.01, method="nitsche", friction=Coulomb(0.2)).advance(0.5, 0.25)
    contact, state = setup.problem.contact, setup.state.contact
    checkpoint = ContactCheckpoint(contact.facets)
    arrays = {k: MPI.COMM_WORLD.bcast(v) for k, v in checkpoint.arrays(state).items()}
    restored = checkpoint.state(arrays, contact.initial())
    for name in (
        "friction",
        "withdrawal_resistance",
        "stress",
        "internal",
        "place",
        "gap",
        "pressure",
        "status",
    ):
        assert np.array_equal(getattr(restored, name), getattr(state, name)), name
        assert getattr(restored, name).dtype == getattr(state, name).dtype


@pytest.mark.parametrize("method", ["penalty", "nitsche"])
@pytest.mark.parametrize("outside", ["held", "free"])
def test_liquid_presses_on_the_wall(method: str, outside: str) -> None:
    """Without a shell the mould carries the ferrostatic pressure unless liquid is held outside."""
    setup = cast(
        MPI.COMM_SELF,
        0.0,
        method=method,
        slice={
            "ferrostatic": Ferrostatic(
                Machine(Steady(SPEED)).head(7000.0), STEEL.solid_fraction, outside=outside
            )
        },
    )
    hot = np.full(len(setup.vertices), STEEL.liquidus + 10.0)
    result = setup.stepper.step(setup.state, 0.5, hot)
    assert result.converged
    found = summary(setup.problem.contact, result.state.contact, result.state.generalized_strains)
    head = 7000.0 * 9.81 * SPEED * 0.5
    carried = head if outside == "free" else 0.0
    assert found.pressure == pytest.approx(carried, rel=0.03, abs=1e-6 * head)
    # With the penalty the wall is compliant, and the stiffness of the liquid carries a little.
    rel = 1e-5 if method == "nitsche" else 0.02
    assert -found.force == pytest.approx([carried * HALF] * 2, rel=rel, abs=1e-6 * head)


def test_gap_opens_first_at_the_corner() -> None:
    """Two seconds of solidification and contraction, without a reduced step."""
    setup = cast(MPI.COMM_SELF, 0.0)
    gaps = SurfaceGap(setup.problem.contact)
    setup.advance(2.0, 0.25)
    found = summary(setup.problem.contact, setup.state.contact, setup.state.generalized_strains)
    assert 0.0 < found.share < 1.0 and found.penetration < 1e-6
    assert found.widest[0] > 0.055 and found.widest[1] > 0.055
    assert found.force[0] == pytest.approx(found.force[1], rel=1e-4)
    gap, places = gaps.at(setup.state), setup.vertices[gaps.dofs]
    middle = np.argmin(np.hypot(places[:, 0], places[:, 1] - HALF))
    assert abs(gap[middle]) < 1e-6
    assert gap.max() == pytest.approx(found.gap, rel=0.2)
    assert np.mean([r.newton for r in setup.results]) < 12
