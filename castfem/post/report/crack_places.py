"""Where a run may crack, as every report says: worst places, rolls, reheat, end of the pool."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from castfem.base.constants import ZERO_CELSIUS
from castfem.runs.output.folder import MAPS_NAME, ROWS_NAME
from castfem.runs.output.summary import Summary
from castfem.runs.results.run_case import case_with

if TYPE_CHECKING:
    from castfem.post.report.cracks import CrackReport

_COMPARED = ("I1", "I2")  # the other indexes are kin of I2, and worst where it is


@dataclass(frozen=True, slots=True)
class CrackPlaces:
    """What the maps of a run's surface say.

    Attributes:
        ranking: Index, value with unit, how far below the worst, and where: the worst first.
        nowhere: In its place, why there is none; empty otherwise.
        others: The roll that carries most, what reheats, where the pool ends: what, and where.
        title: Of these others.
        largest: Largest value of each index, SI.
    """

    ranking: Sequence[tuple[str, str, str, str]]
    nowhere: str
    others: Sequence[tuple[str, str]]
    title: str
    largest: Mapping[str, float] = field(default_factory=dict)

    @property
    def worst(self) -> Iterator[str]:
        """The worst places of I1 and I2, in words."""
        for name, value, _, where in self.ranking:
            if name in _COMPARED:
                yield f"{name} {value}, {where}"


def crack_places(folder: Path, summary: Summary | None) -> CrackPlaces | None:
    """What the maps of a run say; None without maps.

    Args:
        folder: Of the run.
        summary: Of the run; None while there is none.
    """
    if not any((folder / name).is_file() for name in (MAPS_NAME, ROWS_NAME)):
        return None
    from castfem.post.report.cracks import CrackReport, pool_end
    from castfem.runs.output.surface_maps import SurfaceMaps
    from castfem.runs.results.roll_load import heaviest_roll

    report = CrackReport.of(SurfaceMaps(folder))
    ranking = list(report.ranking())
    nowhere = _why_nowhere(report) if report.indexes() and not ranking else ""
    rolls = [*heaviest_roll(folder, report.stations), *report.reheats()]
    pool = [] if summary is None else list(pool_end(summary, report.stations))
    title = "Rolls, reheat, end of the pool" if pool else "Rolls and reheat"
    largest = {name: float(report.maps[name].max()) for name in report.indexes()}
    return CrackPlaces(ranking, nowhere, [*rolls, *pool], title, largest)


def _why_nowhere(report: CrackReport) -> str:
    """Why no index is above 0: the surface is out of the band, or is not pulled within it."""
    from castfem.runs.output.surface_maps import IN_BAND

    low, high = report.maps.heading.band
    band = f"{low - ZERO_CELSIUS:.4g} and {high - ZERO_CELSIUS:.4g} degC"
    if not report.maps[IN_BAND].any():
        return f"nowhere so far: the surface was never between {band}, where ductility is low"
    return f"nowhere so far: no index is above 0 (low ductility is between {band})"


def defects_of(folder: Path) -> str:
    """What is wrong with the machine of a run's case, in words; "" for nothing.

    Args:
        folder: Of the run, with its case.
    """
    case = case_with(folder, "defect")
    found = None if case is None or case.machine is None else case.machine.defect
    return "; ".join(str(one).rstrip(",") for one in found or ())
