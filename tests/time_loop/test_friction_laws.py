"""A billet with each law of friction, from the case file to the force on the strand."""

from __future__ import annotations

import numpy as np
import pytest
from billet_runs import billet, run_in_memory

from castfem.contact.state import SLIP

# Law -> friction over the mould's pressure, and the most friction there is, Pa.
LAWS = {
    "coulomb, coefficient=0.3": (0.3, np.inf),
    "limited, coefficient=0.3, yield_stress=10 MPa": (0.3, np.inf),
    "tresca, share=0.3, yield_stress=10 MPa": (1.0, np.inf),
    "viscous, stress=500 Pa, speed=3.6 m/min": (1.0, 500.0),
    "viscous, stress=1 MPa, speed=3.6 m/min, steepest=0.5": (0.5, np.inf),
    "viscous, stress=1 MPa, speed=3.6 m/min, coefficient=0.2, yield_stress=10 MPa": (1.2, np.inf),
}


@pytest.mark.parametrize("law", list(LAWS))
def test_friction_of_each_law(law: str) -> None:
    """The strand slides down the mould: friction at every point is the law's, and holds it back."""
    keys = f"law={law}".split(", ")
    kept = run_in_memory(
        billet("taper_1", "casting.length=210 mm", *(f"mould.friction.{key}" for key in keys))
    )
    assert kept.summary is not None and kept.summary.status == "finished"
    assert kept.summary.steps["coupling windows cut back"] == 0
    state = kept.states[-1].mechanical.contact
    slides = state.status == SLIP
    assert slides.sum() > 0.5 * len(slides)
    share, most = LAWS[law]
    expected = np.minimum(share * state.pressure, most)
    size = np.hypot(*state.friction.T)
    # Viscous friction at the speed of casting, but for what slides in the plane.
    assert size == pytest.approx(expected, rel=1e-3, abs=1e-3)
    assert -state.friction[:, 1] == pytest.approx(size, rel=2e-2, abs=1e-3)
    assert np.any(expected == most) == (most < np.inf)
