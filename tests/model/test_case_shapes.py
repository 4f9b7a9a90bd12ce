"""Another shape of section for a case that was written for a rectangle."""

from __future__ import annotations

from pathlib import Path

import pytest

from castfem.base.errors import InputError
from castfem.model import load_case, read_case

CASES = Path(__file__).parents[2] / "cases" / "billet125"
ROUND = 'section={shape="round",diameter="125 mm"}'


@pytest.fixture
def layers(tmp_path):
    """Write a file that extends the tapered billet; return its path."""

    def write(text: str, base: str = str(CASES / "taper_1.toml"), name: str = "case.toml") -> Path:
        path = tmp_path / name
        path.write_text(f'extends = "{base}"\n{text}')
        return path

    return write


def test_a_round_leaves_out_what_only_a_rectangle_knows():
    reading = read_case(CASES / "taper_1.toml", [ROUND])
    assert reading.problems == () and reading.case.mesh.corner_size is None
    (told,) = [line for line in reading.warnings if "left out" in line]
    assert told.startswith("--set: section.shape") and "mesh.corner_size (" in told
    assert "coupled.toml" in told
    by_keys = load_case(CASES / "taper_1.toml", ["section.shape=round", "section.diameter=125 mm"])
    assert by_keys.physics() == reading.case.physics()


def test_sizes_and_tapers_of_the_mould_go_too(layers):
    path = layers(
        '[mould]\ncorner_radius = "4 mm"\nwidth = "126 mm"\n'
        'taper = { face = "1 %/m", corner = "2 %/m", wide_face = "1.5 %/m" }\n'
    )
    assert load_case(path).mould.corner_radius == 0.004
    table = load_case(path, [ROUND]).mould
    assert (table.corner_radius, table.width) == (None, None)
    assert list(table.taper.parts) == ["face"]
    scripted = load_case(path).with_({"section": {"shape": "round", "diameter": "125 mm"}})
    assert scripted.mould == table and scripted.mesh.corner_size is None
    above = layers('[section]\nshape = "round"\ndiameter = "125 mm"\n', path.name, "above.toml")
    assert load_case(above).mould == table
    # What a rectangle of other sides does not know is nothing.
    section = 'section={shape="rectangle",width="124 mm",height="124 mm",corner_radius="5 mm"}'
    assert load_case(path, [section]).mould.corner_radius == 0.004


@pytest.mark.parametrize("key", ["mesh.corner_size=1 mm", "mould.width=130 mm"])
@pytest.mark.parametrize("first", [True, False])
def test_what_was_given_with_the_shape_was_meant(layers, key, first):
    changes = [key, ROUND] if first else [ROUND, key]
    with pytest.raises(InputError, match=key.partition("=")[0]):
        load_case(CASES / "taper_1.toml", changes)
    table, _, rest = key.partition(".")
    name, _, value = rest.partition("=")
    given = f'[section]\nshape="round"\ndiameter="125 mm"\n[{table}]\n{name}="{value}"\n'
    with pytest.raises(InputError, match=key.partition("=")[0]):
        load_case(layers(given))
    with pytest.raises(InputError, match=key.partition("=")[0]):
        load_case(CASES / "taper_1.toml", [ROUND]).with_({key.partition("=")[0]: value})
