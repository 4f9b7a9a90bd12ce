"""Impossible and doubtful defects of a machine, and their error messages."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from castfem.base.errors import InputError
from castfem.model import Case, load_case
from castfem.model.checks.unusual import warnings

FOLDER = Path(__file__).parents[2] / "cases" / "slab1200"
REFERENCE = load_case(FOLDER / "reference.toml").with_({"reference": []})


def slab(*defects: dict[str, Any]) -> Case:
    return REFERENCE.with_({"machine.defect": list(defects)})


@pytest.mark.parametrize(
    ("defect", "key", "words"),
    [
        ({"kind": "locked", "roll": 95}, "defect.0.roll", "has 87 pairs, numbered from 1"),
        ({"kind": "bent", "roll": 9}, "defect.0", "one of locked, misaligned, lost, nozzles"),
        ({"kind": "misaligned", "roll": 9}, "defect.0.by", "missing"),
        (
            {"kind": "nozzles", "circuit": "arc", "rolls": [47, 52], "share": 0.66},
            "defect.0.circuit",
            "the case has no [secondary]",
        ),
    ],
)
def test_impossible_defects_are_rejected(defect: dict[str, Any], key: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        slab(defect)
    (problem,) = caught.value.problems
    assert key in problem and words in problem


def test_unknown_and_missing_keys_are_reported_together() -> None:
    with pytest.raises(InputError) as caught:
        slab({"kind": "misaligned", "rolls": 48, "offset": "2 mm"})
    messages = [problem.partition("machine.defect.0.")[2] for problem in caught.value.problems]
    assert messages == [
        "roll: is missing; number of the pair, counted from 1",
        "by: is missing; distance towards the centre of curvature; negative: away from it, such as "
        '"2 mm"',
        "rolls: unknown key (48); allowed: roll, kind, by, resistance; did you mean roll?",
        'offset: unknown key ("2 mm"); allowed: roll, kind, by, resistance',
    ]


def test_defects_are_named_as_cause_of_overlapping_rolls() -> None:
    offsets = ("25 mm", "26 mm", "24 mm")
    with pytest.raises(InputError) as caught:
        slab(*({"kind": "misaligned", "roll": 20, "by": by} for by in offsets))
    (problem,) = caught.value.problems
    assert "machine.defect: with roll 20 off by 25 mm and roll 20 off by 26 mm and" in problem
    assert "sharply: roll 19: diameter (225 mm) overlaps" in problem
    assert problem.endswith("below it; move it less")


def test_warnings_caused_by_a_defect_name_it() -> None:
    found = warnings(slab({"kind": "misaligned", "roll": 20, "by": "-26 mm"}))
    (first, *_) = (one for one in found if one.path[0] == "machine")
    assert first.path == ("machine", "defect") and "strains the faces" in first.text
    assert first.text.startswith("with roll 20 off by -26 mm: ")
    found = warnings(slab({"kind": "misaligned", "roll": 20, "by": "2 mm"}))
    assert not [one for one in found if one.path[0] == "machine"]


def test_defect_without_effect_is_rejected() -> None:
    """It would change the resistance of the rolls, but the case has none, or no curve."""
    plain, locked = load_case(FOLDER / "coarse.toml"), {"kind": "locked", "roll": 48}
    coupled = load_case(FOLDER / "reference.toml").with_(
        {"machine.extraction.resistance": "coupled"}
    )
    with pytest.raises(InputError, match=r"defect\.0\.kind.* without \[machine\.extraction\]"):
        plain.with_({"machine.defect": [locked]})
    coupled.with_({"machine.defect": [locked]})
    off = {"kind": "misaligned", "roll": 48, "by": "2 mm"}
    for case in (plain, coupled):
        case.with_({"machine.defect": [off]})
        with pytest.raises(InputError, match=r"defect\.0\.resistance.* without a maker's curve"):
            case.with_({"machine.defect": [off | {"resistance": "118 kN"}]})


@pytest.mark.parametrize("lost_first", [True, False])
def test_lost_pair_has_no_other_defect(lost_first: bool) -> None:
    lost = {"kind": "lost", "roll": 30}
    misaligned = {"kind": "misaligned", "roll": 30, "by": "2 mm"}
    for second in (misaligned, {"kind": "locked", "roll": 30}):
        both, at = ((lost, second), 1) if lost_first else ((second, lost), 0)
        with pytest.raises(InputError, match=rf"defect\.{at}\.roll: \(30\): this pair is also"):
            slab(*both)
        slab(lost, second | {"roll": 31})


def test_repeated_defects_and_loss_of_all_rolls_are_rejected() -> None:
    locked = {"kind": "locked", "roll": 48}
    with pytest.raises(InputError, match=r"machine\.defect\.1: appears twice"):
        slab(locked, locked)
    with pytest.raises(InputError, match="fewer than two pairs"):
        slab(*({"kind": "lost", "roll": n} for n in range(1, 87)))


@pytest.mark.parametrize("by", ["2 m", "34 mm"])
def test_too_large_offset_is_rejected(by: str) -> None:
    """2 m is a slip for 2 mm; the pitch of #48 is 335 mm."""
    with pytest.raises(InputError, match=r"defect\.0\.by: .* by more than 0\.1 of the 33\d mm to"):
        slab({"kind": "misaligned", "roll": 48, "by": by})
    slab({"kind": "misaligned", "roll": 48, "by": "-10 mm"})


def test_defects_at_the_ends_of_the_machine_are_rejected() -> None:
    """A misaligned pair needs one on each side; the mould must support the faces to the first."""
    for number, side, lost in ((1, "above", ()), (87, "below", ()), (2, "above", (1,))):
        missing = [{"kind": "lost", "roll": n} for n in lost]
        for by in ("2 mm", "-2 mm"):
            off = {"kind": "misaligned", "roll": number, "by": by}
            with pytest.raises(InputError, match=rf"roll: \({number}\): no pair {side} it"):
                slab(*missing, off)
    slab({"kind": "misaligned", "roll": 2, "by": "2 mm"})
    first = {"kind": "lost", "roll": 1}
    REFERENCE.with_({"mechanics.bulging": "none"}).with_({"machine.defect": [first]})
    bulging = load_case(FOLDER / "bulging.toml")
    with pytest.raises(InputError, match=r"defect\.0\.roll: \(1\).*the mould holds the faces"):
        bulging.with_({"machine.defect": [first]})
    bulging.with_({"machine.defect": [{"kind": "lost", "roll": 2}]})
