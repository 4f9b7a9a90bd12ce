"""A run: its files, how it is stopped, and what it queries only once."""

from __future__ import annotations

import itertools
import json
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest
from runs.billet_runs import cells, run
from small_case import small

from castfem.base.errors import InputError, RunFailure
from castfem.model import Case, load_case
from castfem.runs import loop, recorder
from castfem.runs.output.fields import Fields
from castfem.runs.output.history import read_history
from castfem.runs.output.summary_file import Summary

CASES = Path(__file__).parents[2] / "cases"
COARSE = cells(2, 6, 12)


def billet(*overrides: str) -> Case:
    return load_case(CASES / "billet125" / "thermal.toml", (*COARSE, *overrides))


def test_run_writes_the_complete_folder(tmp_path: Path) -> None:
    summary = run(billet(), tmp_path)
    names = {p.name for p in tmp_path.iterdir() if not p.name.startswith(".")}
    assert names == {
        "case.toml",
        "run.json",
        "run.log",
        "history.csv",
        "fields.xdmf",
        "fields.h5",
        "checkpoint.h5",
        "summary.json",
    }
    record = json.loads((tmp_path / "run.json").read_text())
    assert record["status"] == "finished"
    assert record["ranks"] == 1
    assert {"castfem", "dolfinx", "petsc", "python"} <= record["versions"].keys()
    assert summary.quantities["position"].value == pytest.approx(0.6)
    assert summary.balances["heat"]["worst_step"].value < 1e-9
    assert summary.balances["heat"]["whole"].value < 1e-9
    assert {c.reference.quantity for c in summary.references} >= {"shell_mid_face", "shell_corner"}
    history = read_history(tmp_path / "history.csv")
    assert history["time"].iloc[0] == 0.0
    assert history["time"].iloc[-1] == 10.0
    assert (np.diff(history["heat_removed"]) > 0).all()
    assert (np.diff(history["shell_corner"]) >= -1e-9).all()
    assert history["temperature_min"].min() >= 160.0
    assert history["temperature_max"].max() <= 1542.5 + 1e-4
    again = load_case(tmp_path / "case.toml")
    assert again.physics_hash() == billet().physics_hash()


def test_heat_removed_agrees_with_the_flux_integrated(tmp_path: Path) -> None:
    """Two ways to one number: the balance's heat, and the surface flux over time at mid-face."""
    case = load_case(CASES / "verification" / "alloy_similarity.toml", ['casting.length="200 mm"'])
    run(case, tmp_path)
    history = read_history(tmp_path / "history.csv")
    late = history[history["time"] > 2.0]
    flux = late["heat_flux_mid_face"].to_numpy() * 1e3
    times = late["time"].to_numpy()
    by_flux = np.sum(0.5 * (flux[1:] + flux[:-1]) * np.diff(times)) * 0.3e-3
    by_balance = late["heat_removed"].iloc[-1] - late["heat_removed"].iloc[0]
    assert by_flux == pytest.approx(by_balance, rel=2e-3)


STEPS = 'thermal.time.step="0.1 s"'

KILLED = """
import os, signal, sys
from castfem.model import load_case
from castfem.runs import loop
class Killer:
    def start(self, *a): self.n = 0
    def update(self, *a):
        self.n += 1
        if self.n == int(sys.argv[3]): os.kill(os.getpid(), signal.SIGKILL)
    def stop(self): pass
loop.run(load_case(sys.argv[1], sys.argv[4:]), sys.argv[2], progress=Killer())
"""
RUBBING = (
    "mould.friction.law=coulomb",
    "mould.friction.coefficient=0.2",
    "coupling.interval=0.2 s",
    "casting.length=120 mm",
    "output.every=0.4 s",
)


@pytest.fixture(scope="module")
def never_killed(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., tuple[Path, Summary]]:
    """Return folder and summary of an uninterrupted run, once for all that are killed."""

    @cache
    def _whole(name: str, settings: tuple[str, ...]) -> tuple[Path, Summary]:
        folder = tmp_path_factory.mktemp("whole")
        file = CASES / "billet125" / f"{name}.toml"
        return folder, run(load_case(file, (*COARSE, *settings)), folder)

    return _whole


@pytest.mark.parametrize(
    ("name", "settings", "steps", "every", "times"),
    [
        ("thermal", (STEPS,), 33, 10, 21),
        ("taper_0", (*RUBBING, "mould.contact=nitsche"), 8, 3, 6),
        ("taper_0", RUBBING, 2, 20, 6),  # before the first checkpoint but that of the meniscus
    ],
)
def test_killed_and_resumed_run_is_the_uninterrupted_one(
    tmp_path: Path,
    never_killed: Callable[..., tuple[Path, Summary]],
    name: str,
    settings: tuple[str, ...],
    steps: int,
    every: int,
    times: int,
) -> None:
    """To the last bit: state, history, counts and fields; contact (Nitsche's, too) and friction."""
    overrides = (*COARSE, f"output.checkpoint_every={every}", *settings)
    file = CASES / "billet125" / f"{name}.toml"
    arguments = [str(file), str(tmp_path / "killed"), str(steps), *overrides]
    done = subprocess.run([sys.executable, "-c", KILLED, *arguments], check=False)
    assert done.returncode == -9
    assert json.loads((tmp_path / "killed" / "run.json").read_text())["status"] == "running"
    with Fields(tmp_path / "killed") as fields:  # all that was written, not only to the checkpoint
        reached = (steps - 1) * (0.1 if name == "thermal" else 0.2)
        assert fields.times[-1] > reached - 0.4
    case = load_case(file, overrides)
    resumed = run(case, tmp_path / "killed", resume=True)
    folder, whole = never_killed(name, settings)
    assert resumed.steps == whole.steps
    assert resumed.quantities == whole.quantities and resumed.balances == whole.balances
    for file_name in ("history.csv", "fields.xdmf"):
        one, other = ((f / file_name).read_bytes() for f in (tmp_path / "killed", folder))
        assert one == other, file_name
    with Fields(tmp_path / "killed") as ours, Fields(folder) as theirs:
        assert len(theirs.times) == times
        for field in theirs.names:
            for k in range(times):
                one, other = ours.values(field, k), theirs.values(field, k)
                assert np.array_equal(one, other, equal_nan=True), field


def test_checkpoint_of_other_physics_is_refused(tmp_path: Path) -> None:
    run(billet('casting.length="100 mm"'), tmp_path)
    with pytest.raises(InputError, match="another case"):
        run(billet('casting.speed="3 m/min"'), tmp_path, resume=True)
    # Settings of the solver are no physics.
    run(billet("thermal.solver.snes_max_it=40", 'casting.length="120 mm"'), tmp_path, resume=True)


def test_failed_run_has_a_reason_and_its_last_good_state(tmp_path: Path) -> None:
    case = billet('thermal.solver={ksp_type="preonly", pc_type="none", snes_max_it=5}')
    with pytest.raises(RunFailure, match="smallest step"):
        run(case, tmp_path)
    record = json.loads((tmp_path / "run.json").read_text())
    assert record["status"] == "failed"
    assert "smallest step" in record["reason"]
    summary = Summary.load(tmp_path)
    assert summary is not None and summary.status == "failed"
    assert (tmp_path / "checkpoint.h5").is_file()
    history = read_history(tmp_path / "history.csv")
    assert history["time"].iloc[-1] == pytest.approx(record["reached"]["time"])


def test_only_requested_files_are_written(tmp_path: Path) -> None:
    run(billet("output.fields=[]", "output.checkpoint_every=0", 'casting.length="60 mm"'), tmp_path)
    names = {p.name for p in tmp_path.iterdir()}
    assert not names & {"fields.xdmf", "fields.h5", "checkpoint.h5"}
    record = json.loads((tmp_path / "run.json").read_text())
    assert sorted(record["compiled_forms"]) == [
        "heat.conduction",
        "heat.storage",
        "heat.surface.corner",
        "heat.surface.narrow_face",
        "heat.surface.wide_face",
    ]


def test_only_the_requested_field_is_written(tmp_path: Path) -> None:
    run(billet('output.fields=["solid_fraction"]', 'casting.length="60 mm"'), tmp_path)
    text = (tmp_path / "fields.xdmf").read_text()
    assert "solid_fraction" in text
    assert "temperature" not in text


THERMAL_ONLY = """
import sys
from importlib.util import find_spec
from castfem.model import load_case
from castfem.runs import loop
loop.run(load_case(sys.argv[1], sys.argv[3:]), sys.argv[2])
parts = (
    *(f"castfem.physics.{name}" for name in ("mechanics", "constitutive", "contact")),
    *(f"castfem.physics.materials.{name}" for name in
      ("hot_tearing", "ductility", "microsegregation")),
    *(f"castfem.physics.machine.{name}" for name in
      ("rolls", "extraction", "bulging", "stations", "spray_layout")),
    *(f"castfem.runs.results.{name}" for name in
      ("probes", "crack_tracking", "hot_tearing_tracking")),
    "castfem.physics.thermal.spray_flux", "castfem.model.build.secondary", "castfem.studies",
    "castfem.runs.output.surface_maps",
)
unwanted = [m for m in sys.modules if f"{m}.".startswith(tuple(f"{name}." for name in parts))]
# scipy.sparse doubled the imports of a run.
unwanted += [m for m in ("gmsh", "matplotlib", "pandas", "pint", "scipy.sparse")
             if m in sys.modules]
import dolfinx
if "utils" in vars(dolfinx):  # later versions have in fem.petsc what imports numba
    unwanted += [m for m in ("numba",) if m in sys.modules]
    dolfinx.utils.numba_utils.MatSetValuesLocal  # at first use it is there
print("LOADED", unwanted, "GONE", [name for name in parts if find_spec(name) is None])
"""


def test_thermal_run_loads_only_what_it_needs(tmp_path: Path) -> None:
    case = str(CASES / "billet125" / "thermal.toml")
    overrides = [*COARSE, 'casting.length="60 mm"']
    run(billet('casting.length="60 mm"'), tmp_path / "first")  # the mesh is in the cache
    done = subprocess.run(
        [sys.executable, "-c", THERMAL_ONLY, case, str(tmp_path / "second"), *overrides],
        capture_output=True,
        text=True,
        check=True,
    )
    assert "LOADED [] GONE []" in done.stdout


def test_command_loads_only_what_it_needs(tmp_path: Path) -> None:
    """A billet loads no rolls, a mould no copper, a thermal run with figures no pandas."""
    code = (
        "import sys; from importlib.util import find_spec; from castfem.cli import execute; "
        "assert execute(sys.argv[2:]) == 0; unwanted = sys.argv[1].split(); "
        "print('LOADED', [n for n in unwanted if n in sys.modules], "
        "'GONE', [n for n in unwanted if find_spec(n) is None])"
    )
    rolls = "castfem.physics.machine.rolls castfem.physics.machine.bulging.creep"
    copper = "castfem.physics.mould.hot.tube castfem.studies.mould_fit.coupled dolfinx"
    heavy = "pandas gmsh pint urllib.request matplotlib.pyplot "
    heavy += "castfem.studies.accuracy castfem.studies.sweep castfem.studies.optimisation"
    taper = ("run", "billet125/taper_1", "-q", "-o", "run", "--accuracy", "coarse", "--set")
    taper = (*taper, "casting.length=6 mm", "--set", "output.figures=false")
    changes = [w for one in (*COARSE, "casting.length=60 mm") for w in ("--set", one)]
    run(billet("casting.length=60 mm"), tmp_path / "first")  # the mesh is in the cache
    for unwanted, command in (
        (rolls, taper),
        (copper, ("mould", "billet125/taper_1", "-o", "m.png")),
        (heavy, ("run", "billet125/thermal", "-o", "drawn", *changes)),
    ):
        done = subprocess.run(
            [sys.executable, "-c", code, unwanted, *command],
            cwd=tmp_path, capture_output=True, text=True, check=True,
        )  # fmt: skip
        assert "LOADED [] GONE []" in done.stdout, done.stdout
    assert (tmp_path / "drawn" / "figures" / "shell.png").is_file()
    assert "thinnest shell" in done.stdout  # read off the history


def test_simulation_has_only_the_laws_it_needs() -> None:
    from castfem.model.build.simulation import build
    from castfem.physics.thermal import flux_laws

    simulation = build(billet(), MPI.COMM_SELF)
    assert not simulation.stepper.estimate
    kinds = {type(law) for c in simulation.zones._coolings for _, law in c.laws}
    assert kinds == {flux_laws.Contact}
    adaptive = billet('thermal.time.adaptive={tolerance="1 K"}')
    assert build(adaptive, MPI.COMM_SELF).stepper.estimate


def test_full_caster_by_one_key(tmp_path: Path) -> None:
    summary = run(billet('casting.length="20 m"', "output.fields=[]"), tmp_path)
    assert summary.quantities["metallurgical_length"].value == pytest.approx(17.7, abs=0.5)
    assert summary.balances["heat"]["worst_step"].value < 1e-9
    assert summary.zones[0].name == "mould"
    history = read_history(tmp_path / "history.csv")
    for zone in summary.zones[:-1]:
        assert np.abs(history["position"] - zone.end).min() < 1e-9
    # The numbers of the thesis are compared at the mould's exit.
    ours = {c.reference.quantity: c.ours for c in summary.references}
    at_exit = history.iloc[(history["position"] - 0.6).abs().argmin()]
    assert ours["shell_mid_face"] == pytest.approx(1e-3 * at_exit["shell_mid_face"], rel=1e-9)


def test_missing_emissivity_is_reported_before_the_run(tmp_path: Path) -> None:
    case = load_case(
        CASES / "billet125" / "thermal.toml",
        ["steel.name=alloy_similarity", 'cooling.0.surface=[{law="radiation", ambient="25 degC"}]'],
    )
    with pytest.raises(InputError, match="emissivity"):
        run(case, tmp_path)


# What cannot change during a run is queried once, at any number of saves


def test_checkpoints_are_at_least_a_second_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without `output.checkpoint_every`; with it there is one every so many steps."""
    short = {"thermal.time": {"step": "10 ms"}, "output.fields": []}
    calls, saved = itertools.count(), []
    monkeypatch.setattr(recorder, "monotonic", lambda: 0.6 * next(calls))
    save = recorder.save_checkpoint

    def noted(path: Path, meta: dict[str, Any], *given: Any, **named: Any) -> None:
        saved.append(meta["counts"]["steps"])
        save(path, meta, *given, **named)

    monkeypatch.setattr(recorder, "save_checkpoint", noted)
    loop.run(small(short), tmp_path / "usual", comm=MPI.COMM_SELF)
    taken = saved[-1]
    assert taken > 80 and saved == [*range(0, taken, 40), taken]  # 20 steps take 0.6 s
    saved.clear()
    loop.run(small({**short, "output.checkpoint_every": 20}), tmp_path / "said", comm=MPI.COMM_SELF)
    assert saved == [*range(0, taken + 1, 20), taken]


# An error that looks like the end of typed input is a failure, not an interruption


@pytest.mark.parametrize("place", ["build", "TimeLoop.advance"])
def test_end_of_file_is_not_an_interruption(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    def cut_off(*_: object) -> None:
        raise EOFError("Ran out of input")

    monkeypatch.setattr(f"castfem.runs.loop.{place}", cut_off)
    with pytest.raises(EOFError, match="Ran out of input"):
        loop.run(small(), tmp_path, comm=MPI.COMM_SELF)
    record = json.loads((tmp_path / "run.json").read_text())
    assert record["status"] == "failed" and "Ran out of input" in record["reason"]
