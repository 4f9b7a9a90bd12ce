"""Synthetic maps of a surface: half a slab between ten pairs of rolls, bent and straightened."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from castfem.meshes.build import build
from castfem.physics.machine.rolls import Rolls, Segment, expand
from castfem.physics.machine.stations import Stations
from castfem.runs.output.surface_maps import Heading, MapWriter, SurfaceLine, SurfaceMap

WIDE, THICK = 0.4, 0.1  # m, of the whole slab
ROWS, LENGTH, SPEED = 121, 3.0, 0.02
BAND = (1073.15, 1223.15)
MAPS = (
    SurfaceMap("temperature", "K", "degC", "temperature"),
    SurfaceMap("I1", "Pa", "MPa", "I1"),
    SurfaceMap("I2", "1/s", "1/s", "I2"),
    SurfaceMap("band_time", "s", "s", "time in the band"),
)


def rolls() -> Rolls:
    """Return rolls 1 to 2 straight, bending to 4, arc to 6, straightening to 8, straight to 10."""
    radii = (np.inf, 4.0, 4.0, np.inf, np.inf)
    return expand([Segment(2, 0.25, 0.12, radius) for radius in radii], 0.4)


def surface() -> SurfaceLine:
    """Return the surface of the half slab."""
    mesh = build(
        "rectangle", width=WIDE, height=THICK, symmetry="half", surface_size=0.01, core_size=0.02
    )
    return SurfaceLine.of(mesh)


def write_maps(
    folder: Path,
    *,
    ended: bool = True,
    alike: float = 0.0,
    kink: float = 0.0,
    scale: float = 1.0,
    band: tuple[float, float] = BAND,
) -> SurfaceLine:
    """Write the maps and return their surface.

    The surface cools down from 1300 to 700 degC and warms up by 80 K at mid-width of the intrados.
    I1 is 30 MPa at the corner of the intrados at 2.125 m (roll 8), 28 and 29 MPa near it, 24 MPa
    at the corner of the extrados at 1.1 m (roll 4); I2 has 2e-4 1/s in the middle of the intrados
    at 2.0 m and `alike` on all of the extrados at 1.1 m. At 2.8 m the corner of the extrados has an
    I1 of `kink` (Pa). All indexes are multiplied by `scale`. `band`: K.
    """
    line = surface()
    heading = Heading(line, MAPS, band, Stations(rolls()).columns(), THICK, 0.3)
    position = np.linspace(0.0, LENGTH, ROWS)
    values = np.zeros((ROWS, len(MAPS), len(line.nodes)))
    values[:, 0] = (1573.15 - 200.0 * position)[:, None]
    warm = np.clip((position - 2.0) / 0.5, 0.0, 1.0) * (80.0 + 200.0 * 0.5)
    values[:, 0, line.at(0.0, 0.5 * THICK)] += warm
    half = 0.5 * WIDE
    for map_, place, at, value in (
        (1, (half, 0.5 * THICK), 2.125, 30e6),
        (1, (half, 0.3 * THICK), 2.125, 28e6),
        (1, (half, 0.5 * THICK), 2.2, 29e6),
        (1, (half, -0.5 * THICK), 1.1, 24e6),
        (1, (half, -0.5 * THICK), 2.8, kink),
        (2, (0.0, 0.5 * THICK), 2.0, 2e-4),
    ):
        values[int(np.argmin(np.abs(position - at))), map_, line.at(*place)] = value
    extrados = line.face == line.faces.index("extrados")
    values[int(np.argmin(np.abs(position - 1.1))), 2, extrados] = alike
    values[:, 1:] *= scale
    writer = MapWriter(folder, heading)
    for z, row in zip(position, values, strict=True):
        writer.append(float(z) / SPEED, float(z), row)
    if ended:
        writer.close()
    else:
        writer.sync()
    return line
