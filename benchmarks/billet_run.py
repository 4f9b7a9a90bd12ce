"""Run of one billet of thesis V.2 in memory, and its results for tables and figures.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from time import process_time

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from benchmarks.report import ROOT
from castfem.base.errors import CastfemError
from castfem.model import load_case
from castfem.model.build.simulation import build
from castfem.runs.loop import TimeLoop
from castfem.runs.results.headline import OPEN, spells
from castfem.runs.results.run_state import RunState
from castfem.runs.results.sample import Sample
from castfem.runs.results.summary import quantities

CASES = ROOT / "cases" / "billet125"
MOULDS = ("idealised", "taper_3", "taper_1", "taper_0", "taper_minus_1", "taper_minus_3")
NAMES = dict(
    zip(MOULDS, ("idealised", "+3 %/m", "+1 %/m", "0 %/m", "-1 %/m", "-3 %/m"), strict=True)
)
PATIENCE = 300.0  # s of processor time after which a run is stopped
HALF_FACE = 62.5e-3  # m

SHOWN = {
    "heat_removed_slice": ("heat [kJ]", ".2f"),
    "shell_mid_face": ("shell, mid-face [mm]", ".2f"),
    "shell_corner": ("shell, corner [mm]", ".2f"),
    "surface_temperature_mid_face": ("surface, mid-face [°C]", ".0f"),
    "surface_temperature_corner": ("surface, corner [°C]", ".0f"),
    "von_mises_max": ("peak stress [MPa]", ".2f"),
    "von_mises_mid_face": ("stress, mid-face [MPa]", ".2f"),
    "size_mid_face": ("width [mm]", ".3f"),
    "size_corner": ("diagonal [mm]", ".3f"),
}
"""Quantities of the tables: heading and format."""

# Coarse cells and windows, to see trends.
COARSE = (
    "mesh.surface_size=1.2 mm",
    "mesh.corner_size=1.2 mm",
    "mesh.face_size=8 mm",
    "mesh.core_size=12 mm",
    "coupling.interval=0.2 s",
)
QUIET = ("output.fields=[]", "output.figures=false", "output.checkpoint_every=0")


def mesh(size: float) -> tuple[str, ...]:
    """Return the keys for cells of `size` mm at the surface, others in the shipped proportion."""
    scale = size / 0.8
    return (
        f"mesh.surface_size={size:g} mm",
        f"mesh.corner_size={size:g} mm",
        f"mesh.face_size={6 * scale:g} mm",
        f"mesh.core_size={8 * scale:g} mm",
    )


def every(window: float) -> str:
    """Return the key for coupling windows of `window` s."""
    return f"coupling.interval={window:g} s"


def touch(method: str, factor: float) -> str:
    """Return the key for contact by a method with a factor."""
    return f'mould.contact={{method="{method}",factor={factor}}}'


class Late(CastfemError):
    """A run has taken too long."""


@dataclass
class Listener:
    """Replaces the recorder of a run: checks the time and keeps results of every window."""

    deadline: float  #: time at which the run is stopped, s of `process_time`
    penetration: float = 0.0  #: largest penetration of all windows, m
    unbalanced: float = 0.0  #: largest error of the forces
    force: float = np.nan  #: force of the wall on half a face in the last window, N/m of strand
    pressure: float = np.nan  #: pressure on mid-face in the last window, Pa
    #: position [m], gap [mm] and surface temperature [K] by probe, diagonal [m], of every window
    tracks: dict[str, list[float]] = field(default_factory=dict)

    def step(self, run: RunState, sample: Sample) -> None:
        """Record a committed window.

        Raises:
            Late: The deadline has passed.
        """
        if process_time() > self.deadline:
            raise Late(f"given up at {sample.time:.2f} s")
        self._note("position", sample.position)
        for name, profile in sample.profiles.items():
            self._note(f"surface {name}", float(profile.temperature[0]))
        strained = sample.mechanics
        if strained is None:
            return
        self._note("diagonal", strained.across["corner"])
        for name, gap in strained.gap.items():
            self._note(f"gap {name}", 1e3 * gap)
        if strained.balance is None:
            return
        self.unbalanced = max(self.unbalanced, strained.balance.forces_error)
        if strained.contact is not None:
            self.penetration = max(self.penetration, strained.contact.penetration)
            self.force = abs(float(strained.contact.force[0]))
            self.pressure = strained.pressure["mid_face"]

    def _note(self, name: str, value: float) -> None:
        self.tracks.setdefault(name, []).append(value)

    def track(self, name: str) -> npt.NDArray[np.float64]:
        """Return a track as an array."""
        return np.array(self.tracks[name])

    def cools_to(self, name: str, temperature: float) -> float:
        """Return where a probe's surface first cools to a temperature [K], mm; NaN if never."""
        surface, position = self.track(f"surface {name}"), 1e3 * self.track("position")
        below = np.flatnonzero(surface < temperature)
        if not below.size:
            return np.nan
        i = int(below[0])
        share = (surface[i - 1] - temperature) / (surface[i - 1] - surface[i])
        return float(position[i - 1] + share * (position[i] - position[i - 1]))

    def lost(self) -> float:
        """Return where contact is first lost at a probe as in `castfem show`, mm; NaN if never."""
        gaps = [self.track(name) for name in self.tracks if name.startswith("gap ")]
        found = [s.start for gap in gaps for s in spells(gap, self.track("position"), OPEN)]
        return 1e3 * min(found, default=np.nan)

    def diagonal(self, position: float) -> float:
        """Return the diagonal at a position [m], m."""
        return float(np.interp(position, self.track("position"), self.track("diagonal")))


@dataclass(frozen=True)
class Found:
    """Results of one run."""

    #: results at the exit of the mould by name, in the units of the tables
    values: Mapping[str, float]
    seconds: float  #: processor time of the time loop
    cells: int  #: number of cells
    failure: str = ""  #: message of a run that failed, otherwise ""
    cut: int = 0  #: number of windows that were cut back
    newton: int = 0  #: number of Newton iterations of the mechanics
    windows: int = 0  #: number of windows
    #: labels of the values in the summary, with the position of a maximum
    labels: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)  #: units of the values in the summary


def run(mould: str, changes: Iterable[str] = (), patience: float = PATIENCE) -> Found:
    """Run one billet with some keys changed."""
    case = load_case(CASES / f"{mould}.toml", (*QUIET, *changes))
    simulation = build(case, MPI.COMM_SELF)
    listener = Listener(process_time() + patience)
    loop = TimeLoop(simulation, listener)  # type: ignore[arg-type]
    start, failure = process_time(), ""
    try:
        loop.run()
    except CastfemError as error:
        failure = str(error)
    seconds = process_time() - start
    assert loop.run_state.sample is not None
    summary = quantities(loop.run_state.sample)
    values = {n: q.shown for n, q in summary.items()}
    values |= _on_the_way(listener, simulation.steel.solidus, simulation.steel.liquidus)
    cells = simulation.section.mesh.topology.index_map(2).size_global
    iterations = 0 if simulation.mechanics is None else simulation.mechanics.problem.iterations
    simulation.destroy()
    found = Found(
        values, seconds, cells, failure, loop.run_state.counts.cut_back, iterations,
        loop.run_state.counts.windows,
        {n: q.label for n, q in summary.items()}, {n: q.shown_unit for n, q in summary.items()},
    )  # fmt: skip
    print(f"  {mould} {' '.join(changes)}: {seconds:.1f} s {failure}", flush=True)
    return found


def _on_the_way(listener: Listener, solidus: float, liquidus: float) -> dict[str, float]:
    """Return results that the summary does not have; units of the tables: mm, um, %/m, kN/m, MPa.

    The taper is (303): closure of the diagonal over its size at the exit and the length, from
    125 mm below the meniscus (225 mm of the mould) on.
    """
    found = {
        "penetration": 1e6 * listener.penetration,
        "unbalanced": listener.unbalanced,
        "lost": listener.lost(),
        "first_mush": listener.cools_to("corner", liquidus),
        "first_solid": listener.cools_to("corner", solidus),
        "closed_mush": listener.cools_to("mid_face", liquidus),
        "closed_solid": listener.cools_to("mid_face", solidus),
        "force": 1e-3 * listener.force,
        "pressure_mean": 1e-6 * listener.force / HALF_FACE,
        "pressure_mid_face": 1e-6 * listener.pressure,
    }
    final = listener.diagonal(0.6)
    found["taper_corner"] = 100.0 * (listener.diagonal(0.125) - final) / (final * 0.475)
    return found
