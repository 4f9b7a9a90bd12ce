"""`castfem mould`: the numbers it prints, the picture it draws, the mistakes it tells."""

from __future__ import annotations

import pytest

PNG = b"\x89PNG\r\n\x1a\n"


def rows(printed):
    """The table of tapers: lines of name, from, to, inlet, outlet, taper."""
    lines = [line for line in printed.splitlines() if line.endswith(tuple("0123456789"))]
    split = [line.rsplit(maxsplit=5) for line in lines]
    return [(r[0], *map(float, r[1:])) for r in split if r[0].startswith(("mid", "corner", "diam"))]


def test_prints_the_taper_and_draws_it(castfem, write, tmp_path):
    status, out, _ = castfem("mould", write('taper = "1 %/m"'))
    assert status == 0
    assert rows(out) == [
        ("mid-face, width", 0.0, 600.0, 125.0, 124.254, 1.0),
        ("mid-face, height", 0.0, 600.0, 125.0, 124.254, 1.0),
        ("corner, diagonal", 0.0, 600.0, 172.635, 171.605, 1.0),
    ]
    assert "drawn in case_mould.png" in out
    assert (tmp_path / "case_mould.png").read_bytes().startswith(PNG)


def test_prints_every_zone_and_the_whole(castfem, write):
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


def test_override_of_the_taper(castfem, write):
    _, out, _ = castfem("mould", write(), "--set", "mould.taper=-3 %/m", "-o", "m.png")
    assert rows(out)[0] == ("mid-face, width", 0.0, 600.0, 125.0, 127.291, -3.0)


def test_cold_mould_is_told_as_made_too(castfem, write):
    path = write('taper = "1 %/m"\ncondition = "cold"\nwall_temperature = { position = [0, 600], '
                 'position_unit = "mm", value = [200, 100], unit = "degC" }')  # fmt: skip
    _, out, _ = castfem("mould", path, "-o", "m.png")
    assert "given cold at 25 degC; expanded by 2.97 per mille at the meniscus" in out
    working, made = out.split("as made, cold")
    assert rows(working)[0][3] == 125.0
    assert rows(made)[0][5] == 1.0
    assert rows(working)[0][5] > 1.2
    assert "--hot" not in out


def test_case_with_a_tube_says_which_command_bends_it(castfem, write):
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
def test_mistakes(words, message, castfem, write):
    write('taper = "1 %/m"')
    status, _, err = castfem("mould", *words)
    assert status == 1
    assert message in err
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize(
    ("command", "work"),
    [
        (("mould", "case.toml", "--hot"), "castfem.studies.mould_fit.coupled.hot_mould_of"),
        (("section", "billet125/idealised"), "castfem.studies.mould_fit.section.find_section"),
    ],
)
def test_a_picture_of_no_format_is_refused_before_a_run(command, work, castfem, write, monkeypatch):
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
