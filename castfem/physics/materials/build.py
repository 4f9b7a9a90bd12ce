"""Builds a `Steel` from a material file: reads quantities, makes laws, checks everything."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.errors import choices, shown
from castfem.base.quantities import Kind
from castfem.base.table_notation import Curve
from castfem.base.tables import Constant, Table
from castfem.base.units import format as write
from castfem.base.units import nearest
from castfem.physics.materials import alloying, iron_carbon, knots
from castfem.physics.materials.enthalpy_table import EnthalpyTable
from castfem.physics.materials.expansion import (
    ChandraExpansion,
    ConstantExpansion,
    DensityExpansion,
    DifferentialExpansion,
    Expansion,
    MeanExpansion,
)
from castfem.physics.materials.formulas import FORMULAS
from castfem.physics.materials.phase_table import HEAT, PhaseTable, TableCurve
from castfem.physics.materials.plausible import COLDEST, HOTTEST, implausible
from castfem.physics.materials.properties import ByFormula, Property
from castfem.physics.materials.schema import (
    KINDS,
    TEMPERATURE,
    Entry,
    ExpansionEntry,
    MaterialFile,
    Problem,
)
from castfem.physics.materials.solid_fraction import (
    NARROWEST,
    LeverFraction,
    LinearFraction,
    SolidFraction,
    TableFraction,
)
from castfem.physics.materials.steel import Origin, Steel

CURVES = ("density", "specific_heat", "enthalpy", "conductivity", "emissivity", "youngs_modulus",
          "poisson_ratio")  # fmt: skip
NEEDED = ("density", "specific_heat", "conductivity")
BY_DATABASE = "database"  # formula of a property that comes from the table of a database
# formulas that use the diagram or that table
BY_DIAGRAM = ("lever_rule", "iron_carbon", BY_DATABASE)
# solid fractions that are consistent with an enthalpy by phase
BY_PHASE = ("lever_rule", BY_DATABASE)


class Faulty(Exception):
    """An entry could not be used; the problem is already recorded."""


@dataclass
class Workshop:
    """A steel under construction, with the problems found so far."""

    given: MaterialFile  #: the material file
    name: str  #: name of the steel
    composition: Mapping[str, float]  #: wt%
    #: iron-carbon diagram, None without carbon content; or the table from a database
    diagram: iron_carbon.Diagram | None = None
    left_out: tuple[str, ...] = ()  #: elements that are stated, but have no known effect
    problems: list[Problem] = field(default_factory=list)  #: problems found so far

    def fail(self, *path: str, text: str) -> Faulty:
        """Record a problem; raise the returned exception to give up the entry."""
        self.problems.append(Problem(path, text))
        return Faulty()

    def steel(self) -> Steel | None:
        """Make the steel, or return None with `problems` filled."""
        self._make_diagram()
        curves = self._curves()
        fraction = self._or_none(self._fraction)
        latent = self._or_none(self._latent_heat)
        self._or_none(self._heat_of_table, curves, fraction)
        expansion = self._or_none(self._expansion, curves.get("density"))
        enthalpy = self.given.enthalpy
        in_rows = enthalpy is not None and enthalpy.formula is None
        for key in NEEDED:
            if self.given.entry(key) is None and not (in_rows and key == "specific_heat"):
                sample = KINDS[key].example
                self.fail(key, text=f'is missing; the {KINDS[key].name}, such as "{sample}"')
        if self.problems or fraction is None or latent is None:
            return None
        steel = Steel(
            name=self.name,
            description=self.given.description,
            solidus=fraction.solidus,
            liquidus=fraction.liquidus,
            latent_heat=latent,
            properties=MappingProxyType(curves),
            fraction=fraction,
            expansion=expansion,
            composition=MappingProxyType(dict(self.composition)),
            diagram=self.diagram,
            origins=MappingProxyType(self._origins()),
            left_out=self.left_out,
        )
        if "enthalpy" in curves:
            steel = _with_released_heat(steel)
        self.problems += implausible(steel, self.given)
        return None if self.problems else steel

    def _or_none(self, make: Any, *arguments: Any) -> Any:
        try:
            return make(*arguments)
        except Faulty:
            return None

    def _make_diagram(self) -> None:
        if "C" not in self.composition or self.diagram is not None:
            return
        try:
            self.diagram = alloying.diagram_of(self.composition, self.given.diagram)
        except ValueError as error:
            self.fail("composition", text=str(error))

    def _phases(self, key: str, formula: str) -> iron_carbon.Diagram:
        """Return the iron-carbon diagram for a formula that needs it."""
        if formula == BY_DATABASE and not isinstance(self.diagram, PhaseTable):
            raise self.fail(key, "formula", text="needs a database: set steel.database in the case")
        if self.diagram is not None:
            return self.diagram
        if any(problem.path[0] == "composition" for problem in self.problems):
            raise Faulty  # the cause has been reported
        raise self.fail(key, text=f"{formula} needs the carbon content, composition.C")

    # -- entries ---------------------------------------------------------------------------

    def _form(self, key: str, entry: Entry, allowed: tuple[str, ...]) -> str:
        """Return whether the entry is a "value", a "table" or a "formula"; refuse others."""
        forms = entry.forms
        if len(forms) != 1:
            found = f"{' and '.join(forms)} exclude each other" if forms else "is empty"
            raise self.fail(key, text=f"{found}; give one of value, a table and formula")
        form = "table" if forms[0] in ("temperature", "file") else forms[0]
        if form not in allowed:
            raise self.fail(key, text=f"cannot be a {form}; allowed: {choices(allowed)}")
        if form != "formula" and entry.parameters:
            raise self.fail(key, "parameters", text="only a formula has parameters")
        if form != "table" and "outside" in entry.model_fields_set:
            raise self.fail(key, "outside", text="only a table has ends")
        return form

    def _constant(self, key: str, entry: Entry) -> float:
        if entry.unit is not None:
            raise self.fail(
                key, "unit", text=f'write a single value with its unit, "{KINDS[key].example}"'
            )
        try:
            return KINDS[key].read(entry.value)
        except ValueError as error:
            raise self.fail(key, text=f"{error} ({shown(entry.value)})") from None

    def _table(self, key: str, entry: Entry) -> Table:
        columns = ("temperature", "temperature_unit", "value", "unit", "file")
        written = {k: getattr(entry, k) for k in columns if getattr(entry, k) is not None}
        try:
            table = Curve(KINDS[key], over="temperature").read(written)
        except ValueError as error:
            raise self.fail(key, text=str(error)) from None
        assert not isinstance(table, float)
        for number, (above, below) in enumerate(itertools.pairwise(table.arguments), start=2):
            if below - above < NARROWEST:
                text = f"row {number} is {below - above:.2g} K above row {number - 1}; a jump takes"
                raise self.fail(key, text=f"{text} {NARROWEST:g} K at least, better 0.001 K")
        return replace(table, refuse_outside=entry.outside == "refuse")

    def _named(self, key: str, entry: Entry, names: tuple[str, ...]) -> str:
        """Return the formula of an entry if it is one of `names`."""
        if entry.formula not in names:
            raise self.fail(
                key,
                "formula",
                text=f'no formula "{entry.formula}" for {key}; one of '
                f"{choices(names) or 'none'}{nearest(str(entry.formula), names)}",
            )
        return str(entry.formula)

    def _formula(self, key: str, entry: Entry) -> ByFormula:
        names = tuple(name for name, f in FORMULAS.items() if f.quantity == key)
        formula = FORMULAS[self._named(key, entry, names)]
        values = {name: p.default for name, p in formula.parameters.items()}
        for name, given in entry.parameters.items():
            if name not in values:
                text = f"unknown parameter; allowed: {choices(values) or 'none'}"
                raise self.fail(key, "parameters", name, text=text + nearest(name, values))
            parameter = formula.parameters[name]
            kind = Kind(parameter.unit, least=parameter.least, most=parameter.most)
            try:
                values[name] = kind.read(given)
            except ValueError as error:
                raise self.fail(key, "parameters", name, text=f"{error} ({shown(given)})") from None
        if formula.by_phase:
            self._phases(key, formula.name)
        return ByFormula(formula, MappingProxyType(values), self.diagram)

    # -- properties ------------------------------------------------------------------------

    def _curves(self) -> dict[str, Property]:
        curves = {}
        for key in CURVES:
            entry = self.given.entry(key)
            law = self._or_none(self._curve, key, entry) if entry is not None else None
            if law is not None:
                curves[key] = law
        return curves

    def _curve(self, key: str, entry: Entry) -> Property:
        allowed = ("table", "formula") if key == "enthalpy" else ("value", "table", "formula")
        form = self._form(key, entry, allowed)
        if isinstance(self.diagram, PhaseTable) and entry.formula == BY_DATABASE and key in HEAT:
            return TableCurve(self.diagram, key)
        if form == "value":
            return Constant(self._constant(key, entry))
        if form == "table":
            table = self._table(key, entry)
            try:
                return EnthalpyTable(table) if key == "enthalpy" else table
            except ValueError as error:
                raise self.fail(key, text=str(error)) from None
        law = self._formula(key, entry)
        self._check_range(key, law)
        return law

    def _heat_of_table(self, curves: dict[str, Property], fraction: SolidFraction | None) -> None:
        """Set the specific heat that follows from a table of enthalpies."""
        law = curves.get("enthalpy")
        if not isinstance(law, EnthalpyTable) or fraction is None:
            return
        if self.given.specific_heat is not None:
            raise self.fail(
                "specific_heat", text="follows from the enthalpy, which is a table; leave it out"
            )
        curves["specific_heat"] = law.sensible(fraction.solidus, fraction.liquidus)

    def _check_range(self, key: str, law: Property) -> None:
        """Refuse a formula outside the bounds of its quantity from 20 to 1700 degC."""
        kinks = [t for t in law.kinks if COLDEST < t < HOTTEST]
        t = np.union1d(np.linspace(COLDEST, HOTTEST, 841), kinks)
        for side in ("above", "below"):
            values = law(t, side)
            for at, value in zip(t, values, strict=True):
                try:
                    if not np.isfinite(value):
                        raise ValueError("must be finite")
                    KINDS[key].bounded(float(value))
                except ValueError as error:
                    text = f"{value:g} {KINDS[key].unit} at {at - ZERO_CELSIUS:.0f} degC: {error}"
                    raise self.fail(key, text=text) from None

    def _temperature(self, key: str) -> float:
        """Solidus or liquidus of a linear solid fraction, K."""
        entry = self.given.entry(key)
        if entry is None:
            raise self.fail(key, text=f'is missing; the {key}, such as "1500 degC"')
        if self._form(key, entry, ("value", "formula")) == "value":
            return self._constant(key, entry)
        name = self._named(key, entry, ("iron_carbon", "regression"))
        diagram = self._phases(key, name)
        if name == "iron_carbon":
            return diagram.solidus if key == "solidus" else diagram.liquidus
        if key == "solidus":
            return alloying.regression_solidus(self.composition)
        return alloying.regression_liquidus(self.composition)

    def _fraction(self) -> SolidFraction:
        entry = self.given.solid_fraction or Entry(formula="linear")
        form = self._form("solid_fraction", entry, ("table", "formula"))
        name = "table"
        if form == "formula":
            name = self._named("solid_fraction", entry, ("linear", "lever_rule", BY_DATABASE))
        if name == "linear":
            return self._linear()
        for key in ("solidus", "liquidus"):
            if self.given.entry(key) is not None:
                raise self.fail(
                    key,
                    text=f"follows from solid_fraction, which is a {name.replace('_', ' ')}; "
                    'leave it out, or set solid_fraction.formula = "linear"',
                )
        if name == "table":
            table = self._table("solid_fraction", entry)
            try:
                return TableFraction(table)
            except ValueError as error:
                raise self.fail("solid_fraction", text=str(error)) from None
        return LeverFraction(self._phases("solid_fraction", name))

    def _linear(self) -> SolidFraction:
        solidus = self._or_none(self._temperature, "solidus")
        liquidus = self._or_none(self._temperature, "liquidus")
        if solidus is None or liquidus is None:
            raise Faulty
        if solidus > liquidus:
            texts = [write(t, "K", "degC") for t in (solidus, liquidus)]
            raise self.fail("solidus", text="({}) lies above the liquidus ({})".format(*texts))
        return LinearFraction(solidus, liquidus)

    def _latent_heat(self) -> float:
        """Latent heat, J/kg; 0 for now if the enthalpy releases it."""
        entry, enthalpy = self.given.latent_heat, self.given.enthalpy
        if enthalpy is not None:
            if entry is not None:
                raise self.fail("latent_heat", text="is in the enthalpy already; leave one out")
            fraction = self.given.solid_fraction
            by_phase = enthalpy.formula is not None
            if by_phase and (fraction is None or fraction.formula not in BY_PHASE):
                raise self.fail(
                    "enthalpy",
                    text="freezes by the lever rule; "
                    'set solid_fraction.formula = "lever_rule", or give latent_heat instead',
                )
            return 0.0
        if entry is None:
            raise self.fail("latent_heat", text='is missing; such as "270 kJ/kg", or an enthalpy')
        self._form("latent_heat", entry, ("value",))
        return self._constant("latent_heat", entry)

    def _expansion(self, density: Property | None) -> Expansion | None:
        entry = self.given.thermal_expansion
        if entry is None:
            return None
        key = "thermal_expansion"
        form = self._form(key, entry, ("value", "table", "formula"))
        if form != "table" and entry.model_fields_set & {"coefficient", "origin"}:
            raise self.fail(key, text="only a table has coefficient and origin")
        if form == "value":
            return ConstantExpansion(self._constant(key, entry))
        if form == "table":
            return self._tabulated(entry)
        if self._named(key, entry, ("density", "chandra")) == "density":
            if density is None:
                raise Faulty
            return DensityExpansion(density)
        return ChandraExpansion(self._phases(key, "chandra"))

    def _tabulated(self, entry: ExpansionEntry) -> Expansion:
        key = "thermal_expansion"
        table = self._table(key, entry)
        if entry.coefficient == "differential":
            if entry.origin is not None:
                raise self.fail(key, "origin", text="only a mean coefficient has an origin")
            return DifferentialExpansion(table)
        if entry.origin is None:
            raise self.fail(
                key,
                "origin",
                text='is missing; the reference temperature of the mean coefficient, "20 degC"',
            )
        try:
            return MeanExpansion(table, TEMPERATURE.read(entry.origin))
        except ValueError as error:
            raise self.fail(key, "origin", text=f"{error} ({shown(entry.origin)})") from None

    def _origins(self) -> dict[str, Origin]:
        origins = {
            "solid_fraction": Origin("formula linear", "[Pascon2003] (12), unless stated", "F")
        }
        for key in KINDS:
            entry = self.given.entry(key)
            if entry is None:
                continue
            law = f"formula {entry.formula}" if entry.formula else "table"
            if entry.forms == ("value",):
                law = str(entry.value)
            formula = FORMULAS.get(entry.formula or "")
            if entry.formula in BY_DIAGRAM and not entry.source:
                found = iron_carbon.SOURCES[self.given.diagram]
                if isinstance(self.diagram, PhaseTable):
                    found = self.diagram.source, "C"
                origins[key] = Origin(law, *found)
                continue
            source = entry.source or (formula.source if formula else "")
            status = entry.status if entry.source or not formula else formula.status
            origins[key] = Origin(law, source, status)
        if "enthalpy" in origins:  # provides the specific heat, too, if that is not given
            origins.setdefault("specific_heat", origins["enthalpy"])
        return origins


def _with_released_heat(steel: Steel) -> Steel:
    """Return the steel with the heat that its enthalpy releases between liquidus and solidus."""
    law, heat = steel.properties["enthalpy"], steel.properties["specific_heat"]
    total = float(law(steel.liquidus, "above") - law(steel.solidus, "below"))
    if steel.liquidus > steel.solidus:
        breaks = steel.breakpoints(steel.solidus, steel.liquidus)
        t = knots.grid(breaks, steel.solidus, steel.liquidus, curved=True)
        sensible = knots.one_sided(heat, knots.nodes(t)) @ knots.WEIGHTS * np.diff(t)
        total -= float(sensible.sum())
    return replace(steel, latent_heat=total)
