"""The coarse slab on rolls with the pressure on, and a run of it that is stopped and goes on."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pandas as pd
import pytest
from interrupted import history_of, stopped

from castfem.base.types import Array
from castfem.fem import reductions
from castfem.model import Case, load_case
from castfem.model.build import mechanics
from castfem.model.load import from_document
from castfem.physics.contact.roll_support import Bed, Memory, RollSupport
from castfem.physics.mechanics.definition import Ferrostatic, Slice
from castfem.runs import loop
from castfem.runs.output.history import read_history

pytestmark = pytest.mark.slow

CASE = Path(__file__).parents[2] / "cases" / "slab1200" / "bending.toml"
FACES = ("wide_face_intrados", "wide_face_extrados")
GIVEN = 5e-5  # m: by which the rolls give way under the pressure
BULGE = 2e-4  # m: which the foundation comes to step by step


@dataclass(frozen=True)
class Softening:
    """Pressure of a liquid core, and a bulge that grows from step to step: it is remembered."""

    ferrostatic: Ferrostatic
    centre: Array

    def initial(self) -> Memory:
        return {"bulge": np.zeros(1)}

    def beds(
        self, memory: Memory, start: float, end: float, before: Array, temperature: Array
    ) -> tuple[dict[str, Bed], Memory]:
        hot = reductions.largest(MPI.COMM_SELF, temperature[self.centre])
        pressure = float(self.ferrostatic.pressure(np.array([hot]), end)[0])
        bulge = 0.5 * (memory["bulge"] + BULGE)
        bed = Bed(pressure, pressure / GIVEN, float(bulge[0]))
        return dict.fromkeys(FACES, bed), {"bulge": bulge}


@pytest.fixture
def case(monkeypatch: pytest.MonkeyPatch) -> Case:
    """From the exit of the mould on; rolls begin there, too."""
    make = mechanics.make_slice

    def on_rolls(*of: Any) -> Slice:
        made, (_, _, machine, _, section, _) = make(*of), of
        places = section.vertex_space.tabulate_dof_coordinates()[: section.owned, :2]
        assert made.ferrostatic is not None
        foundation = Softening(made.ferrostatic, np.hypot(*places.T) < 1e-9)
        rolls = RollSupport(FACES, foundation, machine.position, (0.8, 30.0), (0.93,))
        return replace(made, interactions=(rolls,))

    monkeypatch.setattr(mechanics, "make_slice", on_rolls)
    changes = ("output.fields=[]", "output.figures=false", "casting.length=1.2 m",
               "output.checkpoint_every=1")  # fmt: skip
    document = load_case(CASE, changes).document()
    del document["mechanics"]["held"]
    document["mechanics"]["ferrostatic"] = "full"  # fed liquid bears no part of it
    document["casting"]["start"] = {"at": "mould_exit"}
    return from_document(document)


def history(folder: Path) -> pd.DataFrame:
    return read_history(folder / "history.csv")


def test_a_slab_on_rolls(case: Case, tmp_path: Path) -> None:
    """Held by its rolls, through bulge and pressure; resumed to the bit."""
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    unbroken = history_of(case, whole)
    stopped(case, parts, 3)
    assert len(history(parts)) < len(history(whole)) - 1
    loop.run(case, parts, comm=MPI.COMM_SELF, resume=True)
    assert (parts / "history.csv").read_bytes() == unbroken
    found = history(whole)
    positions = found["position"].to_numpy()
    assert np.abs(positions - 0.93).min() < 1e-6  # where the rolls ask for it
    moved = [found[f"displacement_mid_face_{face}"].to_numpy() for face in ("intrados", "extrados")]
    assert moved[0] == pytest.approx(moved[1], rel=1e-6)
    rest = 1e3 * BULGE * (1.0 - 0.5 ** np.arange(len(moved[0])))
    # Far from the edges the shell hands on all the pressure: it is where the rolls have it.
    assert moved[0] == pytest.approx(rest, abs=1e-5)  # mm
