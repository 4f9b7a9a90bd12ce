"""The section that comes out as it is wanted: found, written, and run forward."""

from __future__ import annotations

from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from castfem.base.errors import InputError, RunFailure
from castfem.cli import execute
from castfem.cli.mould import write_outline
from castfem.model import Case, load_case
from castfem.model.build_mould import build_mould
from castfem.model.wall_shape import WallShape, write_wall
from castfem.physics.mould import DisplacedMould
from castfem.studies.mould_fit.follow import follow
from castfem.studies.mould_fit.section import (
    LIMITS,
    Attempt,
    SectionLimits,
    find_section,
    natural_wall,
    outline_of,
    sides_of_section,
)

from .coarse import CASES, COARSE, coarse

AT = 0.2


def billet(*changes: str) -> Case:
    return coarse("idealised", *changes)


@pytest.fixture(scope="module")
def attempts() -> list[Attempt]:
    return find_section(billet(), MPI.COMM_SELF, "case", AT)


def test_square_is_found_in_a_few_runs(attempts: list[Attempt]) -> None:
    assert 2 <= len(attempts) <= 6
    assert attempts[0].worst > 10.0 * LIMITS.close and attempts[-1].worst <= LIMITS.close
    assert not attempts[0].start.offset.any()
    # What stood out in the first run is taken back at the meniscus.
    taken = attempts[-1].start.offset + attempts[0].end.offset
    assert np.abs(taken).max() < 0.1 * attempts[0].worst


def test_forward_run_of_the_written_outline(attempts: list[Attempt], tmp_path: Path) -> None:
    """A case of its own, of what stands in the file: width and diagonal at the end are wanted."""
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


def test_wall_that_follows_the_strand(attempts: list[Attempt], tmp_path: Path) -> None:
    """Read back it is a mould that the strand touches all round, all the way."""
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


def test_bulge_without_a_wall_of_its_shape_is_refused() -> None:
    with pytest.raises(InputError, match=r"section\.bulge: the cavity must have"):
        load_case(CASES / "taper_1.toml", ("section.bulge=0.1 mm",))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("thermal", "mechanics: the table is missing"),
        ("taper_1", "mould: the outline is looked for in an idealised mould"),
    ],
)
def test_cases_that_cannot_be_asked(name: str, words: str) -> None:
    with pytest.raises(InputError, match=rf"^mine: {words}"):
        find_section(load_case(CASES / f"{name}.toml"), MPI.COMM_SELF, "mine")


def test_section_that_cannot_be_had_says_how_far_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("castfem.studies.mould_fit.section.LIMITS", SectionLimits(runs=1))
    with pytest.raises(RunFailure, match=r"mine: after 1 runs the section is still \d+ um off"):
        find_section(billet(), MPI.COMM_SELF, "mine", 0.06)


def test_command_finds_writes_and_draws(
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
