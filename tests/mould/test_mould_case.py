"""The table [mould]: its contents, writing and reading back, and invalid input.

A mould of the size of the strand touches the surface of its mesh everywhere. Equation
numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import math
import tomllib

import numpy as np
import pytest

from castfem.base.errors import InputError
from castfem.base.tables import Table
from castfem.meshes import build
from castfem.model import load_case
from castfem.model.mould import Mould
from castfem.model.mould_from_case import build_mould
from castfem.model.schema import case_schema, markdown_page
from castfem.model.section import BeamBlank, Rectangle, Round
from castfem.physics.mould import Displaced, Taper

ROUND = '[section]\nshape = "round"\ndiameter = "200 mm"\n[mesh]\nsurface_size = "1 mm"\n'
BEAM_BLANK = """
[section]
shape = "beam_blank"
width = "400 mm"
height = "300 mm"
web_thickness = "100 mm"
flange_thickness = "60 mm"
root_thickness = "90 mm"
fillet_radius = "20 mm"
shoulder_radius = "15 mm"
corner_radius = "10 mm"
"""
STRIP = '[section]\nshape = "strip"\nlength = "50 mm"\nwidth = "5 mm"\n'


def built(path):
    case = load_case(path)
    return build_mould(case.mould, case.section)


def tapers(path):
    """Return the taper in %/m over each zone, by dimension."""
    found = {}
    for zone in built(path).zones():
        found.setdefault(zone.dimension, []).append(100 * zone.taper)
    return found


VALID = {
    "nothing": "",
    "one line": 'taper = "1 %/m"',
    "percent": 'taper = "-3 percent/m"',
    "double": 'taper = [{ to = "225 mm", taper = "0 %/m" }, { taper = "0.57 %/m" }]',
    "parabola": 'taper = { top = "2 %/m", exit = "0.4 %/m" }',
    "mixed": 'taper = [{ to = "0.2 m", top = "2 %/m", exit = "1 %/m" }, { taper = "1 %/m" }]',
    "corner": 'taper = { face = "-0.53 %/m", corner = "0.4 %/m" }',
    "slab": 'taper = { narrow_face = "1 %/m", wide_face = "0 %/m" }',
    "step": 'taper = { position = ["0 mm", "300 mm", "301 mm"], value = [0, 0, 0.5], unit = "mm" }',
    "cold": 'condition = "cold"\nwall_temperature = "160 degC"\ncopper.expansion = "16e-6 1/K"',
    "temperatures": 'wall_temperature = { position = [0, 0.1, 0.6], position_unit = "m", '
    'value = [100, 220, 120], unit = "degC" }',
    "sizes": 'width = "125.2 mm"\nheight = "125.1 mm"\ncorner_radius = "4 mm"',
    "contact word": 'contact = "nitsche"',
    "contact table": 'contact = { method = "penalty", factor = 100 }',
    "friction": 'friction = { law = "coulomb", coefficient = 0.3 }',
}


@pytest.fixture(scope="module")
def validator():
    jsonschema = pytest.importorskip("jsonschema")
    return jsonschema.Draft202012Validator(case_schema())


@pytest.mark.parametrize("lines", VALID.values(), ids=VALID)
def test_valid_tables_are_unchanged_when_reread(lines, write, tmp_path, validator):
    path = write(lines)
    case = load_case(path)
    copy = tmp_path / "resolved.toml"
    copy.write_text(case.resolved_toml(), encoding="utf-8")
    assert load_case(copy) == case
    assert load_case(copy).physics_hash() == case.physics_hash()
    for text in (path, copy):
        validator.validate(tomllib.loads(text.read_text(encoding="utf-8")))


def test_without_a_table_the_mould_is_idealised(write):
    path = write()
    path.write_text(path.read_text().split("[mould]")[0])
    case = load_case(path)
    assert case.mould is None
    assert "mould" not in case.document()


def test_default_is_a_straight_mould_of_the_strand_size(write):
    mould = built(write())
    assert tapers(write()) == {"width": [0.0], "height": [0.0], "diagonal": [0.0]}
    assert mould.dimensions(0.3)["width"] == 0.125
    assert mould.wall_temperature is None


def test_tapers_satisfy_300(write):
    assert tapers(write(VALID["one line"]))["width"] == pytest.approx([1.0], rel=1e-12)
    double = tapers(write(VALID["double"]))["width"]
    assert double[:2] == pytest.approx([0.0, 0.57], rel=1e-12)
    assert tapers(write(VALID["parabola"]))["width"] == pytest.approx([1.2], rel=1e-12)
    corner = tapers(write(VALID["corner"]))
    assert corner["width"] == pytest.approx([-0.53], rel=1e-12)
    assert corner["diagonal"] == pytest.approx([0.4], rel=1e-12)
    slab = tapers(write(VALID["slab"]))
    assert (slab["width"], slab["height"]) == (pytest.approx([1.0], rel=1e-12), [0.0])


def test_table_of_displacements_becomes_a_displaced_wall(write):
    mould = built(write(VALID["step"]))
    assert mould.tapers.width == Displaced(Table("position", (0.0, 0.3, 0.301), (0.0, 0.0, 0.0005)))
    assert mould.dimensions(0.6)["width"] == pytest.approx(0.124, rel=1e-14)


def test_override_and_inheritance_change_the_taper(write):
    case = load_case(write(VALID["one line"]), ["mould.taper=3 %/m"])
    assert build_mould(case.mould, case.section).zones()[0].taper == pytest.approx(0.03)
    parabolic = case.with_({"mould.taper": {"top": "2 %/m", "exit": "1 %/m"}})
    assert build_mould(parabolic.mould, parabolic.section).zones()[0].taper == pytest.approx(0.015)
    assert parabolic.physics_hash() != case.physics_hash()
    separate = parabolic.with_({"mould.taper": {"face": "1 %/m", "corner": "2 %/m"}})
    separate = separate.with_({"mould.taper.corner": "3 %/m"})
    zones = {z.dimension: z for z in build_mould(separate.mould, separate.section).zones()}
    assert zones["width"].taper == pytest.approx(0.01)
    assert zones["diagonal"].taper == pytest.approx(0.03)


def test_wall_temperature_is_interpolated(write):
    mould = built(write(VALID["temperatures"]))
    assert mould.temperature(0.05) == pytest.approx(160 + 273.15)
    assert mould.temperature(0.35) == pytest.approx(170 + 273.15)


def test_cold_mould_has_the_strand_size_when_hot(write):
    mould = built(write('condition = "cold"\nwall_temperature = "160 degC"\ntaper = "1 %/m"'))
    assert mould.dimensions(0.0)["width"] == pytest.approx(0.125, rel=1e-15)
    cold = 0.125 / (1 + 17e-6 * 135)
    assert mould.dimensions(0.0, as_made=True)["width"] == pytest.approx(cold, rel=1e-14)
    sized = built(
        write('condition = "cold"\nwall_temperature = "160 degC"\nwidth = "125 mm"\n')
    ).dimensions(0.3)
    assert sized["width"] == pytest.approx(0.125 * (1 + 17e-6 * 135), rel=1e-14)


def test_expansion_is_by_the_mean_copper_temperature(write):
    lines = 'condition = "cold"\nwall_temperature = "160 degC"\n'
    lines += 'width = "125 mm"\n[mould.copper]\ntemperature = "120 degC"\ncold = "20 degC"'
    assert built(write(lines)).dimensions(0.0)["width"] == pytest.approx(
        0.125 * (1 + 17e-6 * 100), rel=1e-14
    )


def test_round_and_beam_blank_moulds_are_built(write):
    table = Mould.model_validate({"length": "600 mm", "taper": "1 %/m"})
    bloom = build_mould(table, Round.model_validate({"shape": "round", "diameter": "200 mm"}))
    (zone,) = bloom.zones()
    assert (zone.dimension, zone.inlet) == ("diameter", 0.2)
    assert zone.taper == pytest.approx(0.01, rel=1e-12)
    blank = built(write(VALID["one line"], BEAM_BLANK))
    assert blank.dimensions(0.0) == pytest.approx({"width": 0.4, "height": 0.3}, rel=1e-14)
    assert isinstance(blank.tapers.width, Taper)
    found = blank.gap_function([[0.0, 0.045], [0.19, 0.0]], [[0.0, 1.0], [1.0, 0.0]], 0.6)
    assert found.gap == pytest.approx([0.05 / 1.006 - 0.045, 0.2 / 1.006 - 0.19], rel=1e-12)


def test_friction_laws_have_their_thresholds(write):
    """Also the viscous stress at a speed, and the limit (236), a share of p0 / sqrt(3)."""
    pressure, rate = np.array([1e6]), np.array([0.06])

    def law(lines):
        return load_case(write(f"friction = {{ {lines} }}")).mould.friction.build()

    assert load_case(write()).mould.friction.build() is None
    assert law('law = "coulomb", coefficient = 0.3').threshold(pressure)[0] == [3e5]
    limited = law('law = "limited", coefficient = 0.9, yield_stress = "1.25 MPa"')
    assert limited.threshold(pressure)[0] == pytest.approx(0.75e6 / math.sqrt(3.0))
    tresca = law('law = "tresca", share = 0.5, yield_stress = "6 MPa"')
    assert tresca.threshold(pressure)[0] == [1e6]
    tresca = law('law = "tresca", share = 0.5, yield_stress = "6 MPa", steepest = 2')
    assert tresca.threshold(pressure)[0] == pytest.approx(3e6 / math.sqrt(3.0))
    viscous = 'law = "viscous", stress = "20 kPa", speed = "30 mm/s", exponent = 0.5'
    assert law(viscous).excess(rate)[0] == pytest.approx(2e4 * math.sqrt(2.0))
    assert law(f"{viscous}, steepest = 0.5").cap == 0.5
    both = law(f'{viscous}, coefficient = 0.1, yield_stress = "3 MPa", steepest = 0.5')
    assert both.cap == 0.5 and law(viscous).cap == 1.0
    assert both.threshold(pressure)[0] == [1e5]
    assert both.excess(rate)[0] == pytest.approx(2e4 * math.sqrt(2.0))


# Lines of [mould], the dotted key, words of the message.
MISTAKES = {
    "no unit": ('taper = "1"', "taper", ['("1")', "needs its unit", '"1 %/m"']),
    "no divisor": ('taper = "2 %"', "taper", ['("2 %")', "did you mean %/m?"]),
    "a slope": ('taper = "1.8 mm/m"', "taper", ["1.8 mm/m is 1 %/m of a section of 180 mm"]),
    "slip": ('taper = "1 %/mm"', "taper", ["is 1000 %/m", "at most 50 %/m"]),
    "half a parabola": ('taper = { top = "1 %/m" }', "taper", ["'exit' is missing"]),
    "unknown key": ('taper = { tap = "1 %/m" }', "taper", ["'tap'", "did you mean top?"]),
    "faulty part": ('taper = { corner = { top = "1", exit = "0 %/m" } }', "taper",
        ["corner: top:", "needs its unit"]),
    "order": ('taper = [{ to = "300 mm", taper = "1 %/m" }, { to = "200 mm", taper = "2 %/m" }]',
        "taper", ["segment 2", "'to' (200 mm)", "beyond the end of the previous segment (300 mm)"]),
    "open end": ('taper = [{ taper = "1 %/m" }, { taper = "2 %/m" }]', "taper",
        ["segment 1", "only the last segment may"]),
    "short": ('taper = [{ to = "300 mm", taper = "1 %/m" }, { to = "500 mm", taper = "2 %/m" }]',
        "taper", ["ends 500 mm below", "the mould 600 mm", "leave out its 'to'"]),
    "closing": ('taper = { position = ["0 mm", "1 mm"], value = ["0 mm", "70 mm"] }', "taper",
        ["the mould closes", "-15 x -15 mm"]),
    "tight": ('width = "120 mm"', "width", ["(120 mm)", "has 125 mm", "at least that"]),
    "rounder": ('corner_radius = "7 mm"', "corner_radius", ["has 5 mm", "at most that"]),
    "other shape": ('diameter = "125 mm"', "diameter",
        ['shape "rectangle"', "allowed: width, height, corner_radius"]),
    "cold, how hot": ('condition = "cold"', "wall_temperature",
        ["needs its temperature at work", '"160 degC"']),
    "rows": ('wall_temperature = { position = [0, 1], value = [1, 2], unit = "degC" }',
        "wall_temperature", ['position_unit = "mm"']),
    "method": ('contact = "penalti"', "contact", ["penalty or nitsche", "mean penalty?"]),
    "no coefficient": ('friction = { law = "coulomb" }', "friction.coefficient",
        ["is missing", "friction stress over pressure"]),
    "no limit": ('friction = { law = "viscous", stress = "1 kPa", speed = "1 m/s", '
        "coefficient = 0.1 }", "friction", ["a threshold needs", "yield_stress"]),
    "never reached": ('friction = { law = "viscous", stress = "6 MPa", speed = "1 m/s", '
        'yield_stress = "9 MPa" }', "friction.stress",
        ["(6 MPa)", "yield_stress / sqrt(3), 5.196 MPa", "raise yield_stress"]),
}  # fmt: skip


@pytest.mark.parametrize(("lines", "key", "words"), MISTAKES.values(), ids=MISTAKES)
def test_invalid_input_is_rejected_in_one_line(lines, key, words, write):
    path = write(lines)
    with pytest.raises(InputError) as caught:
        load_case(path)
    (line,) = caught.value.problems
    assert line.startswith(f"{path}: mould.{key}: ")
    for word in words:
        assert word in line


@pytest.mark.parametrize(
    ("section", "lines", "words"),
    [
        (ROUND, 'width = "200 mm"', 'shape "round"; allowed: diameter'),
        (ROUND, 'taper = { corner = "1 %/m" }', 'shape "round" has one taper'),
        (BEAM_BLANK, 'width = "400 mm"', "its sizes are the section's"),
        (STRIP, "", "a strip has no mould"),
    ],
)
def test_keys_of_another_section_are_rejected(section, lines, words, write):
    with pytest.raises(InputError) as caught:
        load_case(write(lines, section))
    assert any(words in line for line in caught.value.problems)


def test_invalid_section_is_reported_as_such(write):
    with pytest.raises(InputError) as caught:
        load_case(write("", '[section]\ncorner_radius = "70 mm"\n'))
    assert [line.split(": ")[1] for line in caught.value.problems] == ["section.corner_radius"]


def test_length_is_required(write):
    path = write('taper = "1 %/m"')
    path.write_text(path.read_text().replace('length = "600 mm"\n', ""))
    with pytest.raises(InputError, match=r"mould\.length: is missing"):
        load_case(path)


def test_reference_page_describes_the_mould():
    page = markdown_page()
    for part in ("### `[mould]`", "### `[mould.copper]`", '`[mould.friction], law = "viscous"`'):
        assert part in page
    assert '| `taper` | taper: `"1 %/m"`, or segments' in page


MM = 1e-3
SIZES = {"surface_size": 2 * MM, "core_size": 10 * MM}
SECTIONS = {
    "rounded": (Rectangle, {"width": 125, "height": 125, "corner_radius": 5}),
    "sharp slab": (Rectangle, {"width": 400, "height": 100, "corner_radius": 0}),
    "round": (Round, {"diameter": 200}),
    "beam_blank": (
        BeamBlank,
        {
            "width": 400,
            "height": 300,
            "web_thickness": 100,
            "flange_thickness": 60,
            "root_thickness": 90,
            "fillet_radius": 20,
            "shoulder_radius": 15,
            "corner_radius": 10,
        },
    ),
}


@pytest.mark.parametrize("symmetry", ["quarter", "half", "whole"])
@pytest.mark.parametrize("name", SECTIONS)
def test_facets_of_the_mesh_are_on_the_wall(name, symmetry):
    """The gap in the middle of a facet is the sagitta of the arc, at most h^2 / 8 r."""
    model, lengths = SECTIONS[name]
    shape = {"Rectangle": "rectangle", "Round": "round", "BeamBlank": "beam_blank"}[model.__name__]
    written = {key: f"{value} mm" for key, value in lengths.items()}
    section = model.model_validate({"shape": shape, "symmetry": symmetry, **written})
    mould = build_mould(Mould.model_validate({"length": "600 mm"}), section)
    mesh = build(**section.model_dump(), **SIZES)
    outer = [mesh.groups.index(group) for group in mesh.outer_groups]
    facets = mesh.facets[np.isin(mesh.facet_group, outer)]
    start, end = mesh.points[facets[:, 0]], mesh.points[facets[:, 1]]
    along = end - start
    h = np.hypot(*along.T)[:, None]
    normals = np.stack([along[:, 1], -along[:, 0]], axis=1) / h
    found = mould.gap_function(0.5 * (start + end), normals, 0.3)
    radii = [value * MM for key, value in lengths.items() if key.endswith("radius") and value]
    smallest = min(radii, default=0.1 if shape == "round" else np.inf)
    sagitta = 1.01 * float(h.max()) ** 2 / (8.0 * smallest)
    assert np.abs(found.gap).max() <= sagitta + 1e-12
    assert (found.normal * normals).sum(axis=1).min() > 0.99
    flat = np.abs(found.gap) < 1e-12
    assert flat.sum() >= (0 if shape == "round" else 0.5 * len(flat))
