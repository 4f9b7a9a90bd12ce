"""The first of (38) as a reader can check it: stress, external force, accumulated friction, rest.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from billet_runs import billet, run, run_in_memory, shipped

from castfem.runs.output.history import read_history

RUBBING = ("casting.length=150 mm", "mould.friction.law=coulomb", "mould.friction.coefficient=0.3")


@pytest.mark.parametrize("method", ["penalty", "nitsche"])
def test_pull_of_friction_and_external_force_are_that_of_the_stress(
    tmp_path: Path, method: str
) -> None:
    external = 'mechanics.planes.force="8 N"'
    summary = run(billet("taper_1", *RUBBING, external, f"mould.contact={method}"), tmp_path)
    terms = {name: q.value for name, q in summary.balances["axial force"].items()}
    assert terms["external"] == 2.0  # of the quarter
    assert terms["friction"] > 1.0
    assert terms["force"] == pytest.approx(terms["external"] + terms["friction"], rel=1e-6)
    assert abs(terms["reaction"]) < 1e-6 * terms["force"]
    # Sticks or slides: the strand is drawn past a wall that stands, so most of it slides.
    touching, sticking = (summary.quantities[f"contact_{n}"].value for n in ("share", "sticking"))
    assert 0.0 <= sticking < 0.5 * touching
    # Of the whole strand, four times that of the quarter.
    found = summary.quantities
    assert found["mould_pull"].value == pytest.approx(4.0 * terms["friction"], rel=1e-12)
    assert found["mould_friction"].value > 0.0
    # The pull is the friction of all steps, over the length that each has travelled.
    table = read_history(tmp_path / "history.csv")
    travelled = np.diff(table["position"])
    pull = -np.cumsum(table["friction_force"].to_numpy()[1:] * travelled)
    assert np.allclose(table["friction_pull"].to_numpy()[1:], pull, rtol=1e-6)
    header = (tmp_path / "history.csv").read_text().splitlines()[0]
    assert "friction_force [kN/m]" in header and "friction_pull [kN]" in header


def test_a_force_on_the_strand_strains_all_its_parts_alike() -> None:
    force = ("casting.length=30 mm", 'mechanics.planes.force="1 kN"')
    quarter, half = (
        run_in_memory(billet("coupled", *force, f"section.symmetry={s}")).samples[-1].mechanics
        for s in ("quarter", "half")
    )
    assert quarter is not None and half is not None
    assert quarter.strain > 1e-3
    assert half.strain == pytest.approx(quarter.strain, rel=1e-5)


def test_what_planes_that_are_held_bear(tmp_path: Path) -> None:
    held = 'mechanics.planes.a0="0"'
    summary = run(shipped("taper_1", *RUBBING, held), tmp_path)
    terms = {name: q.value for name, q in summary.balances["axial force"].items()}
    assert abs(terms["reaction"]) > terms["friction"] > 1.0
    assert terms["reaction"] == pytest.approx(terms["force"] - terms["friction"], rel=1e-12)
