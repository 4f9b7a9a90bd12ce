"""A valid case to which tests add a table [mould]."""

from __future__ import annotations

from pathlib import Path

import pytest

BASE = Path(__file__).parents[2] / "cases" / "billet125" / "coupled.toml"
COOLING = """
[[cooling]]
name = "mould"
to = "600 mm"

[[cooling.surface]]
law = "contact"
coefficient = "1600 W/(m^2 K)"
gap_conductivity = "0.15 W/(m K)"
wall = "mould"
"""


@pytest.fixture
def write(tmp_path):
    """Write a case with lines of its table [mould]; return its path.

    If they set a wall temperature, the cooling uses it.
    """

    def _write(lines: str = "", more: str = "", name: str = "case.toml") -> Path:
        path = tmp_path / name
        more += COOLING if "wall_temperature" in lines else ""
        head = f'title = "billet in its mould"\nextends = "{BASE}"\n{more}\n'
        path.write_text(f'{head}[mould]\nlength = "600 mm"\n{lines}\n', encoding="utf-8")
        return path

    return _write
