"""Follows the vertices of the section through the mushy zone, for the hot tearing criteria."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.fem import dof_values
from castfem.model.quality import FEEDING, Feeding
from castfem.physics.materials import hot_tearing as laws
from castfem.physics.materials.hot_tearing import MushyHistory
from castfem.runs.results.crack_state import Tearing
from castfem.runs.results.thermal_quantities import temperature_at

if TYPE_CHECKING:
    from castfem.model.build.simulation import Simulation
    from castfem.model.quality import Quality
    from castfem.physics.coupling.staggered import StrandState
    from castfem.physics.materials import Steel
    from castfem.physics.materials.curve import ThermalCurve
    from castfem.runs.results.mechanical import MechanicalSampler

NEAR = 1e-6  # K: temperatures this close to a reaction belong to it
_NAME = "hot_tearing"  # prefix of array names in a checkpoint


class Follower:
    """Follows the owned vertices of a simulation with hot tearing criteria (collective).

    Args:
        simulation: The simulation.
        mechanics: Samples its strained slice; None without mechanics.
    """

    def __init__(self, simulation: Simulation, mechanics: MechanicalSampler | None) -> None:
        quality = simulation.case.quality
        assert quality is not None and quality.hot_tearing
        self.simulation, steel = simulation, simulation.steel
        if (lack := lacks(quality, steel)) is not None:
            raise InputError(f"quality.{lack[0]}: {lack[1]}")
        strained = any(name != "clyne_davies" for name in quality.hot_tearing)
        self._mechanics = mechanics if strained else None
        fractions = (FEEDING, *quality.brittle)
        kelvin = [temperature_at(steel, fraction) for fraction in fractions]
        # Over a step heat is removed at a constant rate, while the temperature falls fast where
        # little latent heat is left.
        curve = simulation.problem.curve
        feeds, begins, ends = (enthalpy_at(curve, steel, fraction) for fraction in fractions)
        self._begins = kelvin[1]  # temperature at which the brittle range begins, K
        self._levels = feeds, begins, ends
        width = kelvin[1] - kelvin[2]
        feeding = None
        if "rdg" in quality.hot_tearing:
            feeding = _feeding(quality.rdg or Feeding.model_validate({}), steel, kelvin[2])
        law = laws.WON
        if (given := quality.won) is not None:
            law = laws.CriticalStrain(given.factor, given.rate_exponent, given.range_exponent)
        none = np.zeros(simulation.section.owned)
        self.start = Tearing(
            MushyHistory(), width, kelvin[0] - kelvin[2], law, feeding, none, none,
            np.zeros((0, 4)), none > 0.0, none > 0.0,
        )  # fmt: skip

    def note(self, old: Tearing, strand: StrandState, duration: float) -> Tearing:
        """Process a step; of zero length where the run begins or continues (collective)."""
        thermal, strain, history = strand.thermal, old.strain, old.history
        here = np.zeros(len(old.here), bool)
        if len(history.relief) != len(here):
            history = MushyHistory.begun(thermal.enthalpy, self._levels[0])
        mechanical = strand.mechanical if self._mechanics is not None else None
        if self._mechanics is not None and mechanical is not None:
            strain = self._mechanics.strain(mechanical)
        if duration > 0.0:
            taken: list[Array] = [np.zeros(len(here))] * 3
            if self._mechanics is not None:
                added = strain - old.strain
                if old.mechanical is not None and mechanical is not None:
                    added[:, 2] += self._mechanics.front_strain(old.mechanical, mechanical)
                taken = self._strained(added, thermal.point.temperature)
            parts = laws.NUMERICS.parts
            part = duration / parts
            around, axial, gradient = taken[0] / parts, taken[1] / parts, taken[2]
            ends = (old.rate, thermal.rate)
            values = laws.cubic_between(old.enthalpy, thermal.enthalpy, ends, duration)
            for before, after in pairwise(values):
                history, inside = history.advanced(
                    before, after, self._levels, part, around, axial, gradient
                )
                here |= inside > 0.0
        return replace(
            old, history=history, enthalpy=thermal.enthalpy, rate=thermal.rate, strain=strain,
            here=here, passed=thermal.enthalpy <= self._levels[2], mechanical=mechanical,
        )  # fmt: skip

    def _strained(self, strain: Array, temperature: Array) -> list[Array]:
        """Strain along the isotherm and along the strand, and gradient, at the vertices (n,).

        Dendrites grow along the gradient and are torn apart across it; strain along it is fed. The
        strain of the liquid has no meaning, since its mesh follows the shell: of the points around
        a vertex those in or below the brittle range count, if there are any. There is no thermal
        strain above the solidus; the elastic strain is that of some MPa at most.
        """
        assert self._mechanics is not None
        points = self._mechanics.strained.points
        local = dof_values.with_ghosts(points.section.vertex_space, temperature)
        slope = (points.gradient @ local).reshape(-1, 2)
        steep = np.linalg.norm(slope, axis=1)
        nx, ny = slope.T / np.where(steep > 0.0, steep, 1.0)
        xx, yy, zz, xy = strain.T
        around = ny**2 * xx + nx**2 * yy - 2.0**0.5 * nx * ny * xy
        at = points.vertex[: len(strain)] @ local
        frozen = (at <= self._begins).astype(float)
        kinds = np.column_stack([around, zz, steep, np.ones(len(at))])
        both = points.at_vertices(np.hstack([kinds, kinds * frozen[:, None]]))
        share = both[:, -1:]
        found = np.where(share > 0.0, both[:, 4:] / np.where(share > 0.0, share, 1.0), both[:, :4])
        return list(found.T[:3])

    @staticmethod
    def arrays(state: Tearing) -> dict[str, Array]:
        """Arrays for a checkpoint at the owned vertices; the rest follows from the slice."""
        return {f"{_NAME}_{name}": getattr(state.history, name) for name in MushyHistory.names()}

    def restored(self, by_node: Mapping[str, Array]) -> Tearing:
        """Restore the state of `arrays`, by node."""
        nodes = self.simulation.section.node_of_owned
        found = (
            np.asarray(by_node[f"{_NAME}_{name}"], float)[nodes] for name in MushyHistory.names()
        )
        return replace(self.start, history=MushyHistory(*found))


def enthalpy_at(curve: ThermalCurve, steel: Steel, fraction: float) -> float:
    """Enthalpy at a solid fraction of a steel, J/m3.

    Fractions that freeze at one temperature, such as in the peritectic reaction, are linear in
    enthalpy.
    """
    kelvin = temperature_at(steel, fraction)
    for knot in steel.breakpoints(kelvin - NEAR, kelvin + NEAR):
        liquid = float(steel.solid_fraction(knot, "above"))
        solid = float(steel.solid_fraction(knot, "below"))
        if liquid < fraction < solid:
            hot, cold = float(curve.enthalpy(knot, "right")), float(curve.enthalpy(knot, "left"))
            return hot - (fraction - liquid) / (solid - liquid) * (hot - cold)
    return float(curve.enthalpy(kelvin))


def lacks(quality: Quality, steel: Steel) -> tuple[str, str] | None:
    """Data that the criteria need and the steel lacks: key of [quality], and text."""
    fractions = (FEEDING, *quality.brittle)
    feeds, begins, ends = (temperature_at(steel, fraction) for fraction in fractions)
    if not feeds > begins > ends:
        wider = (
            "" if steel.diagram is None else 'segregation widens it, steel.diagram = "segregated"; '
        )
        return "hot_tearing", (
            f"{steel.name} goes through its brittle range at one temperature: a front without "
            f"thickness, in which a place spends no time; {wider}give another quality.brittle or "
            "steel, or leave the criteria out"
        )
    if "rdg" not in (quality.hot_tearing or ()):
        return None
    given = quality.rdg or Feeding.model_validate({})
    if given.shrinkage is None and not _shrinkage(steel) > 0.0:
        return "rdg.shrinkage", (
            f"the density of {steel.name} does not rise as it freezes; "
            'give the shrinkage, shrinkage = "4 percent"'
        )
    if given.arm_spacing is None and not 0.0 < steel.composition.get("C", 0.0) < 1.0:
        return "rdg.arm_spacing", (
            f"{steel.name} states no carbon content (up to 1 %), from "
            'which it is computed; give it, arm_spacing = "120 um"'
        )
    return None


def _shrinkage(steel: Steel) -> float:
    return float(steel.density(steel.solidus, "below")) / steel.liquid_density - 1.0


def _feeding(given: Feeding, steel: Steel, roots: float) -> laws.Feeding:
    """Feeding parameters for a complete steel whose dendrites coalesce at `roots`, K."""
    shrinkage = _shrinkage(steel) if given.shrinkage is None else given.shrinkage
    carbon, spacing = steel.composition.get("C", 0.0), given.arm_spacing

    def spaced(cooling_rate: Array) -> Array:
        if spacing is None:
            return laws.secondary_arm_spacing(cooling_rate, carbon)
        return np.full_like(cooling_rate, spacing)

    integrals = laws.feeding_integrals(steel.solid_fraction, steel.liquidus, roots)
    return laws.Feeding(given.viscosity, shrinkage, integrals, spaced)
