"""Values that a case may have, but that are unlikely."""

from __future__ import annotations

from pathlib import Path

import pytest

from castfem.base import log
from castfem.cli.checking import problems_of
from castfem.model import Case, read_case, shipped_cases
from castfem.model.checks.unusual import warnings_with
from castfem.physics.materials import load_steel

TAPERED = Path(__file__).parents[2] / "cases" / "billet125" / "taper_0.toml"
ROUGH = 'mould.friction={ law = "coulomb", coefficient = %s }'
TWO = 'mould.taper=[{ to = "100 mm", taper = "%s" }, { taper = "0.5 %%/m" }]'
WALL = 'mould.taper={ position = [0, 600], position_unit = "mm", value = [0, %s], unit = "mm" }'

AIR = '{ law = "radiation", emissivity = 0.8, ambient = "25 degC", on = [%s] }'


def _warnings(*changes: str) -> tuple[str, ...]:
    reading = read_case(TAPERED, changes)
    assert not reading.problems
    return reading.warnings


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("mould.taper=20 %/m", "mould.taper: the mould closes by 12 %; did you mean 2 %/m?"),
        (
            'mould.taper={ face = "1 %/m", narrow_face = "15 %/m" }',
            "mould.taper: narrow_face: the mould closes by 9 %; did you mean 1.5 %/m?",
        ),
        # 62.5 mm / 57.5 mm
        (WALL % 5, "mould.taper: the mould closes by 8.7 %"),
        ("casting.speed=360 m/min", "casting.speed: (360 m/min) is far from what strands are"),
        ("coupling.interval=10 s", "coupling.interval: (0.6 m of strand) is longer than"),
        (ROUGH % 30, "(30) is more than 2 times the pressure; did you mean 0.3?"),
    ],
)
def test_unlikely_values_give_a_warning(change: str, message: str) -> None:
    (line,) = _warnings(change)
    assert line.startswith("--set: ")
    assert message in line
    assert ("did you mean" in line) == ("did you mean" in message)


def test_cells_as_thick_as_a_shell() -> None:
    sizes = (f"mesh.{place}_size=25 mm" for place in ("surface", "corner", "face", "core"))
    thick, corner = _warnings(*sizes)
    assert "mesh.surface_size: (25 mm) is as thick as a shell" in thick
    assert "mesh.corner_size: cells of 25 mm along a corner of radius 5 mm" in corner


def test_long_cells_at_a_corner_give_a_warning() -> None:
    (line,) = _warnings("mesh.corner_size=0.9 mm")
    assert "mesh.corner_size: cells of 0.9 mm" in line and "0.833333 mm or less" in line
    assert not _warnings("mesh.corner_size=0.83 mm")


ROWS = 'mould.taper={ position = %s, position_unit = "mm", value = %s, unit = "mm" }'


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (("[0, 600]", "[125.8, 124.9]"), "125.8 mm at the meniscus look like a size of the cavity"),
        (("[100, 600]", "[0.1, 0.5]"), "the table begins 100 mm below the meniscus with 0.1 mm,"),
        (("[0, 700]", "[0, 0.5]"), "the table continues to 700 mm below the meniscus, the mould"),
        (("[0, 400]", "[0, 0.5]"), "the table ends 400 mm below the meniscus, the mould ends 600 "),
        (("[0, 600]", "[0.2, 0.7]"), ""),  # the value at the meniscus is subtracted
        (("[0, 300, 300.1]", "[0, 0, 0.5]"), ""),  # a step
    ],
)
def test_ambiguous_tables_of_the_wall_give_a_warning(rows: tuple[str, str], message: str) -> None:
    lines = _warnings(ROWS % rows)
    assert [line.removeprefix("--set: mould.taper: ")[: len(message)] for line in lines] == (
        [message] if message else []
    )


@pytest.mark.parametrize(
    ("written", "percent"),
    [("0.18", 0.18), ("'0.18'", 0.18), ("'0.18 %'", 0.18), ("'1800 ppm'", 0.18)],
)
def test_composition_in_per_cent_is_one(written: str, percent: float) -> None:
    """`"0.18 %"` is no share of 0.0018."""
    changes = ("steel.name=plain_carbon", f"steel.composition={{ C = {written} }}")
    case = read_case(TAPERED, changes).case
    assert isinstance(case, Case)
    assert case.steel.composition == {"C": pytest.approx(percent)}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("casting.temperature=2500 degC", ["--set: casting.temperature: 997.5 K above the liq"]),
        ("casting.superheat=150 K", []),
        ("casting.temperature=1600 degC", []),
    ],
)
def test_too_hot_steel_gives_a_warning(change: str, message: list[str]) -> None:
    reading = read_case(TAPERED, (change,))
    assert isinstance(reading.case, Case)
    problems = warnings_with(reading.case, load_steel("carbon_042"))
    found = [line for line in map(reading.line, problems) if "above the liquidus" in line]
    assert [line[: len(one)] for line, one in zip(found, message, strict=True)] == message


HEAT = "cooling.mould.surface=[%s]"
CONTACT = (
    '{law="contact", coefficient="1600 W/(m^2 K)", gap_conductivity="0.15 W/(m K)", '
    'wall="160 degC"%s}'
)
RADIATION = '{law="radiation", emissivity=0.8, ambient="160 degC"%s}'
FOLLOWS = 'is not changed by the gap that opens in the mould; heat that is to follow it is law = "c'


@pytest.mark.parametrize(
    ("laws", "message"),
    [
        (['{law="flux", value="1 MW/m^2"}'], "0: a given flux " + FOLLOWS),
        ([CONTACT % ', gap="0 mm"'], "0: contact with a gap of its own " + FOLLOWS),
        ([CONTACT % ', on=["wide"]', RADIATION % ""], "1: radiation " + FOLLOWS),
    ],
)
def test_heat_independent_of_the_gap_gives_a_warning(laws: list[str], message: str) -> None:
    (line,) = _warnings(HEAT % ", ".join(laws))
    assert f"cooling.0.surface.{message}" in line.replace(' (zone "mould")', "")


def test_radiation_without_a_gap_gives_a_warning() -> None:
    thermal = TAPERED.with_name("thermal.toml")
    both = HEAT % ", ".join([CONTACT % "", RADIATION % ""])
    (line,) = read_case(thermal, [both]).warnings
    assert "surface.1" in line
    assert "radiation has no effect beside contact without a gap" in line
    assert (
        read_case(thermal, [HEAT % ", ".join([CONTACT % ', gap="1 mm"', RADIATION % ""])]).warnings
        == ()
    )
    apart = [CONTACT % ', on=["wide"]', RADIATION % ', on=["narrow", "corner"]']
    assert read_case(thermal, [HEAT % ", ".join(apart)]).warnings == ()
    assert _warnings(both) == ()  # there is a mould with a gap


@pytest.mark.parametrize(
    "change",
    [
        "mould.taper=10 %/m",
        TWO % "20 %/m",  # steep, but 2.3 % in all
        "casting.speed=18 m/min",
        ROUGH % 1,
    ],
)
def test_plausible_values_give_no_warning(change: str) -> None:
    assert _warnings(change) == ()


THERMAL = TAPERED.with_name("thermal.toml")
SPRAYED = (
    'cooling.0.surface=[{law="spray",water="%s",water_temperature="25 degC",correlation="%s"},'
    '{law="radiation",ambient="25 degC",emissivity=0.8}]'
)


@pytest.mark.parametrize(
    ("water", "correlation", "message"),
    [
        ("72 L/(m^2 s)", "wendelstorf", "measured for, 3 to 30 L/(m^2 s): the coefficient is that"),
        ("9 L/(m^2 s)", "bolle", "1 to 7 L/(m^2 s): extrapolated"),
        ("25 L/(m^2 s)", "mizikar", "at most 20.3 L/(m^2 s): extrapolated"),
        ("1 L/(m^2 s)", "sasaki", "1.67 to 41.7 L/(m^2 s): below, it falls to zero"),
        ("0 L/(m^2 s)", "bolle", None),
        ("5 L/(m^2 s)", "wendelstorf", None),
    ],
)
def test_water_beyond_the_measurements_gives_a_warning(water, correlation, message) -> None:
    found = read_case(THERMAL, [SPRAYED % (water, correlation)]).warnings
    assert len(found) == (message is not None)
    assert all(message in line and "cooling.0.surface.0.water" in line for line in found)


def test_spray_without_radiation_gives_a_warning() -> None:
    single = SPRAYED.replace(',{law="radiation",ambient="25 degC",emissivity=0.8}', "")
    (line,) = read_case(THERMAL, [single % ("5 L/(m^2 s)", "nozaki")]).warnings
    assert "a spray without radiation" in line


@pytest.mark.parametrize(
    ("laws", "left_out"),
    [
        ([AIR % '"wide_face"', AIR % '"narrow_face"'], "corner"),  # the arc between the faces
        ([AIR % '"corner"'], "wide_face, narrow_face"),
        ([AIR % '"wide", "narrow", "corner"'], ""),
        ([], ""),  # a full zone may be insulated
    ],
)
def test_uncooled_part_of_the_surface_gives_a_warning(laws: list[str], left_out: str) -> None:
    found = [w for w in _warnings(f"cooling.air.surface=[{', '.join(laws)}]") if "no heat" in w]
    assert len(found) == bool(left_out)
    assert not found or f"no heat law holds on {left_out}: " in found[0]


def test_kelvin_for_degrees_gives_a_warning() -> None:
    (line,) = read_case(THERMAL, ["cooling.mould.surface.0.wall=160 K"]).warnings
    assert '(160 K) is -113.2 degC; did you mean "160 degC"?' in line


def _with(steel: dict[str, object], law_carbon: float | None, *changes: str) -> list[str]:
    written = ", ".join(f"{element} = {share}" for element, share in steel.items())
    named = ("steel.name=plain_carbon", f"steel.composition={{ {written} }}")
    reading = read_case(TAPERED, [*named, *changes])
    assert isinstance(reading.case, Case) and not reading.problems
    made = load_steel("plain_carbon", composition=steel)
    return [problem.text for problem in warnings_with(reading.case, made, law_carbon)]


@pytest.mark.parametrize(
    ("changes", "fix"),
    [
        ([], None),
        (["mechanics.law=kozlowski_zhu"], 'give "kozlowski_zhu_signed"'),
        (["mechanics.law=%s"], 'give it hardening = "signed"'),
        (["mechanics.law=kozlowski_zhu", "mechanics.bulging=elastic"], None),
    ],
)
def test_hardening_law_of_a_strip_gives_one_warning(
    changes: list[str], fix: str | None, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    from castfem.cli.checking import check_case
    from castfem.physics.constitutive import parameters

    own = tmp_path / "own.toml"
    own.write_text((Path(parameters.__file__).parent / "data" / "kozlowski_zhu.toml").read_text())
    given = [change.replace("%s", str(own)) for change in changes]
    check_case("slab", TAPERED.parents[1] / "slab1200" / "bulging.toml", given)
    out, err = capfd.readouterr()
    lines = [line for line in (out + err).splitlines() if "hardens further" in line]
    assert len(lines) == (fix is not None)
    if fix is not None:
        assert "mechanics.law: (" in lines[0] and "what 4 pitches make of virgin steel" in lines[0]
        assert fix in lines[0]


@pytest.mark.parametrize(("limit", "warned"), [("automatic", True), ("0 MPa", False)])
def test_yield_limit_of_a_signed_law_gives_a_warning(
    limit: str, warned: bool, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """The shipped set has none; with one a bent slab ends without equilibrium."""
    from castfem.cli.checking import check_case
    from castfem.physics.constitutive import parameters

    shipped = Path(parameters.__file__).parent / "data" / "norton_hoff_kozlowski_signed.toml"
    text = shipped.read_text()
    assert 'yield_limit = "0 MPa"' in text
    own = tmp_path / "own.toml"
    own.write_text(text.replace('yield_limit = "0 MPa"', f'yield_limit = "{limit}"'))
    slab = TAPERED.parents[1] / "slab1200" / "bending.toml"
    check_case("slab", slab, [f"mechanics.law={own}"])
    assert ('give it yield_limit = "0 MPa"' in "".join(capfd.readouterr())) == warned


def test_data_that_do_not_fit_the_steel_give_a_warning() -> None:
    assert _with({"C": 0.1}, 0.1) == []
    assert _with({"C": 0.2}, None) == []
    (line,) = _with({"C": 0.2}, 0.1)
    assert "numbers of a steel of 0.1 %C, plain_carbon has 0.2 %C" in line
    (line,) = _with({"C": 0.1, "V": 0.05, "Nb": 0.02}, 0.1)
    assert line == "there are no data for V, Nb; the steel is computed without"
    cold = ("casting.temperature=1500 degC",)
    (line,) = _with({"C": 0.1}, 0.1, *cold)
    assert "lies below the liquidus of plain_carbon" in line and "% of solid" in line


# Slabs whose upper rows of nozzles intentionally reach the edges, and spray slightly past them.
OVER_THE_EDGE = ("edges", "warm_edges", "nozzles_47_52")


@pytest.mark.parametrize(("end", "roll", "off"), [("4.11 m", 15, "0.086"), ("2.322 m", 8, "0.5")])
def test_zone_that_ends_near_a_roll_gives_a_warning(end: str, roll: int, off: str) -> None:
    """A window of milliseconds is between the two, whose strain rate is that of a jump."""
    slab = TAPERED.parents[1] / "slab1200" / "slab.toml"
    zone = "bender" if roll == 15 else "top"
    (line,) = read_case(slab, (f"cooling.{zone}.to={end}",)).warnings
    place = {15: "4.110086", 8: "2.3225"}[roll]
    assert f"({end}) is {off} mm off roll {roll}: " in line and f'give "{place} m"' in line
    assert not read_case(slab, (f"cooling.{zone}.to={place} m",)).warnings
    assert not read_case(slab, (f"cooling.{zone}.to={float(place) - 0.05} m",)).warnings
    thermal = slab.with_name("thermal.toml")  # a step of milliseconds does not matter for heat
    assert not read_case(thermal, (f"cooling.{zone}.to={end}",)).warnings


@pytest.mark.parametrize("path", shipped_cases.shipped().values(), ids=shipped_cases.shipped())
def test_shipped_cases_give_no_warning(path: Path) -> None:
    lines = read_case(path).warnings
    if path.stem in OVER_THE_EDGE:
        assert len(lines) == 2 and all("4 % of the water misses the face" in one for one in lines)
    else:
        assert lines == ()


def test_faulty_case_gives_no_warnings() -> None:
    reading = read_case(TAPERED, ["mould.taper=20 %/m", "casting.length=3"])
    assert len(reading.problems) == 1
    assert reading.warnings == ()


SLABS = TAPERED.parents[1] / "slab1200"


@pytest.mark.parametrize(
    ("case", "changes", "message"),
    [
        (TAPERED, ("coupling.passes=1", "coupling.window_error=3 K"),
         "error: has no effect with p"),
        (SLABS / "bulging.toml", ("coupling.passes=3",), "passes: has no effect without [mould]"),
        (SLABS / "thermal.toml", ("coupling.interval=1 s",), "no effect without [mechanics]"),
        (TAPERED, ("mechanics.liquid_stiffness=1e-3",), "liquid_stiffness: has no effect: liquid"),
        (TAPERED, ("mechanics.elasticity=elastic_steel", "steel.overrides.youngs_modulus=20 GPa"),
         "overrides.youngs_modulus: has no effect beside mechanics.elasticity"),
        (SLABS / "reference.toml", ("machine.extraction.friction_axis=0.02",),
         "friction_axis: has no effect beside a maker's curve"),
    ],
)  # fmt: skip
def test_ineffective_keys_give_a_warning(
    case: Path, changes: tuple[str, ...], message: str
) -> None:
    """The same keys give none where they have an effect."""
    plain = read_case(case)
    assert not plain.problems and not any("no effect" in line for line in plain.warnings)
    reading = read_case(case, changes)
    assert not reading.problems
    (line,) = (line for line in reading.warnings if "no effect" in line)
    assert message in line


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (("thermal.time.step=1 s",), "thermal.time.step: (1 s) is cut to output.every (0.5 s)"),
        (("thermal.time.adaptive={largest='3 s'}",), "adaptive.largest: (3 s) is cut to output"),
        (("thermal.time.step=1 s", "output.every=1 s"), ""),
        (("thermal.time.step=1 s", "output.fields=[]"), ""),
    ],
)
def test_step_beyond_the_next_state_gives_a_warning(changes: tuple[str, ...], message: str) -> None:
    reading = read_case(TAPERED.with_name("thermal.toml"), changes)
    assert not reading.problems
    lines = [line for line in reading.warnings if "output.every" in line]
    assert len(lines) == bool(message) and message in "".join(lines)


def test_values_of_an_accuracy_give_no_warning(capsys: pytest.CaptureFixture[str]) -> None:
    size = "thermal.time.adaptive={largest='1 s'}"
    counts = []
    for overrides, sizes in (((size,), ()), ((), (size,))):
        log.setup()
        try:
            case, _, problems = problems_of(TAPERED.with_name("thermal.toml"), overrides, sizes)
        finally:
            log.close()
        assert case is not None and not problems
        counts.append(capsys.readouterr().err.count("is cut to output.every"))
    assert counts == [1, 0]


def test_accuracy_reports_results_beyond_its_cells(
    capsys: pytest.CaptureFixture[str],
) -> None:
    log.setup()
    try:
        case, _, problems = problems_of(TAPERED, (), ("mesh.corner_size=2 mm",))
    finally:
        log.close()
    assert case is not None and not problems
    assert "--accuracy: mesh.corner_size: cells of 2 mm along a corner" in capsys.readouterr().err


def test_effective_keys_of_the_coupling_give_no_warning() -> None:
    for changes in (("coupling.passes=3", "coupling.window_error=3 K"), ("coupling.passes=1",)):
        assert not any("no effect" in line for line in _warnings(*changes))


@pytest.mark.parametrize(
    ("case", "changes"),
    [
        (SLABS / "bulging.toml", ()),
        (SLABS / "reference.toml", ()),
        (TAPERED.with_name("thermal.toml"), ("output.every=0.1 s", "thermal.time.adaptive={}")),
    ],
)
def test_resolved_case_gives_no_further_warnings(
    case: Path, changes: tuple[str, ...], tmp_path: Path
) -> None:
    """It has every key with its default, although the user has set none of them."""
    written = read_case(case, changes)
    (tmp_path / "case.toml").write_text(written.case.resolved_toml(), encoding="utf-8")
    again = read_case(tmp_path / "case.toml")
    assert len(again.warnings) == len(written.warnings)
