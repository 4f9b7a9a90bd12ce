"""A billet with each law of friction, from the case file to the force on the strand."""

from __future__ import annotations

import numpy as np
import pytest
from billet_runs import run_in_memory, shipped

from castfem.physics.contact.state import SLIP

# Law -> friction over the mould's pressure; what a law has without pressure, Pa, and over pressure
# at most.
LAWS = {
    "limited, coefficient=0.3, yield_stress=10 MPa": (0.3, 0.0, 0.0),
    "tresca, share=0.3, yield_stress=10 MPa": (0.0, 0.3 * 10e6 / 3.0**0.5, 1.0),
    "viscous, stress=500 Pa, speed=3.6 m/min": (0.0, 500.0, 1.0),
    "viscous, stress=1 MPa, speed=3.6 m/min, coefficient=0.2, yield_stress=10 MPa": (0.2, 1e6, 1.0),
}


@pytest.mark.parametrize("law", list(LAWS))
def test_friction_of_each_law(law: str) -> None:
    """The strand slides down the mould: friction at every point is the law's, and holds it back."""
    keys = f"law={law}".split(", ")
    kept = run_in_memory(
        shipped("taper_1", "casting.length=210 mm", *(f"mould.friction.{key}" for key in keys))
    )
    assert kept.summary is not None and kept.summary.status == "finished"
    assert kept.summary.steps["coupling windows cut back"] == 0
    state = kept.states[-1].mechanical.contact
    slides = state.status == SLIP
    assert slides.sum() > 0.5 * len(slides)
    share, most, steepest = LAWS[law]
    expected = share * state.pressure + np.minimum(steepest * state.pressure, most)
    size = np.hypot(*state.friction.T)
    # Viscous friction at the speed of casting, but for what slides in the plane.
    assert size == pytest.approx(expected, rel=1e-3, abs=1e-3)
    assert -state.friction[:, 1] == pytest.approx(size, rel=2e-2, abs=1e-3)
    if most == 500.0:  # all of it where the mould is pressed on
        assert (size > 499.0).any()
