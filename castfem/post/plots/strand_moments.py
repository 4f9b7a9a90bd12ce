"""The strand at moments, cut lengthwise through its middle as it lies in its machine."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.types import Array
from castfem.post.plots.style import STYLE, head, look, new_figure
from castfem.runs.caster.files import moment_files

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from castfem.model import Case

_SHOWN = "temperature", "solid_fraction"
_CELSIUS = 500.0, 1550.0
_SOLID, _THICKER = 0.999, 4.0  # where the pool ends; how much thicker the strand is drawn
_MOVED = 1e-6  # m: a strand whose face moves less across goes straight down


@look()
def moments_figure(folder: Path, case: Case) -> Figure | None:
    """Return a panel for each moment, coloured by temperature; None without moments.

    A bent strand is drawn in its shape, thicker; one that goes straight down over the whole width.
    """
    found = moment_files(folder)
    if not found:
        return None
    cuts = [middle_of(path) for _, path in found]
    spans = np.max([np.ptp(points.reshape(-1, 2), axis=0) for points, _, _ in cuts], axis=0)
    straight = all(np.ptp(points[:, 0, 0]) < _MOVED for points, _, _ in cuts)
    thicker = 1.0 if straight else _THICKER
    each = float(np.clip(STYLE.width * spans[1] / max(spans[0], 1e-9), 2.0, 5.0))
    shape = (1, len(found)) if straight else (len(found), 1)
    figure = new_figure(STYLE.width, each * shape[0] + 0.8)
    panels = figure.subplots(*shape, sharex=True, sharey=True, squeeze=False).ravel()
    head(figure, case.title)
    for panel, (clock, _), (points, temperature, solid) in zip(panels, found, cuts, strict=True):
        middle = 0.5 * (points[:, :1] + points[:, -1:])
        x, y = np.moveaxis(middle + thicker * (points - middle), -1, 0)
        shades = panel.pcolormesh(
            x, y, temperature - ZERO_CELSIUS, shading="gouraud", cmap="inferno",
            vmin=_CELSIUS[0], vmax=_CELSIUS[1], rasterized=True,
        )  # fmt: skip
        panel.contour(x, y, solid, levels=[_SOLID], colors="#00c8ff", linewidths=1.2)
        panel.set_aspect("auto" if straight else "equal")
        panel.set_title(f"{clock / 60.0:.4g} min by the clock", fontsize=9)
        panel.grid(False)
    figure.colorbar(shades, ax=list(panels), label="temperature [°C]", shrink=0.5)
    for panel in panels[:1] if straight else panels:
        panel.set_ylabel("height [m]")
    where = "across" if straight else f"from the mould, drawn {thicker:g} times as thick"
    figure.supxlabel(f"{where} [m]; blue: edge of the pool", fontsize="medium")
    return figure


def middle_of(path: Path) -> tuple[Array, Array, Array]:
    """Return the middle of the wide faces: points (rows, n, 2) m, temperature K, solid fraction.

    Points are away from the mould and up from the meniscus, from face to face.
    """
    import meshio

    mesh = meshio.read(path)
    position = np.asarray(mesh.point_data["position"])
    count = int(np.argmax(position != position[0]))  # points of a slice
    points = mesh.points.reshape(-1, count, 3)
    across = np.abs(points[0, :, 1])
    here = np.flatnonzero(across <= across.min() + 1e-6)
    here = here[np.argsort(points[0, here, 0])]
    values = (np.asarray(mesh.point_data[n]).reshape(-1, count)[:, here] for n in _SHOWN)
    temperature, solid = values
    return points[:, here][..., [0, 2]], temperature, solid
