"""Output of `castfem check` on a valid case before its run: given heat, written fields."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from castfem import run
from castfem.base.errors import InputError
from castfem.cli.checking import check_case, describe
from castfem.cli.drawing import build_mesh
from castfem.model.casting import MOST_STATES, usual_interval
from castfem.physics.constitutive import available_laws
from castfem.physics.materials import load_steel
from castfem.post.report.show import slow_output
from castfem.runs.output.run_record import RunRecord
from tests.small_case import small, strip

if TYPE_CHECKING:
    from castfem.model import Case


FLUX = {"law": "contact", "wall": "160 degC", "flux": "2 MW/m^2"}
CORNER = "the same flux everywhere round the section"


def lines_on(case: Case) -> list[str]:
    """Return the lines on a case, stripped."""
    found = describe("small", case, load_steel("carbon_042"), build_mesh(case))
    return [line.strip() for line in found.splitlines()]


def mould(*laws: dict[str, Any], **more: Any) -> Case:
    """Return a billet of 100 mm, corners of 5 mm, in a mould of 60 mm with these laws."""
    return small({"cooling": [{"name": "mould", "to": "60 mm", "surface": list(laws)}], **more})


def test_given_flux_is_shown_in_kw_and_with_published_ones() -> None:
    found = lines_on(mould(FLUX))
    (line,) = (one for one in found if one.startswith("mould: "))
    perimeter = 0.4 - 0.01 * (4.0 - 3.14159)  # of the full billet, slightly less by its chords
    power = re.fullmatch(r"mould: ([\d.]+) kW in all without a gap, 2 MW/m\^2 on average", line)
    assert power and float(power[1]) == pytest.approx(2e3 * 0.06 * perimeter, rel=3e-3)
    usual = found[found.index(line) + 1]
    # 1 s in the mould: the mean of 2.68 - 0.335 sqrt(t), and of 5 - 0.2444 t
    assert "savage_pritchard 2.46, brimacombe 2.52, li_thomas 4.88" in usual
    assert not any("check numbers and units" in one for one in found)


def test_heat_of_the_water_is_the_total() -> None:
    water = FLUX | {"water": "1000 L/min", "water_rise": "6 K"}
    (line,) = (one for one in lines_on(mould(water)) if one.startswith("mould: "))
    assert line.startswith("mould: 417 kW in all")


@pytest.mark.parametrize(("flux", "far"), [("9 MW/m^2", False), ("2 kW/m^2", True)])
def test_flux_in_a_wrong_unit_is_reported(flux: str, far: bool) -> None:
    assert (
        any("check numbers and units" in one for one in lines_on(mould(FLUX | {"flux": flux})))
        == far
    )


def test_each_face_and_fluxes_below_a_gap() -> None:
    """Faces have own lines; a flux only on corners, or lowered by a gap, is no even flux."""
    faces = FLUX | {"on": ["wide_face", "narrow_face"]}
    corner = FLUX | {"on": ["corner"], "flux": "1 MW/m^2"}
    found = lines_on(mould(faces, corner))
    assert sum(one.startswith("mould on corner: ") for one in found) == 1
    assert not any(CORNER in one for one in found)
    assert any(CORNER in one for one in lines_on(mould(FLUX)))
    apart = FLUX | {"gap": "0.1 mm", "gap_conductivity": "0.15 W/(m K)"}
    assert not any(CORNER in one for one in lines_on(mould(apart)))
    assert not any(CORNER in one or " kW in all" in one for one in lines_on(small()))
    # the strip is 2 mm wide: 1 MW/m2 on 2 mm over 10 mm
    assert any(one.startswith("chill: 0.02 kW in all, 1 MW/m^2") for one in lines_on(strip()))


@pytest.mark.parametrize(
    ("duration", "every"),
    [(10.0, 0.5), (125.0, 0.5), (125.1, 1.0), (385.7, 2.0), (1e3, 5.0), (2500.0, 10.0)],
)
def test_long_runs_write_fields_less_often(duration: float, every: float) -> None:
    assert usual_interval(duration) == pytest.approx(every)
    assert duration / usual_interval(duration) <= MOST_STATES * (1 + 1e-9)


def test_case_of_a_run_keeps_its_interval() -> None:
    """It remains after any later change; a given value is kept."""
    long = {"output": {"figures": False}, "casting.length": "20 m", "casting.speed": "3 m/min"}
    case = small(long)
    assert case.output_every == 2.0 and case.document()["output"]["every"] == "2 s"
    assert case.with_({"casting.length": "60 mm"}).output_every == 2.0
    assert small(long | {"output": {"every": "0.1 s"}}).output_every == pytest.approx(0.1)
    assert small({"output": {}}).output_every == 0.5


def test_states_and_their_size_are_those_on_disk(tmp_path: Path) -> None:
    case = small({"output.every": "0.02 s", "casting.length": "30 mm"})
    run(case, tmp_path / "out")
    (line,) = (one for one in lines_on(case) if one.startswith("fields: "))
    assert line.startswith("fields: 26 states, 0.02 s apart, about ")
    size = sum((tmp_path / "out" / name).stat().st_size for name in ("fields.h5", "fields.xdmf"))
    assert float(line.split()[-2]) == pytest.approx(1e-6 * size, rel=0.3)
    assert not any(one.startswith("fields") for one in lines_on(small({"output": {"fields": []}})))


@pytest.mark.parametrize(("output", "reported"), [(40.0, True), (4.0, False), (10.0, False)])
def test_run_that_mostly_writes_gets_advice(output: float, reported: bool) -> None:
    record = RunRecord(wall_time={"petsc": 40.0 if output > 4.0 else 1.0, "output": output})
    text = slow_output(record)
    assert bool(text) == reported
    assert not reported or (text.startswith("50%") and "output.every" in text)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("optimise.minimise=bloom_max", "optimise.minimise: ("),
        ("optimise.minimise=way_I1_max", 'optimise.minimise: ("way_I1_max") '),  # has no [quality]
        ("optimise.fidelity=coarse", ""),
    ],
)
def test_search_is_checked_with_its_case(tmp_path: Path, change: str, message: str) -> None:
    """Keys that the case lacks, and results that no run of it has, are found without a run."""
    file = tmp_path / "case.toml"
    file.write_text('extends = "billet125/optimum_single"\n')
    if message:
        with pytest.raises(InputError) as caught:
            check_case("case", file, [change])
        assert any(message in line for line in caught.value.problems)
    else:
        assert "case: valid" in check_case("case", file, [change])
    mistyped = '[[optimise.variable]]\nkey = "mould.tapr"\nrange = ["0 %/m", "3 %/m"]\n'
    file.write_text(file.read_text() + mistyped)
    with pytest.raises(InputError, match=r"mould\.tapr: unknown key"):
        check_case("case", file, ["optimise.fidelity=coarse"])


# `castfem check` and `castfem run` on the mechanical tables of a case: one-line messages


ALL_LAWS = "one of " + ", ".join(available_laws())


@pytest.mark.parametrize(
    ("assignment", "message"),
    [
        ("mechanics.law=norton_hof", 'mechanics.law: "norton_hof" not found; ' + ALL_LAWS),
        ("mechanics.law=elastic_steel", 'mechanics.law: "elastic_steel" holds none; ' + ALL_LAWS),
        ("mechanics.law=./soft.toml", 'mechanics.law: "soft.toml": file not found; did you mean'),
        ("mechanics.law=./sift.toml", "sift.toml: law: is missing; one of thermo_elastic"),
        ("mechanics.elasticity=elastic", 'mechanics.elasticity: "elastic" not found; one of'),
        ("mechanics.elasticity=./sift.toml", "sift.toml: young: is missing; the Young's modulus"),
    ],
)
def test_law_of_the_slice_is_checked(castfem, assignment: str, message: str) -> None:
    Path("sift.toml").write_text("poisson = 0.3\n", encoding="utf-8")
    for command in ("check", "run"):
        outcome = castfem(command, "billet125/idealised", "--set", assignment)
        assert outcome.status == 1
        assert message in outcome.err
        assert outcome.err.count("\n") == 1
        assert outcome.err.startswith("castfem: --set: mechanics.")
    assert not Path("results").exists()


def test_required_data_of_the_steel_are_checked(castfem) -> None:
    radiation = 'cooling=[{name = "air", surface = [{law = "radiation", ambient = "25 degC"}]}]'
    missing = {
        "steel.name: copper has no thermal_expansion, which [mechanics] needs": (),
        'cooling.0.surface.0.emissivity (zone "air"): steel copper has no': ("--set", radiation),
    }
    for command in ("check", "run"):
        words = ("--set", "steel.name=copper", *(one for more in missing.values() for one in more))
        outcome = castfem(command, "billet125/taper_1", *words)
        assert outcome.status == 1
        for line in missing:
            assert f"--set: {line}" in outcome.err
    assert not Path("results").exists()
    given = ("--set", 'steel.overrides.thermal_expansion="1.7e-5 1/K"')
    assert castfem("check", "billet125/taper_1", "--set", "steel.name=copper", *given).status == 0


def test_sprays_need_the_emissivity_of_the_steel(castfem) -> None:
    outcome = castfem("check", "slab1200/sprays", "--set", "steel.name=copper")
    assert outcome.status == 1
    assert "secondary.emissivity: " in outcome.err
