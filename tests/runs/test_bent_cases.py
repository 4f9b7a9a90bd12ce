"""Cases whose rolls bend the strand: planes, halves, history, and invalid input.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest
from bent_case import HALF, RADIUS, SEGMENT, bent
from runs.billet_runs import run_in_memory, simulated

from castfem.base.errors import InputError
from castfem.model import Case, load_case
from castfem.physics.mechanics.machine_bending import BentPlanes
from castfem.runs import loop
from castfem.runs.output.history import read_history
from castfem.runs.output.summary_file import Summary


def samples_of(case: Case) -> tuple[list[Any], float]:
    """Return the samples of a run in memory, and the number of modelled parts in the section."""
    return run_in_memory(case).samples, {"half": 2.0, "whole": 1.0}[case.section.symmetry]


def planes_of(case: Case) -> tuple[BentPlanes, Callable[[float], float]]:
    """Return the planes of a case, and the position of its slice over time."""
    with simulated(case) as simulation:
        planes = simulation.mechanics.problem.slice.planes
        assert isinstance(planes, BentPlanes)
        return planes, simulation.machine.position


def test_planes_follow_rolls() -> None:
    """(41): a2 = -a0 / (R - f/2), 1/R linear between the rolls; through states of a run."""
    kept = run_in_memory(bent())
    rolls, chi = [0.1, 0.6, 1.35], [0.0, 1.0 / RADIUS, 0.0]
    seen = []
    for state, sample in zip(kept.states, kept.samples[-len(kept.states) :], strict=True):
        a0, a1, a2, _ = state.mechanical.generalized_strains
        curvature = float(np.interp(sample.position, rolls, chi))
        middle = curvature / (1.0 - curvature * HALF)
        assert a2 == pytest.approx(-(1.0 + a0) * middle, rel=1e-12, abs=1e-15)
        assert a1 == 0.0
        seen.append(curvature)
    assert max(seen) == pytest.approx(1.0 / RADIUS, rel=1e-12)


@pytest.mark.parametrize(
    ("place", "axis"), [("intrados", HALF), ("centre", 0.0), ("extrados", -HALF), ("20 mm", 0.02)]
)
def test_imposed_neutral_axis(place: str, axis: float) -> None:
    """(42)-(44): the thickness is 1 at y1."""
    planes, position = planes_of(bent(mechanics__planes={"neutral_axis": place}))
    assert planes.free == ()
    time = 0.7 / 0.06
    assert position(time) == pytest.approx(0.7, rel=1e-12)
    radius = 0.75 / 0.65 * RADIUS
    a0, _, a2, _ = planes.at(time)[0]
    assert 1.0 + a0 == pytest.approx((radius - HALF) / (radius - HALF - axis), rel=1e-12)
    assert a2 == pytest.approx(-1.0 / (radius - HALF - axis), rel=1e-12)


def test_neutral_axis_on_the_compressed_face(tmp_path: Path) -> None:
    """Intrados in bending, extrados in straightening; the resolved case has both."""
    given = {"bending": "intrados", "straightening": "-50 mm"}
    case = bent(mechanics__planes={"neutral_axis": given}, casting__length="1.5 m")
    planes, position = planes_of(case)
    middle = 1.0 / (RADIUS - HALF)
    time = 1.45 / 0.06
    assert position(time) == pytest.approx(1.45, rel=1e-12)
    a0, _, a2, _ = planes.at(time)[0]
    assert 1.0 + a0 == pytest.approx((1.0 + middle * HALF) / (1.0 - middle * HALF), rel=1e-12)
    assert a2 == 0.0
    (tmp_path / "case.toml").write_text(case.resolved_toml())
    assert load_case(tmp_path / "case.toml").physics_hash() == case.physics_hash()


def test_force_from_a_file(tmp_path: Path) -> None:
    """Over position, for the whole strand; the resolved case has its rows."""
    path = tmp_path / "effort.csv"
    path.write_text("position [mm], value [kN]\n0, 0\n500, 20\n1500, 40\n")
    given = {"force": {"file": str(path)}, "force_contains_bending": True}
    case = bent(mechanics__planes=given)
    planes, position = planes_of(case)
    for time, effort in ((2.0, 4.8e3), (15.0, 28e3)):
        assert position(time) == pytest.approx(0.06 * time, rel=1e-12)
        assert planes.load(time)[0] == pytest.approx(0.5 * effort, rel=1e-12)
    assert planes.contains_work
    resolved = tmp_path / "case.toml"
    resolved.write_text(case.resolved_toml())
    path.unlink()
    assert load_case(resolved).physics_hash() == case.physics_hash()


def test_half_takes_half_of_the_load() -> None:
    """Force over position, moment and work of the whole strand, strain: whole = half."""
    table = {"position": [0, 1.5], "position_unit": "m", "value": [0, 60], "unit": "kN"}
    planes = {"force": table, "force_contains_bending": False}
    (half, parts), (whole, _) = (
        samples_of(
            bent(section__symmetry=part, mechanics__planes=planes, mechanics__tolerance=1e-8)
        )
        for part in ("half", "whole")
    )
    ours, theirs = half[-1].mechanics, whole[-1].mechanics
    assert theirs.load == pytest.approx(60e3, rel=1e-9)
    assert parts * ours.load == pytest.approx(theirs.load, rel=1e-12)
    for name in ("moment", "work"):
        found = parts * getattr(ours.bending, name)
        assert found == pytest.approx(getattr(theirs.bending, name), rel=1e-5)
    assert ours.strain == pytest.approx(theirs.strain, rel=1e-6)
    # N = F + k M - int M dk, as in the summary.
    assert ours.bending_force != 0.0
    left = ours.balance.axial[0] - ours.load - ours.bending_force
    assert abs(left) < 1e-7 * ours.load


def test_history_and_summary_name_the_faces(tmp_path: Path) -> None:
    """Intrados is y > 0; a resumed run has bent as an uninterrupted one."""
    case = bent()
    loop.run(case, tmp_path / "whole", comm=MPI.COMM_SELF)
    short = case.with_({"casting.length": "0.8 m"})
    loop.run(short, tmp_path / "parts", comm=MPI.COMM_SELF)
    loop.run(case, tmp_path / "parts", comm=MPI.COMM_SELF, resume=True)
    whole, parts = (read_history(tmp_path / name / "history.csv") for name in ("whole", "parts"))
    ours = {name.split(" [")[0] for name in whole.columns}
    for face in ("intrados", "extrados"):
        assert {f"axial_stress_mid_face_{face}", f"surface_temperature_corner_{face}"} <= ours
    assert {"curvature", "neutral_axis", "bending_moment", "bending_work"} <= ours
    last = parts.iloc[-1], whole.iloc[-1]
    for name in ("bending_moment", "bending_work", "axial_strain"):
        column = next(c for c in whole.columns if c.startswith(name))
        assert last[0][column] == pytest.approx(last[1][column], rel=1e-3)
    summary = Summary.load(tmp_path / "whole")
    assert summary is not None and summary.balances["heat"]["whole"].value < 1e-11


REFUSED = {
    "quarter": (
        {"section__symmetry": "quarter"}, "section.symmetry", "mirrors the strand at y = 0",
    ),
    "a2": ({"mechanics__planes": {"a2": "0.1 1/m"}}, "planes.a2", "impose the curvature"),
    "axis outside": (
        {"mechanics__planes": {"neutral_axis": "60 mm"}}, "planes.neutral_axis",
        "(60 mm) lies outside of the strand; from -50 mm (extrados) to 50 mm (intrados)",
    ),
    "one of two axes": (
        {"mechanics__planes": {"neutral_axis": {"bending": "intrados"}}}, "planes.neutral_axis",
        "a table has the keys bending and straightening",
    ),
    "axis and force": (
        {"mechanics__planes": {"neutral_axis": "centre", "force": "1 kN"}}, "planes.force",
        "has no effect where the neutral axis is imposed",
    ),
    "counted twice": (
        {"mechanics__planes": {"force": {"position": ["0 m", "1 m"], "value": ["0 N", "1 N"]}}},
        "planes.force_contains_bending", "is missing; true for a measured or maker's curve",
    ),
    "straight": (
        {"machine": {}, "mechanics__planes": {"closing": "axial"}}, "planes.closing",
        'give the rolls of [machine] a radius, or closing = "tangential"',
    ),
}  # fmt: skip


@pytest.mark.parametrize("mistake", REFUSED)
def test_invalid_input_is_rejected(mistake: str) -> None:
    """One line each: key, reason, fix."""
    changes, key, words = REFUSED[mistake]
    if mistake == "straight":
        changes = {**changes, "machine": {"first": "100 mm", "segment": [SEGMENT]}}
    with pytest.raises(InputError) as caught:
        bent(**changes)
    (problem,) = caught.value.problems
    assert key in problem
    assert words in problem
