"""The mould and the cooling zones of one case: where it ends, what it changes, what is written."""

from __future__ import annotations

import pytest

from castfem.base.errors import InputError
from castfem.model import load_case

CONTACT = 'wall = "160 degC"\n'
FOLLOWS = CONTACT + 'gap_conductivity = "0.15 W/(m K)"\n'
MOULD = '\n[mechanics]\nlaw = "norton_hoff_kozlowski"\n\n[mould]\nlength = "600 mm"\n'
END, LENGTH = "cooling.mould.to", "casting.length"
AIR = "cooling.air.surface"


@pytest.fixture
def moulded(write, sound):
    """Write a case with a mould of 600 mm and a zone of contact as long."""

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
        # Below the contact the flux to the mould is given.
        ("mould.length=700 mm", f"{LENGTH}=2 m", f'{AIR}=[{{law="flux", value="1 MW/m^2"}}]'),
    ],
)
def test_a_zone_that_ends_with_the_mould_is_sound(moulded, changes):
    assert load_case(moulded(), changes).mould is not None


@pytest.mark.parametrize(
    ("changes", "said"),
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
def test_contact_and_mould_that_do_not_end_together(moulded, changes, said):
    with pytest.raises(InputError) as caught:
        load_case(moulded(), changes)
    (problem,) = caught.value.problems
    assert said in problem


def test_where_the_wall_changes(moulded):
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


def test_no_mould_changes_nowhere(write):
    assert load_case(write()).mould_knots() == ()


def test_fields_of_contact_are_written_with_a_mould(moulded, write, sound):
    free = load_case(write(sound + MOULD.partition("[mould]")[0], "free.toml"))
    assert "stress" in free.output_fields
    both = ("gap", "contact_pressure")
    assert load_case(moulded()).output_fields == free.output_fields + both


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_cells_of_first_order_are_not_for_a_mould(moulded, cell):
    with pytest.raises(InputError, match=r"mesh\.order: \(1\) makes .* give order = 2"):
        load_case(moulded(), ("mesh.order=1", f"mesh.cell={cell}"))


def test_cells_of_first_order_do_for_a_sharp_corner(moulded):
    case = load_case(moulded(), ("mesh.order=1", "section.corner_radius=0 mm"))
    assert case.mesh.order == 1
