"""Each kind of mistake is reported with file, key, value, allowed values, nearest name."""

from __future__ import annotations

import pytest

from castfem.base.errors import InputError
from castfem.model import load_case

# (text, its replacement, dotted key, parts of the message)
MISTAKES = {
    "unknown key": (
        'width = "125 mm"\n', 'width = "125 mm"\nhieght = "3 mm"\n', "section.hieght",
        ['("3 mm")', "unknown key", "allowed: shape, width, height", "did you mean height?"],
    ),
    "misspelt key of an inner table": (
        'name = "mould"\n', 'name = "mould"\ngap_conductivty = "0.1 W/(m K)"\n',
        "cooling.0.gap_conductivty",
        ["allowed: name, to, surface", "did you mean gap_conductivity of [[cooling.surface]]?"],
    ),
    "key of another table": (
        'width = "125 mm"\n', 'width = "125 mm"\nstep = "1 s"\n', "section.step",
        ["did you mean thermal.time.step?"],
    ),
    "key of another kind of table": (
        'width = "125 mm"\n', 'width = "125 mm"\ndiameter = "1 mm"\n', "section.diameter",
        ['did you mean diameter of shape = "round" or mould.diameter'],
    ),
    "key beside and elsewhere": (
        'width = "125 mm"\n', 'width = "125 mm"\nradius = "1 mm"\n', "section.radius",
        ["did you mean corner_radius or radius of [[machine.segment]]?"],
    ),
    "wrong unit": (
        '"3.6 m/min"', '"3.6 m/mn"', "casting.speed",
        ['("3.6 m/mn")', "'m/mn' is not known", "did you mean m/min?"],
    ),
    "wrong dimension": (
        '"3.6 m/min"', '"3.6 mm"', "casting.speed",
        ['("3.6 mm")', "unit of a length, a speed is needed", '"3.6 m/min"'],
    ),
    "no unit": (
        '"600 mm"\nsuperheat', "600\nsuperheat", "casting.length", ["needs its unit", "(600)"],
    ),
    "celsius as difference": (
        '"40 K"', '"40 degC"', "casting.superheat", ['("40 degC")', "written in kelvin", '"40 K"'],
    ),
    "missing key": (
        'speed = "3.6 m/min"\n', "", "casting.speed",
        ["is missing", "casting speed", '"3.6 m/min"'],
    ),
    "missing table": ('[steel]\nname = "carbon_042"\n', "", "steel", ["table [steel] is missing"]),
    "table for a list of tables": (
        "[[cooling.surface]]", "[cooling.surface]", "cooling.0.surface",
        ["must be a list of tables, each of which begins with [[cooling.surface]]"],
    ),
    "neither temperature": (
        'superheat = "40 K"\n', "", "casting", ["superheat or temperature is missing"],
    ),
    "both temperatures": (
        'superheat = "40 K"\n', 'superheat = "40 K"\ntemperature = "1540 degC"\n', "casting",
        ["superheat and temperature exclude each other"],
    ),
    "negative length": (
        '"5 mm"', '"-5 mm"', "section.corner_radius", ['("-5 mm")', "must not be below 0 m"],
    ),
    "gap without conductivity": (
        'wall = "160 degC"', 'wall = "160 degC"\ngap = "1 mm"', "cooling.0.surface.0",
        ["needs its gap_conductivity"],
    ),
    "nan": (
        'ambient = "25 degC"', 'ambient = "25 degC"\nemissivity = nan',
        "cooling.1.surface.0.emissivity", ["(nan)", "finite"],
    ),
    "emissivity beyond one": (
        'ambient = "25 degC"', 'ambient = "25 degC"\nemissivity = 1.2',
        "cooling.1.surface.0.emissivity", ["(1.2)", "must not be above 1"],
    ),
    "cells too small for the section": (
        'surface_size = "0.5 mm"', 'surface_size = "1 nm"', "mesh.surface_size",
        ["(1e-06 mm)", "too fine", "at least 0.000625 mm"],
    ),
    "water that is ice": (
        'law = "radiation"\nambient = "25 degC"',
        'law = "spray"\nwater = "5 L/(m^2 s)"\nwater_temperature = "25 K"\ncorrelation = "nozaki"',
        "cooling.1.surface.0.water_temperature", ['("25 K")', "must not be below 0 degC"],
    ),
    "a table for a constant": (
        'length = "600 mm"', 'length = { time = [0, 1], value = ["3 m", "4 m"] }', "casting.length",
        ['a single length is needed here, such as "125 mm"; no table'],
    ),
    "unknown law": (
        '"radiation"', '"radiaton"', "cooling.1.surface.0",
        ['law = "radiaton"', "one of contact, flux, spray", "did you mean radiation?"],
    ),
    "law left out": (
        'law = "radiation"\n', "", "cooling.1.surface.0", ["'law' is missing", "one of contact"],
    ),
    "unknown choice": (
        'core_size = "8 mm"', 'core_size = "8 mm"\ncell = "triangel"', "mesh.cell",
        ['("triangel")', "one of quadrilateral, triangle", "did you mean triangle?"],
    ),
    "beginning of a name": (
        'coefficient = "1600 W/(m^2 K)"',
        'flux = "savage"',
        "cooling.0.surface.0.flux",
        ["the name of a formula, savage_pritchard", "did you mean savage_pritchard?"],
    ),
    "word beside a quantity": (
        'coefficient = "1600 W/(m^2 K)"',
        'coefficient = "1600 W/(m^2 K)"\nmeasured_at = "any"',
        "cooling.0.surface.0.measured_at",
        ['or "any speed"', "did you mean any speed?"],
    ),
    "word for a table": (
        "[mesh]",
        '[mechanics]\nbulging = "elast"\n[mesh]',
        "mechanics.bulging.model",
        ['not possible ("elast"); one of creep, elastic', "did you mean elastic?"],
    ),
    "order": ('core_size = "8 mm"', 'core_size = "8 mm"\norder = 3', "mesh.order", ["(3)", "1, 2"]),
    "unknown field": (
        "[mesh]", '[output]\nfields = ["temprature"]\n[mesh]', "output.fields.0",
        ['("temprature")', "did you mean temperature?"],
    ),
    "field twice": (
        "[mesh]", '[output]\nfields = ["temperature", "temperature"]\n[mesh]', "output.fields",
        ["appears twice"],
    ),
    "text for a truth value": (
        "[mesh]", '[output]\nfigures = "yes"\n[mesh]', "output.figures",
        ['("yes")', "true or false"],
    ),
    "unknown group": (
        'law = "radiation"', 'law = "radiation"\non = ["wide_fase"]', "cooling.1.surface.0.on",
        ['"wide_fase"', "allowed: wide_face, narrow_face, corner", "did you mean wide_face?"],
    ),
    "line of symmetry cooled": (
        'law = "radiation"', 'law = "radiation"\non = ["symmetry_x"]', "cooling.1.surface.0.on",
        ["no boundary group"],
    ),
    "given temperature and another law": (
        'ambient = "25 degC"\n',
        'ambient = "25 degC"\n[[cooling.surface]]\nlaw = "temperature"\nvalue = "900 degC"\n',
        "cooling.1.surface.1", ["given temperature on corner, narrow_face, wide_face excludes"],
    ),
    "zones not in order": (
        'name = "air"', 'name = "air"\nto = "500 mm"', "cooling.1.to",
        ["(500 mm)", "end of the previous zone (600 mm)"],
    ),
    "zone without end before the last": (
        'to = "600 mm"\n', "", "cooling.0", ["'to' is missing", "only the last zone"],
    ),
    "zone name twice": ('name = "air"', 'name = "mould"', "cooling.1.name", ['("mould")', "twice"]),
    "radius too large": (
        '"5 mm"', '"80 mm"', "section.corner_radius",
        ["(80 mm)", "no flat face", "below half the smaller side (62.5 mm)"],
    ),
    "cells larger than the section": (
        'core_size = "8 mm"', 'core_size = "8 m"', "mesh.core_size",
        ["(8000 mm)", "larger than half the section (62.5 mm)"],
    ),
    "step and adaptive": (
        "[mesh]", '[thermal.time]\nstep = "50 ms"\nadaptive = { tolerance = "1 K" }\n[mesh]',
        "thermal.time", ["exclude each other"],
    ),
    "bounds of the step": (
        "[mesh]", '[thermal.time.adaptive]\nsmallest = "1 s"\n[mesh]', "thermal.time.adaptive",
        ["smallest (1 s) <= first (0.001 s)"],
    ),
    "table that is missing": (
        "[mesh]", "[machine.extraction]\n[mesh]", "machine.extraction.resistance",
        ["is missing", 'such as { file = "resistance.csv" }'],
    ),
    "reference without unit": (
        "[mesh]", '[[reference]]\nquantity = "x"\nvalue = "4.75 mn"\nsource = "y"\n[mesh]',
        "reference.0.value", ['("4.75 mn")', "did you mean"],
    ),
    "composition": (
        'name = "carbon_042"\n', 'name = "carbon_042"\ncomposition = { C = 120 }\n',
        "steel.composition.C", ["(120)", "must not be above 100"],
    ),
}  # fmt: skip


@pytest.mark.parametrize(("old", "new", "key", "parts"), MISTAKES.values(), ids=MISTAKES)
def test_mistake_is_reported(write, sound, old, new, key, parts):
    assert old in sound
    path = write(sound.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        load_case(path)
    lines = [line for line in caught.value.problems if line.startswith(f"{path}: {key}")]
    assert lines, caught.value.problems
    for words in parts:
        assert any(words in line for line in lines), lines


def test_missing_zones_are_requested_with_their_syntax(write, sound):
    without = sound[: sound.index("[[cooling]]")]
    with pytest.raises(
        InputError, match=r"cooling: is missing; at least one table \[\[cooling\]\]"
    ):
        load_case(write(without))


def test_zones_must_reach_the_end(write, sound):
    text = sound.replace('length = "600 mm"', 'length = "2 m"').replace(
        'name = "air"', 'name = "air"\nto = "1 m"'
    )
    with pytest.raises(
        InputError, match=r"cooling\.1\.to .*\(1000 mm\) ends before casting.length"
    ):
        load_case(write(text))


def test_all_problems_are_reported_at_once(write, sound):
    """A wrong unit hides neither an unknown or missing key, nor a check of several keys."""
    text = (
        sound.replace('"3.6 m/min"', '"3.6 m"')
        .replace('superheat = "40 K"\n', "")
        .replace('name = "air"', 'name = "air"\nto = "500 mm"')
        .replace('core_size = "8 mm"\n', 'cor_size = "8 mm"\n')
        .replace('"radiation"', '"radiaton"')
    )
    with pytest.raises(InputError) as caught:
        load_case(write(text))
    messages = str(caught.value)
    for words in (
        "casting.speed: ",
        "casting: superheat or temperature is missing",
        "cooling.1.to",
        "mesh.cor_size: unknown",
        "mesh.core_size: is missing",
        "radiaton",
    ):
        assert words in messages
    assert len(caught.value.problems) == 6


def test_zone_is_reported_with_its_name(write, sound):
    with pytest.raises(InputError, match=r'cooling\.1\.surface\.0\.ambient \(zone "air"\)'):
        load_case(write(sound.replace('"25 degC"', '"25"')))


def test_file_not_found_names_the_nearest(write, tmp_path):
    write(name="billet.toml")
    with pytest.raises(
        InputError, match=r"billte\.toml: file not found; did you mean billet\.toml"
    ):
        load_case(tmp_path / "billte.toml")


def test_folder_instead_of_file(tmp_path):
    with pytest.raises(InputError, match="is a folder; name a file"):
        load_case(tmp_path)


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ('title = "x"\nspeed = \n', "2, column 9"),
        ('title = "x"\n[casting\n', "2"),
        ("a = 1\na = 2\n", "2"),
        ('title = "x', "1"),
        # A table that is defined twice, named as written.
        ("[mould.tube]\na = 1\n[ mould . tube ]\n", "3, column 16: [ mould . tube ] is there alr"
         "eady, in line 1; "),
        ('[[cooling]]  # one\nname = "a"\n[cooling]\n', "3, column 9: [cooling] is one of several "
         "tables; write [[cooling]]"),
        ('[cooling]\nname = "a"\n[cooling]\n', "3, column 9: [cooling] is one of several "
         "tables; write [[cooling]]"),
        ("[cooling.surface]\na = 1\n[ cooling.surface ]\n", "3, column 19: [ cooling.surface ] is "
         "one of several tables; write [[cooling.surface]]"),
        ("[tensile.segment]\na = 1\n[tensile.segment]\n", "3, column 17: [tensile.segment] is one "
         "of several tables; write [[tensile.segment]]"),
        ("[mould]\ntube.above = 1\n[mould.tube]\n", "3, column 12: [mould.tube] is there already, "
         "by a key; "),
        ("mould.tube = {}\n[[mould.tube]]\n", "2, column 13: Cannot mutate immutable namespace "
         "mould.tube: "),
    ],
)  # fmt: skip
def test_syntax_error_names_the_line(write, text, parts):
    path = write(text)
    with pytest.raises(InputError) as caught:
        load_case(path)
    assert str(caught.value).startswith(f"{path}: line {parts}")


def test_not_utf8(tmp_path):
    path = tmp_path / "latin.toml"
    path.write_bytes(b'title = "x"\n# \xe9\n')
    with pytest.raises(InputError, match="line 2: is not UTF-8 text"):
        load_case(path)


def test_byte_order_mark_is_no_error(tmp_path, sound):
    path = tmp_path / "bom.toml"
    path.write_text(sound, encoding="utf-8-sig")
    assert load_case(path).title == "billet"


def test_counts_begin_at_one(write, sound):
    with pytest.raises(InputError, match=r"coupling\.passes: must be at least 1 \(0\)"):
        load_case(write(sound), ["mechanics.law=norton_hoff_kozlowski", "coupling.passes=0"])
    with pytest.raises(InputError, match=r"checkpoint_every: must not be negative \(-1\)"):
        load_case(write(sound), ["output.checkpoint_every=-1"])
