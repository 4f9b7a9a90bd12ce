"""A beam blank in its mould: a surface that is hollow between web and flange."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from runs.billet_runs import CASES, run_in_memory

from castfem.model import load_case

BEAM_BLANK = f"""
extends = "{CASES / "tapered.toml"}"

[casting]
speed = "1 m/min"
length = "40 mm"

[section]
shape = "beam_blank"
width = "400 mm"
height = "300 mm"
web_thickness = "100 mm"
flange_thickness = "60 mm"
root_thickness = "90 mm"
fillet_radius = "20 mm"
shoulder_radius = "15 mm"
corner_radius = "10 mm"

[mesh]
surface_size = "4 mm"
corner_size = "6 mm"
surface_depth = "4 mm"
face_size = "20 mm"
core_size = "20 mm"

[mould]
taper = "1 %/m"

[coupling]
interval = "0.6 s"

[output]
fields = []
figures = false
"""


def test_beam_blank_in_its_mould(tmp_path: Path) -> None:
    """Forces and heat balance, the wall is not entered, and it bears the liquid."""
    (tmp_path / "beam_blank.toml").write_text(BEAM_BLANK)
    kept = run_in_memory(load_case(tmp_path / "beam_blank.toml"))
    for sample in kept.samples[1:]:
        mechanics = sample.mechanics
        assert mechanics is not None and mechanics.balance is not None
        contact = mechanics.contact
        assert contact is not None and contact.penetration < 1e-6 and contact.share > 0.5
        assert mechanics.balance.forces_error < 1e-6 and mechanics.balance.axial_error < 1e-6
        assert abs(sample.balance) < 1e-9
        # The lines of symmetry carry what the wall bears.
        left = mechanics.balance.support + contact.force
        assert np.abs(left).max() < 1e-6 * np.abs(contact.force).max()
    # At first there is next to no shell: one pressure, on half the width and half the web.
    first = kept.samples[1].mechanics
    assert first is not None and first.contact is not None
    assert first.contact.force[1] / first.contact.force[0] == pytest.approx(200 / 50, rel=0.01)
    assert kept.summary is not None
    assert kept.summary.balances["heat"]["whole"].value < 1e-9
