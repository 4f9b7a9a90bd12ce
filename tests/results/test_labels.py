"""The last row of an unfinished run reads like the table of a finished one."""

from __future__ import annotations

import io
import re

import pytest
from rich.console import Console
from strained_run import write_strained

import castfem
from castfem.base.shown_quantity import Quantity
from castfem.model import load_case
from castfem.model.shipped_cases import find
from castfem.post.report.show import show
from castfem.runs.output.run_record import RunRecord
from castfem.runs.results.headline import plain_label
from castfem.runs.results.labels import last_quantities


def test_an_interrupted_run_is_told_in_the_words_of_a_finished_one(tmp_path):
    write_strained(tmp_path)
    (tmp_path / "summary.json").unlink()
    path = tmp_path / "run.json"
    path.write_text(path.read_text().replace('"finished"', '"running"'))
    assert RunRecord.load(tmp_path).status == "running"
    out = io.StringIO()
    show(tmp_path, Console(file=out, width=120), figures=False)
    text = out.getvalue()
    assert text.startswith("killed or aborted")
    rows = [re.split(r"  +", line.strip()) for line in text.split("Last of ")[1].splitlines()]
    told = {row[0]: row[1:] for row in rows if len(row) == 3}
    assert list(told)[1:3] == ["time", "position"]
    assert told["share of the surface in contact"] == ["100", "%"]
    assert told["diagonal"] == ["172.12", "mm"]
    assert told["von Mises stress, mid-face"] == ["3.6", "MPa"]
    assert told["heat removed per m"][1] == "MJ/m"
    assert told["largest penetration into the mould here"] == ["0.01", "µm"]
    for word in ("newton", "force", "error", "step"):
        assert not any(word in label for label in told)


def test_the_words_are_those_of_the_report(tmp_path):
    """Of a run with mechanics and friction: each quantity as its own summary has it."""
    lines = ["casting.length=6 mm", "mould.friction.law=coulomb", "mould.friction.coefficient=0.2"]
    case = load_case(find("billet125/taper_1"), overrides=lines)
    with castfem.run(case, tmp_path / "out") as result:
        table, finished = result.history, result.summary.quantities
    units = table.attrs["units"]
    found = last_quantities({str(k): float(v) for k, v in table.iloc[-1].items()}, units)
    assert {"contact_sticking", "gap_corner", "size_corner", "penetration"} <= set(found)
    for name, quantity in found.items():
        assert (quantity.label, quantity.unit) == (plain_label(finished[name]), finished[name].unit)
        assert quantity.value == pytest.approx(finished[name].value, rel=1e-9, abs=1e-15)


@pytest.mark.parametrize(
    ("label", "plain"),
    [
        (
            "largest I1, axial tension in the band, bending, extrados, corner, 4.10 m (roll 15), "
            "205 s, bending",
            "largest I1, axial tension in the band, bending",
        ),
        (
            "largest I1, axial tension in the band on the way, intrados, 61.4 mm from the corner, "
            "16.83 m, 841.6 s, straightening",
            "largest I1, axial tension in the band on the way",
        ),
        ("largest gap, x = 1.0, y = 2.0 mm, 0.52 m, 8.5 s, mould", "largest gap"),
        ("von Mises stress, narrow face", "von Mises stress, narrow face"),
    ],
)
def test_a_plain_label_does_not_tell_the_place(label: str, plain: str) -> None:
    """Beside other runs the place of one of them would mislead."""
    assert plain_label(Quantity(1.0, "Pa", label)) == plain
