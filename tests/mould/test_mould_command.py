"""`castfem mould` and `castfem mould --hot`: printed values, pictures, files, invalid input."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from castfem.model import load_case
from castfem.model.mould_from_case import build_mould
from castfem.post.plots.mould import closed, radius_at

PNG = b"\x89PNG\r\n\x1a\n"


def rows(printed):
    """Return the rows of the table of tapers: name, from, to, inlet, outlet, taper."""
    lines = [line for line in printed.splitlines() if line.endswith(tuple("0123456789"))]
    split = [line.rsplit(maxsplit=5) for line in lines]
    return [(r[0], *map(float, r[1:])) for r in split if r[0].startswith(("mid", "corner", "diam"))]


def test_taper_is_printed_and_drawn(castfem, write, tmp_path):
    status, out, _ = castfem("mould", write('taper = "1 %/m"'))
    assert status == 0
    assert rows(out) == [
        ("mid-face, width", 0.0, 600.0, 125.0, 124.254, 1.0),
        ("mid-face, height", 0.0, 600.0, 125.0, 124.254, 1.0),
        ("corner, diagonal", 0.0, 600.0, 172.635, 171.605, 1.0),
    ]
    assert "drawn in case_mould.png" in out
    assert (tmp_path / "case_mould.png").read_bytes().startswith(PNG)


def test_every_zone_and_the_total_are_printed(castfem, write):
    path = write('taper = { face = "-0.53 %/m", corner = [{ to = "225 mm", taper = "0 %/m" }, '
                 '{ taper = "0.57 %/m" }] }')  # fmt: skip
    status, out, _ = castfem("mould", path, "-o", "m.svg")
    assert status == 0
    diagonal = [row for row in rows(out) if row[0] == "corner, diagonal"]
    assert [(row[1], row[2], row[5]) for row in diagonal] == [
        (0.0, 225.0, 0.0),
        (225.0, 600.0, 0.57),
        (0.0, 600.0, 0.356),
    ]


def test_taper_can_be_overridden(castfem, write):
    _, out, _ = castfem("mould", write(), "--set", "mould.taper=-3 %/m", "-o", "m.png")
    assert rows(out)[0] == ("mid-face, width", 0.0, 600.0, 125.0, 127.291, -3.0)


def test_cold_mould_is_also_printed_as_made(castfem, write):
    path = write('taper = "1 %/m"\ncondition = "cold"\nwall_temperature = { position = [0, 600], '
                 'position_unit = "mm", value = [200, 100], unit = "degC" }')  # fmt: skip
    _, out, _ = castfem("mould", path, "-o", "m.png")
    assert "given cold at 25 degC; expanded by 2.97 per mille at the meniscus" in out
    working, made = out.split("as made, cold")
    assert rows(working)[0][3] == 125.0
    assert rows(made)[0][5] == 1.0
    assert rows(working)[0][5] > 1.2
    assert "--hot" not in out


def test_case_with_a_tube_names_the_hot_command(castfem, write):
    _, out, _ = castfem("mould", write('[mould.tube]\nthickness = "10 mm"'), "-o", "m.png")
    assert out.count("as heat distorts its copper tube: castfem mould ") == 1 and " --hot\n" in out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("billet125/idealised",), "is idealised and follows the strand; add [mould] with length"),
        (("case.toml", "-o", "m.doc"), "a picture ends in .png"),
        (("case.toml", "-o", "none/m.png"), "none/m.png: cannot be written"),
        (("case.toml", "--set", "mould.taper=x"), "mould.taper"),
        (
            ("billet125/idealised", "--set", "mould.taper=1 %/m"),
            'mould.length: is missing; from the meniscus to the end of the mould, such as "600 mm"',
        ),
    ],
)
def test_invalid_input_is_rejected_in_one_line(words, message, castfem, write):
    write('taper = "1 %/m"')
    status, _, err = castfem("mould", *words)
    assert status == 1
    assert message in err
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize(
    ("command", "work"),
    [
        (("mould", "case.toml", "--hot"), "castfem.studies.mould_fit.coupled.hot_mould_of"),
        (
            ("section", "billet125/idealised"),
            "castfem.studies.mould_fit.meniscus_outline.find_section",
        ),
    ],
)
def test_unknown_picture_format_is_rejected_before_a_run(
    command, work, castfem, write, monkeypatch
):
    write('taper = "1 %/m"')

    def run(*_: object) -> None:
        raise AssertionError("run for nothing")

    monkeypatch.setattr(work, run)
    status, _, err = castfem(*command, "-o", "m.doc")
    assert (status, err.strip()) == (
        1,
        "castfem: m.doc: the name of a picture ends in .png, .pdf, .svg; to write into a folder, "
        "make it first",
    )


TUBE = """
[mould.tube]
thickness = "10 mm"
cell_size = "50 mm"
cells_across = 1
flux = "2 MW/m^2"
"""


def table(printed):
    """Return the rows of the table of dimensions."""
    lines = printed.splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith("position [mm]"))
    return [[float(cell) for cell in line.split()] for line in lines[start + 2 : start + 15]]


def test_drawn_outline_is_that_of_the_mould():
    """The distortion is drawn 40 times as large, and so are errors of the outline."""
    case = load_case(Path(__file__).parents[2] / "cases" / "billet125" / "hot.toml")
    cavity = build_mould(case.mould, case.section)
    angle = np.linspace(-0.7, 0.7, 301)
    radius = radius_at(closed(cavity, 0.3, 400), angle)
    half = 0.5 * cavity.dimensions(0.3)["width"]
    assert np.abs(radius * np.cos(angle) - half).max() < 1e-6


@pytest.fixture
def hot(castfem, write):
    def _run(lines, *words):
        path = write(lines + TUBE)
        return path, castfem("mould", path, "--hot", *words)

    return _run


def test_wall_of_a_cold_mould_is_read_by_a_run(hot, tmp_path):
    """Without a width the hot mould has the size of the strand, so the cold one is smaller."""
    lines = 'taper = "1 %/m"\ncondition = "cold"\nwall_temperature = "160 degC"\n'
    path, (status, out, _) = hot(lines)
    assert status == 0
    rows = table(out)
    assert rows[0][0] == 0.0 and rows[-1][0] == 600.0
    assert rows[0][2] == 125.0 and rows[0][1] < 124.95
    assert all(row[1] < row[2] and row[3] < row[4] for row in rows)
    assert (tmp_path / "case_hot.png").read_bytes().startswith(PNG)
    assert "tube in case_hot.vtu" in out and (tmp_path / "case_hot.vtu").exists()
    (tmp_path / "run.toml").write_text(
        path.read_text().replace("taper", 'displacement = { file = "case_hot.csv" }\ntaper')
    )
    case = load_case(tmp_path / "run.toml")
    mould = build_mould(case.mould, case.section)
    for position, *sizes in rows:
        found = mould.dimensions(1e-3 * position)
        assert 1e3 * found["width"] == pytest.approx(sizes[1], abs=1e-3)
        assert 1e3 * found["diagonal"] == pytest.approx(sizes[3], abs=1e-3)


def test_sizes_of_a_cold_mould_are_kept(hot):
    lines = 'width = "125 mm"\nheight = "125 mm"\ncondition = "cold"\nwall_temperature = "160 degC"'
    _, (_, out, _) = hot(lines)
    rows = table(out)
    assert [row[1] for row in rows] == [125.0] * 13
    assert all(0.05 < row[2] - 125.0 < 0.4 for row in rows)


def test_hot_mould_prints_its_cold_sizes(hot, tmp_path):
    _, (_, out, _) = hot('taper = "1 %/m"')
    rows = table(out)
    assert rows[0][2] == 125.0 and rows[-1][2] == pytest.approx(124.254, abs=1e-3)
    assert all(row[1] < row[2] for row in rows)
    assert not (tmp_path / "case_hot.csv").exists()


@pytest.mark.parametrize(
    ("key", "heat"),
    [("flux", 'flux = "2 MW/m^2"'), ("hot_face", 'hot_face = "150 degC"\nwater_side = "100 degC"')],
)
def test_prescribed_heat_needs_no_coupling(castfem, write, key, heat):
    """With --coupled this is reported, with --hot it is not."""
    path = write(TUBE.replace('flux = "2 MW/m^2"', heat))
    status, out, _ = castfem("mould", path, "--coupled")
    assert status == 0
    assert out.startswith(f"mould.tube.{key} heats the tube: the strand is not computed, nothing")
    _, out, _ = castfem("mould", path, "--hot")
    assert "strand" not in out


def test_a_tube_without_heat_has_the_temperature_of_its_water(hot):
    _, (status, out, _) = hot("", "--set", "mould.tube.flux=0 W/m^2")
    assert status == 0
    assert re.search(r"heat +0\.0 kW", out)
    assert {cell for row in table(out) for cell in row[-3:]} == {40.0}


def test_softening_copper_is_reported(hot):
    _, (_, out, _) = hot("", "--set", "mould.tube.flux=7 MW/m^2")
    assert "warning: above 400 degC the copper softens" in out


def test_case_without_a_tube_is_rejected(castfem, write):
    status, _, err = castfem("mould", write(), "--hot")
    assert status == 1
    assert "mould.tube: the table is missing; add [mould.tube]" in err and err.count("\n") == 1
