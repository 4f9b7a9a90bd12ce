"""Strand and mould fitted to each other: the section at the meniscus, the ideal taper.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pandas as pd
import pytest

from castfem.base.errors import InputError, RunFailure
from castfem.cli import execute
from castfem.cli.mould import write_outline
from castfem.model import Case, load_case
from castfem.model.load import load
from castfem.model.mould_from_case import build_mould, nominal_mould
from castfem.model.wall_shape import WallShape, write_wall
from castfem.physics.mould import DisplacedMould
from castfem.studies.mould_fit.coupled import AGREEMENT, Turn, drawing, flux_of, hot_mould_of
from castfem.studies.mould_fit.follow import follow
from castfem.studies.mould_fit.ideal_taper import strand_sizes
from castfem.studies.mould_fit.meniscus_outline import (
    LIMITS,
    Attempt,
    SectionLimits,
    find_section,
    natural_wall,
    outline_of,
    sides_of_section,
)
from castfem.studies.optimisation import Evaluation
from castfem.studies.optimisation.problem import DesignProblem

from .coarse import CASES, COARSE, coarse

AT = 0.2


def billet(*changes: str) -> Case:
    return coarse("idealised", *changes)


@pytest.fixture(scope="module")
def attempts() -> list[Attempt]:
    return find_section(billet(), MPI.COMM_SELF, "case", AT)


def test_square_is_reached_in_a_few_runs(attempts: list[Attempt]) -> None:
    assert 2 <= len(attempts) <= 6
    assert attempts[0].worst > 10.0 * LIMITS.close and attempts[-1].worst <= LIMITS.close
    assert not attempts[0].start.offset.any()
    # The outline at the meniscus compensates the deviation of the first run.
    remaining = attempts[-1].start.offset + attempts[0].end.offset
    assert np.abs(remaining).max() < 0.1 * attempts[0].worst


def test_run_with_the_written_outline_ends_square(attempts: list[Attempt], tmp_path: Path) -> None:
    """A new case with the written outline has the specified width and diagonal at the end."""
    write_outline(tmp_path / "outline.csv", attempts[-1].start, "found")
    lines = "\n".join(f"{key} = \"{value}\"" for key, value in {
        "surface_size": "3 mm", "corner_size": "3 mm", "face_size": "12 mm", "core_size": "16 mm",
    }.items())  # fmt: skip
    (tmp_path / "case.toml").write_text(
        f'title = "forward"\nextends = "{CASES}/idealised.toml"\n'
        f'[casting]\nlength = "200 mm"\n[mesh]\n{lines}\n[coupling]\ninterval = "0.5 s"\n'
        '[section]\nbulge = { file = "outline.csv" }\n'
    )
    case = load_case(tmp_path / "case.toml")
    found = follow(case, MPI.COMM_SELF)
    sides = sides_of_section(case.section)  # type: ignore[arg-type]
    end = outline_of(found.outline[-1], found.line.place, attempts[-1].start, sides)
    assert np.abs(end.offset).max() <= LIMITS.close
    assert found.value("size_mid_face") == pytest.approx(0.125, abs=2.0 * LIMITS.close)
    diagonal = np.sqrt(2.0) * (0.125 - 0.01) + 0.01
    assert found.value("size_corner") == pytest.approx(diagonal, abs=2.0 * LIMITS.close)
    again = load_case_of(case, tmp_path)
    assert again.physics_hash() == case.physics_hash()
    plain = follow(billet(f"casting.length={AT} m"), MPI.COMM_SELF)
    assert abs(plain.value("size_mid_face") - 0.125) > 5.0 * LIMITS.close


def load_case_of(case: Case, folder: Path) -> Case:
    (folder / "again.toml").write_text(case.resolved_toml())
    return load_case(folder / "again.toml")


def test_written_wall_follows_the_strand(attempts: list[Attempt], tmp_path: Path) -> None:
    """The strand touches the wall read back, all round and all along."""
    case = billet()
    sides = sides_of_section(case.section)  # type: ignore[arg-type]
    wall = natural_wall(attempts[-1], sides)
    write_wall(tmp_path / "wall.csv", wall, "natural")
    assert WallShape().read({"file": str(tmp_path / "wall.csv")}).moved == pytest.approx(
        wall.moved, abs=1e-11
    )
    changes = {
        "casting.length": f"{AT} m",
        "mould.length": f"{AT} m",
        "mould.displacement": WallShape().write(wall),
        "section.bulge": {
            "way": attempts[-1].start.ways.tolist(), "way_unit": "m",
            "value": attempts[-1].start.offset.tolist(), "unit": "m",
        },
    }  # fmt: skip
    run = case.with_(changes)
    assert run.mould is not None
    mould = build_mould(run.mould, run.section)
    assert isinstance(mould, DisplacedMould)
    strand = attempts[-1].strand
    tangent = np.gradient(strand.outline[-1], axis=0)
    normals = np.stack([tangent[:, 1], -tangent[:, 0]], 1) / np.hypot(*tangent.T)[:, None]
    gap = mould.gap_function(strand.outline[-1], normals, AT).gap
    assert np.abs(gap).max() < 5e-6
    middle = len(strand.positions) // 2
    gap = mould.gap_function(strand.outline[middle], normals, strand.positions[middle]).gap
    assert np.abs(gap).max() < 15e-6


def test_bulge_in_an_unshaped_mould_is_rejected() -> None:
    with pytest.raises(InputError, match=r"section\.bulge: the cavity must have"):
        load_case(CASES / "taper_1.toml", ("section.bulge=0.1 mm",))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("thermal", "mechanics: the table is missing"),
        ("taper_1", "mould: the outline is computed in an idealised mould"),
    ],
)
def test_unsuitable_cases_are_rejected(name: str, words: str) -> None:
    with pytest.raises(InputError, match=rf"^mine: {words}"):
        find_section(load_case(CASES / f"{name}.toml"), MPI.COMM_SELF, "mine")


def test_unreached_section_is_reported_with_its_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("castfem.studies.mould_fit.meniscus_outline.LIMITS", SectionLimits(runs=1))
    with pytest.raises(RunFailure, match=r"mine: after 1 runs the section is still \d+ um off"):
        find_section(billet(), MPI.COMM_SELF, "mine", 0.06)


def test_section_command_writes_its_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    words = [part for change in COARSE for part in ("--set", change)]
    status = execute(["section", "billet125/idealised", "--at", "60 mm", *words])
    out = capsys.readouterr().out
    assert status == 0 and "run 1:" in out and "way round [mm]" in out
    assert (tmp_path / "idealised_section.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "idealised_section_outline.csv").is_file()
    wall = WallShape().read({"file": str(tmp_path / "idealised_section_wall.csv")})
    assert wall.positions[-1] == pytest.approx(0.06)
    assert execute(["section", "billet125/idealised", "--at", "60 K"]) == 1
    assert "--at 60 K:" in capsys.readouterr().err


# The start of a search for tapers: (302) and (303) of [Pascon2003], for each kind of taper.


WIDE, DIAGONAL = 125.0, 2.0**0.5 * 115.0 + 10.0  # mm


def strand(folder: Path) -> Path:
    """Write the history of a strand that bulges to 125.4 mm.

    Its diagonal contracts to 172.18 mm, from 125 mm below the meniscus on.
    """
    z = np.linspace(0.0, 0.6, 121)
    corner = DIAGONAL - (DIAGONAL - 172.18) * np.maximum(z - 0.125, 0.0) / 0.475
    history = pd.DataFrame({
        "time [s]": z / 0.06, "position [m]": z, "size_mid_face [mm]": WIDE + 0.4 * z / 0.6,
        "size_narrow_face [mm]": WIDE + 0.4 * z / 0.6, "size_corner [mm]": corner,
    })  # fmt: skip
    history.to_csv(folder / "history.csv", index=False)
    return folder


def start(taper: Any, keys: list[str], folder: Path) -> np.ndarray:
    variables = [{"key": f"mould.taper{key}", "range": ["-2 %/m", "2 %/m"]} for key in keys]
    case = load("billet125/taper_1").with_({
        "mould.taper": taper,
        "optimise": {"minimise": "von_mises_max", "variable": variables},
    })  # fmt: skip
    found = DesignProblem(case).start(Evaluation(folder=strand(folder)))
    return -2.0 + 4.0 * found


def test_start_has_the_tapers_of_the_thesis(tmp_path):
    taper = {"face": "0.1 %/m", "corner": [
        {"to": "125 mm", "taper": "0.1 %/m"}, {"taper": "0.1 %/m"},
    ]}  # fmt: skip
    found = start(taper, [".face", ".corner.0.taper", ".corner.1.taper"], tmp_path)
    second = 100.0 * (DIAGONAL - 172.18) / (172.18 * 0.475)
    assert found == pytest.approx([-100.0 * 0.4 / (125.4 * 0.6), 0.0, second], abs=0.01)


def test_single_taper_starts_from_the_corner(tmp_path):
    """It is the straight line that fits the diagonal; by the face the taper would be negative."""
    (found,) = start("1 %/m", [""], tmp_path)
    z = np.linspace(0.0, 0.6, 25)
    drawn = (DIAGONAL - 172.18) * np.maximum(z - 0.125, 0.0) / 0.475
    slope = float(z @ drawn / (z @ z)) / 172.18 * 100.0
    assert found == pytest.approx(slope, abs=0.01)


def test_parabolic_taper_starts_flat(tmp_path):
    top, end = start({"top": "1 %/m", "exit": "0.4 %/m"}, [".top", ".exit"], tmp_path)
    assert top < end


def test_start_is_limited_to_the_range(tmp_path):
    taper = {"face": "0 %/m", "corner": "0 %/m"}
    case = load("billet125/taper_1").with_({
        "mould.taper": taper,
        "optimise": {"minimise": "von_mises_max", "variable": [
            {"key": "mould.taper.face", "range": ["0 %/m", "1 %/m"]},
            {"key": "mould.taper.corner", "range": ["0 %/m", "1 %/m"], "start": "0.3 %/m"},
        ]},
    })  # fmt: skip
    found = DesignProblem(case).start(Evaluation(folder=strand(tmp_path)))
    assert found == pytest.approx([0.0, 0.3])


@pytest.mark.parametrize("name", ["single", "double", "parabolic", "corner", "double_corner"])
def test_shipped_optimisations_start_within_their_ranges(name: str, tmp_path: Path):
    problem = DesignProblem(load(f"billet125/optimum_{name}"))
    assert problem.needs_ideal
    found = problem.start(Evaluation(folder=strand(tmp_path)))
    assert np.all((found > 0.0) & (found < 1.0))
    best = problem.case.with_(problem.changes(problem.request(found)))
    assert best.mould is not None
    assert best.optimise == problem.case.optimise


def test_width_and_height_of_a_bloom_start_separately(tmp_path: Path) -> None:
    """Each starts from its own face; a single taper from the displacement of the corner."""
    z = np.linspace(0.0, 0.6, 121)
    half = {"x": 0.1 * z / 0.6, "y": 0.3 * z / 0.6}  # contraction of each side, mm
    pd.DataFrame({
        "time [s]": z / 0.06, "position [m]": z, "size_mid_face [mm]": 100.0 - 2.0 * half["y"],
        "size_narrow_face [mm]": 200.0 - 2.0 * half["x"],
        "displacement_corner [mm]": -0.6 / 0.6 * z,
    }).to_csv(tmp_path / "history.csv", index=False)  # fmt: skip

    def start_of(taper: Any, *keys: str) -> np.ndarray:
        case = load("billet125/taper_1").with_({
            "section.width": "200 mm", "section.height": "100 mm", "mould.taper": taper,
            "optimise": {"minimise": "von_mises_max", "variable": [
                {"key": f"mould.taper{key}", "range": ["-2 %/m", "2 %/m"]} for key in keys
            ]},
        })  # fmt: skip
        return -2.0 + 4.0 * DesignProblem(case).start(Evaluation(folder=tmp_path))

    width, height = start_of(
        {"narrow_face": "0 %/m", "wide_face": "0 %/m"}, ".narrow_face", ".wide_face"
    )
    assert width == pytest.approx(100.0 * 0.2 / (199.8 * 0.6), rel=1e-3)
    assert height == pytest.approx(100.0 * 0.6 / (99.4 * 0.6), rel=5e-3)
    (both,) = start_of("1 %/m", "")
    long, moved = np.hypot(190.0, 90.0) + 10.0, 2.0 * 0.6 * np.hypot(200, 100) * 2.0**0.5 / 300.0
    assert both == pytest.approx(100.0 * moved / ((long - moved) * 0.6), rel=0.01)


def test_web_of_a_beam_blank_is_not_its_height(tmp_path: Path) -> None:
    z = np.linspace(0.0, 0.6, 13)
    history = pd.DataFrame(
        {"position": z, "size_mid_face": 90.0 + z, "size_narrow_face": 380.0 - z}
    )
    cavity = {"width": 0.38, "height": 0.26}
    ((name, width),) = strand_sizes(history, z, cavity).items()
    assert name == "width" and width == pytest.approx(0.38 - 1e-3 * z)
    ((name, _),) = strand_sizes(history, z, {"diameter": 0.09}).items()
    assert name == "diameter"


# Iterations between strand and hot mould: they converge, and their heat is consistent.


TUBE = (
    "casting.length=200 mm",
    "mould.length=200 mm",
    "mould.tube.thickness=10 mm",
    "mould.tube.cell_size=40 mm",
    "mould.tube.cells_across=1",
)


COLD = (
    "mould.condition=cold",
    "mould.wall_temperature=160 degC",
    "cooling.mould.surface.0.wall=mould",
)


def strained_billet(*changes: str) -> Case:
    return coarse("taper_1", *TUBE, *changes)


@pytest.fixture(scope="module")
def turns() -> list[Turn]:
    return hot_mould_of(coarse("hot", *TUBE), MPI.COMM_SELF, "case", turns=8)


def test_shipped_hot_case_is_the_billet_in_a_cold_mould() -> None:
    """It differs only in its mould and in the wall temperature of the cooling."""
    hot, same = load_case(CASES / "hot.toml"), coarse("taper_1", *COLD)
    assert hot.mould is not None and same.mould is not None and hot.mould.tube is not None
    assert hot.mould.model_copy(update={"tube": None}) == same.mould
    assert hot.cooling[0] == same.cooling[0]
    assert hot.mould.tube.thickness == 0.01 and hot.mould.tube.support == "hung"


def test_cold_mould_requires_the_wall_temperature() -> None:
    with pytest.raises(InputError, match=r"a cold mould needs its temperature at work: wall_temp"):
        strained_billet("mould.condition=cold")


def test_flux_of_a_run_is_the_heat_it_removes() -> None:
    case = strained_billet()
    strand = follow(case, MPI.COMM_SELF)
    assert strand.positions[0] == 0.0 and strand.positions[-1] == pytest.approx(0.2)
    assert case.mould is not None
    flux = flux_of(strand, nominal_mould(case.mould, case.section))
    # The heat of the run is per metre of strand; the flux is the power of the quarter.
    power = strand.value("heat_removed") * 0.06
    assert 4.0 * flux.heat(np.linspace(0.0, 0.2, 81)) == pytest.approx(power, rel=0.04)
    assert strand.outline.shape == (*strand.flux.shape, 2)
    assert strand.outline[0] == pytest.approx(strand.line.place)
    assert 1e-5 < np.abs(strand.outline[-1] - strand.line.place).max() < 1e-3


def test_strand_and_mould_converge_in_a_few_iterations(turns: list[Turn]) -> None:
    assert 3 <= len(turns) <= 6
    assert turns[-1].moved < AGREEMENT.shape and abs(turns[-1].heat) < AGREEMENT.heat
    assert turns[1].moved > turns[-1].moved
    assert all(turn.strand is not None for turn in turns)


def test_last_run_uses_the_hot_wall(turns: list[Turn]) -> None:
    """The last run has the wall and the wall temperature of the iteration before."""
    last, before = turns[-1].strand, turns[-2].wall
    hot = last.flux[-1]
    coefficient = 1600.0
    # At mid-face, in contact, more heat flows if the wall is colder than 160 degC.
    first = turns[0].strand
    wall = float(np.interp(last.positions[-1], *before.profile()))
    change = hot[0] / first.flux[-1][0] - 1.0
    assert np.sign(change) == np.sign(433.15 - wall)
    assert abs(change) < coefficient * abs(433.15 - wall) / first.flux[-1].max() + 0.02


def test_cold_mould_has_the_strand_size_at_the_meniscus(turns: list[Turn]) -> None:
    case = strained_billet("mould.condition=cold", "mould.wall_temperature=160 degC")
    assert case.mould is not None
    nominal = nominal_mould(case.mould, case.section)
    found = drawing(case.mould, nominal, turns[-1].wall)
    assert found.hot.dimensions(0.0)["width"] == pytest.approx(0.125)
    assert found.cold.dimensions(0.0)["width"] < 0.12495
    difference = found.hot.dimensions(0.15)["width"] - found.cold.dimensions(0.15)["width"]
    heat = turns[-1].wall.displacement.at(0.15)[0, 0]
    assert difference == pytest.approx(2.0 * heat, abs=1e-9)
    assert found.displacement is not None
    run = case.with_({"mould.displacement": _columns(found.displacement)})
    assert run.mould is not None
    assert build_mould(run.mould, run.section).dimensions(0.15) == found.hot.dimensions(0.15)


def _columns(wall: object) -> object:
    from castfem.model.wall_shape import WallShape

    return WallShape().write(wall)  # type: ignore[arg-type]


def test_case_without_a_tube_is_rejected() -> None:
    case = load_case(CASES / "taper_1.toml")
    with pytest.raises(InputError, match=r"^mine: mould.tube: the table is missing"):
        hot_mould_of(case, MPI.COMM_SELF, "mine")


def test_prescribed_flux_needs_no_strand() -> None:
    case = strained_billet("mould.tube.flux=2 MW/m^2")
    (turn,) = hot_mould_of(case, MPI.COMM_SELF, "case", turns=5)
    assert turn.strand is None and turn.wall.heated.supplied > 0.0
