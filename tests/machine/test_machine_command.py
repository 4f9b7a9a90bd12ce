"""`castfem machine`: tables of rolls, drives and sprays, the picture, the solid position."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from castfem.base.errors import InputError, RunFailure
from castfem.base.shown_quantity import Quantity
from castfem.cli.machine import draw_machine
from castfem.model import Case, load_case
from castfem.physics.machine.extraction.effort import Passing
from castfem.physics.machine.rolls import Pair, Rolls
from castfem.runs.output.summary_file import Summary

CASES = Path(__file__).parents[2] / "cases"


def test_table_and_picture_are_made(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    draw_machine(load_case(CASES / "slab1200" / "thermal.toml"), tmp_path / "m.png", "slab")
    out = capsys.readouterr().out
    assert "pairs of rolls   87, 14 of them driven with 1716.2 kN in all" in out
    assert "bending          2.322 to 4.11 m, rolls 8 to 15, R = 8.006 m of the extrados" in out
    assert "inclination      90 degrees at the end" in out
    rows = [line.split() for line in out.splitlines() if line[:4].strip().isdigit()]
    assert len(rows) == 87
    assert rows[7][:5] == ["8", "2.322", "250.0", "215", "35.0"]
    assert rows[49][5:8] == ["226.1", "8.400", rows[49][7]]
    assert (tmp_path / "m.png").stat().st_size > 20_000
    assert "solid" not in out


def run_of(folder: Path, case: Case, **found: float) -> Path:
    folder.mkdir(exist_ok=True)
    quantities = {name: Quantity(value, "m", name) for name, value in found.items()}
    summary = Summary(
        title="slab", status="finished", quantities=quantities, references=(), balances={},
        steps={}, wall_time={}, zones=(), mould_exit=0.8, unchecked=(),
    )  # fmt: skip
    (folder / "summary.json").write_text(json.dumps(summary.to_json()))
    (folder / "case.toml").write_text(case.resolved_toml())
    return folder


def test_solid_position_of_a_run_is_printed_and_marked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from castfem.post.plots import machine as picture

    marks: list[list[tuple[float, str]]] = []
    monkeypatch.setattr(picture, "_marks", lambda ax, side, drawn: marks.append(list(drawn)))
    case, run = load_case(CASES / "slab1200" / "thermal.toml"), tmp_path / "run"
    run.mkdir()
    with pytest.raises(InputError, match=r"--run .*run: holds no finished run"):
        draw_machine(case, tmp_path / "m.png", "slab", run)
    end, unfinished = {"position": 20.5}, "not down to 20.5 m, where the run ends; liquid to"
    for found, text, marked in (
        ({"metallurgical_length": 20.4}, "below roll 68", ["solid at 20.4 m"]),
        ({"liquid_end": 19.0}, f"{unfinished} 19 m", ["liquid to 19 m", "not solid at 20.5 m"]),
        ({}, f"{unfinished} there", ["not solid at 20.5 m"]),
    ):
        draw_machine(case, tmp_path / "m.png", "slab", run_of(run, case, **found, **end))
        assert text in capsys.readouterr().out
        assert [words for _, words in marks.pop()] == marked


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"machine.defect": [{"kind": "lost", "roll": 48}]}, "roll 48 is lost, in the case in ord"),
        ({"machine": {"first": "0.9 m", "segment": [
            {"rolls": 9, "pitch": "0.3 m", "diameter": "0.2 m"}]}}, "it has 9 pairs of rolls, the "
         "case 87"),
        ({"machine": None}, "it has no rolls"),
        ({"title": "another"}, ""),
    ],
)  # fmt: skip
def test_run_with_another_machine_is_rejected(
    change: dict[str, Any], message: str, tmp_path: Path
) -> None:
    case = load_case(CASES / "slab1200" / "thermal.toml")
    run, picture = run_of(tmp_path / "run", case.with_(change), position=20.0), tmp_path / "m.png"
    if not message:
        draw_machine(case, picture, "slab", run)
        return
    with pytest.raises(InputError, match=f"run: the run has another machine: .*{message}"):
        draw_machine(case, picture, "slab", run)


def test_drives_of_a_coupled_run_are_printed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Here the history is that of a curve with known shares, down to #56, and includes #55.

    The slice has the complete pull of a drive at the pair below the drive.
    """
    from castfem.model.machine_from_case import known_resistance

    case = load_case(CASES / "slab1200" / "reference.toml")
    known, pairs = known_resistance(case.machine.extraction, case.machine), case.machine.pairs()
    at = [pair.position for pair in pairs.pairs[:56]]
    states = [known.after(known.initial(0.0), s, Passing(0.0, 0.0, np.zeros(0))) for s in at]
    rows = [
        f"{50.0 * s},{s},{1e-3 * one.resistance},{1e-3 * one.drives},{1e-3 * one.effort}"
        for s, one in zip(at, states, strict=True)
    ]
    head = "time [s],position [m],roll_resistance [kN],drive_force [kN],effort [kN]"
    coupled = case.with_({"machine.extraction.resistance": "coupled"})
    run = run_of(tmp_path / "run", coupled, position=at[-1])
    (run / "history.csv").write_text("\n".join([head, *rows]) + "\n")
    draw_machine(coupled, tmp_path / "m.png", "slab", run)
    out = capsys.readouterr().out
    cells = {line.split()[0]: line.split() for line in out.splitlines() if line.strip()[:1] == "#"}
    assert len(cells) == 14
    assert cells["#50"] == ["#50", "14.592", "61.21", "61.21", "72.37"]  # as with the curve
    assert len(cells["#55"]) == 5 and float(cells["#55"][3]) > 0.0
    assert cells["#60"] == ["#60", f"{pairs.pairs[59].position:.3f}"]  # not reached by the run
    assert (
        f"down to {at[-1]:.4g} m the rolls resist with {1e-3 * known.steps[:56].sum():.5g}" in out
    )


def test_case_without_rolls_is_rejected(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"billet: machine: the table is missing"):
        draw_machine(load_case(CASES / "billet125" / "thermal.toml"), tmp_path / "m.png", "billet")


def test_sprays_are_listed_and_drawn(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from castfem.post.plots import machine as picture

    drawn: list[list[object]] = []
    draw = picture._sprays
    monkeypatch.setattr(
        picture, "_sprays", lambda ax, side, sprays: (drawn.append(sprays), draw(ax, side, sprays))
    )
    draw_machine(load_case(CASES / "slab1200" / "sprays.toml"), tmp_path / "m.png", "slab")
    out = capsys.readouterr().out
    row = next(line for line in out.splitlines() if "bender" in line and "wide_face" in line)
    assert row.split()[-6:] == ["445", "0.193", "10.6", "600", "59.0", "63.2"]  # at 1.2 m/min
    (sprays,) = drawn
    # Each of 66 gaps has a row on both wide faces; rows on the narrow faces are not drawn.
    assert len(sprays) == 2 * 66
    first = sprays[0]
    assert isinstance(first, picture.Spray)
    assert (first.end - first.start, first.stand_off) == pytest.approx((0.04044, 0.21), abs=1e-5)


def test_shares_of_the_drives_are_printed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = load_case(CASES / "slab1200" / "reference.toml")
    draw_machine(case, tmp_path / "m.png", "slab")
    out = capsys.readouterr().out
    rows = {line.split()[0]: line.split() for line in out.splitlines() if line.strip()[:1] == "#"}
    assert len(rows) == 14
    assert rows["#50"] == ["#50", "14.592", "61.21", "61.21", "72.37"]  # 7.38 t left
    assert "the rolls resist with 686.47 kN, the drives could take 1716.2 kN" in out
    assert "largest effort in the strand: 112.8 kN, at roll 55" in out
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


def test_check_prints_the_rolls() -> None:
    from castfem.cli.checking import check_case

    out = check_case("slab", CASES / "slab1200" / "thermal.toml", ())
    assert "  87 pairs of rolls, 0.87 to 26.4324 m" in out.splitlines()


def test_nozzles_with_a_defect_are_listed_and_marked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from castfem.post.plots import machine as picture

    drawn: list[list[picture.Spray]] = []
    monkeypatch.setattr(picture, "_sprays", lambda ax, side, sprays: drawn.append(sprays))
    draw_machine(load_case(CASES / "slab1200" / "nozzles_47_52.toml"), tmp_path / "m.png", "slab")
    out = " ".join(capsys.readouterr().out.split())
    assert 'nozzles of "straightener" from roll 47 to 52 with 66 % of their water' in out
    assert re.search(r"straightener wide_face [^#]* 66 % of the water from roll 47 to 52", out)
    (sprays,) = drawn
    assert sum(spray.defect for spray in sprays) == 2 * 5  # gaps, on both wide faces


def test_labelled_rolls_are_not_adjacent() -> None:
    """Every fifth, drives, the first and the last; rolls with a defect always."""
    from castfem.post.plots.machine import numbered

    def labels(count: int, driven: tuple[int, ...] = (), locked: tuple[int, ...] = ()) -> list[int]:
        pairs = tuple(
            Pair(1.0 + i, 0.2, driven=i + 1 in driven, locked=i + 1 in locked) for i in range(count)
        )
        return [i + 1 for i in numbered(Rolls(pairs))]

    assert labels(12) == [1, 5, 10, 12]
    assert labels(11, driven=(4, 8)) == [1, 4, 8, 11]
    assert labels(11, driven=(4,), locked=(5, 6)) == [1, 5, 6, 11]
