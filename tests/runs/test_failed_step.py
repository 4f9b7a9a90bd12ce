"""A failed attempt leaves the slice unchanged: temperature, mechanics, contact and friction."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest
from mechanics.setups import SliceSetup, box, mapped
from runs.billet_runs import FED, Kept, billet, run

from castfem.base.errors import RunFailure
from castfem.model.build.simulation import Simulation, build
from castfem.physics.constitutive.elasticity import Elasticity, Solidity
from castfem.physics.constitutive.flow_laws import ThermoElastic
from castfem.physics.contact.state import OPEN, SLIP
from castfem.physics.coupling.staggered import CouplingWindow, StaggeredCoupling, StrandState
from castfem.physics.mechanics.problem import MechanicalProblem
from castfem.physics.mechanics.stepper import MechanicalStepper
from castfem.runs import restart
from castfem.runs.loop import TimeLoop
from castfem.runs.output.history import read_history
from castfem.runs.results.run_state import RunState
from castfem.runs.results.sample import Sample

RUBBING = (
    "mould.friction.law=coulomb", "mould.friction.coefficient=0.2", "mould.contact=nitsche",
    "casting.length=210 mm", "coupling.interval=0.5 s", "mesh.surface_size=3 mm",
    "mesh.corner_size=3 mm", "mesh.face_size=14 mm", "coupling.window_error=1000 K",
)  # fmt: skip
BEFORE, WHEN = 3.0, 3.5  # s: the window whose first attempt fails, the corner half open
Bits = dict[str, bytes]


def bits(part: Any, name: str = "state") -> Bits:
    """Return every number of a state, as bytes, by its path."""
    if is_dataclass(part):
        below = (bits(getattr(part, f.name), f"{name}.{f.name}") for f in fields(part))
        return {key: found for one in below for key, found in one.items()}
    if isinstance(part, tuple) and any(is_dataclass(one) for one in part):
        return {k: b for i, one in enumerate(part) for k, b in bits(one, f"{name}[{i}]").items()}
    return {name: np.asarray(part).tobytes()}


class Attempts:
    """Watches the coupling, and spoils its first attempt to reach `WHEN`.

    Args:
        patch: Patch for the time of the run.
        spoil: Function of the patch for the failing attempt that spoils what the attempt uses; if
            None, nothing is computed in its place.

    Attributes:
        before: The committed state at the beginning of each failed attempt.
        after: The same state at its end.
        given: The initial state of the attempt that follows each of these.
    """

    def __init__(
        self, patch: pytest.MonkeyPatch, spoil: Callable[[pytest.MonkeyPatch], None] | None
    ) -> None:
        self.before: list[Bits] = []
        self.after: list[Bits] = []
        self.given: list[StrandState] = []
        self._spoil, self._patch, self._take = spoil, patch, StaggeredCoupling.take
        patch.setattr(
            StaggeredCoupling,
            "take",
            lambda coupling, old, end, error: self.take(coupling, old, end, error),
        )

    def take(
        self, coupling: StaggeredCoupling, old: StrandState, end: float, error: float
    ) -> CouplingWindow:
        if len(self.given) < len(self.before):
            self.given.append(old)
        if self.before or end != WHEN:
            return self._take(coupling, old, end, error)
        self.before.append(bits(old))
        found = self._fail(coupling, old, end, error)
        self.after.append(bits(old))
        assert not found.converged and found.state is old
        return found

    def _fail(
        self, coupling: StaggeredCoupling, old: StrandState, end: float, error: float
    ) -> CouplingWindow:
        if self._spoil is None:
            nothing: Any = SimpleNamespace(reason="spoilt", refused=False, unborne=False)
            return CouplingWindow(False, old, nothing, nothing, 1)
        with self._patch.context() as patch:
            self._spoil(patch)
            return self._take(coupling, old, end, error)


def untried(patch: pytest.MonkeyPatch) -> None:
    """Give up the mechanics before they begin; the temperatures are at the new time."""

    def step(self: MechanicalStepper, old: Any, time: float, temperature: Any) -> Any:
        nothing = np.zeros(self.problem.points.deviator_points)
        return SimpleNamespace(
            converged=False,
            state=old,
            newton=0,
            reason="spoilt",
            dissipation=nothing,
            refused=False,
            unborne=False,
        )

    patch.setattr(MechanicalStepper, "step", step)


def half_way(patch: pytest.MonkeyPatch) -> None:
    """End Newton's method after two iterations, far from equilibrium, with contact evaluated."""
    solve = MechanicalProblem.solve

    def cut(self: MechanicalProblem, guesses: Any) -> Any:
        snes = self.solver.snes
        before = snes.getTolerances()
        snes.setTolerances(max_it=2)
        try:
            return solve(self, guesses)
        finally:
            snes.setTolerances(*before)

    patch.setattr(MechanicalProblem, "solve", cut)


def found_and_lost(patch: pytest.MonkeyPatch) -> None:
    """Solve the mechanics with their contact, and report that they have not converged."""
    step = MechanicalStepper.step

    def lost(self: MechanicalStepper, old: Any, time: float, temperature: Any) -> Any:
        result = step(self, old, time, temperature)
        assert result.converged
        return replace(result, converged=False, state=old, reason="spoilt", balance=None)

    patch.setattr(MechanicalStepper, "step", lost)


def repeated(patch: pytest.MonkeyPatch) -> None:
    """Let a first iteration succeed with a gap not converged, and the next one fail."""
    step, calls = MechanicalStepper.step, []

    def second(self: MechanicalStepper, old: Any, time: float, temperature: Any) -> Any:
        result = step(self, old, time, temperature)
        calls.append(time)
        if len(calls) == 1:
            return result
        return replace(result, converged=False, state=old, reason="spoilt", balance=None)

    patch.setattr(MechanicalStepper, "step", second)
    patch.setattr(StaggeredCoupling, "_misjudged", lambda *given: 1e3)  # K


class Undisturbed(Kept):
    """Keeps a run whose spoilt attempt computes nothing, and a checkpoint from before it."""

    def __init__(self, simulation: Simulation) -> None:
        super().__init__()
        self.simulation = simulation
        self.checkpoint: tuple[Any, Any] = (None, None)

    def step(self, run: RunState, sample: Sample) -> None:
        super().step(run, sample)
        if sample.time == BEFORE:
            self.checkpoint = restart.description(run), restart.arrays(run)


@pytest.fixture(scope="module")
def undisturbed() -> Iterator[Undisturbed]:
    """Return the run that takes the same windows."""
    simulation = build(billet("taper_0", *RUBBING), MPI.COMM_SELF)
    with pytest.MonkeyPatch.context() as patch:
        Attempts(patch, None)
        kept = Undisturbed(simulation)
        TimeLoop(simulation, kept).run()  # type: ignore[arg-type]
    yield kept
    simulation.destroy()


@pytest.mark.parametrize("spoil", [untried, half_way, found_and_lost, repeated])
def test_failed_attempt_leaves_no_trace(
    undisturbed: Undisturbed, monkeypatch: pytest.MonkeyPatch, spoil: Callable[[Any], None]
) -> None:
    attempts, kept = Attempts(monkeypatch, spoil), Kept()
    time_loop = TimeLoop(undisturbed.simulation, kept)  # type: ignore[arg-type]
    restart.restore(time_loop.run_state, *undisturbed.checkpoint)
    time_loop.run()
    (old,) = attempts.given
    assert attempts.before == attempts.after == [bits(old)]
    # Contact, friction, flow and Nitsche's own state could have been spoilt ...
    assert old.mechanical is not None and old.mechanical.contact is not None
    contact = old.mechanical.contact
    assert set(contact.status) == {OPEN, SLIP} and np.abs(contact.friction[:, 1]).max() > 1e3
    for array in (
        contact.stress, contact.internal, contact.withdrawal_resistance, old.mechanical.internal,
        old.heating,
    ):  # fmt: skip
        assert np.abs(array).max() > 1e-8
    # ... all at one instant: the slice was strained by its own temperatures.
    assert old.time == old.thermal.time == old.mechanical.time == BEFORE
    assert np.array_equal(old.mechanical.temperature, old.thermal.point.temperature)
    # The run continues as if the attempt had never been.
    assert time_loop.run_state.counts.cut_back == 1
    same = undisturbed.states[-len(kept.states) :]
    assert same[0].time > BEFORE and len(same) == 3 and same[-1].time == WHEN
    for ours, theirs in zip(kept.states, same, strict=True):
        one, other = bits(ours), bits(theirs)
        assert not [name for name in one if one[name] != other[name]]


# Runs that leave the validity of the model end, with the state before on disk


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
    """Run a case that must fail; return the reason and the last instant of its history, s."""
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


def test_force_beyond_the_section_is_refused(tmp_path: Path) -> None:
    reason, _ = refused(tmp_path, "taper_1", "mechanics.planes.force=20 kN")
    assert "times as thick" in reason and "there is no shell yet" in reason


def test_moment_beyond_the_section_is_refused(tmp_path: Path) -> None:
    reason, _ = refused(tmp_path, "idealised", NO_MOULD, "mechanics.planes.moment_y=2 kN m")
    assert "times as thick" in reason


@pytest.mark.parametrize(
    ("symmetry", "load"), [("half", "moment_y=3 kN m"), ("whole", "moment_x=2 kN m")]
)
def test_moment_before_a_shell_is_refused(tmp_path: Path, symmetry: str, load: str) -> None:
    """The first window already fails: no shorter one has more that could take the load."""
    changes = (*FED, f"section.symmetry={symmetry}", f"mechanics.planes.{load}")
    with pytest.raises(RunFailure) as caught:
        run(billet("taper_1", *changes), tmp_path)
    assert f"mechanics.planes.{load.partition('=')[0]}: there is no shell yet" in str(caught.value)
    assert "smallest step" not in str(caught.value)


def test_load_that_a_thin_shell_takes_is_not_blamed() -> None:
    """The elastic strain of the present shell decides whether a shorter step may help."""
    simulation = SliceSetup(mapped(1, 1, box(0.1, 0.1)), LAW, judge=True)
    judge, count = simulation.stepper._validity, simulation.problem.points.count
    hot, cold = np.full(count, 1800.0), np.full(count, 1000.0)
    area = 0.1 * 0.1
    young = LAW.elasticity.moduli(np.array([1800.0]))[2][0]
    assert judge.unborne({"force": 0.09 * young * area}, hot) == ""
    assert "planes.force: there is no shell" in judge.unborne({"force": 0.12 * young * area}, hot)
    assert judge.unborne({"force": 1e12}, cold) == "" == judge.unborne({}, hot)


def test_slab_without_support_below_the_mould_fails(tmp_path: Path) -> None:
    reason, time = refused(tmp_path, "taper_1", *SLAB)
    assert "beyond small strain" in reason and 'mechanics.strain = "large"' in reason
    assert time >= 5.0  # the mould held it


def test_held_face_in_a_closing_mould_fails(tmp_path: Path) -> None:
    """It cannot yield, and the wall moves into it: 16 GPa before the end of the mould."""
    held = 'mechanics.held=[{on=["narrow_face"], component="x"}]'
    reason, time = refused(tmp_path, "taper_1", held, "casting.length=150 mm")
    assert "the wall's pressure alone" in reason and "supports" in reason
    assert 0.2 < time < 2.0
