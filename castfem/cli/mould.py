"""`castfem mould`: the taper of a mould as (300) defines it, and a picture of the mould.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.errors import InputError
from castfem.cli.drawing import aligned, check_picture, drawing, print_rows
from castfem.model import Case

if TYPE_CHECKING:
    from castfem.physics.mould import Mould, Zone


def draw_mould(case: Case, picture: Path, origin: str) -> None:
    """Print size and taper of a case's mould and draw it.

    Args:
        case: The case.
        picture: File of the picture.
        origin: What the user called the case, for messages.

    Raises:
        InputError: The case has no mould, or the picture cannot be written.
    """
    from castfem.model.build_mould import build_mould
    from castfem.post.plots.mould import draw

    table = case.mould
    if table is None:
        raise InputError(
            f"{origin}: mould: the table is missing, the mould is idealised and follows the "
            'strand; add [mould] with length = "600 mm" and taper = "1 %/m"'
        )
    check_picture(picture)
    mould = build_mould(table, case.section)
    print_rows(mould_rows(mould))
    print()
    print("\n".join(taper_lines(mould.zones())))
    if mould.expansion is not None:
        print("\nas made, cold")
        print("\n".join(taper_lines(mould.zones(as_made=True))))
    if table.tube is not None:
        print(f"\nas heat distorts its copper tube: castfem mould {origin} --hot")
    with drawing(picture):
        draw(mould, picture, case.title)


def mould_rows(mould: Mould) -> list[tuple[str, str]]:
    """Return label and value of what characterises a mould."""
    rows = [("length", f"{1e3 * mould.length:g} mm from the meniscus")]
    for label, position in (("at the meniscus", 0.0), ("at the exit", mould.length)):
        sizes = mould.dimensions(position)
        rows.append((label, ", ".join(f"{name} {1e3 * w:.3f} mm" for name, w in sizes.items())))
    if mould.wall_temperature is not None:
        values = [value - ZERO_CELSIUS for value in mould.wall_temperature.values]
        low, high = min(values), max(values)
        span = f"{low:g}" if low == high else f"{low:g} to {high:g}"
        rows.append(("wall", f"{span} degC"))
    if mould.expansion is None:
        rows.append(("condition", "sizes and taper are those of the working mould"))
    else:
        warm = mould.expansion.factor(0.0), mould.expansion.factor(mould.length)
        rows.append(
            (
                "condition",
                f"given cold at {mould.expansion.cold - ZERO_CELSIUS:g} degC; expanded by "
                f"{1e3 * (warm[0] - 1.0):.2f} per mille at the meniscus, "
                f"{1e3 * (warm[1] - 1.0):.2f} at the exit",
            )
        )
    return rows


def taper_lines(zones: Iterable[Zone]) -> list[str]:
    """Return the table of the tapers: dimension, zone, its size at both ends, taper in %/m."""
    head = ("dimension", "from [mm]", "to [mm]", "inlet [mm]", "outlet [mm]", "taper [%/m]")
    rows = [head]
    for zone in zones:
        rows.append(
            (
                _WHERE.get(zone.dimension, zone.dimension),
                f"{1e3 * zone.start:g}",
                f"{1e3 * zone.end:g}",
                f"{1e3 * zone.inlet:.3f}",
                f"{1e3 * zone.outlet:.3f}",
                f"{100.0 * zone.taper + 0.0:+.3f}",
            )
        )
    return aligned(rows)


_WHERE = {
    "width": "mid-face, width",
    "height": "mid-face, height",
    "diagonal": "corner, diagonal",
}
