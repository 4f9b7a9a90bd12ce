"""Build the foundation of the wide faces from [mechanics.bulging] and the rolls."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.constants import same_or_before
from castfem.base.errors import RunFailure
from castfem.base.types import Array
from castfem.fem.probes import LineProbes, Profile
from castfem.fem.rank_zero import shared_out
from castfem.model.build.shell_prediction import Core, ShellPrediction
from castfem.physics.contact.roll_support import Bed
from castfem.physics.machine.bulging import (
    Bulge,
    BulgingModel,
    CreepingStrip,
    Shell,
    Span,
)
from castfem.physics.machine.bulging.result import along

if TYPE_CHECKING:
    from castfem.physics.machine import Machine
    from castfem.physics.machine.bulging.uneven import UnevenRolls

Memory = Mapping[str, Array]
WIDTHLESS = (
    ". That is a strip, held by its rolls alone: where the narrow faces are not many pitches apart "
    'they would hold it, too; mechanics.bulging = "elastic" neglects creep and continues'
)


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of the foundation of the wide faces."""

    #: largest bulge relative to the pitch; beyond it slopes are no longer small
    most_bulge: float = 0.05
    least_bulge: float = 50e-6  #: stiffness of a bed is at most the pressure over this, m
    #: stiffness relative to a bed's that keeps a solid strand without rolls in place
    within: float = 1e-3
    #: relative to the pitch: distance from the narrow face where a clamped plate bulges as a strip
    edge: float = 0.32
    #: motion of a face in the mould under a change of the pressure alone, m
    mould_play: float = 1e-3
    #: number of rolls whose forces are stored if rolls are uneven, see `UnevenPitch`
    foreseen: int = 3


LIMITS = Limits()


@dataclass(frozen=True, slots=True)
class Face:
    """A wide face."""

    probe: str  #: name of the inward line from its middle
    #: offset at the first roll, outwards from the undeformed section, m: where the mould leaves it,
    #: if there is one
    start: float = 0.0


@dataclass(frozen=True, slots=True)
class PitchByPitch:
    """Foundation of the wide faces: one bulge for each pitch, from the shell in its middle.

    A pitch starts with the first step that ends beyond its roll, and its strip moves at the slice's
    mean speed from roll to roll: where the strand stops in between, it creeps for longer. It is
    computed with the shell predicted for half of that time after its roll. Above the first roll the
    mould holds all faces against the pressure, softly: its taper follows the shell. A modelled
    mould holds them itself, and its end supports the shell like a roll.
    """

    #: makes a bulge from shell and pitch, by the position of the pitch's middle, m
    model: Callable[[float], BulgingModel]
    nodes: int  #: number of nodes of a bulge
    machine: Machine  #: machine of the case
    rolls: Array  #: positions of the pairs, m; preceded by the end of the mould if modelled
    offsets: Array  #: offsets of the rolls from the first one, outwards, m
    faces: Mapping[str, Face]  #: the wide faces by their groups
    others: tuple[str, ...]  #: groups held by the mould only
    probes: LineProbes  #: lines of the wide faces
    front: float  #: temperature at the inside of the shell, K
    core: Core  #: the liquid
    ahead: ShellPrediction  #: predicts the shell
    #: half width of the section, m; None to leave the strip's axial strain out of the slice
    half_width: float | None = None
    #: treatment of uneven rolls; None if none is missing or misaligned
    uneven: UnevenRolls | None = None
    #: offsets of the rolls from the strand's line, towards the centre of curvature, m
    lines: Array | None = None
    above: int = 0  #: entries of `rolls` that are not rolls: 1 with the end of a mould, else 0

    def initial(self) -> Memory:
        """See `Foundation`: `pitch` counts the rolls passed, the rest belongs to its bulge."""
        many = len(self.faces)
        names = ("stiffness", "thickness", "neutral", "largest", "force", "load", "error")
        found: dict[str, Array] = {name: np.zeros(many) for name in names}
        for name in ("z", "deflection", "slope", "curvature", "axial_strain"):
            found[name] = np.zeros((many, self.nodes))
        if self.uneven is not None:
            found["added"] = np.zeros((many, LIMITS.foreseen))
        return found | {"pitch": np.zeros(1)}

    def beds(
        self, memory: Memory, start: float, end: float, before: Array, temperature: Array
    ) -> tuple[Mapping[str, Bed], Memory]:
        """See `Foundation`."""
        place, profiles = self.machine.position(end), self.probes.sample(temperature)
        passed = sum(not same_or_before(place, float(roll)) for roll in self.rolls)
        handed_on = {
            g: self.core.handed_on(profiles[face.probe], end) for g, face in self.faces.items()
        }
        if passed == 0:
            soft = self.core.head(self.machine.time_near(float(self.rolls[0]))) / LIMITS.mould_play
            beds = {group: Bed(p, soft) for group, p in handed_on.items()}
            most = max(handed_on.values())
            return beds | {group: Bed(most, soft) for group in self.others}, memory
        if passed != int(memory["pitch"][0]):
            in_middle = profiles
            if passed < len(self.rolls):
                in_middle = self._half_way(passed, (start, end), before, profiles)
            memory = self._entered(passed, end, in_middle, memory)
        offset = float(np.interp(place, self.rolls, self.offsets))
        beds = {group: Bed() for group in self.others}
        for i, (group, pressure) in enumerate(handed_on.items()):
            way = place - self.rolls[passed - 1]
            w = along(memory["z"][i], memory["deflection"][i], memory["slope"][i], way)
            out = offset + self.faces[group].start
            if self.lines is not None:
                out += _outward(group) * float(np.interp(place, self.rolls, self.lines))
            profile = profiles[self.faces[group].probe]
            within = max(self.core.share_handed_on(profile), LIMITS.within)
            beds[group] = Bed(pressure, float(memory["stiffness"][i]), float(w), out, within)
        return beds, memory

    def _half_way(
        self, passed: int, step: tuple[float, float], before: Array, after: dict[str, Profile]
    ) -> dict[str, Profile]:
        """Profiles half the time of a pitch after its roll, from those of its first step."""
        first, last = (float(roll) for roll in self.rolls[passed - 1 : passed + 1])
        middle = 0.5 * (self.machine.time_at(first) + self.machine.time_near(last))
        begun = self.probes.sample(before)
        return {
            face.probe: self.ahead.at(middle, step, begun[face.probe], after[face.probe])
            for face in self.faces.values()
        }

    def _entered(
        self, passed: int, time: float, profiles: dict[str, Profile], old: Memory
    ) -> Memory:
        """Memory of a pitch that starts at `time` (s), after so many rolls.

        The profiles are those of its middle.
        """
        new = {name: np.array(values) for name, values in self.initial().items()}
        new["pitch"][0], new["error"][:] = passed, old["error"]  # the largest so far
        if passed == len(self.rolls):  # nothing bulges beyond the last roll
            head = self.core.head(time)
            new["z"][:] = np.arange(self.nodes)
            new["stiffness"][:] = head / LIMITS.least_bulge
            new["force"][:] = 0.5 * old["load"]
            return new
        first, last = self.rolls[passed - 1 : passed + 1]
        head = self.core.head(self.machine.time_near(0.5 * float(first + last)))
        speed = self.machine.speed_between(float(first), float(last))
        share = 1.0 / max(self.core.head(time), 1e-300)
        shells = [profiles[face.probe] for face in self.faces.values()]
        loads = [head * share * self.core.handed_on(profile, time) for profile in shells]
        spans = [Span(float(last - first), p, speed) for p in loads]
        strips = shared_out(
            self.probes.section.comm,
            [
                partial(self._bulge, passed - 1, _outward(group), span, profile)
                for group, span, profile in zip(self.faces, spans, shells, strict=True)
            ],
        )
        for i, (span, profile) in enumerate(zip(spans, shells, strict=True)):
            bulge, added = strips[i]
            top, most = _furthest(bulge)
            # The shell's stiffness between its rolls is p/w, where p is the remaining head. It is
            # used also below a missing roll, where a crept shell is deflected everywhere.
            left = max(self.core.share_handed_on(profile), LIMITS.within)
            new["stiffness"][i] = head / max(most / left, LIMITS.least_bulge)
            new["thickness"][i], new["largest"][i] = bulge.thickness, top
            new["load"][i] = span.pressure * span.length
            new["error"][i] = max(old["error"][i], bulge.error)
            if passed > self.above:  # the end of a mould is not a roll
                new["force"][i] = 0.5 * (old["load"][i] + new["load"][i])
            if added is not None:
                new["force"][i], new["added"][i] = bulge.roll_force[0], added
            new["neutral"][i] = bulge.neutral
            new["z"][i] = span.length * np.linspace(0.0, 1.0, self.nodes)
            if len(bulge.z) == self.nodes:  # otherwise it does not bulge
                for name in ("z", "deflection", "slope", "curvature", "axial_strain"):
                    new[name][i] = getattr(bulge, name)
        return new

    def axial_strain(
        self,
        memory: Memory,
        new: Memory,
        start: float,
        end: float,
        places: Array,
        *,
        front: bool = False,
    ) -> Array | None:
        """See `StretchingFoundation`: strain of the strip, decreasing towards the narrow faces."""
        passed = int(new["pitch"][0])
        if self.half_width is None or not 0 < passed < len(self.rolls):
            return None
        roll, length = self.rolls[passed - 1], float(new["z"][0, -1])
        begun = start if int(memory["pitch"][0]) == passed else self.machine.time_at(float(roll))
        way = np.array([self.machine.position(time) for time in (begun, end)]) - roll
        edge = np.clip((self.half_width - np.abs(places[:, 0])) / (LIMITS.edge * length), 0.0, 1.0)
        found = np.zeros(len(places))
        for i, face in enumerate(self.faces.values()):
            surface = float(self.probes.lines[face.probe][0][1])
            depth = abs(surface) - np.sign(surface) * places[:, 1]
            bent, stretched = (
                float(np.diff(np.interp(way, new["z"][i], new[name][i]))[0])
                for name in ("curvature", "axial_strain")
            )
            part = stretched + bent * (new["neutral"][i] - depth)
            inside = abs(surface) if front else new["thickness"][i]
            found += np.where(depth < inside, edge * part, 0.0)
        return found

    def _bulge(
        self, pitch: int, outward: float, span: Span, profile: Profile
    ) -> tuple[Bulge, Array | None]:
        """Bulge of a pitch, and the additional roll loads if rolls are uneven.

        Raises:
            RunFailure: There is no shell, or none that can span the pitch.
        """
        first, last = self.rolls[pitch : pitch + 2]
        middle, thickness = 0.5 * float(first + last), profile.isotherm_depth(self.front)
        if thickness <= 0.0:
            raise RunFailure(
                f"bulging: there is no shell between the rolls at {first:.4g} and {last:.4g} m"
            )
        shell = Shell(thickness, lambda d: np.interp(d, profile.depth, profile.temperature))
        if not span.pressure > 0.0:
            return Bulge.none(span, shell), None
        model, added = self.model(middle), None
        try:
            below = pitch - self.above  # index of the roll above it
            if self.uneven is not None and below >= 0 and self.uneven.near(below):
                found = self.uneven.bulge(below, span, shell, outward)
                bulge, added = found.bulge, found.added
            else:
                bulge = model.bulge(span, shell)
        except RunFailure as error:
            raise RunFailure(f"bulging, pitch around {middle:.4g} m: {error}") from None
        if (most := _furthest(bulge)[1]) > LIMITS.most_bulge * span.length:
            creeps = isinstance(model, CreepingStrip)
            raise RunFailure(_breaks_out(float(first), float(last), bulge, most, creeps))
        return bulge, added


def _furthest(bulge: Bulge) -> tuple[float, float]:
    """Largest outward deflection, and largest absolute deflection, m."""
    top, _, low = bulge.extremes()
    return top, max(top, -low)


def _breaks_out(first: float, last: float, bulge: Bulge, most: float, creeps: bool) -> str:
    length = last - first
    by = f"{1e3 * most:.3g} mm" if most < length else "more than its pitch"
    return (
        f"bulging: between the rolls at {first:.4g} and {last:.4g} m a shell of "
        f"{1e3 * bulge.thickness:.3g} mm would bulge by {by} (at most "
        f"{1e3 * LIMITS.most_bulge * length:.3g} mm): it is too thin or too hot for a pitch of "
        f"{1e3 * length:.4g} mm; look at cooling and speed, and for rolls that are lost"
    ) + (WIDTHLESS if creeps else "")


def _outward(group: str) -> float:
    """1 for the face towards the centre of curvature, -1 for the other."""
    return -1.0 if group.endswith("_extrados") else 1.0
