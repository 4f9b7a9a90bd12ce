"""Usual and possible ranges of each quantity, one table of all keys; the number of steps."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from castfem.base.quantities import Kind
from castfem.base.ranges import RANGES
from castfem.model import read_case
from castfem.model.base import TableModel, tag_of
from castfem.model.case import Case
from castfem.model.checks.ranges import _kinds
from castfem.model.problems import submodels
from castfem.model.tensile import TensileCase
from castfem.physics.constitutive.flow_laws import RadialReturn
from castfem.physics.machine.roll_table import KINDS as ROLLS
from castfem.physics.materials import load_steel
from castfem.physics.materials.plausible import unusual

CASES = Path(__file__).parents[2] / "cases"
THERMAL, TAPERED = CASES / "billet125" / "thermal.toml", CASES / "billet125" / "taper_1.toml"
SLAB, HOT = CASES / "slab1200" / "bending.toml", CASES / "billet125" / "hot.toml"
# Numerical choices, places and times that are compared with others, numbers limited by the kind
# of quantity, on both sides or because any value is possible.
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
    """Yield keys of a case with a quantity, also with the kind of their table, and their units."""
    tag = tag_of(model)
    for name, field in model.model_fields.items():
        own = f"{key}.{name}" if key else name
        for kind in _kinds([field.annotation, *field.metadata]):
            yield own, f"{key}.{tag}.{name}" if tag else own, kind
        for inner in submodels(field.annotation):
            yield from numeric(inner, own)


def bounded(kind: Kind) -> bool:
    """Return whether the kind itself has both limits."""
    return kind.most is not None


def test_every_key_has_its_range() -> None:
    tensile = (entry for entry in numeric(TensileCase) if entry[0].startswith("tensile"))
    lacking = {
        of_kind
        for key, of_kind, kind in (*numeric(Case), *tensile)
        if not {key, of_kind} & {*RANGES, *WITHOUT} and not bounded(kind)
    }
    fix = "give them a usual and a possible range in castfem/base/ranges.py (or enter WITHOUT here)"
    assert not lacking, f"{', '.join(sorted(lacking))}: {fix}"
    assert {f"machine.rolls.{key}" for key in ROLLS} <= RANGES.keys()
    laws = {f"law.{key}" for law in RadialReturn.laws.values() for key in law.parameters}
    assert laws | {"law.young"} == {key for key in RANGES if key.startswith("law.")}


def test_every_range_belongs_to_a_key() -> None:
    keys = {name for model in (Case, TensileCase) for key in numeric(model) for name in key[:2]}
    own = {"steel", "law"}
    for key in RANGES:
        table = key.split(".")[:-1]
        if table[0] not in own and table != ["machine", "rolls"]:
            assert key in keys, f"{key} of castfem/base/ranges.py is no key of a case"


def test_usual_values_are_possible() -> None:
    for key, bounds in RANGES.items():
        (low, high), (least, most) = bounds.usual, bounds.possible
        assert least <= low < high <= most, key


def start(low: float, high: float) -> str:
    return (
        'casting.start={profile={depth=[0,50],depth_unit="mm",'
        f'value=[{low},{high}],unit="degC"}}}}'
    )


@pytest.mark.parametrize(
    ("case", "changes", "message"),
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
        (TAPERED, ("mould.friction={law='coulomb',coefficient=30}",), "did you mean 0.3?"),
    ],
)
def test_absurd_values_give_a_warning(case: Path, changes: tuple[str, ...], message: str) -> None:
    reading = read_case(case, changes)
    assert not reading.problems
    assert [line for line in reading.warnings if message in line], reading.warnings


@pytest.mark.parametrize(
    ("case", "change", "message"),
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
def test_impossible_values_are_refused(case: Path, change: str, message: str) -> None:
    reading = read_case(case, (change,))
    assert [line for line in reading.problems if message in line], reading.problems


@pytest.mark.parametrize(("apertures", "refused"), [(100, True), (150, False), (500, False)])
def test_rolls_that_do_not_fit_the_strand_are_reported(apertures: int, refused: bool) -> None:
    """The slab is 220 mm thick."""
    rolls = (
        'machine.rolls={position=[0.9,1.2,1.5],position_unit="m",diameter=[200,200,200],'
        f'diameter_unit="mm",aperture=[{apertures},{apertures},{apertures}],aperture_unit="mm"}}'
    )
    reading = read_case(SLAB, (rolls, "mechanics.planes.force_contains_bending=false"))
    message = (
        ": a section of 220 mm cannot pass" if refused else " of a section 220 mm thick; is one of"
    )
    lines = reading.problems if refused else reading.warnings
    assert [line for line in lines if f"roll 1: aperture ({apertures} mm){message}" in line], lines
    assert bool(reading.problems) == refused


def test_key_of_a_bent_strand_is_refused_without_bending() -> None:
    straight = (
        'machine.rolls={position=[0.9,1.2,1.5],position_unit="m",diameter=[200,200,200],'
        'diameter_unit="mm"}'
    )
    key = "mechanics.planes.force_contains_bending"
    (problem,) = read_case(SLAB, (straight, f"{key}=true")).problems
    assert f"{key}: is for a strand that its machine bends" in problem
    assert problem.endswith("or force_contains_bending = false")


def test_start_hotter_than_poured_gives_a_warning() -> None:
    from castfem.model.checks.unusual import warnings_with

    case = read_case(THERMAL, (start(1600, 2900),)).case
    assert isinstance(case, Case)
    texts = [p.text for p in warnings_with(case, load_steel("carbon_042"))]
    assert any("(2900 degC) is hotter than the steel was poured (1542.5 degC)" in t for t in texts)


@pytest.mark.parametrize(("unit", "warned"), [("m", True), ("mm", False)])
def test_table_beyond_any_strand_gives_a_warning(unit: str, warned: bool) -> None:
    """Metres written for millimetres: the first row would apply all the way."""
    flux = f'position=[0, 300, 600], position_unit="{unit}", value=[2.5, 1.5, 1], unit="MW/m^2"'
    law = f'cooling.mould.surface=[{{ law="flux", value={{ {flux} }} }}]'
    reading = read_case(CASES / "billet125" / "thermal.toml", [law])
    assert not reading.problems
    found = [line for line in reading.warnings if "last position: (600000 mm) is far" in line]
    assert len(found) == warned


@pytest.mark.parametrize(
    ("key", "value", "usual"),
    [
        ("conductivity", "3 W/(m K)", False),
        ("density", "1.5 g/cm^3", False),
        ("density", "7.4 g/cm^3", True),
        ("emissivity", 0.03, False),
    ],
)
def test_doubtful_steel_gives_a_warning(key: str, value: object, usual: bool) -> None:
    steel = load_steel("carbon_042", overrides={key: value})
    assert bool(list(unusual(steel))) != usual


def test_formula_is_checked_against_the_same_range() -> None:
    from castfem.base.errors import InputError

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
    ("text", "message"),
    [
        ('law = "perfectly_plastic"\nyield_stress = "1e6 GPa"\n', "yield_stress: (1e+09 MPa) is b"),
        ('law = "norton_creep"\nstress = "1 uPa"\nrate = "1 1/s"\nexponent = 3\n', "stress: (1e-"),
    ],
)
def test_law_is_checked_against_its_ranges(tmp_path: Path, text: str, message: str) -> None:
    from castfem.base.errors import InputError
    from castfem.physics.constitutive.parameters import load_elasticity, load_law

    (tmp_path / "own.toml").write_text(text)
    with pytest.raises(InputError) as error:
        load_law("own.toml", load_elasticity(), tmp_path)
    assert message in str(error.value)


def test_modulus_of_no_metal_is_refused(tmp_path: Path) -> None:
    from castfem.base.errors import InputError
    from castfem.physics.constitutive.parameters import load_elasticity

    (tmp_path / "own.toml").write_text('young = "1e6 GPa"\npoisson = 0.3\n')
    with pytest.raises(InputError, match=r"young: \(1000000 GPa\) is beyond what metals have"):
        load_elasticity(str(tmp_path / "own.toml"))


FLUX = (
    'cooling.0.surface=[{{law="flux", value={{position=[0, {end}], position_unit="mm", '
    'value=[2.5, {last}], unit="MW/m^2"}}}}]'
)


@pytest.mark.parametrize(
    ("end", "last", "warned"), [(300, 1.5, True), (300, 2.5, False), (590, 1.5, False)]
)
def test_table_that_ends_before_its_zone_gives_a_warning(
    end: int, last: float, warned: bool
) -> None:
    reading = read_case(THERMAL, (FLUX.format(end=end, last=last),))
    message = f'value (zone "mould"): the table ends at {end} mm, the zone at 600 mm'
    assert any(message in line for line in reading.warnings) == warned, reading.warnings


@pytest.mark.parametrize(("size", "warned"), [(125.0, False), (125.1, False), (126.0, True)])
def test_cavity_that_liquid_would_fill_gives_a_warning(size: float, warned: bool) -> None:
    reading = read_case(TAPERED, (f"mould.width={size} mm", f"mould.height={size} mm"))
    assert any("liquid fills its mould" in line for line in reading.warnings) == warned


MANY = list(range(5000))
ROWS = (
    f"mould.wall_temperature={{position={MANY},position_unit='um',"
    f"value={[150 + i % 2 for i in MANY]},unit='degC'}}"
)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (("casting.length=10 km", "coupling.interval=0.1 s"), "coupling.interval: (0.1 s) makes"),
        ((ROWS, "cooling.0.surface.0.wall=mould"), "has 4 999 rows in the run, each of which ends"),
    ],
    ids=["length", "rows"],
)
def test_runs_of_hours_are_reported_before_they_start(
    changes: tuple[str, ...], message: str
) -> None:
    reading = read_case(TAPERED, changes)
    lines = [line[:200] for line in (*reading.warnings, *reading.problems)]
    assert any(message in line for line in lines), lines[:9]


@pytest.mark.parametrize(("started", "warned"), [(0.0, False), (3000.0, False), (30.0, True)])
def test_rows_outside_the_run_are_no_steps(started: float, warned: bool) -> None:
    """As in a plant's record of a day, of which a slice sees some minutes."""
    at = [*range(30), *(30 + i / 1000 for i in range(2000)), *range(40, 6000)]
    speed = f"casting.speed={{time={at},time_unit='s',value={[3.6] * len(at)},unit='m/min'}}"
    reading = read_case(THERMAL, (speed, f"casting.start.time={started} s"))
    assert not reading.problems
    assert any("rows in the run" in line for line in reading.warnings) == warned


def test_machine_without_any_pair_is_refused() -> None:
    rolls = (
        'machine.rolls={position=[0.9,1.2,1.5],position_unit="m",diameter=[200,200,200],'
        'diameter_unit="mm"}'
    )
    lost = ", ".join(f'{{kind="lost",roll={n}}}' for n in (1, 2, 3))
    changes = (rolls, f"machine.defect=[{lost}]", "mechanics.planes.force_contains_bending=false")
    problems = read_case(SLAB, changes).problems
    assert any("leave fewer than two pairs" in line for line in problems), problems


TAPERED_SHORT = Path(__file__).parents[2] / "cases" / "billet125" / "taper_0.toml"


@pytest.mark.parametrize(
    ("change", "key", "count"),
    [
        ("coupling.interval=1e-9 s", "coupling.interval", "10 000 000 000 coupling windows"),
        ("coupling.mechanical_step=1e-9 s", "coupling.mechanical_step", "mechanical steps"),
        ("thermal.time.step=1 us", "thermal.time.step", "10 000 000 thermal steps"),
        ("output.every=1e-9 s", "output.every", "10 000 000 000 states of the fields"),
    ],
)
def test_endless_run_is_refused_with_its_count(change: str, key: str, count: str) -> None:
    found = [line for line in read_case(TAPERED_SHORT, [change]).problems if f": {key}: " in line]
    assert len(found) == 1 and count in found[0] and "at most" in found[0], found


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            ["casting.speed=1 um/min"],
            "--set: casting.speed: (1e-06 m/min) takes 4.2e+02 days for 0.6 m: give a higher one",
        ),
        (["casting.speed=1e-9 m/min"], "--set: casting.speed: (1e-09 m/min) is beyond"),
        (["casting.length=1e9 m"], "--set: casting.length: (1e+12 mm) is beyond"),
    ],
)
def test_endless_run_of_a_strand_is_reported_once(changes: list[str], message: str) -> None:
    (line,) = read_case(TAPERED_SHORT, changes).problems
    assert line.startswith(message)


def test_slow_strand_with_few_steps_is_valid() -> None:
    slow = ["casting.speed=9 mm/min", "coupling.interval=0.2 s", "output.every=10 s"]
    assert not read_case(TAPERED_SHORT, slow).problems


def test_disabled_output_makes_no_states() -> None:
    assert not read_case(TAPERED_SHORT, ["output.every=1e-9 s", "output.fields=[]"]).problems


def test_long_run_is_reported_with_its_time() -> None:
    (line,) = read_case(TAPERED_SHORT, ["coupling.mechanical_step=50 us"]).warnings
    assert "(5e-05 s) makes 200 000 mechanical steps" in line
    assert line.endswith("5.6 hours")
    line, cut = read_case(TAPERED_SHORT, ["output.every=1 ms"]).warnings
    assert "10 000 states of the fields" in line
    assert "is cut to output.every (0.001 s)" in cut
