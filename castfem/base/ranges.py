"""Table of usual and possible values of the quantities of continuous casting.

A value outside its usual range gives a warning, one outside its possible range an error. Both find
wrong units and misread numbers, not unusual machines; where a kind of quantity allows 0, it means
that something is left out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from castfem.base.quantities import Kind

_ANY = math.inf


@dataclass(frozen=True, slots=True)
class Bounds:
    """Usual and possible ranges, SI."""

    usual: tuple[float, float]  #: values outside give a warning
    possible: tuple[float, float]  #: values outside give an error
    what: str  #: subject of the message: "strands are cast at"

    def impossible(self, value: float, kind: Kind) -> str:
        """Error text for an impossible value (SI); "" if it is possible."""
        return self._beyond(value, kind, self.possible, "beyond")

    def unusual(self, value: float, kind: Kind) -> str:
        """Warning text for an unusual value (SI); "" if it is usual."""
        return self._beyond(value, kind, self.usual, "far from")

    def _beyond(self, value: float, kind: Kind, ends: tuple[float, float], how: str) -> str:
        left_out = value == 0.0 and kind.unit != "K"
        if left_out or ends[0] <= value <= ends[1]:
            return ""
        low, high = (end if math.isinf(end) else kind.number(end) for end in ends)
        unit = kind.suffix
        between = f"{low:.6g} to {high:.6g}{unit}"
        if math.isinf(high):
            between = f"at least {low:.6g}{unit}"
        shown = f"{kind.number(value):.7g}{unit}"
        return f"({shown}) is {how} what {self.what}, {between}; are number and unit right?"


def of(key: str) -> Bounds | None:
    """Return the bounds of a dotted key without indices; None if it has none."""
    return RANGES.get(key)


_MM, _PER_MIN, _LITRES = 1e-3, 1.0 / 60.0, 1e-3 / 60.0
_SIDE = Bounds((20 * _MM, 4.0), (0.1 * _MM, 20.0), "strands measure")
_RADIUS = Bounds((0.0, 1.0), (0.0, 20.0), "strands measure")
_AWAY = Bounds((_MM, 100.0), (1e-6, 1e4), "casting machines measure")
_SURROUNDINGS = Bounds((200.0, 1500.0), (0.0, 5e3), "walls and surroundings have")
_STEEL = Bounds((200.0, 3300.0), (50.0, 6e3), "cast metal has")  # no metal that is cast melts above
_COEFFICIENT = Bounds((1.0, 1e5), (1e-3, 1e9), "cooled surfaces have")
_FLUX = Bounds((1e3, 2e7), (-1e9, 1e9), "moulds and sprays take")
_ZONE_WATER = Bounds(
    (_LITRES, 8e3 * _LITRES), (1e-3 * _LITRES, 1e6 * _LITRES), "a zone is sprayed with"
)
_SPECIFIC = Bounds((1e-5, 1e-2), (1e-9, 1.0), "strands are sprayed with")
_FACTOR = Bounds((0.1, 20.0), (1e-3, 1e3), "correlations are divided by")
_STRESS = Bounds((1e2, 1e9), (10.0, 1e12), "surfaces of hot steel bear")
_FORCE = Bounds((-1e7, 1e7), (-1e12, 1e12), "machines pull with")
_STRAIN = Bounds((-0.1, 0.1), (-10.0, 10.0), "strands are strained by")
_SPAN = Bounds((-2.0, 2.0), (-20.0, 20.0), "strands measure")
_SPEED = Bounds((0.01 * _PER_MIN, 20 * _PER_MIN), (1e-9, 100.0), "strands are cast at")
_COPPER = "copper and its alloys have"
_METAL = "metals have"

_GROUPS: Mapping[tuple[str, ...], Bounds] = {
    ("casting.speed", "cooling.surface.measured_at", "mould.friction.viscous.speed"): _SPEED,
    ("casting.length", "cooling.to", "mechanics.until", "caster.pyrometer.at"): _AWAY,
    ("caster.cut",): Bounds((0.1, 50.0), (1e-3, 1e4), "strands are cut to lengths of"),
    ("casting.superheat",): Bounds((0.0, 150.0), (0.0, 1e4), "metal is poured with"),
    ("casting.temperature", "casting.start.profile", "cooling.surface.temperature.value"): _STEEL,
    ("casting.start.meniscus",): Bounds((0.5 * _MM, 50 * _MM), (1e-6, 0.3), "menisci measure"),
    ("section.width", "section.height", "section.diameter", "section.length", "mould.width",
     "mould.height", "mould.diameter", "section.web_thickness", "section.flange_thickness",
     "section.root_thickness"): _SIDE,
    ("section.strip.width",): Bounds((0.01 * _MM, 4.0), (1e-6, 20.0), "strips measure"),
    ("section.corner_radius", "mould.corner_radius", "section.fillet_radius",
     "section.shoulder_radius"): _RADIUS,
    ("section.bulge",): Bounds((-0.02, 0.02), (-1.0, 1.0), "bulges of sections are"),
    ("cooling.surface.power",): Bounds((1e3, 2e7), (1e-3, 1e10), "moulds take"),
    ("cooling.surface.contact.water", "cooling.surface.flux.water"): Bounds(
        (10 * _LITRES, 2e4 * _LITRES), (1e-3 * _LITRES, 1e6 * _LITRES), "moulds are cooled with"
    ),
    ("cooling.surface.factor",): Bounds((0.1, 3.0), (0.0, 1e3), "heat of a mould changes by"),
    ("cooling.surface.water_rise",): Bounds((0.2, 40.0), (1e-6, 300.0), "water of moulds warms by"),
    ("cooling.surface.coefficient", "secondary.run_off"): _COEFFICIENT,
    ("cooling.surface.contact.coefficient", "secondary.contact.coefficient"): Bounds(
        (20.0, 1e5), (1e-3, 1e9), "contact with a mould or a roll has"
    ),
    ("cooling.surface.flux", "cooling.surface.flux.value", "mould.tube.flux"): _FLUX,
    ("cooling.surface.wall", "cooling.surface.ambient", "mould.wall_temperature",
     "mould.copper.cold", "mould.copper.temperature", "mould.tube.hot_face",
     "mould.tube.water_side", "secondary.ambient", "secondary.contact.temperature"): _SURROUNDINGS,
    ("cooling.surface.gap",): Bounds((0.0, 10 * _MM), (0.0, 1.0), "gaps in moulds have"),
    ("cooling.surface.gap_conductivity",): Bounds(
        (5e-3, 20.0), (1e-6, 1e4), "gases and slags have"
    ),
    ("cooling.surface.spray.water",): Bounds(
        (1e-2, 100.0), (1e-9, 1e5), "strands are sprayed with"
    ),
    ("cooling.surface.flow", "secondary.circuit.flow"): _ZONE_WATER,
    ("water.flow",): Bounds(
        (_LITRES, 4e4 * _LITRES), (1e-3 * _LITRES, 1e6 * _LITRES), "strands are sprayed with"
    ),
    ("cooling.surface.specific", "water.specific", "secondary.circuit.specific"): _SPECIFIC,
    ("cooling.surface.area",): Bounds((1e-3, 200.0), (1e-6, 1e5), "zones have"),
    ("cooling.surface.machine_factor", "secondary.nozzle.machine_factor"): _FACTOR,
    ("cooling.surface.refractive_index",): Bounds((1.0, 4.0), (0.1, 100.0), "gases and slags have"),
    ("cooling.surface.absorption",): Bounds((0.0, 1e5), (0.0, 1e9), "gases and slags have"),
    ("mechanics.planes.a0", "mechanics.planes.across"): _STRAIN,
    ("mechanics.planes.a1", "mechanics.planes.a2"): Bounds(
        (-2.0, 2.0), (-1e3, 1e3), "curvatures of strands are"
    ),
    ("mechanics.planes.force", "mechanics.planes.moment_x", "mechanics.planes.moment_y"): _FORCE,
    ("mechanics.bulging.largest",): Bounds((1e-6, 0.05), (1e-9, 1.0), "shells bulge by"),
    ("mechanics.held.value",): Bounds((-0.05, 0.05), (-10.0, 10.0), "strands are moved by"),
    ("mould.length",): Bounds((50 * _MM, 3.0), (1e-6, 20.0), "moulds measure"),
    ("mould.copper.expansion", "mould.copper.mean_expansion"): Bounds(
        (1e-6, 4e-5), (1e-9, 1e-3), _COPPER
    ),
    ("mould.copper.conductivity",): Bounds((10.0, 450.0), (0.1, 1e5), _COPPER),
    ("mould.copper.youngs_modulus",): Bounds((1e10, 4e11), (1e5, 1e13), _COPPER),
    ("mould.tube.thickness",): Bounds((2 * _MM, 100 * _MM), (0.1 * _MM, 1.0), "tubes have"),
    ("mould.tube.above", "mould.tube.corner_reach"): Bounds(
        (0.1 * _MM, 1.0), (1e-6, 10.0), "tubes have"
    ),
    ("mould.tube.thermocouple.depth",): Bounds((0.5 * _MM, 100 * _MM), (1e-6, 1.0), "copper has"),
    ("mould.tube.thermocouple.way",): Bounds((0.1 * _MM, 2.0), (1e-6, 10.0), "moulds measure"),
    ("mould.tube.water_coefficient",): Bounds((500.0, 2e5), (1.0, 1e9), "cooling channels have"),
    ("mould.tube.water_temperature",): Bounds(
        (273.15, 373.15), (250.0, 647.0), "cooling water has"
    ),
    ("mould.oscillation.stroke",): Bounds((0.1 * _MM, 50 * _MM), (1e-6, 1.0), "moulds move by"),
    ("mould.oscillation.frequency",): Bounds((0.1, 20.0), (1e-6, 1e3), "moulds oscillate at"),
    ("mould.contact.factor",): Bounds((0.1, 1e5), (1e-3, 1e7), "contact factors are"),
    ("mould.friction.coefficient",): Bounds((0.0, 2.0), (0.0, 1e4), "surfaces have"),
    ("mould.friction.steepest",): Bounds((1e-3, 10.0), (1e-6, 1e6), "surfaces have"),
    ("mould.friction.yield_stress", "mould.friction.stress"): _STRESS,
    ("machine.first", "machine.rolls.position"): Bounds((_MM, 100.0), (0.0, 1e4), _AWAY.what),
    ("machine.segment.pitch",): Bounds((30 * _MM, 3.0), (_MM, 100.0), "pitches of rolls measure"),
    ("machine.segment.diameter", "machine.rolls.diameter"): Bounds(
        (30 * _MM, 1.0), (_MM, 10.0), "rolls have"
    ),
    ("machine.segment.radius", "machine.rolls.radius"): Bounds(
        (1.0, 1e5), (0.1, _ANY), "casting machines have"
    ),
    ("machine.segment.aperture", "machine.rolls.aperture"): _SIDE,
    ("machine.rolls.capacity", "machine.defect.resistance"): Bounds(
        (1e2, 1e7), (1e-3, 1e10), "rolls draw or resist with"
    ),
    ("machine.extraction.resistance",): Bounds((1.0, 1e7), (1e-6, 1e10), "rolls resist with"),
    ("machine.extraction.friction_axis", "machine.extraction.friction_surface"): Bounds(
        (0.0, 1.0), (0.0, 1e3), "rolls have"
    ),
    ("machine.defect.by",): Bounds((-8 * _MM, 8 * _MM), (-0.5, 0.5), "rolls are off by"),
    ("secondary.circuit.across",): _SPAN,
    ("secondary.circuit.stand_off",): Bounds((10 * _MM, 2.0), (1e-4, 20.0), "nozzles stand off by"),
    ("quality.critical_strain",): Bounds((1e-5, 0.2), (1e-9, 10.0), "steel cracks at"),
    ("quality.won.factor",): Bounds((1e-4, 1.0), (1e-9, 1e3), "critical strains have"),
    ("quality.won.rate_exponent", "quality.won.range_exponent"): Bounds(
        (0.0, 2.0), (0.0, 10.0), "critical strains have"
    ),
    ("quality.rdg.viscosity",): Bounds((1e-3, 1e-2), (1e-5, 10.0), "liquid metal has"),
    ("quality.rdg.shrinkage",): Bounds((0.005, 0.08), (1e-5, 0.3), "metal shrinks by"),
    ("quality.rdg.arm_spacing",): Bounds((1e-5, 1e-3), (1e-7, 0.02), "dendrites have"),
    ("quality.rdg.cavitation",): Bounds((100.0, 1e6), (1.0, 1e9), "liquid metal bears"),
    ("steel.solidus", "steel.liquidus"): Bounds((373.15, 3300.0), (373.15, 3300.0), _METAL),
    ("steel.latent_heat",): Bounds((3e4, 5e5), (1e4, 2e6), _METAL),
    ("steel.density",): Bounds((2e3, 1.2e4), (1e3, 25e3), _METAL),
    # Outside the freezing range; at Curie points about 5000.
    ("steel.specific_heat",): Bounds((100.0, 6e3), (80.0, 1e4), _METAL),
    ("steel.conductivity",): Bounds((5.0, 450.0), (1.0, 5e3), _METAL),
    ("steel.emissivity",): Bounds((0.05, 1.0), (0.01, 1.0), _METAL),
    ("steel.thermal_expansion",): Bounds((2e-6, 6e-5), (1e-6, 1e-4), _METAL),
    # A transformation within one kelvin changes lengths by 0.5 %.
    ("steel.thermal_expansion.differential",): Bounds((-1e-2, 1e-2), (-1e-2, 1e-2), _METAL),
    ("steel.youngs_modulus", "law.young", "tensile.young"): Bounds(
        (1e5, 4e11), (1e3, 6e11), _METAL
    ),
    ("law.strength", "law.yield_stress", "law.stress"): Bounds((1e3, 2e9), (1.0, 1e13), _METAL),
    ("law.yield_limit",): Bounds((0.0, 2e9), (0.0, 1e13), _METAL),
    ("law.p1",): Bounds((-10.0, 50.0), (-1e3, 1e4), _METAL),
    ("law.p3",): Bounds((0.0, 0.5), (0.0, 1.0), _METAL),
    ("law.p4",): Bounds((-0.1, 0.6), (-1.0, 1.0), _METAL),
    ("law.rate",): Bounds((1e-15, 1e3), (1e-60, 1e15), "metals creep at"),
    ("law.exponent",): Bounds((1.0, 12.0), (0.05, 1e3), "metals creep with"),
    ("law.recovery_time",): Bounds((1e-3, 1e7), (1e-9, 1e15), "metals recover in"),
    ("tensile.temperature",): _STEEL,
    ("tensile.segment.rate",): Bounds((-1e3, 1e3), (-1e9, 1e9), "bars are strained at"),
    ("tensile.segment.duration",): Bounds((1e-6, 1e7), (1e-12, 1e12), "tests last"),
    ("tensile.expansion",): Bounds((1e-6, 1e-4), (1e-12, 1e-2), _METAL),
}  # fmt: skip
RANGES: Mapping[str, Bounds] = {key: bounds for keys, bounds in _GROUPS.items() for key in keys}
"""Bounds by dotted key of a case, with `steel.` for material files and `law.` for files of laws. A
variant of a table may have its own: `cooling.surface.spray.water`."""
