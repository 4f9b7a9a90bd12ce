"""wall_flux.csv: heat flux into the wall of the mould, for the temperature of the copper."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.types import Array
from castfem.model.mould_from_case import nominal_mould
from castfem.physics.mould.hot.flux import FluxMap, WallPlaces
from castfem.physics.mould.perimeter import sides_of
from castfem.runs.output.folder import WALL_FLUX_NAME
from castfem.runs.output.history import read_columns
from castfem.runs.output.surface_maps import SurfaceLine

if TYPE_CHECKING:
    from castfem.model.build.simulation import Simulation
    from castfem.physics.coupling.staggered import StrandState
    from castfem.runs.results.sample import Sample

_HEAD = "flux_at_"  # prefix of the position round the wall, mm


def surface_flux(simulation: Simulation, strand: StrandState) -> Array:
    """Return the heat flux out of the surface at the owned vertices (owned,), W/m2."""
    thermal = strand.thermal
    flow = simulation.problem.surface_flow(thermal.point, thermal.rate, thermal.time)
    share = simulation.zones.perimeter_share()
    return np.asarray(flow / np.where(share > 0.0, share, np.inf))


class WallFlux:
    """Samples the flux into the wall after each step.

    Args:
        simulation: A case whose [mould.tube] has thermocouples (collective).

    Attributes:
        columns: Name and unit of each column, one for each place round a quarter of the wall.
    """

    def __init__(self, simulation: Simulation) -> None:
        case, section = simulation.case, simulation.section
        assert case.mould is not None
        mould = nominal_mould(case.mould, case.section)
        source = section.source
        line: SurfaceLine = section.comm.bcast(None if source is None else SurfaceLine.of(source))
        self._simulation, self._nodes = simulation, line.nodes
        self._places = WallPlaces(line.place, sides_of(mould.cavity, mould.tapers, 0.0))
        names = [f"{_HEAD}{1e3 * way:.3f}" for way in self._places.ways]
        self.columns = (("time", "s"), ("position", "m"), *((name, "W/m^2") for name in names))

    def rows(self, strand: StrandState, sample: Sample) -> dict[str, dict[str, float]]:
        """Return the row of the file, by file name; empty on ranks other than 0 (collective)."""
        whole = self._simulation.section.gather(surface_flux(self._simulation, strand))
        if whole is None:
            return {}
        values = (sample.time, sample.position, *self._places.mean(whole[self._nodes]))
        names = (name for name, _ in self.columns)
        return {WALL_FLUX_NAME: dict(zip(names, map(float, values), strict=True))}


def read_wall_flux(folder: Path, length: float) -> FluxMap:
    """Return the heat flux of a run into a wall of a given length (m).

    Raises:
        InputError: The run has not written it.
    """
    table = read_columns(folder / WALL_FLUX_NAME)
    names = [name for name in table.columns if str(name).startswith(_HEAD)]
    inside = table["position"] <= length * (1.0 + 1e-9)
    ways = 1e-3 * np.array([float(str(name).removeprefix(_HEAD)) for name in names])
    return FluxMap(
        table["position"][inside], ways, np.column_stack([table[name][inside] for name in names])
    )
