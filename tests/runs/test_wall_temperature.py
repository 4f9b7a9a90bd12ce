"""The temperature of the wall along the mould is what the strand's heat meets."""

from __future__ import annotations

import numpy as np
import pytest
from billet_runs import run_in_memory, shipped

from castfem.base.errors import InputError

TABLE = '{position=[0, 30, 60], position_unit="mm", value=[100, 400, 200], unit="degC"}'


def test_heat_meets_the_wall_where_it_is() -> None:
    """Without a gap the flux is h (T - T_wall(z)) at every depth."""
    case = shipped(
        "taper_3",
        "casting.length=60 mm",
        "cooling.mould.surface.0.wall=mould",
        f"mould.wall_temperature={TABLE}",
    )
    samples = [r for r in run_in_memory(case).samples if r.position > 0.0]
    depth = np.array([r.position for r in samples])
    wall = 273.15 + np.interp(depth, [0.0, 0.03, 0.06], [100.0, 400.0, 200.0])
    surface = np.array([r.profiles["mid_face"].temperature[0] for r in samples])
    flux = np.array([r.flux["mid_face"] for r in samples])
    assert np.ptp(wall) > 150.0
    assert np.allclose(flux, 1600.0 * (surface - wall), rtol=1e-3)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            ("mould.wall_temperature=150 degC",),
            r"base.toml: cooling\.0\.surface\.0\.wall .*: 160 degC here, 150 degC as "
            r'mould\.wall_temperature; leave one of the two out, or set this to "mould"$',
        ),
        ((f"mould.wall_temperature={TABLE}",), "160 degC here, a table as mould"),
        (
            ("cooling.mould.surface.0.wall=mould",),
            r'wall = "mould" takes mould\.wall_temperature, which is not given; give wall = '
            r'"160 degC" here, or wall_temperature = "160 degC" in \[mould\]$',
        ),
    ],
)
def test_a_wall_has_one_temperature(changes: tuple[str, ...], message: str) -> None:
    with pytest.raises(InputError, match=message):
        shipped("taper_1", *changes)
