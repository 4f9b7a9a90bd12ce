"""[secondary]: what is wrong with it is told in one line, with key and mend."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from rolled_case import SECONDARY, circuit, rolled, secondary

from castfem.base.errors import InputError
from castfem.model import Case
from castfem.model.load import from_document, read_case
from castfem.model.plausibility import warnings
from castfem.model.secondary import Circuit

CASES = Path(__file__).parents[2] / "cases"
FLAT = SECONDARY["nozzle"][0]


def problem(**changes: Any) -> str:
    with pytest.raises(InputError) as found:
        rolled(**changes)
    assert len(found.value.problems) == 1, found.value.problems
    return str(found.value.problems[0])


def of(**changes: Any) -> str:
    return problem(secondary=secondary(**changes))


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"contact": {"angle": "10 deg"}}, "contact: share or coefficient is missing"),
        ({"contact": {"angle": "10 deg", "share": 0.1, "coefficient": "9 W/(m^2 K)"}}, "exclude"),
        ({"contact": {"angle": "10 deg", "coefficient": "9 W/(m^2 K)"}}, "of the rolls is"),
        ({"contact": {"angle": "171 deg", "share": 0.1}, "circuit": []}, ""),
        ({"run_off": None, "falls_off": "60 deg"}, "falls_off: has no effect without run_off"),
        ({"nozzle": [FLAT | {"correlation": "boole"}]}, "bolle"),
        ({"nozzle": [{k: v for k, v in FLAT.items() if k != "correlation"}]}, "one of table"),
        ({"nozzle": [FLAT, FLAT]}, '("flat") is used twice'),
        ({"circuit": [circuit(across=[])]}, "(circuit \"all\"): must not be empty"),
        ({"circuit": [circuit(across=["0 mm", "0 mm"])]}, "two nozzles stand at 0 mm"),
        ({"circuit": [circuit(across=["20 mm"])]}, "not mirrored at the middle"),
        ({"circuit": [circuit(on=["wide_face", "narrow_face"])]}, "wide and narrow faces in one"),
        ({"circuit": [circuit(rolls=[1, 6])]}, "numbers from 1 to 5"),
        ({"circuit": [circuit(stand_off="50 mm")]}, "between the rolls, below their axes"),
        ({"circuit": [circuit(flow="-3 L/min")]}, "must not be below 0"),
    ],
)  # fmt: skip
def test_a_table_that_cannot_be(changes: dict[str, Any], text: str) -> None:
    if not text:  # rolls 120 mm thick, 200 mm apart: their contacts just do not meet
        rolled(secondary=secondary(**changes))
        return
    told = of(**changes)
    assert "secondary" in told and text in told


def test_contacts_that_overlap() -> None:
    # A contact of 171 degrees is 179 mm long, of a roll of 150 mm 224 mm: longer than the pitch.
    segment = [{"rolls": 5, "pitch": "200 mm", "diameter": "150 mm"}]
    # Sprays in the gap of less than nothing that is left are not told besides.
    told = problem(
        secondary=secondary(
            contact={"angle": "171 deg", "share": 0.1}, circuit=[circuit(rolls=[1, 5])]
        ),
        machine={"first": "300 mm", "segment": segment},
    )
    assert "contact with rolls 1 and 2 overlap" in told


@pytest.mark.parametrize(
    ("segment", "roll"),
    [
        ([("600 mm", "150 mm"), ("120 mm", "150 mm")], "roll 2"),
        ([("600 mm", "150 mm"), ("200 mm", "150 mm"), ("200 mm", "260 mm")], "roll 3"),
    ],
)
def test_rolls_that_overlap_are_told_alone(segment: list[tuple[str, str]], roll: str) -> None:
    # Neither as contacts that overlap nor as sprays in a gap of less than nothing.
    parts = [{"rolls": 1, "pitch": pitch, "diameter": size} for pitch, size in segment]
    machine = {"first": "600 mm", "segment": parts}
    told = problem(machine=machine, secondary=secondary(circuit=[circuit(rolls=[1, len(parts)])]))
    assert roll in told and "overlaps" in told


def test_what_it_needs_besides() -> None:
    data = rolled().document()
    del data["machine"]
    with pytest.raises(InputError, match="there are none; add"):
        from_document(data)
    data = rolled().document()
    del data["cooling"][0]["to"]
    with pytest.raises(InputError, match="'to' is missing; it is where"):
        from_document(data)


def test_what_was_probably_not_meant() -> None:
    wide = rolled(secondary=secondary(circuit=[circuit(flow="2000 L/min")]))
    assert [p for p in warnings(wide) if "reach the surface" in p.text] == []  # nozaki: any flow
    bolle = [FLAT | {"correlation": "bolle"}]
    for flow, text in (("2000 L/min", "known to 7: beyond"), ("1 L/min", "measured from 1 on")):
        case = rolled(secondary=secondary(nozzle=bolle, circuit=[circuit(flow=flow)]))
        assert any(text in p.text for p in warnings(case))
    lost = [p.text for p in warnings(rolled())]
    assert any(
        "53.8 % of the water misses the face: sprays of 346.4 mm on 160 mm" in t for t in lost
    )
    spare = rolled(secondary=secondary(nozzle=[FLAT, FLAT | {"name": "spare"}]))
    assert any("belongs to no circuit" in p.text for p in warnings(spare))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("temperature [degC], water [L/(m^2 s)]\n1, 2\n", "a header and rows are needed"),
        ("800, 1, 0\n800, 5, 9\n900, 1, 0\n900, 5, 9\n", "must begin at 0"),
        (
            "800, 0, 0\n800, 0, 9\n900, 0, 0\n",
            "line 3: this temperature and flow stand there twice",
        ),
        ("800, 0, x\n800, 5, 9\n900, 0, 0\n", "line 2: value (x)"),
    ],
)
def test_a_table_of_coefficients_that_cannot_be_read(tmp_path: Path, text: str, told: str) -> None:
    header = "temperature [degC], water [L/(m^2 s)], value [W/(m^2 K)]\n"
    (tmp_path / "h.csv").write_text(text if text.startswith("temp") else header + text)
    model = {k: v for k, v in FLAT.items() if k != "correlation"}
    found = of(nozzle=[model | {"table": {"file": str(tmp_path / "h.csv")}}])
    assert told in found and "h.csv" in found


def test_it_is_written_as_it_was_read() -> None:
    case = read_case(CASES / "slab1200" / "sprays.toml")
    assert case.problems == () and case.warnings == ()
    assert isinstance(case.case, Case)
    again = from_document(case.case.document())
    assert again == case.case and again.physics_hash() == case.case.physics_hash()


def test_nozzles_share_the_flow_of_the_whole_strand() -> None:
    base = circuit(rolls=[2, 5], across=["-10 mm", "10 mm"])
    for on, faces in ((["wide_face"], 2), (["wide_face_intrados"], 1), (["narrow_face"], 2)):
        assert Circuit.model_validate(base | {"on": on}).nozzles() == faces * 3 * 2


@pytest.mark.parametrize("name", ["wide", "wide_face", "wide_face_intrados"])
def test_a_name_stands_for_the_faces_that_begin_with_it(name: str) -> None:
    """Nozzles far from the middle stand on a wide face, not outside of a narrow one."""
    wide = circuit(on=[name], across=["-70 mm", "70 mm"])
    assert Circuit.model_validate(wide).wide
    assert rolled(secondary=secondary(circuit=[wide])) is not None
    assert not Circuit.model_validate(circuit(on=["narrow"])).wide
