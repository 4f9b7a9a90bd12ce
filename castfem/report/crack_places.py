"""Where a run may crack, as every report says: worst places, rolls, reheat, end of the pool."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from castfem.output.folder import MAPS_NAME, ROWS_NAME
from castfem.output.summary import Summary
from castfem.values.constants import ZERO_CELSIUS


@dataclass(frozen=True, slots=True)
class CrackPlaces:
    """What the maps of a run's surface say.

    Attributes:
        ranking: Index, value with unit, how far below the worst, and where: the worst first.
        nowhere: In its place, why there is none; empty otherwise.
        others: The roll that carries most, what reheats, where the pool ends: what, and where.
        title: Of these others.
    """

    ranking: Sequence[tuple[str, str, str, str]]
    nowhere: str
    others: Sequence[tuple[str, str]]
    title: str

    @property
    def worst(self) -> Iterator[str]:
        """The worst place of each index, in words."""
        for name, value, _, where in self.ranking:
            if name:
                yield f"{name} {value}, {where}"


def crack_places(folder: Path, summary: Summary | None) -> CrackPlaces | None:
    """What the maps of a run say; None without maps.

    Args:
        folder: Of the run.
        summary: Of the run; None while there is none.
    """
    if not any((folder / name).is_file() for name in (MAPS_NAME, ROWS_NAME)):
        return None
    from castfem.output.surface_maps import SurfaceMaps
    from castfem.report.cracks import CrackReport, pool_end
    from castfem.report.roll_load import heaviest_roll

    report = CrackReport.of(SurfaceMaps(folder))
    ranking, nowhere = list(report.ranking()), ""
    if report.indexes() and not ranking:
        cold, hot = (kelvin - ZERO_CELSIUS for kelvin in report.maps.heading.band)
        nowhere = (
            f"nowhere so far: no index is above 0 (low ductility is between {cold:.4g} and "
            f"{hot:.4g} degC)"
        )
    rolls = [*heaviest_roll(folder, report.stations), *report.reheats()]
    pool = [] if summary is None else list(pool_end(summary, report.stations))
    title = "Rolls, reheat, end of the pool" if pool else "Rolls and reheat"
    return CrackPlaces(ranking, nowhere, [*rolls, *pool], title)
