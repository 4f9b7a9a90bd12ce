"""The hot mould of a case: iteration strand -> flux -> tube -> wall -> strand to convergence.

The strand's flux heats the tube. The tube's shape, if the mould is given cold, and the temperature
of its hot face, if the strand's cooling uses that of the mould, act on the strand. The shape
depends weakly on the flux (10 % more heat widens the wall by 20 um), so that fixed-point iteration
converges.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpi4py import MPI

import numpy as np

from castfem.base.constants import ROUNDING
from castfem.base.errors import InputError
from castfem.base.shown_quantity import Quantity
from castfem.base.tables import Constant, Table, as_function
from castfem.base.types import Array
from castfem.model.cooling import MOULD, Contact
from castfem.model.mould_from_case import nominal_mould
from castfem.model.wall_shape import WallShape
from castfem.physics.mould.displaced import DisplacedMould, WallDisplacement
from castfem.physics.mould.hot.copper import CONDUCTIVITY, EXPANSION, POISSON, STIFFNESS, Copper
from castfem.physics.mould.hot.flux import FluxMap, of_strand, profile
from castfem.physics.mould.hot.model import HotMould, HotWall, TubeSettings
from castfem.physics.mould.mould import Mould
from castfem.physics.mould.perimeter import sides_of
from castfem.runs.results.wall_flux import read_wall_flux
from castfem.studies.mould_fit.follow import Followed, follow

if TYPE_CHECKING:
    from castfem.model import Case
    from castfem.model.mould import CopperThermocouples
    from castfem.model.mould import Mould as MouldTable
    from castfem.physics.mould.hot.conduction import Heated


@dataclass(frozen=True, slots=True)
class Agreement:
    """Convergence criteria of strand and mould."""

    shape: float = 2e-6  #: change of the wall per iteration at convergence, m
    heat: float = 1e-3  #: relative change of the heat removed at convergence
    most: int = 8  #: largest number of iterations


AGREEMENT = Agreement()


@dataclass(frozen=True, slots=True, eq=False)
class Turn:
    """One iteration."""

    strand: Followed | None  #: the run whose flux heated the tube; None if the flux is given
    wall: HotWall  #: resulting wall
    moved: float  #: largest change of the wall since the previous iteration, m; NaN in the first
    heat: float  #: relative change of the heat removed since then; NaN in the first


@dataclass(frozen=True, slots=True, eq=False)
class Drawing:
    """The mould in the cold and in the working condition."""

    cold: Mould  #: the cold mould
    hot: Mould  #: the working mould
    displacement: WallDisplacement | None
    """Displacement from the case's sizes and taper to the working wall, for `mould.displacement`;
    None if the case gives the working mould."""


def table_of(case: Case, origin: str) -> MouldTable:
    """Return [mould] of a case with a tube."""
    table = case.mould
    if table is None or table.tube is None:
        raise InputError(
            f"{origin}: mould.tube: the table is missing; add [mould.tube] with "
            'thickness = "10 mm" (docs/hot_mould.md)'
        )
    return table


def copper_of(table: MouldTable) -> Copper:
    """Return the copper of a mould."""
    given = table.copper

    def either(value: float | Table | None, usual: Constant | Table) -> Constant | Table:
        return usual if value is None else as_function(value)

    return Copper(
        either(given.conductivity, CONDUCTIVITY),
        either(given.mean_expansion, EXPANSION),
        either(given.youngs_modulus, STIFFNESS),
        either(given.poisson, Constant(POISSON)),
        given.cold,
    )


def settings_of(table: MouldTable) -> TubeSettings:
    """Return the tube settings of a mould that has one."""
    given = table.tube
    assert given is not None

    def maybe(value: float | Table | None) -> Constant | Table | None:
        return None if value is None else as_function(value)

    return TubeSettings(
        given.thickness,
        given.above,
        as_function(given.water_coefficient),
        as_function(given.water_temperature),
        given.support,
        maybe(given.hot_face),
        maybe(given.water_side),
        int(given.cells_across),
        given.cell_size,
        given.solver,
    )


def hot_mould_of(
    case: Case,
    comm: MPI.Comm,
    origin: str,
    turns: int = 1,
    report: Callable[[int, Turn], None] = lambda number, turn: None,
) -> list[Turn]:
    """Return the iterations of a case's hot mould, the last of which is the result (collective).

    Args:
        case: A case with [mould.tube].
        comm: Communicator.
        origin: Name of the case in messages.
        turns: Largest number of iterations; 1 heats the tube once. They end when wall and heat have
            converged, and after one if the tube's flux or face temperatures are given.
        report: Called after each iteration.
    """
    table = table_of(case, origin)
    assert table.tube is not None
    mould = nominal_mould(table, case.section)
    tube = HotMould(comm, mould, copper_of(table), settings_of(table))
    if not table.tube.heated_by_strand:
        turn = Turn(None, tube.solve(given_flux(table, mould)), np.nan, np.nan)
        report(1, turn)
        return [turn]
    found: list[Turn] = []
    for number in range(1, turns + 1):
        strand = follow(_heated(case, table, found[-1].wall if found else None), comm)
        wall = tube.solve(flux_of(strand, mould))
        found.append(_turn(strand, wall, found[-1] if found else None))
        report(number, found[-1])
        if found[-1].moved < AGREEMENT.shape and abs(found[-1].heat) < AGREEMENT.heat:
            break
    return found


def given_flux(table: MouldTable, mould: Mould) -> FluxMap | None:
    """Return the flux given in [mould.tube]; None if it gives the temperature of the hot face."""
    assert table.tube is not None
    if table.tube.flux is None:
        return None
    sides = sides_of(mould.cavity, mould.tapers, 0.0)
    share, reach = table.tube.corner_flux, table.tube.corner_reach
    return profile(as_function(table.tube.flux), sides, table.length, share, reach)


def flux_of(strand: Followed, mould: Mould) -> FluxMap:
    """Return the heat flux of a strand within its mould, on the mould's wall."""
    inside = strand.positions <= mould.length * (1.0 + 1e-9)
    sides = sides_of(mould.cavity, mould.tapers, 0.0)
    return of_strand(strand.positions[inside], strand.line.place, strand.flux[inside], sides)


def drawing(table: MouldTable, mould: Mould, wall: HotWall) -> Drawing:
    """Return the cold and the working mould, from the displacement by heat.

    For a working mould the cold one is determined, and vice versa. Sizes left out of a cold mould
    are those of the strand at the meniscus in the working condition.

    Args:
        table: [mould].
        mould: Mould with sizes and taper as written.
        wall: The hot wall.
    """
    heat = wall.displacement
    if table.condition == "working":
        back = WallDisplacement(heat.positions, heat.ways, -heat.moved)
        return Drawing(_displaced(mould, back), mould, None)
    if not any((table.width, table.height, table.diameter, table.corner_radius)):
        start = WallDisplacement(heat.positions, heat.ways, heat.less(0.0).moved - heat.moved)
        cold = _displaced(mould, start)
        filled = heat.less(0.0)
        return Drawing(cold, _displaced(mould, filled), filled)
    return Drawing(mould, _displaced(mould, heat), heat)


def _displaced(mould: Mould, displacement: WallDisplacement) -> Mould:
    return DisplacedMould(mould.cavity, mould.length, mould.tapers, displacement)


def _heated(case: Case, table: MouldTable, wall: HotWall | None) -> Case:
    """Return the case down to the end of its mould, with the wall of the previous iteration.

    The first iteration has the nominal wall, without the free expansion of [mould.copper].
    """
    changes: dict[str, Any] = {}
    if case.casting.length > table.length:
        changes["casting.length"] = f"{table.length!r} m"
    if table.condition == "cold":
        mould = nominal_mould(table, case.section)
        shape = None if wall is None else drawing(table, mould, wall).displacement
        if shape is None:
            changes["mould.condition"] = "working"
        else:
            changes["mould.displacement"] = WallShape().write(shape)
    if wall is not None and table.wall_temperature is not None and _takes_wall(case):
        changes["mould.wall_temperature"] = _temperature(*wall.profile())
    return case.with_(changes) if changes else case


def _takes_wall(case: Case) -> bool:
    """Return whether a law of the cooling takes the wall temperature from the mould."""
    return any(
        isinstance(law, Contact) and law.wall in (None, MOULD)
        for zone in case.cooling
        for law in zone.surface
    )


def _temperature(positions: Array, kelvin: Array) -> dict[str, Any]:
    """Return a table of the wall temperature for a case file."""
    rows = np.linspace(0.0, positions[-1], 21)
    return {
        "position": rows.tolist(),
        "position_unit": "m",
        "value": np.interp(rows, positions, kelvin).tolist(),
        "unit": "K",
    }


def _turn(strand: Followed, wall: HotWall, before: Turn | None) -> Turn:
    if before is None or before.strand is None:
        return Turn(strand, wall, np.nan, np.nan)
    change = wall.displacement.moved - before.wall.displacement.moved
    moved = float(np.hypot(change[..., 0], change[..., 1]).max())
    old, new = before.strand.value("heat_removed"), strand.value("heat_removed")
    return Turn(strand, wall, moved, (new - old) / old)


class CopperTemperatures:
    """Temperature of the copper of a case for the heat of its run; the strand keeps its wall."""

    def __init__(self, case: Case, folder: Path) -> None:
        self._case, self._folder = case, folder

    @cached_property
    def _tube(self) -> tuple[HotMould, Heated]:
        """The tube with its temperature; computed on first use."""
        table = table_of(self._case, str(self._folder))
        mould = nominal_mould(table, self._case.section)
        tube = HotMould(MPI.COMM_SELF, mould, copper_of(table), settings_of(table))
        assert table.tube is not None
        if table.tube.heated_by_strand:
            return tube, tube.heat(read_wall_flux(self._folder, table.length))
        return tube, tube.heat(given_flux(table, mould))

    def at(self, one: CopperThermocouples, position: float) -> Quantity:
        """Return the temperature at a thermocouple of a row.

        Args:
            one: The row.
            position: Position of the thermocouple below the meniscus, m.
        """
        tube, heated = self._tube
        length = tube.mould.length
        if not 0.0 <= position <= length * (1.0 + ROUNDING):
            raise InputError(
                f"{one.name}.temperature: {1e3 * position:g} mm is not within the mould, "
                f"which ends at {1e3 * length:g} mm"
            )
        around = float(tube.ways[-1])
        if one.way > around * (1.0 + ROUNDING):
            raise InputError(
                f"mould.tube.thermocouple {one.name}: way ({1e3 * one.way:g} mm) is beyond the "
                f"quarter of the wall, {1e3 * around:g} mm; give a smaller one"
            )
        places = np.array([min(position, length)])
        kelvin = tube.temperature_at(heated, places, min(one.way, around), one.depth)
        return Quantity(float(kelvin[0]), "degC", f"temperature of the copper at {one.name}")
