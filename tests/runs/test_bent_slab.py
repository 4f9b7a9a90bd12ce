"""The shipped slab in bender and straightener: what comes out whatever the data of the steel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from runs.billet_runs import Kept, run_in_memory

from castfem.model import load_case
from castfem.model.load import from_document
from castfem.runs.results.sample import Sample

CASE = Path(__file__).parents[2] / "cases" / "slab1200" / "bending.toml"
COARSE = (
    "coupling.interval=1 m",
    "thermal.time.adaptive.tolerance=12 K",
    "mesh.core_size=30 mm",
    "mesh.face_size=100 mm",
    "output.fields=[]",
    "output.figures=false",
)
BENDER, STRAIGHTENER = (2.3225, 4.110086), (14.272438, 16.832438)  # m: rolls 8 to 15, 49 to 57
HALF = 0.11  # m: of the thickness
STRAIGHT = {"position": ["0.87 m", "30 m"], "diameter": ["130 mm", "130 mm"]}

pytestmark = pytest.mark.slow


@dataclass
class Slab:
    """The slab through its machine, and one that goes straight down as far as the bender's end."""

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
    """Samples behind the first of two positions (m), up to the second."""
    slack = 1e-6
    return [s for s in kept.samples if ends[0] + slack < s.position < ends[1] + slack]


def largest(samples: Sequence[Sample], probe: str) -> float:
    return max(s.strained.axial_stress[probe] for s in samples)


def test_the_stretched_corners_are_pulled(slab: Slab) -> None:
    """Extrados in bending, intrados in straightening, and there more (thesis VI.3.3)."""
    bending, straightening = (within(slab.bent, e) for e in (BENDER, STRAIGHTENER))
    outside, inside = largest(bending, "corner_extrados"), largest(straightening, "corner_intrados")
    assert outside > 0.0
    assert inside > outside
    assert bending[-1].strained.axial_stress["corner_intrados"] < 0.0
    assert straightening[-1].strained.axial_stress["corner_extrados"] < 0.0
    moments = [[s.bending.moment for s in samples] for samples in (bending, straightening)]
    assert max(moments[0]) < 0.0 < moments[1][-1]
    assert 0.0 < -bending[-1].bending.work < -straightening[-1].bending.work


def test_bending_leaves_the_neutral_axis_between_centre_and_intrados(slab: Slab) -> None:
    """What bending alone does to the planes; contraction by cooling moves the axis outwards."""
    places = np.linspace(*BENDER, 3)  # at the end of a window each, but for 0.1 m
    strains, curvatures = [], []
    for kept in (slab.bent, slab.straight):
        at = [s.position for s in kept.samples]
        strains.append(np.interp(places, at, [s.strained.strain for s in kept.samples]))
        curvatures.append(np.interp(places, at, [s.bending.curvature for s in kept.samples]))
    assert not curvatures[1].any()
    turned = np.diff(curvatures[0])
    alone = np.diff(strains[0] - strains[1]) / turned
    whole = np.diff(strains[0]) / turned
    assert np.all((alone > 0.0) & (alone < HALF)), alone
    assert np.all(whole < alone)


def test_it_comes_out_straight(slab: Slab) -> None:
    """On the arc at the radius of the rolls, and no curvature at the end."""
    arc = [s.bending.curvature for s in within(slab.bent, (BENDER[1], STRAIGHTENER[0]))]
    assert arc == pytest.approx([1.0 / (8.006 - HALF)] * len(arc), rel=1e-9)
    last = slab.bent.samples[-1].strained
    assert last.bending.curvature == 0.0
    assert last.balance is not None
    assert last.balance.axial[0] == pytest.approx(50e3, rel=1e-6)  # half of 100 kN
