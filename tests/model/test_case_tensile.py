"""Tensile tests as cases: kind of a file, its table, its mistakes."""

from __future__ import annotations

import tomllib

import pytest

from castfem.base.errors import InputError
from castfem.base.tables import Table
from castfem.model import Case, TensileCase, load_any, load_case, read_case
from castfem.model.shipped_cases import shipped

TEST = """\
title = "pulled"

[tensile]
material = "kozlowski_zhu"
carbon = 0.1
temperature = "1100 degC"

[[tensile.segment]]
rate = "1e-3 1/s"
duration = "10 s"
"""


def test_table_decides_the_kind(write):
    assert isinstance(load_any(write()), Case)
    case = load_any(write(TEST))
    assert isinstance(case, TensileCase)
    assert (case.tensile.temperature, case.tensile.steps) == (1373.15, 200)
    assert [(s.rate, s.duration) for s in case.tensile.segment] == [(1e-3, 10.0)]


def test_steps_are_counted_over_all_segments(write):
    path = write(f'{TEST}\n[[tensile.segment]]\nrate = "-1e-3 1/s"\nduration = "10 s"\n')
    with pytest.raises(InputError, match=r"steps: \(600000\) makes 1 200 000 steps"):
        load_any(path, ["tensile.steps=600000"])


def test_strand_is_required_by_its_commands(write):
    path = write(TEST)
    with pytest.raises(InputError, match=f"^{path}: is a tensile test; the case of a strand is"):
        load_case(path)


def test_resolved_case_reads_back_equal(write):
    text = TEST.replace(
        'temperature = "1100 degC"\n',
        'expansion = "2e-5 1/K"\nyoung = "20 GPa"\n'
        'temperature = { time = [0, 10], time_unit = "s", value = ["20 degC", "1500 K"] }\n',
    )
    case = load_any(write(text), ["tensile.steps=7", "tensile.segment.0.rate=-1e-3 1/s"])
    assert isinstance(case, TensileCase)
    assert isinstance(case.tensile.temperature, Table)
    again = load_any(write(case.resolved_toml(), "elsewhere/case.toml"))
    assert again == case
    assert again.physics_hash() == case.physics_hash()
    assert "extends" not in tomllib.loads(case.resolved_toml())


def test_material_may_be_a_table_and_inherits_keys(write):
    table = '[tensile.material]\nlaw = "norton_hoff"\nstrength = "30 MPa"\np3 = 0.1\n'
    write(TEST.replace('material = "kozlowski_zhu"\ncarbon = 0.1\n', "") + table, "base.toml")
    softer = load_any(write('extends = "base.toml"\n[tensile.material]\np1 = 50\n'))
    assert softer.tensile.material == {
        "law": "norton_hoff", "strength": "30 MPa", "p3": 0.1, "p1": 50,
    }  # fmt: skip
    other = '[tensile.material]\nlaw = "perfectly_plastic"\nyield_stress = "9 MPa"\n'
    plastic = load_any(write(f'extends = "base.toml"\n{other}'))
    assert plastic.tensile.material == {"law": "perfectly_plastic", "yield_stress": "9 MPa"}


def test_material_file_is_found_from_the_case(write):
    path = write(TEST.replace('"kozlowski_zhu"', '"../laws/mine.toml"'), "cases/case.toml")
    case = load_any(path)
    assert case.tensile.material == str(path.parent.parent / "laws" / "mine.toml")
    law = write("a = 1\n", "laws/mine.toml")
    before = case.physics_hash()
    law.write_text("a = 2\n")
    assert case.physics_hash() != before


def test_hash_depends_on_the_physics_only(write):
    path = write(TEST)
    plain = load_any(path).physics_hash()
    for same in ("title=other", "output.figures=false"):
        assert load_any(path, [same]).physics_hash() == plain
    for other in ("tensile.steps=10", "tensile.carbon=0.2", "tensile.segment.0.duration=9 s"):
        assert load_any(path, [other]).physics_hash() != plain


@pytest.mark.parametrize(
    ("assignment", "message"),
    [
        ("tensile.segment.0.rate=1e-3", "tensile.segment.0.rate: a strain rate needs its unit"),
        ("tensile.segment.0.duration=0 s", "must be above 0"),
        ("tensile.steps=0", "tensile.steps: must be at least 1 (0)"),
        (
            "tensile.cycles=1000000000",
            "tensile.cycles: (1000000000) makes 200 000 000 000 steps of the test; at "
            "most 1 000 000: give fewer",
        ),
        ("tensile.steps=2.5", "must be a whole number"),
        ("tensile.poisson=0.5", "must not be above 0.499"),
        ("tensile.temprature=1 K", "did you mean temperature?"),
        ("output.fields=[]", "output.fields: unknown key"),
    ],
)
def test_mistakes(write, assignment, message):
    reading = read_case(write(TEST), [assignment])
    assert len(reading.problems) == 1
    assert message in reading.problems[0]


def test_temperature_of_cycles_must_return(write):
    words = ['tensile.temperature={time=["0 s", "10 s"], value=["900 degC", "950 degC"]}']
    assert not read_case(write(TEST), words).problems
    (problem,) = read_case(write(TEST), [*words, "tensile.cycles=2"]).problems
    assert "tensile.temperature: ends a cycle of 10 s +50 K from where it began" in problem


def test_missing_keys_are_reported_together(write):
    found = read_case(write('title = "x"\n[tensile]\n[[tensile.segment]]\nrate = "1 1/s"\n'))
    assert [line.split(": ")[1] for line in found.problems] == [
        "tensile.material",
        "tensile.temperature",
        "tensile.segment.0.duration",
    ]


def test_references_of_a_test_have_no_position(write):
    text = TEST + '[[reference]]\nquantity = "q"\nvalue = "1 MPa"\nsource = "s"\nat = "1 m"\n'
    (problem,) = read_case(write(text)).problems
    assert "reference.0.at: a tensile test has no position" in problem


def test_shipped_tests_are_those_of_the_thesis():
    """The same rates, turns and parameters as benchmarks.thesis_tensile, Figs 58-62."""
    from benchmarks import thesis_tensile

    names = ("constant_rate", "rate_jump", "softening", "unloading", "unloading_softening")
    for name, test in zip(names, thesis_tensile.TESTS, strict=True):
        case = load_any(shipped()[f"tensile/{name}"])
        assert isinstance(case, TensileCase)
        strain, turns = 0.0, []
        for segment in case.tensile.segment:
            strain += segment.rate * segment.duration
            turns.append((segment.rate, pytest.approx(strain, rel=1e-12)))
        assert turns == list(test.segments)
        assert case.tensile.material["p1"] == test.p1
