"""Strand and hot mould going round: they agree, and what goes back is what the copper has."""

from __future__ import annotations

from mpi4py import MPI

import numpy as np
import pytest

from castfem.base.errors import InputError
from castfem.model import Case, load_case
from castfem.model.build_mould import build_mould, nominal_mould
from castfem.studies.mould_fit.coupled import AGREEMENT, Turn, drawing, flux_of, hot_mould_of
from castfem.studies.mould_fit.follow import follow

from .coarse import CASES, coarse

TUBE = (
    "casting.length=200 mm",
    "mould.length=200 mm",
    "mould.tube.thickness=10 mm",
    "mould.tube.cell_size=40 mm",
    "mould.tube.cells_across=1",
)


COLD = (
    "mould.condition=cold",
    "mould.wall_temperature=160 degC",
    "cooling.mould.surface.0.wall=mould",
)


def billet(*changes: str) -> Case:
    return coarse("taper_1", *TUBE, *changes)


@pytest.fixture(scope="module")
def turns() -> list[Turn]:
    return hot_mould_of(coarse("hot", *TUBE), MPI.COMM_SELF, "case", turns=8)


def test_shipped_case_is_the_billet_in_a_mould_drawn_cold() -> None:
    """What the page says of it: nothing but its mould, and where its wall's heat comes from."""
    hot, same = load_case(CASES / "hot.toml"), coarse("taper_1", *COLD)
    assert hot.mould is not None and same.mould is not None and hot.mould.tube is not None
    assert hot.mould.model_copy(update={"tube": None}) == same.mould
    assert hot.cooling[0] == same.cooling[0]
    assert hot.mould.tube.thickness == 0.01 and hot.mould.tube.support == "hung"


def test_cold_mould_needs_the_temperature_of_its_wall() -> None:
    with pytest.raises(InputError, match=r"a cold mould needs its temperature at work: wall_temp"):
        billet("mould.condition=cold")


def test_flux_of_a_run_is_the_heat_it_removes() -> None:
    case = billet()
    strand = follow(case, MPI.COMM_SELF)
    assert strand.positions[0] == 0.0 and strand.positions[-1] == pytest.approx(0.2)
    assert case.mould is not None
    flux = flux_of(strand, nominal_mould(case.mould, case.section))
    # Per metre of strand the heat of the run; along the mould the power of the quarter.
    power = strand.value("heat_removed") * 0.06
    assert 4.0 * flux.heat(np.linspace(0.0, 0.2, 81)) == pytest.approx(power, rel=0.04)
    assert strand.outline.shape == (*strand.flux.shape, 2)
    assert strand.outline[0] == pytest.approx(strand.line.place)
    assert 1e-5 < np.abs(strand.outline[-1] - strand.line.place).max() < 1e-3


def test_they_agree_after_a_few_turns(turns: list[Turn]) -> None:
    assert 3 <= len(turns) <= 6
    assert turns[-1].moved < AGREEMENT.shape and abs(turns[-1].heat) < AGREEMENT.heat
    assert turns[1].moved > turns[-1].moved
    assert all(turn.strand is not None for turn in turns)


def test_strand_meets_the_hot_wall_at_last(turns: list[Turn]) -> None:
    """Its last run had the wall and the wall temperature of the turn before."""
    last, before = turns[-1].strand, turns[-2].wall
    assert last is not None
    hot = last.flux[-1]
    coefficient = 1600.0
    # Where the wall is colder than 160 degC more heat goes: mid-face, in contact.
    first = turns[0].strand
    assert first is not None
    wall = float(np.interp(last.positions[-1], *before.profile()))
    change = hot[0] / first.flux[-1][0] - 1.0
    assert np.sign(change) == np.sign(433.15 - wall)
    assert abs(change) < coefficient * abs(433.15 - wall) / first.flux[-1].max() + 0.02


def test_drawing_of_a_cold_mould_fills_it_at_the_meniscus(turns: list[Turn]) -> None:
    case = billet("mould.condition=cold", "mould.wall_temperature=160 degC")
    assert case.mould is not None
    nominal = nominal_mould(case.mould, case.section)
    found = drawing(case.mould, nominal, turns[-1].wall)
    assert found.hot.dimensions(0.0)["width"] == pytest.approx(0.125)
    assert found.cold.dimensions(0.0)["width"] < 0.12495
    difference = found.hot.dimensions(0.15)["width"] - found.cold.dimensions(0.15)["width"]
    heat = turns[-1].wall.displacement.at(0.15)[0, 0]
    assert difference == pytest.approx(2.0 * heat, abs=1e-9)
    assert found.displacement is not None
    run = case.with_({"mould.displacement": _columns(found.displacement)})
    assert run.mould is not None
    assert build_mould(run.mould, run.section).dimensions(0.15) == found.hot.dimensions(0.15)


def _columns(wall: object) -> object:
    from castfem.model.wall_shape import WallShape

    return WallShape().write(wall)  # type: ignore[arg-type]


def test_case_without_a_tube_is_refused() -> None:
    case = load_case(CASES / "taper_1.toml")
    with pytest.raises(InputError, match=r"^mine: mould.tube: the table is missing"):
        hot_mould_of(case, MPI.COMM_SELF, "mine")


def test_given_flux_needs_no_strand() -> None:
    case = billet("mould.tube.flux=2 MW/m^2")
    (turn,) = hot_mould_of(case, MPI.COMM_SELF, "case", turns=5)
    assert turn.strand is None and turn.wall.heated.supplied > 0.0
