"""Numbers to compare with: names and units are those of results, or the case is not sound."""

from __future__ import annotations

import pytest
from runs.billet_runs import FED, billet, run_in_memory

from castfem.base.errors import InputError
from castfem.base.result_registry import unit_of
from castfem.base.shown_quantity import si_unit
from castfem.model import load_case

REFERENCE = '\n[[reference]]\nquantity = "{}"\nvalue = "{}"\nsource = "a book"\n'


@pytest.mark.parametrize(
    ("quantity", "value", "told"),
    [
        ("shell_mid_face", "4 kg", r'reference\.0\.value: \("4 kg"\) does not measure.*"mm"'),
        ("shell_mid_face", "4", r"reference\.0\.value"),
        ("axial_strain", "1 mm", "a plain number"),
        ("shel_mid_face", "4 mm", r"reference\.0\.quantity.*did you mean shell_mid_face"),
        ("shell", "4 mm", r"reference\.0\.quantity"),
        ("gap_mid_faces", "4 mm", r"reference\.0\.quantity.*did you mean gap_mid_face\?"),
    ],
)
def test_what_no_run_could_be_compared_with(write, sound, quantity, value, told):
    with pytest.raises(InputError, match=told):
        load_case(write(sound + REFERENCE.format(quantity, value)))


def test_other_units_and_images_of_symmetry(write, sound):
    for quantity, value in (
        ("shell_mid_face", "0.2 inch"),
        ("surface_temperature_corner_intrados", "900 degC"),
        ("contact_share", "80 percent"),
        ("axial_strain", "-0.002"),
    ):
        load_case(write(sound + REFERENCE.format(quantity, value)))


def test_the_list_has_the_results_of_a_run():
    friction = 'mould.friction={law="coulomb", coefficient=0.3}'
    half = "section.symmetry=half"
    case = billet("taper_1", *FED, "casting.length=20 mm", friction, half)
    summary = run_in_memory(case).summary
    assert summary is not None
    for name, quantity in summary.quantities.items():
        unit = unit_of(name)
        assert unit is not None, name
        assert si_unit(unit) == si_unit(quantity.shown_unit), name
    assert len(summary.quantities) > 40
