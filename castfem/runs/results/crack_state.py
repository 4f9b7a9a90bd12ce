"""State of the crack indexes and of hot tearing at one time of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.constants import ROUNDING
from castfem.base.types import Array, Flags
from castfem.physics.machine.stations import Stations
from castfem.physics.materials import hot_tearing as laws
from castfem.physics.materials.hot_tearing import MushyHistory
from castfem.runs.output.surface_maps import (
    SurfaceLine,
)

if TYPE_CHECKING:
    from castfem.physics.mechanics.state import MechanicalState

TimedStrains = tuple[float, float, float, float]
"""Time (s), and the generalized strains a0 - 1, a1, a2."""


@dataclass(frozen=True, slots=True)
class Tearing:
    """Values of the criteria at the owned vertices after a step; its arrays are never modified."""

    history: MushyHistory  #: history of each vertex in the mushy zone
    width: float  #: width of the brittle range, K
    mushy: float  #: temperature range of the stress relief before it, K
    law: laws.CriticalStrain  #: parameters of the criterion "won"
    feeding: laws.Feeding | None  #: parameters of the criterion "rdg"; None without it
    enthalpy: Array  #: enthalpy at the vertices, J/m3
    rate: Array  #: rate of the enthalpy at the end of the step, W/m3
    strain: Array  #: strain at the deviator's points, Mandel (n, 4); empty without mechanics
    here: Flags  #: whether each vertex was in the brittle range within the step
    passed: Flags  #: whether it has left the range
    mechanical: MechanicalState | None = None  #: state of the slice; None without mechanics

    def won(self) -> Array:
        """Strain across the dendrites in the range so far over the critical one (n,)."""
        history = self.history
        return laws.won_damage(history.strain, history.vulnerable, self.width, self.law)

    def clyne_davies(self) -> Array:
        """Time in the range over that before it (n,); 0 before the end of the range."""
        found = laws.clyne_davies(self.history.vulnerable, self.history.relief)
        return np.where(self.passed, found, 0.0)

    def rdg(self) -> Array:
        """Pressure drop from mean values on the way, Pa (n,); 0 before the end of the range."""
        assert self.feeding is not None
        history = self.history
        time = history.relief + history.vulnerable
        cooling = self.mushy / np.where(time > 0.0, time, np.inf)
        drop = self.feeding.pressure_drop(history.strain_rate(), history.gradient(), cooling)
        return np.where(self.passed, drop, 0.0)


@dataclass(frozen=True, slots=True)
class Worst:
    """The largest value of an index, with its place and time."""

    value: float = 0.0  #: in SI
    x: float = 0.0  #: coordinate on the undeformed section, m
    y: float = 0.0  #: coordinate on the undeformed section, m
    time: float = 0.0  #: s
    position: float = 0.0  #: m


@dataclass(frozen=True, slots=True)
class QualityState:
    """State of the indexes at one time; its arrays are never modified."""

    line: SurfaceLine  #: the surface
    caster: Stations  #: the rolls
    time: float = -1.0  #: s; -1 before the first sample
    temperature: Array = field(default_factory=lambda: np.zeros(0))  #: of the owned vertices, K
    strain_history: tuple[TimedStrains, ...] = ()  #: generalized strains over the last roll pitch
    #: the sample from which rates are computed, and those since: time, temperature at the owned
    #: vertices, K
    recent: tuple[tuple[float, Array], ...] = ()
    #: values of each index at the owned vertices
    values: Mapping[str, Array] = field(default_factory=dict)
    largest: Mapping[str, Worst] = field(default_factory=dict)  #: largest values at this time
    worst: Mapping[str, Worst] = field(default_factory=dict)  #: largest values since the meniscus
    #: largest values in bending and straightening, if the slice has come there
    in_phase: Mapping[str, Mapping[str, Worst]] = field(default_factory=dict)
    #: temperature on the centre line, K; NaN in a section without a probe to the centre
    centre: float = np.nan
    #: solid fraction on the centre line; None in a section without a probe to the centre
    solid_fraction: float | None = None
    #: position at which the centre line reached each solid fraction, m
    passed: Mapping[float, float] = field(default_factory=dict)
    #: values of the hot tearing criteria; None if the case names none
    tearing: Tearing | None = None

    def words(self, worst: Worst | None) -> str:
        """Description of the largest value: place, position, roll, time, phase; "" without any."""
        if worst is None or not worst.value > 0.0:
            return ""
        vertex = self.line.at(worst.x, worst.y)
        off = self.line.place[vertex] - (worst.x, worst.y)
        on = np.abs(off).max() <= ROUNDING * np.ptp(self.line.place)
        depth = f"{1e3 * self.line.depth(worst.x, worst.y):.3g} mm deep"
        place = f"x = {1e3 * worst.x:.1f}, y = {1e3 * worst.y:.1f} mm, {depth}"
        where = self.line.words(vertex) if on else place
        return f"{where}, {self.caster.words(worst.position, worst.time)}"

    def within(self, phase: str, index: str) -> Worst | None:
        """The largest value of an index in a phase; None before that phase."""
        return self.in_phase.get(phase, {}).get(index)
