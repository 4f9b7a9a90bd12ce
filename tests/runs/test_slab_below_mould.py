"""A slab that goes with its stresses from its own mould to the rolls between which it bulges."""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from billet_runs import Kept, run_in_memory
from interrupted import history_of
from small_case import small
from test_bulging_slab import SLAB, rolls_of

from castfem.base.errors import InputError
from castfem.model import Case
from castfem.model.build.simulation import build
from castfem.physics.contact.roll_support import RollSupport
from castfem.physics.contact.state import ContactState
from castfem.runs.results.sample import Sample

END, ROLLS = 0.3, (0.38, 0.5, 0.66)
TAPER = 0.02  # 1/m


def slab(**changes: object) -> Case:
    """400 x 100 mm cast through a mould of 300 mm, then over three pairs of rolls."""
    given = {
        "casting": {"speed": "0.6 m/min", "length": "0.51 m", "superheat": "20 K"},
        "mould": {"length": f"{END} m", "taper": {"wide_face": f"{100 * TAPER} %/m"}},
        "machine.rolls.position": [f"{place} m" for place in ROLLS],
        "coupling": {"interval": "60 mm", "passes": 1},
        "mechanics": {"law": "kozlowski_zhu_signed", "liquid": "fed", "bulging": "elastic"},
    } | {key.replace("__", "."): value for key, value in changes.items()}
    table = deepcopy(SLAB) | given
    table["cooling"][0]["to"] = f"{END} m"  # type: ignore[index]
    table["cooling"][0]["surface"][0]["gap_conductivity"] = "0.15 W/(m K)"  # type: ignore[index]
    return small(table)


@pytest.fixture(scope="module")
def own() -> Kept:
    return run_in_memory(slab())


def below(kept: Kept, position: float) -> Sample:
    """The first sample below a position."""
    return next(s for s in kept.samples if s.position > position + 1e-6)


def wall_of(sample: Sample) -> ContactState:
    mechanical = sample.state.mechanical
    assert mechanical is not None
    return next(one for one in mechanical.interactions if isinstance(one, ContactState))


def test_the_mould_holds_the_faces_and_then_the_rolls(own: Kept) -> None:
    within = [s for s in own.samples if 0.0 < s.position <= END]
    assert within[-1].position == pytest.approx(END)
    for sample in within:
        assert all(bed.stiffness == 0.0 for bed in rolls_of(sample).beds.values())
        assert (wall_of(sample).pressure > 0.0).any()
    for sample in own.samples[len(within) + 1 :]:
        assert not (wall_of(sample).pressure > 0.0).any()
        assert all(bed.stiffness > 0.0 for bed in rolls_of(sample).beds.values())


def test_the_first_roll_stands_where_the_mould_leaves_the_face(own: Kept) -> None:
    """Half of what the taper takes of 100 mm, and what the apertures lose below."""
    left = 0.05 / (1.0 + TAPER * END) - 0.05
    for position in (END, *ROLLS[:2]):
        sample = below(own, position)
        bed = rolls_of(sample).beds["wide_face_intrados"]
        lost = np.interp(sample.position, ROLLS, [0.0, -0.1e-3, -0.15e-3])
        assert bed.offset == pytest.approx(left + lost, abs=1e-9)
        moved = sample.strained.moved["mid_face"]
        # The face is held by its edges, too, the nearer the narrower it is.
        assert moved == pytest.approx(bed.rest, abs=20e-6)


def test_the_end_of_the_mould_bears_the_first_span_and_is_no_roll(own: Kept) -> None:
    first, second = (rolls_of(below(own, place)).memory for place in (END, ROLLS[0]))
    assert first["z"][:, -1] == pytest.approx(np.full(2, ROLLS[0] - END))
    assert second["z"][:, -1] == pytest.approx(np.full(2, ROLLS[1] - ROLLS[0]))
    assert first["load"].min() > 0.0 and not first["force"].any()
    assert second["force"] == pytest.approx(0.5 * (first["load"] + second["load"]))


def test_a_first_roll_at_the_end_of_the_mould_has_no_span_above_it() -> None:
    places = [f"{place} m" for place in (END, *ROLLS[1:])]
    kept = run_in_memory(slab(machine__rolls__position=places, casting__length="0.32 m"))
    memory = rolls_of(kept.samples[-1]).memory
    assert memory["z"][:, -1] == pytest.approx(np.full(2, ROLLS[1] - END))
    assert memory["force"] == pytest.approx(0.5 * memory["load"])


def test_whether_rolls_pull_is_as_the_case_says() -> None:
    """By default they do not below a mould that is there, whose corners come off their line."""
    begun = {"at": "mould_exit"}
    for changes, pulls in (
        ({}, False),
        ({"mechanics__bulging": {"model": "elastic", "pull": True}}, True),
        ({"mould": None, "casting__start": begun}, True),
        ({"mould": None, "casting__start": begun,
          "mechanics__bulging": {"model": "elastic", "pull": False}}, False),
    ):  # fmt: skip
        simulation = build(slab(**changes), MPI.COMM_SELF)
        try:
            assert simulation.mechanics is not None
            given = simulation.mechanics.problem.slice.interactions
            (rolls,) = (one for one in given if isinstance(one, RollSupport))
            assert rolls.pull == pulls
        finally:
            simulation.destroy()


def test_it_resumes_byte_for_byte(tmp_path: Path) -> None:
    """Stopped between the mould and the first roll: what spans that is not computed again."""
    case = slab(casting__length="0.39 m")
    assert history_of(case, tmp_path / "a") == history_of(case, tmp_path / "b", 6)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"machine__rolls__position": ["0.29 m", "0.5 m", "0.66 m"]},
         r"position \(0\.29 m\) lies within the mould, which ends at 0\.3 m"),
        ({"casting__start": {"at": "mould_exit"}},
         r"casting\.start\.at: .* begins below the mould"),
        ({"mechanics__bulging": {"model": "none", "pull": True}},
         r'bulging\.pull: has no effect with model = "none"'),
    ],
)  # fmt: skip
def test_what_does_not_go_together_is_told(changes: dict[str, object], text: str) -> None:
    with pytest.raises(InputError, match=text) as told:
        slab(**changes)
    assert len(str(told.value).splitlines()) == 1
