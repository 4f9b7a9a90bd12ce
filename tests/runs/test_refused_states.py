"""Runs that leave what the model can speak of end there, with the state before on disk."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from mechanics.setups import SliceSetup, box, mapped
from runs.billet_runs import FED, billet, run

from castfem.base.errors import RunFailure
from castfem.physics.constitutive.elasticity import Elasticity, Solidity
from castfem.physics.constitutive.flow_laws import ThermoElastic
from castfem.runs.output.history import read_history

SLAB = (
    'section={shape="rectangle", width="1200 mm", height="220 mm", symmetry="quarter"}',
    'mesh={surface_size="8 mm", corner_size="8 mm", face_size="60 mm", core_size="60 mm", order=2}',
    "casting.speed=1.2 m/min", "casting.length=160 mm", "cooling.mould.to=100 mm",
    'mould={length="100 mm", taper="1 %/m"}', "mechanics.liquid_stiffness=1e-5",
    "coupling.interval=1 s",
)  # fmt: skip
LAW = ThermoElastic(Elasticity.constant(1e10, 0.3, Solidity.between(1700.0, 1750.0)))
NO_MOULD = "section.symmetry=half"


def refused(folder: Path, name: str, *overrides: str) -> tuple[str, float]:
    """Run a case that must fail; its reason, and the last instant of its history, s."""
    with pytest.raises(RunFailure) as caught:
        run(billet(name, *overrides), folder)
    record = json.loads((folder / "run.json").read_text())
    assert record["status"] == "failed" and record["reason"] == str(caught.value)
    history = read_history(folder / "history.csv")
    last = history.iloc[-1]
    assert record["reached"]["time"] == pytest.approx(last["time"], rel=1e-9)
    assert (folder / "checkpoint.h5").is_file()
    assert history["temperature_max"].max() < 1543.0 and history["temperature_min"].min() > 0.0
    return str(caught.value), float(last["time"])


def test_a_force_beyond_what_the_section_carries(tmp_path: Path) -> None:
    told, _ = refused(tmp_path, "taper_1", "mechanics.planes.force=20 kN")
    assert "times as thick" in told and "there is no shell yet" in told


def test_a_moment_beyond_what_the_section_carries(tmp_path: Path) -> None:
    told, _ = refused(tmp_path, "idealised", NO_MOULD, "mechanics.planes.moment_y=2 kN m")
    assert "times as thick" in told


@pytest.mark.parametrize(
    ("symmetry", "load"), [("half", "moment_y=3 kN m"), ("whole", "moment_x=2 kN m")]
)
def test_a_moment_before_there_is_a_shell(tmp_path: Path, symmetry: str, load: str) -> None:
    """The first window says so: no shorter one has more that could bear it."""
    changes = (*FED, f"section.symmetry={symmetry}", f"mechanics.planes.{load}")
    with pytest.raises(RunFailure) as caught:
        run(billet("taper_1", *changes), tmp_path)
    assert f"mechanics.planes.{load.partition('=')[0]}: there is no shell yet" in str(caught.value)
    assert "smallest step" not in str(caught.value)


def test_a_load_that_little_would_bear_is_not_blamed() -> None:
    """Elastic strain alone, in what there is, tells whether a shorter step may do."""
    simulation = SliceSetup(mapped(1, 1, box(0.1, 0.1)), LAW, judge=True)
    judge, count = simulation.stepper._validity, simulation.problem.points.count
    assert judge is not None
    hot, cold = np.full(count, 1800.0), np.full(count, 1000.0)
    area = 0.1 * 0.1
    young = LAW.elasticity.moduli(np.array([1800.0]))[2][0]
    assert judge.unborne({"force": 0.09 * young * area}, hot) == ""
    assert "planes.force: there is no shell" in judge.unborne({"force": 0.12 * young * area}, hot)
    assert judge.unborne({"force": 1e12}, cold) == "" == judge.unborne({}, hot)


def test_a_slab_that_nothing_holds_below_the_mould(tmp_path: Path) -> None:
    told, time = refused(tmp_path, "taper_1", *SLAB)
    assert "beyond small strain" in told and 'mechanics.strain = "large"' in told
    assert time >= 5.0  # the mould held it


def test_a_face_that_is_held_in_a_mould_that_closes(tmp_path: Path) -> None:
    """It cannot give way, and the wall goes on into it: 16 GPa before the end of the mould."""
    held = 'mechanics.held=[{on=["narrow_face"], component="x"}]'
    told, time = refused(tmp_path, "taper_1", held, "casting.length=150 mm")
    assert "the wall's pressure alone" in told and "supports" in told
    assert 0.2 < time < 2.0
