"""`castfem machine`: the table, what the rolls do, the picture, the place where all is solid."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from castfem.case import load_case
from castfem.cli.machine import draw_machine
from castfem.errors import InputError, RunFailure

CASES = Path(__file__).parents[2] / "cases"


def test_table_and_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    draw_machine(load_case(CASES / "slab1200" / "thermal.toml"), tmp_path / "m.png", "slab")
    told = capsys.readouterr().out
    assert "pairs of rolls   87, 14 of them driven with 1716.2 kN in all" in told
    assert "bending          2.322 to 4.11 m, rolls 8 to 15, R = 8.006 m of the extrados" in told
    assert "inclination      90 degrees at the end" in told
    rows = [line.split() for line in told.splitlines() if line[:4].strip().isdigit()]
    assert len(rows) == 87
    assert rows[7][:5] == ["8", "2.322", "250.0", "215", "35.0"]
    assert rows[49][5:8] == ["226.1", "8.400", rows[49][7]]
    assert (tmp_path / "m.png").stat().st_size > 20_000
    assert "solid" not in told


def test_where_the_strand_is_solid(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from castfem.output.summary import Quantity, Summary

    case, run = load_case(CASES / "slab1200" / "thermal.toml"), tmp_path / "run"
    run.mkdir()
    with pytest.raises(InputError, match=r"--run .*run: holds no run that has ended"):
        draw_machine(case, tmp_path / "m.png", "slab", run)
    for found, said in (
        ({"metallurgical_length": Quantity(20.4, "m", "metallurgical length")}, "below roll 68"),
        ({}, "not in this run"),
    ):
        empty = Summary(
            title="slab", status="finished", quantities=found, references=(), balances={},
            steps={}, wall_time={}, zones=(), mould_exit=0.8, unchecked=(),
        )  # fmt: skip
        (run / "summary.json").write_text(json.dumps(empty.to_json()))
        draw_machine(case, tmp_path / "m.png", "slab", run)
        assert said in capsys.readouterr().out


def test_a_billet_has_no_rolls(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"billet: machine: the table is missing"):
        draw_machine(load_case(CASES / "billet125" / "thermal.toml"), tmp_path / "m.png", "billet")


def test_check_tells_of_the_rolls() -> None:
    from castfem.cli.checking import check_case

    told = check_case("slab", CASES / "slab1200" / "thermal.toml", ())
    assert "  87 pairs of rolls, 0.87 to 26.4324 m" in told.splitlines()


def test_sprays_are_listed_and_drawn(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from castfem.plots import machine as picture

    drawn: list[list[object]] = []
    draw = picture._sprays
    monkeypatch.setattr(
        picture, "_sprays", lambda ax, side, sprays: (drawn.append(sprays), draw(ax, side, sprays))
    )
    draw_machine(load_case(CASES / "slab1200" / "sprays.toml"), tmp_path / "m.png", "slab")
    told = capsys.readouterr().out
    row = next(line for line in told.splitlines() if "bender" in line and "wide_face" in line)
    assert row.split()[-6:] == ["445", "0.193", "10.6", "600", "59.0", "63.2"]  # at 1.2 m/min
    (sprays,) = drawn
    # 66 gaps of which each has a row on both wide faces; the narrow ones are not seen.
    assert len(sprays) == 2 * 66
    first = sprays[0]
    assert isinstance(first, picture.Spray)
    assert (first.end - first.start, first.stand_off) == pytest.approx((0.04044, 0.21), abs=1e-5)


def test_nozzles_with_a_defect_are_listed_and_marked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from castfem.plots import machine as picture

    drawn: list[list[picture.Spray]] = []
    monkeypatch.setattr(picture, "_sprays", lambda ax, side, sprays: drawn.append(sprays))
    draw_machine(load_case(CASES / "slab1200" / "nozzles_47_52.toml"), tmp_path / "m.png", "slab")
    told = " ".join(capsys.readouterr().out.split())
    assert 'nozzles of "straightener" from roll 47 to 52 with 66 % of their water' in told
    assert re.search(r"straightener wide_face [^#]* 66 % of the water from roll 47 to 52", told)
    (sprays,) = drawn
    assert sum(spray.defect for spray in sprays) == 2 * 5  # gaps, on both wide faces


def test_how_the_drives_share_a_known_resistance(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = load_case(CASES / "slab1200" / "reference.toml")
    draw_machine(case, tmp_path / "m.png", "slab")
    told = capsys.readouterr().out
    rows = {line.split()[0]: line.split() for line in told.splitlines() if line.strip()[:1] == "#"}
    assert len(rows) == 14
    assert rows["#50"] == ["#50", "14.592", "61.21", "61.21", "72.37"]  # 7.38 t left
    assert "the rolls resist with 686.47 kN, the drives could take 1716.2 kN" in told
    assert "largest effort in the strand: 112.8 kN, at roll 55" in told
    assert (tmp_path / "m_extraction.png").stat().st_size > 20_000
    coupled = case.with_({"machine.extraction.resistance": "coupled"})
    draw_machine(coupled, tmp_path / "c.png", "slab")
    assert "resistance: coupled, from the forces of a run" in capsys.readouterr().out
    assert not (tmp_path / "c_extraction.png").exists()
    weak = case.with_(
        {"machine.extraction.resistance": {"position": ["1 m", "2 m"], "value": ["1 kN", "9 MN"]}}
    )
    with pytest.raises(RunFailure, match="the strand would stop: its rolls resist with 9000 kN"):
        draw_machine(weak, tmp_path / "w.png", "slab")
