"""The coarse slab on rolls with its pressure, and a run of it that is stopped and resumed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pandas as pd
import pytest
from interrupted import history_of, stopped
from runs.billet_runs import Kept, run_in_memory

from castfem.base.types import Array
from castfem.fem import reductions
from castfem.model import Case, load_case
from castfem.model.build import mechanics
from castfem.model.load import from_document
from castfem.physics.contact.roll_support import Bed, Memory, RollSupport
from castfem.physics.mechanics.slice_definition import Ferrostatic, Slice
from castfem.runs import loop
from castfem.runs.output.history import read_history
from castfem.runs.results.sample import Sample

pytestmark = pytest.mark.slow

CASE = Path(__file__).parents[2] / "cases" / "slab1200" / "bending.toml"
FACES = ("wide_face_intrados", "wide_face_extrados")
GIVEN = 5e-5  # m: displacement of the rolls under the pressure
BULGE = 2e-4  # m: bulge that the foundation approaches step by step


@dataclass(frozen=True)
class Softening:
    """Foundation with the pressure of a liquid core, and a bulge that grows from step to step."""

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
    """Return the slab from the exit of the mould on, where the rolls begin, too."""
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
    document["mechanics"]["ferrostatic"] = "full"  # fed liquid takes no part of it
    document["casting"]["start"] = {"at": "mould_exit"}
    return from_document(document)


def history(folder: Path) -> pd.DataFrame:
    return read_history(folder / "history.csv")


def test_slab_on_rolls(case: Case, tmp_path: Path) -> None:
    """Held by its rolls, with bulge and pressure; resumed to the bit."""
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    unbroken = history_of(case, whole)
    stopped(case, parts, 3)
    assert len(history(parts)) < len(history(whole)) - 1
    loop.run(case, parts, comm=MPI.COMM_SELF, resume=True)
    assert (parts / "history.csv").read_bytes() == unbroken
    found = history(whole)
    positions = found["position"].to_numpy()
    assert np.abs(positions - 0.93).min() < 1e-6  # where the rolls request it
    moved = [found[f"displacement_mid_face_{face}"].to_numpy() for face in ("intrados", "extrados")]
    assert moved[0] == pytest.approx(moved[1], rel=1e-6)
    rest = 1e3 * BULGE * (1.0 - 0.5 ** np.arange(len(moved[0])))
    # Far from the edges the shell transmits all the pressure: it is at the position of the rolls.
    assert moved[0] == pytest.approx(rest, abs=1e-5)  # mm


# The shipped slab in bender and straightener: results that hold for any data of the steel


COARSE = (
    "coupling.interval=1 m",
    "thermal.time.adaptive.tolerance=12 K",
    "mesh.core_size=30 mm",
    "mesh.face_size=100 mm",
    "output.fields=[]",
    "output.figures=false",
)
BENDER, STRAIGHTENER = (2.3225, 4.110086), (14.272438, 16.832438)  # m: rolls 8 to 15, 49 to 57
HALF = 0.11  # m: half of the thickness
STRAIGHT = {"position": ["0.87 m", "30 m"], "diameter": ["130 mm", "130 mm"]}


@dataclass
class Slab:
    """The slab through its machine, and a straight one as far as the end of the bender."""

    bent: Kept
    straight: Kept


@pytest.fixture(scope="module")
def slab() -> Slab:
    case = load_case(CASE, COARSE)
    document = case.document()
    document["machine"] = {"rolls": STRAIGHT}
    del document["mechanics"]["planes"]["force_contains_bending"]
    document["casting"]["length"] = f"{BENDER[1]} m"
    return Slab(run_in_memory(case), run_in_memory(from_document(document)))


def within(kept: Kept, ends: tuple[float, float]) -> list[Sample]:
    """Return the samples behind the first of two positions (m), up to the second."""
    slack = 1e-6
    return [s for s in kept.samples if ends[0] + slack < s.position < ends[1] + slack]


def largest(samples: Sequence[Sample], probe: str) -> float:
    return max(s.strained.axial_stress[probe] for s in samples)


def test_stretched_corners_are_in_tension(slab: Slab) -> None:
    """Extrados in bending, intrados in straightening, where it is more (thesis VI.3.3)."""
    bending, straightening = (within(slab.bent, e) for e in (BENDER, STRAIGHTENER))
    outside, inside = largest(bending, "corner_extrados"), largest(straightening, "corner_intrados")
    assert outside > 0.0
    assert inside > outside
    assert bending[-1].strained.axial_stress["corner_intrados"] < 0.0
    assert straightening[-1].strained.axial_stress["corner_extrados"] < 0.0
    moments = [[s.bending.moment for s in samples] for samples in (bending, straightening)]
    assert max(moments[0]) < 0.0 < moments[1][-1]
    assert 0.0 < -bending[-1].bending.work < -straightening[-1].bending.work


def test_neutral_axis_is_between_centre_and_intrados(slab: Slab) -> None:
    """The effect of bending alone; contraction by cooling moves the axis outwards."""
    places = np.linspace(*BENDER, 3)  # at the end of a window each, but for 0.1 m
    strains, curvatures = [], []
    for kept in (slab.bent, slab.straight):
        at = [s.position for s in kept.samples]
        strains.append(np.interp(places, at, [s.strained.strain for s in kept.samples]))
        curvatures.append(np.interp(places, at, [s.bending.curvature for s in kept.samples]))
    assert not curvatures[1].any()
    turned = np.diff(curvatures[0])
    by_bending = np.diff(strains[0] - strains[1]) / turned
    total = np.diff(strains[0]) / turned
    assert np.all((by_bending > 0.0) & (by_bending < HALF)), by_bending
    assert np.all(total < by_bending)


def test_slab_comes_out_straight(slab: Slab) -> None:
    """On the arc it has the radius of the rolls, and no curvature at the end."""
    arc = [s.bending.curvature for s in within(slab.bent, (BENDER[1], STRAIGHTENER[0]))]
    assert arc == pytest.approx([1.0 / (8.006 - HALF)] * len(arc), rel=1e-9)
    last = slab.bent.samples[-1].strained
    assert last.bending.curvature == 0.0
    assert last.balance.axial[0] == pytest.approx(50e3, rel=1e-6)  # half of 100 kN
