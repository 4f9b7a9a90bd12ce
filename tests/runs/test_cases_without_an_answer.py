"""Cases that have no answer, or none that rounding does not decide, are refused by name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from runs.billet_runs import CASES, billet, run_in_memory
from small_case import strip

from castfem.base.errors import InputError
from castfem.model import load_case

# What makes the strip of Weiner and Boley, free to contract across.
FREEZING: dict[str, Any] = {
    "casting.length": "5 mm",
    "casting.temperature": "1495 degC",
    "steel.name": "weiner_boley",
    "section.width": "0.5 mm",
    "mesh": {"surface_size": "0.5 mm", "core_size": "0.5 mm"},
    "cooling.0.surface": [{"law": "temperature", "value": "1000 degC"}],
    "thermal.time.step": "50 ms",
    "mechanics": {
        "law": "weiner_boley",
        "ferrostatic": "off",
        "planes": {"a0": "free", "a1": "0 1/m", "a2": "0 1/m", "across": "free"},
    },
    "coupling": {"interval": "50 ms"},
    "output.fields": [],
}


@pytest.mark.parametrize("strain", ["small", "large"])
def test_a_strain_across_that_no_side_follows(strain: str) -> None:
    case = strip(FREEZING | {"mechanics.strain": strain})
    with pytest.raises(InputError, match=r"planes\.across: free along y.*side_low"):
        run_in_memory(case)
    held = {"mechanics.held": [{"on": ["side_low", "side_high"], "component": "y"}]}
    assert run_in_memory(case.with_(held)).value("axial_strain") < 0.0


def test_a_gap_of_nanometres() -> None:
    law = "cooling.mould.surface.0.gap_conductivity"
    with pytest.raises(InputError, match=r"gap of 0\.625 nm would halve the heat"):
        billet("taper_1", f"{law}=1e-6 W/(m K)")
    billet("taper_1", f"{law}=8e-3 W/(m K)")


def test_liquid_too_soft_for_large_strain() -> None:
    for liquid in ("1e-7", "1e-8"):
        with pytest.raises(InputError, match=r"liquid_stiffness: .*folds in a mould"):
            billet("taper_1", "mechanics.strain=large", f"mechanics.liquid_stiffness={liquid}")
        fed = ("mechanics.strain=large", "mechanics.liquid=fed", "mechanics.mush=none")
        billet("taper_1", *fed, f"mechanics.liquid_stiffness={liquid}")
        billet("taper_1", f"mechanics.liquid_stiffness={liquid}")
        billet("idealised", "mechanics.strain=large", f"mechanics.liquid_stiffness={liquid}")


@pytest.mark.parametrize("given", ["-1", '{time=[0, 1], time_unit="s", value=[0, -1.5]}'])
def test_a_slice_without_thickness(given: str) -> None:
    with pytest.raises(InputError, match="leaves the slice no thickness"):
        billet("idealised", f"mechanics.planes.a0={given}")


def test_zones_that_rounding_has_made(tmp_path: Path) -> None:
    zones = "".join(
        f'[[cooling]]\nname="{name}"\n{end}[[cooling.surface]]\nlaw="flux"\nvalue="1 MW/m^2"\n'
        for name, end in (
            ("one", 'to="300 mm"\n'),
            ("two", 'to="300.00000001 mm"\n'),
            ("three", ""),
        )
    )
    path = tmp_path / "case.toml"
    path.write_text(f'extends="{CASES / "thermal.toml"}"\n{zones}')
    with pytest.raises(InputError, match=r"cooling.1.to .*lies 0\.01 nm below"):
        load_case(path)


def test_a_cavity_with_wider_corners() -> None:
    """Round corners of 5 mm fit into wider ones where the cavity has room on both sides."""
    room = ("mould.width=128 mm", "mould.height=128 mm")
    for radius in ("5 mm", "8 mm", "10.1 mm"):
        billet("taper_1", *room, f"mould.corner_radius={radius}")
    with pytest.raises(InputError, match=r"at most 10\.12"):
        billet("taper_1", *room, "mould.corner_radius=10.2 mm")
    with pytest.raises(InputError, match=r"corner_radius.*at most that"):
        billet("taper_1", "mould.corner_radius=6 mm")


@pytest.mark.parametrize("given", ["off", "none"])
def test_fed_liquid_without_its_pressure_in_a_mould(given: str) -> None:
    """Its equations have solutions, but none of a strand.

    On cells of 2 mm "none" folds as the surface freezes, at 102 mm; "off" goes on, and +3 %/m ends
    1.1 mm off its wall with 24 % less heat after 200 mm, +1 %/m with 21 %.
    """
    pressure = f"mechanics.ferrostatic={given}"
    with pytest.raises(InputError, match=r'mechanics\.ferrostatic: .*full.*liquid = "elastic"'):
        billet("taper_1", "mechanics.liquid=fed", pressure)
    billet("taper_1", pressure)
