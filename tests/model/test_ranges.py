"""What each quantity usually is and can be, one table of all keys; how many steps there may be."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from castfem.base.errors import InputError
from castfem.base.quantities import Kind
from castfem.base.ranges import RANGES
from castfem.model import read_case
from castfem.model.base import TableModel, tag_of
from castfem.model.case import Case
from castfem.model.checks.ranges import _kinds
from castfem.model.checks.unusual import warnings_with
from castfem.model.problems import submodels
from castfem.model.tensile import TensileCase
from castfem.physics.constitutive.flow_laws import RadialReturn
from castfem.physics.constitutive.parameters import load_elasticity, load_law
from castfem.physics.machine.rolls import KINDS as ROLLS
from castfem.physics.materials import load_steel
from castfem.physics.materials.plausible import unusual

CASES = Path(__file__).parents[2] / "cases"
THERMAL, TAPERED = CASES / "billet125" / "thermal.toml", CASES / "billet125" / "taper_1.toml"
SLAB, HOT = CASES / "slab1200" / "bending.toml", CASES / "billet125" / "hot.toml"
# Choices of the numerics, places and times that are checked against others, numbers that the kind
# of quantity bounds, on both sides or because any is as good as another.
WITHOUT = {
    *("casting.start.time", "mesh.surface_size", "mesh.corner_size", "mesh.face_size"),
    *("mesh.core_size", "mesh.surface_depth", "mesh.core_depth", "thermal.time.step"),
    *("thermal.time.adaptive.tolerance", "thermal.time.adaptive.first", "output.every"),
    *("thermal.time.adaptive.smallest", "thermal.time.adaptive.largest", "mould.tube.cell_size"),
    *("coupling.mechanical_step", "coupling.settled", "coupling.window_error"),
    *("caster.start", "caster.end", "caster.every", "caster.longest_gap"),
    *("caster.cast_from", "caster.cast_until", "caster.moments"),
    *("output.shell_at", "output.probe.x", "output.probe.y", "output.probe.depth", "reference.at"),
}


def numeric(model: type[TableModel], key: str = "") -> Iterator[tuple[str, str, Kind]]:
    """Keys of a case that hold a quantity, also with the kind of their table, and their units."""
    tag = tag_of(model)
    for name, field in model.model_fields.items():
        own = f"{key}.{name}" if key else name
        for kind in _kinds([field.annotation, *field.metadata]):
            yield own, f"{key}.{tag}.{name}" if tag else own, kind
        for inner in submodels(field.annotation):
            yield from numeric(inner, own)


def test_every_key_has_its_range() -> None:
    tensile = (entry for entry in numeric(TensileCase) if entry[0].startswith("tensile"))
    lacking = {
        of_kind
        for key, of_kind, kind in (*numeric(Case), *tensile)
        if not {key, of_kind} & {*RANGES, *WITHOUT} and kind.most is None
    }
    fix = "give them a usual and a possible range in castfem/base/ranges.py (or enter WITHOUT here)"
    assert not lacking, f"{', '.join(sorted(lacking))}: {fix}"
    assert {f"machine.rolls.{key}" for key in ROLLS} <= RANGES.keys()
    laws = {f"law.{key}" for law in RadialReturn.laws.values() for key in law.parameters}
    assert laws | {"law.young"} == {key for key in RANGES if key.startswith("law.")}


def test_no_range_is_of_a_key_that_is_not_there() -> None:
    keys = {name for model in (Case, TensileCase) for key in numeric(model) for name in key[:2]}
    own = {"steel", "law"}
    for key in RANGES:
        table = key.split(".")[:-1]
        if table[0] not in own and table != ["machine", "rolls"]:
            assert key in keys, f"{key} of castfem/base/ranges.py is no key of a case"


def test_what_is_usual_is_possible() -> None:
    for key, bounds in RANGES.items():
        (low, high), (least, most) = bounds.usual, bounds.possible
        assert least <= low < high <= most, key


def start(low: float, high: float) -> str:
    return (
        'casting.start={profile={depth=[0,50],depth_unit="mm",'
        f'value=[{low},{high}],unit="degC"}}}}'
    )


@pytest.mark.parametrize(
    ("case", "changes", "said"),
    [
        (THERMAL, ("casting.superheat=280 K",), "superheat: (280 K) is far from what metal is pou"),
        (THERMAL, ("cooling.1.surface.0.machine_factor=40",), "(40) is far from what correlations"),
        (
            THERMAL,
            ('cooling.0.surface=[{law="flux", value="1.9e-6 MW/m^2"}]',),
            "(1.9e-06 MW/m^2) is far from what moulds and sprays take, 0.001 to 20 MW/m^2",
        ),
        (
            THERMAL,
            (
                'cooling.1.surface=[{law="spray", flow="16000 L/min", correlation="nozaki", '
                'water_temperature="25 degC"}, '
                '{law="radiation", emissivity=0.8, ambient="25 degC"}]',
            ),
            "(16000 L/min) is far from what a zone is sprayed with, 1 to 8000 L/min",
        ),
        (THERMAL, (start(-100, 1500),), "at 0 mm: (-100 degC) is far from what cast metal has"),
        (THERMAL, ("cooling.mould.wall=-273.15 degC",), "(-273.15 degC) is far from what walls"),
        (SLAB, ('machine.defect=[{kind="misaligned",roll=30,by="15 mm"}]',), "by: (15 mm) is far"),
        (HOT, ("mould.tube.thickness=200 mm",), "thickness: (200 mm) is far from what tubes have"),
    ],
)
def test_what_is_absurd_is_told(case: Path, changes: tuple[str, ...], said: str) -> None:
    reading = read_case(case, changes)
    assert not reading.problems
    assert [line for line in reading.warnings if said in line], reading.warnings


@pytest.mark.parametrize(
    ("case", "change", "said"),
    [
        (THERMAL, "casting.temperature=1e300 degC", "(1e+300 degC) is beyond what cast metal has"),
        (THERMAL, "casting.start={meniscus='500 mm'}", "menisci measure, 0.001 to 300 mm"),
        (THERMAL, start(1600, 30000), "profile: at 50 mm: (30000 degC) is beyond"),
        (THERMAL, "cooling.0.surface.0.gap_conductivity=1e200 W/(m K)", "gases and slags have"),
        (TAPERED, "mould.contact={factor=1e10}", "(1e+10) is beyond what contact factors are"),
        (
            TAPERED,
            "mould.friction={law='limited',coefficient=0.3,yield_stress='1e-6 MPa'}",
            "yield_stress: (1e-06 MPa) is beyond what surfaces of hot steel bear",
        ),
        (HOT, "mould.tube.cell_size=1 um", "makes about 1.8e+11 cells of the tube, at most 300000"),
        (SLAB, "machine.defect=[{kind='misaligned',roll=30,by='1 m'}]", "(1000 mm) is beyond what"),
    ],
)
def test_what_cannot_be_is_refused(case: Path, change: str, said: str) -> None:
    reading = read_case(case, (change,))
    assert [line for line in reading.problems if said in line], reading.problems


THREE_ROLLS = (
    'machine.rolls={position=[0.9,1.2,1.5],position_unit="m",diameter=[200,200,200],'
    'diameter_unit="mm"%s}'
)


@pytest.mark.parametrize("apertures", [100, 500])
def test_rolls_that_do_not_fit_the_strand_are_told(apertures: int) -> None:
    rolls = THREE_ROLLS % f',aperture={[apertures] * 3},aperture_unit="mm"'
    reading = read_case(SLAB, (rolls, "mechanics.planes.force_contains_bending=false"))
    said = f"aperture ({apertures} mm) of a section"
    assert [line for line in reading.warnings if said in line], reading.problems


def test_a_key_of_a_bent_strand_is_refused_with_the_value_that_goes_without() -> None:
    key = "mechanics.planes.force_contains_bending"
    (problem,) = read_case(SLAB, (THREE_ROLLS % "", f"{key}=true")).problems
    assert f"{key}: is for a strand that its machine bends" in problem
    assert problem.endswith("or force_contains_bending = false")


def test_a_start_hotter_than_the_steel_was_poured_is_told() -> None:
    case = read_case(THERMAL, (start(1600, 2900),)).case
    assert isinstance(case, Case)
    texts = [p.text for p in warnings_with(case, load_steel("carbon_042"))]
    assert any("(2900 degC) is hotter than the steel was poured (1542.5 degC)" in t for t in texts)


@pytest.mark.parametrize(("unit", "told"), [("m", True), ("mm", False)])
def test_a_table_over_positions_that_no_strand_has_is_told(unit: str, told: bool) -> None:
    """Metres written for millimetres: the first row would hold all the way."""
    flux = f'position=[0, 300, 600], position_unit="{unit}", value=[2.5, 1.5, 1], unit="MW/m^2"'
    law = f'cooling.mould.surface=[{{ law="flux", value={{ {flux} }} }}]'
    reading = read_case(CASES / "billet125" / "thermal.toml", [law])
    assert not reading.problems
    found = [line for line in reading.warnings if "last position: (600000 mm) is far" in line]
    assert len(found) == told


@pytest.mark.parametrize(
    ("key", "value", "usual"),
    [
        ("conductivity", "3 W/(m K)", False),
        ("density", "1.5 g/cm^3", False),
        ("density", "7.4 g/cm^3", True),
        ("emissivity", 0.03, False),
    ],
)
def test_a_doubtful_steel_is_told(key: str, value: object, usual: bool) -> None:
    steel = load_steel("carbon_042", overrides={key: value})
    assert bool(list(unusual(steel))) != usual


def test_a_formula_is_held_against_the_same_range() -> None:
    change = {
        "conductivity": {
            "formula": "harste_conductivity",
            "parameters": {"liquid_factor": 100, "liquid_conductivity": "100 W/(m K)"},
        }
    }
    with pytest.raises(
        InputError, match=r"formula harste_conductivity at .* is beyond what metals"
    ):
        load_steel("plain_carbon", composition={"C": 0.1}, overrides=change)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('law = "perfectly_plastic"\nyield_stress = "1e6 GPa"\n', "yield_stress: (1e+09 MPa) is b"),
        ('law = "norton_creep"\nstress = "1 uPa"\nrate = "1 1/s"\nexponent = 3\n', "stress: (1e-"),
    ],
)
def test_a_law_is_held_against_its_ranges(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "own.toml").write_text(text)
    with pytest.raises(InputError) as error:
        load_law("own.toml", load_elasticity(), tmp_path)
    assert said in str(error.value)


def test_a_modulus_of_no_metal_is_refused(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text('young = "1e6 GPa"\npoisson = 0.3\n')
    with pytest.raises(InputError, match=r"young: \(1000000 GPa\) is beyond what metals have"):
        load_elasticity(str(tmp_path / "own.toml"))


FLUX = (
    'cooling.0.surface=[{{law="flux", value={{position=[0, {end}], position_unit="mm", '
    'value=[2.5, {last}], unit="MW/m^2"}}}}]'
)


@pytest.mark.parametrize(
    ("end", "last", "told"), [(300, 1.5, True), (300, 2.5, False), (590, 1.5, False)]
)
def test_a_table_that_ends_long_before_its_zone_is_told(end: int, last: float, told: bool) -> None:
    reading = read_case(THERMAL, (FLUX.format(end=end, last=last),))
    said = f'value (zone "mould"): the table ends at {end} mm, the zone at 600 mm'
    assert any(said in line for line in reading.warnings) == told, reading.warnings


@pytest.mark.parametrize(("size", "told"), [(125.0, False), (125.1, False), (126.0, True)])
def test_a_cavity_that_liquid_would_fill_is_told(size: float, told: bool) -> None:
    reading = read_case(TAPERED, (f"mould.width={size} mm", f"mould.height={size} mm"))
    assert any("liquid fills its mould" in line for line in reading.warnings) == told


MANY = list(range(5000))
ROWS = (
    f"mould.wall_temperature={{position={MANY},position_unit='um',"
    f"value={[150 + i % 2 for i in MANY]},unit='degC'}}"
)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (("casting.length=10 km", "coupling.interval=0.1 s"), "coupling.interval: (0.1 s) makes"),
        ((ROWS, "cooling.0.surface.0.wall=mould"), "has 4 999 rows in the run, each of which ends"),
    ],
    ids=["length", "rows"],
)
def test_what_would_take_hours_is_told_before_it_is_run(
    changes: tuple[str, ...], said: str
) -> None:
    reading = read_case(TAPERED, changes)
    told = [line[:200] for line in (*reading.warnings, *reading.problems)]
    assert any(said in line for line in told), told[:9]


@pytest.mark.parametrize(("started", "told"), [(0.0, False), (3000.0, False), (30.0, True)])
def test_rows_of_a_table_outside_the_run_are_no_steps(started: float, told: bool) -> None:
    """As of a plant's record of a day, of which a slice sees some minutes."""
    at = [*range(30), *(30 + i / 1000 for i in range(2000)), *range(40, 6000)]
    speed = f"casting.speed={{time={at},time_unit='s',value={[3.6] * len(at)},unit='m/min'}}"
    reading = read_case(THERMAL, (speed, f"casting.start.time={started} s"))
    assert not reading.problems
    assert any("rows in the run" in line for line in reading.warnings) == told


def test_a_machine_without_any_pair_is_refused() -> None:
    lost = ", ".join(f'{{kind="lost",roll={n}}}' for n in (1, 2, 3))
    changes = (
        THREE_ROLLS % "",
        f"machine.defect=[{lost}]",
        "mechanics.planes.force_contains_bending=false",
    )
    problems = read_case(SLAB, changes).problems
    assert any("leave fewer than two pairs" in line for line in problems), problems


TAPERED_SHORT = CASES / "billet125" / "taper_0.toml"


@pytest.mark.parametrize(
    ("change", "key", "count"),
    [
        ("coupling.interval=1e-9 s", "coupling.interval", "10 000 000 000 coupling windows"),
        ("coupling.mechanical_step=1e-9 s", "coupling.mechanical_step", "mechanical steps"),
        ("thermal.time.step=1 us", "thermal.time.step", "10 000 000 thermal steps"),
        ("output.every=1e-9 s", "output.every", "10 000 000 000 states of the fields"),
    ],
)
def test_a_run_without_end_is_refused_with_its_count(change: str, key: str, count: str) -> None:
    found = [line for line in read_case(TAPERED_SHORT, [change]).problems if f": {key}: " in line]
    assert len(found) == 1 and count in found[0] and "at most" in found[0], found


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            ["casting.speed=1 um/min"],
            "--set: casting.speed: (1e-06 m/min) takes 4.2e+02 days for 0.6 m: give a higher one",
        ),
        (["casting.speed=1e-9 m/min"], "--set: casting.speed: (1e-09 m/min) is beyond"),
        (["casting.length=1e9 m"], "--set: casting.length: (1e+12 mm) is beyond"),
    ],
)
def test_a_strand_that_makes_a_run_without_end_is_named_alone(
    changes: list[str], said: str
) -> None:
    (line,) = read_case(TAPERED_SHORT, changes).problems
    assert line.startswith(said)


@pytest.mark.parametrize(
    "changes",
    [
        ["casting.speed=9 mm/min", "coupling.interval=0.2 s", "output.every=10 s"],  # few steps
        ["output.every=1e-9 s", "output.fields=[]"],  # no states are written
    ],
)
def test_slow_and_often_may_be_no_fault(changes: list[str]) -> None:
    assert not read_case(TAPERED_SHORT, changes).problems


def test_a_long_run_is_told_with_its_time() -> None:
    (line,) = read_case(TAPERED_SHORT, ["coupling.mechanical_step=50 us"]).warnings
    assert "(5e-05 s) makes 200 000 mechanical steps" in line
    assert line.endswith("5.6 hours")
    line, cut = read_case(TAPERED_SHORT, ["output.every=1 ms"]).warnings
    assert "10 000 states of the fields" in line
    assert "is cut to output.every (0.001 s)" in cut
