"""A valid case as text, to be changed by the tests."""

from __future__ import annotations

from pathlib import Path

import pytest

SOUND = """\
title = "billet"

[casting]
speed = "3.6 m/min"
length = "600 mm"
superheat = "40 K"

[steel]
name = "carbon_042"

[section]
shape = "rectangle"
width = "125 mm"
height = "125 mm"
corner_radius = "5 mm"

[mesh]
surface_size = "0.5 mm"
core_size = "8 mm"

[[cooling]]
name = "mould"
to = "600 mm"

[[cooling.surface]]
law = "contact"
coefficient = "1600 W/(m^2 K)"
wall = "160 degC"

[[cooling]]
name = "air"

[[cooling.surface]]
law = "radiation"
ambient = "25 degC"
"""


@pytest.fixture
def sound() -> str:
    return SOUND


@pytest.fixture
def write(tmp_path: Path):
    """Return a function that writes a case file, by default a valid one, and returns its path."""

    def _write(text: str = SOUND, name: str = "case.toml") -> Path:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return path

    return _write
