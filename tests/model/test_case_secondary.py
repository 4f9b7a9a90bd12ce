"""[secondary], mould and zones of one case: their ends, one line for each mistake."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from rolled_case import SECONDARY, circuit, rolled, secondary

from castfem.base.errors import InputError
from castfem.model import Case, load_case
from castfem.model.checks.unusual import warnings
from castfem.model.load import from_document, read_case
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
def test_invalid_table_is_refused(changes: dict[str, Any], text: str) -> None:
    if not text:  # rolls 120 mm thick, 200 mm apart: their contacts just do not touch
        rolled(secondary=secondary(**changes))
        return
    message = of(**changes)
    assert "secondary" in message and text in message


def test_overlapping_contacts_are_refused() -> None:
    # A contact of 171 degrees is 179 mm long, with a roll of 150 mm 224 mm: longer than the pitch.
    segment = [{"rolls": 5, "pitch": "200 mm", "diameter": "150 mm"}]
    # Sprays in the remaining negative gap are not reported in addition.
    message = problem(
        secondary=secondary(
            contact={"angle": "171 deg", "share": 0.1}, circuit=[circuit(rolls=[1, 5])]
        ),
        machine={"first": "300 mm", "segment": segment},
    )
    assert "contact with rolls 1 and 2 overlap" in message


@pytest.mark.parametrize(
    ("segment", "roll"),
    [
        ([("600 mm", "150 mm"), ("120 mm", "150 mm")], "roll 2"),
        ([("600 mm", "150 mm"), ("200 mm", "150 mm"), ("200 mm", "260 mm")], "roll 3"),
    ],
)
def test_overlapping_rolls_are_reported_only_once(
    segment: list[tuple[str, str]], roll: str
) -> None:
    # Neither as overlapping contacts nor as sprays in a negative gap.
    parts = [{"rolls": 1, "pitch": pitch, "diameter": size} for pitch, size in segment]
    machine = {"first": "600 mm", "segment": parts}
    message = problem(
        machine=machine, secondary=secondary(circuit=[circuit(rolls=[1, len(parts)])])
    )
    assert roll in message and "overlaps" in message


def test_secondary_cooling_needs_rolls_and_an_end() -> None:
    data = rolled().document()
    del data["machine"]
    with pytest.raises(InputError, match="there are none; add"):
        from_document(data)
    data = rolled().document()
    del data["cooling"][0]["to"]
    with pytest.raises(InputError, match="'to' is missing; it is where") as caught:
        from_document(data)
    assert "what [secondary] cools needs no zone" in str(caught.value)


def test_unlikely_values_give_a_warning() -> None:
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
    ("text", "message"),
    [
        ("temperature [degC], water [L/(m^2 s)]\n1, 2\n", "a header and rows are needed"),
        ("800, 1, 0\n800, 5, 9\n900, 1, 0\n900, 5, 9\n", "must begin at 0"),
        ("800, 0, 0\n800, 0, 9\n900, 0, 0\n", "line 3: this temperature and flow appear twice"),
        ("800, 0, x\n800, 5, 9\n900, 0, 0\n", "line 2: value (x)"),
    ],
)
def test_unreadable_table_of_coefficients_is_refused(
    tmp_path: Path, text: str, message: str
) -> None:
    header = "temperature [degC], water [L/(m^2 s)], value [W/(m^2 K)]\n"
    (tmp_path / "h.csv").write_text(text if text.startswith("temp") else header + text)
    model = {k: v for k, v in FLAT.items() if k != "correlation"}
    found = of(nozzle=[model | {"table": {"file": str(tmp_path / "h.csv")}}])
    assert message in found and "h.csv" in found


def test_case_is_written_as_it_was_read() -> None:
    case = read_case(CASES / "slab1200" / "sprays.toml")
    assert case.problems == () and case.warnings == ()
    assert isinstance(case.case, Case)
    again = from_document(case.case.document())
    assert again == case.case and again.physics_hash() == case.case.physics_hash()


def test_nozzles_share_the_flow_of_the_strand() -> None:
    base = circuit(rolls=[2, 5], across=["-10 mm", "10 mm"])
    for on, faces in ((["wide_face"], 2), (["wide_face_intrados"], 1), (["narrow_face"], 2)):
        assert Circuit.model_validate(base | {"on": on}).nozzles() == faces * 3 * 2


@pytest.mark.parametrize("name", ["wide", "wide_face", "wide_face_intrados"])
def test_name_represents_the_faces_that_begin_with_it(name: str) -> None:
    """Nozzles far from the middle are on a wide face, not outside a narrow one."""
    wide = circuit(on=[name], across=["-70 mm", "70 mm"])
    assert Circuit.model_validate(wide).wide
    assert rolled(secondary=secondary(circuit=[wide])) is not None
    assert not Circuit.model_validate(circuit(on=["narrow"])).wide


CONTACT = 'wall = "160 degC"\n'
FOLLOWS = CONTACT + 'gap_conductivity = "0.15 W/(m K)"\n'
MOULD = '\n[mechanics]\nlaw = "norton_hoff_kozlowski"\n\n[mould]\nlength = "600 mm"\n'
END, LENGTH = "cooling.mould.to", "casting.length"
AIR = "cooling.air.surface"


@pytest.fixture
def moulded(write, sound):
    """Return a function that writes a case with a mould of 600 mm and a zone of contact as long."""

    def _moulded(text: str = FOLLOWS):
        curved = sound.replace("[mesh]\n", "[mesh]\norder = 2\n")
        return write(curved.replace(CONTACT, text) + MOULD)

    return _moulded


@pytest.mark.parametrize(
    "changes",
    [
        (),
        (f"{END}=50 mm", "mould.length=50 mm"),
        (f"{END}=700 mm",),  # followed to 600 mm
        ("mould.length=700 mm",),
        (f"{END}=700 mm", "mould.length=700 mm", f"{LENGTH}=2 m"),
        (f"{END}=700 mm", f"{LENGTH}=700 mm", "cooling.mould.surface.0.gap=0.1 mm"),
        # Below the contact the flux to the mould is prescribed.
        ("mould.length=700 mm", f"{LENGTH}=2 m", f'{AIR}=[{{law="flux", value="1 MW/m^2"}}]'),
    ],
)
def test_zone_that_ends_with_the_mould_is_valid(moulded, changes):
    assert load_case(moulded(), changes).mould is not None


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            ("mould.length=50 mm", f"{LENGTH}=120 mm"),
            'cooling.0.to (zone "mould"): (600 mm) lies below the end of the mould (50 mm), where '
            'there is no wall to take the heat; give to = "50 mm"',
        ),
        (
            (f"{END}=601 mm", f"{LENGTH}=2 m"),
            'cooling.0.to (zone "mould"): (601 mm) lies below the end of the mould (600 mm)',
        ),
        (
            ('cooling=[{name="all", surface=[{law="contact", coefficient="1600 W/(m^2 K)", '
             'wall="160 degC", gap_conductivity="0.15 W/(m K)"}]}]', "mould.length=50 mm"),
            'cooling.0 (zone "all"): goes on below the end of the mould (50 mm)',
        ),
        (
            ("mould.length=700 mm", f"{LENGTH}=700 mm"),
            "mould.length: (700 mm) goes on below the contact of zone 'mould' (600 mm), where zone "
            "'air' cools the strand as if it were in the open; give mould.length = \"600 mm\"",
        ),
    ],
)  # fmt: skip
def test_contact_and_mould_with_different_ends_are_refused(moulded, changes, message):
    with pytest.raises(InputError) as caught:
        load_case(moulded(), changes)
    (problem,) = caught.value.problems
    assert message in problem


def test_positions_where_the_wall_changes(moulded):
    path = moulded()
    assert load_case(path).mould_knots() == (0.0, 0.6)
    stretches = "[{ to = '200 mm', taper = '2 %/m' }, { taper = '1 %/m' }]"
    table = '{ position = ["0 mm", "100 mm", "900 mm"], value = ["0 mm", "1 mm", "1 mm"] }'
    sides = f"mould.taper={{ narrow_face = {stretches}, wide_face = {table} }}"
    warm = 'mould.copper.temperature={ position = ["0 mm", "50 mm", "800 mm"], value = '
    warm += '["100 degC", "200 degC", "150 degC"] }'
    assert load_case(path, [sides, warm]).mould_knots() == (0.0, 0.1, 0.2, 0.6)
    cold = load_case(path, [sides, warm, "mould.condition=cold", "mould.corner_radius=4 mm"])
    assert cold.mould_knots() == (0.0, 0.05, 0.1, 0.2, 0.6)


def test_no_mould_has_no_changes(write):
    assert load_case(write()).mould_knots() == ()


def test_fields_of_contact_are_written_with_a_mould(moulded, write, sound):
    free = load_case(write(sound + MOULD.partition("[mould]")[0], "free.toml"))
    assert "stress" in free.output_fields
    both = ("gap", "contact_pressure")
    assert load_case(moulded()).output_fields == free.output_fields + both


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_first_order_cells_are_refused_with_a_mould(moulded, cell):
    with pytest.raises(InputError, match=r"mesh\.order: \(1\) makes .* give order = 2"):
        load_case(moulded(), ("mesh.order=1", f"mesh.cell={cell}"))


def test_first_order_cells_are_allowed_at_a_sharp_corner(moulded):
    case = load_case(moulded(), ("mesh.order=1", "section.corner_radius=0 mm"))
    assert case.mesh.order == 1
