"""The case: all input of a run, validated and in SI."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from pydantic import Field, ModelWrapValidatorHandler, model_validator

from castfem.base.constants import ROUNDING
from castfem.base.errors import InputError
from castfem.base.tables import Table as TableOfValues
from castfem.model.base import PROPERTY_FILES, FaultyError, TableModel, is_path
from castfem.model.caster import Caster
from castfem.model.casting import (
    CONTACT_FIELDS,
    THERMAL_FIELDS,
    Casting,
    FieldName,
    Output,
    Reference,
    Steel,
    usual_interval,
)
from castfem.model.cooling import Contact, HeatLaw, Zone
from castfem.model.machine import Machine
from castfem.model.mechanics import MOULD_EXIT, Coupling, Mechanics
from castfem.model.mould import Mould
from castfem.model.optimise import Optimise
from castfem.model.quality import Quality
from castfem.model.secondary import Secondary
from castfem.model.section import Mesh, Section
from castfem.model.shown_units import ShownUnits
from castfem.model.thermal import Thermal, Verification
from castfem.model.water import Water
from castfem.physics.mould.taper import segment_ends

_NOT_PHYSICS: Any = {
    "title": True,
    "output": True,
    "reference": True,
    "verification": True,
    "optimise": True,
    "caster": True,
    "casting": {"length"},
    "mould": {"oscillation"},
    "thermal": {"solver"},
    "mechanics": {"solver"},
}

_MOULD = "mould"  # part of the name of a zone


@dataclass(frozen=True, slots=True)
class Span:
    """A cooling zone within the followed length."""

    name: str  #: name of the zone
    start: float  #: where it begins, from the meniscus, m
    end: float  #: where it ends, m; not beyond the followed length
    #: the heat laws, each with its boundary groups (or beginnings of their names)
    laws: tuple[tuple[tuple[str, ...], HeatLaw], ...]
    whole: bool  #: whether the zone ends here, not only the followed length
    #: whether it is the zone of [secondary], whose laws are not listed here
    roll_to_roll: bool = False


class Case(TableModel):
    """A case file. Tables may be inherited from the file named by `extends`."""

    title: str = Field(min_length=1)
    """one line that says what the case is"""
    casting: Casting
    steel: Steel
    section: Section
    mesh: Mesh
    cooling: tuple[Zone, ...] = Field(min_length=1)
    thermal: Thermal = Field(default_factory=lambda: Thermal.model_validate({}))
    mechanics: Mechanics | None = None
    """the mechanical problem; left out: temperature only"""
    mould: Mould | None = None
    """the rigid mould; left out: an idealised one, without contact forces"""
    machine: Machine | None = None
    """the rolls below the mould; left out: a straight vertical strand"""
    water: Water | None = None
    """spray water of the whole strand, of which zones and circuits take shares; left out: each zone
    gives its own"""
    secondary: Secondary | None = None
    """cooling from roll to roll below [[cooling]]; left out: none"""
    coupling: Coupling = Field(default_factory=lambda: Coupling.model_validate({}))
    quality: Quality | None = None
    """criteria for the quality of the strand; left out: no crack index is computed"""
    output: Output = Field(default_factory=lambda: Output.model_validate({}))
    verification: Verification | None = None
    """the closed form that the run is compared with; left out: none"""
    optimise: Optimise | None = None
    """problem that castfem optimise solves; left out: none. Other commands ignore it"""
    caster: Caster | None = None
    """the slices that castfem caster computes; left out: none. Other commands ignore it"""
    reference: tuple[Reference, ...] = ()

    @model_validator(mode="wrap")
    @classmethod
    def _with_interval(cls, data: Any, handler: ModelWrapValidatorHandler[Case]) -> Case:
        """Set the output interval of the fields, so that the case of a run states it."""
        case = handler(data)
        try:
            if case.output.every is not None:
                return case
            every = usual_interval(case.casting.duration)
        except FaultyError:
            return case
        output = case.output.model_copy(update={"every": every})
        return case.model_copy(update={"output": output})

    def zones(self) -> tuple[Span, ...]:
        """Return the cooling zones within the followed length, in casting order."""
        spans, start = [], 0.0
        default = self.section.cooled_groups()
        for zone in self.cooling:
            end = self.casting.length if zone.to is None else min(zone.to, self.casting.length)
            laws = tuple((law.on or default, law) for law in zone.surface)
            spans.append(Span(zone.name, start, end, laws, whole=zone.to == end))
            start = end
            if end >= self.casting.length:
                return tuple(spans)
        if self.secondary is not None:
            end = self.casting.length
            spans.append(Span("secondary", start, end, (), whole=True, roll_to_roll=True))
        return tuple(spans)

    def mould_exit(self) -> float | None:
        """Return where the mould ends, from the meniscus, m; None if the case has none.

        That is mould.length. Without [mould] it is the end of the consecutive zones from the
        meniscus on whose names contain "mould" or, if the first one's does not, that cool by
        contact with a wall.
        """
        if self.mould is not None:
            return self.mould.length
        zones = self.mould_zones()
        return zones[-1].to if zones else None

    def mould_zones(self) -> tuple[Zone, ...]:
        """Return the zones of the mould, from the meniscus on (see `mould_exit`).

        A [mould] that ends within a zone does not cut it.
        """
        named = [_MOULD in zone.name.lower() for zone in self.cooling]
        walled = [any(isinstance(law, Contact) for law in zone.surface) for zone in self.cooling]
        of_mould = named if named[0] else walled
        return self.cooling[: next((i for i, p in enumerate(of_mould) if not p), len(of_mould))]

    def mechanics_end(self) -> float | None:
        """Return where the mechanics end while the run continues, m; None if they do not."""
        until = None if self.mechanics is None else self.mechanics.until
        place = self.mould_exit() if until == MOULD_EXIT else until
        if not isinstance(place, float) or place >= self.casting.length * (1.0 - ROUNDING):
            return None
        return place

    @property
    def bends(self) -> bool:
        """Whether the rolls of the machine bend the strand; False if no rolls could be read."""
        rolls = None if self.machine is None else self.machine.pairs()
        return rolls is not None and any(math.isfinite(pair.radius) for pair in rolls.pairs)

    @property
    def brittle_band(self) -> tuple[float, float]:
        """Temperatures between which the steel has little ductility, K."""
        return (self.quality or Quality.model_validate({})).band

    @property
    def shown_units(self) -> ShownUnits:
        """The units to show; those of the plant where the case chooses none."""
        return self.output.units or ShownUnits()

    @property
    def output_every(self) -> float:
        """Time between two outputs of the fields, s."""
        assert self.output.every is not None, "the case has been checked"
        return self.output.every

    @property
    def output_clock(self) -> float:
        """Time at which the slice leaves the meniscus, by the clock of the output times, s."""
        return self.casting.clock if self.output.by_clock else 0.0

    def tables_by_clock(self) -> list[TableOfValues]:
        """Return the tables over time that use the clock of `casting.start.time`."""
        laws = [law for zone in self.cooling for law in zone.surface]
        watered = [self.water, *(() if self.secondary is None else self.secondary.circuit), *laws]
        given: list[object] = [self.casting.speed, self.casting.superheat]
        given += [getattr(one, "flow", None) for one in watered]
        given += [getattr(law, "factor", None) for law in laws]
        tables = (one for one in given if isinstance(one, TableOfValues))
        return [table for table in tables if table.over == "time"]

    def output_times(self) -> list[float]:
        """Return the times since the meniscus at which fields are written, without the end, s."""
        every, clock = self.output_every, self.output_clock
        first, last = math.floor(clock / every), int((clock + self.casting.duration) / every)
        times = [i * every - clock for i in range(first + 1, last + 1)]
        # Slices that start at different clock times get the same digits at the same age.
        return [round(time, 9) for time in times] if self.output.by_clock else times

    @property
    def output_fields(self) -> tuple[FieldName, ...]:
        """The fields to write: those requested, or all that the simulation has."""
        if self.output.fields is not None:
            return self.output.fields
        usual: tuple[FieldName, ...] = (
            "displacement",
            "stress",
            "von_mises",
            "viscoplastic_strain",
        )
        found = THERMAL_FIELDS + (usual if self.mechanics is not None else ())
        return found + (CONTACT_FIELDS if self.mould is not None else ())

    def expected(self) -> tuple[Reference, ...]:
        """Return the reference numbers that hold at the end of the run."""
        end = self.casting.length
        return tuple(r for r in self.reference if r.at is None or math.isclose(r.at, end))

    def mould_knots(self) -> tuple[float, ...]:
        """Return start and end of the mould, and where its walls change slope, m; or ()."""
        table = self.mould
        if table is None:
            return ()
        profiles = [given.profile(table.length) for given in table.taper.parts.values()]
        knots = segment_ends(profiles, table.length)
        warmth = table.copper.temperature if table.condition == "cold" else None
        if isinstance(warmth, TableOfValues):
            knots += [p for p in warmth.arguments if 0.0 < p < table.length]
        return tuple(sorted(knots))

    def mesh_parameters(self) -> dict[str, Any]:
        """Return the given keys of [section] and [mesh] in SI: the parameters of the mesh."""
        section = self.section.model_dump(exclude_none=True)
        bulge = getattr(self.section, "bulge", None)
        if isinstance(bulge, TableOfValues):
            section["bulge"] = (list(bulge.arguments), list(bulge.values))
        elif bulge is not None:
            section["bulge"] = ([0.0], [bulge])
        return section | self.mesh.model_dump(exclude_none=True)

    def document(self) -> dict[str, Any]:
        """Return the case as the tables of a case file, every quantity with its unit."""
        tables = self.model_dump(mode="json", exclude_none=True)
        for table, key in (
            (tables["steel"], "composition"),
            (tables["steel"], "overrides"),
            (tables["thermal"], "solver"),
            (tables, "reference"),
            (tables.get("mechanics", {}), "solver"),
            (tables.get("mechanics", {}), "held"),
            (tables.get("machine", {}), "segment"),
            (tables.get("secondary", {}), "nozzle"),
            (tables.get("secondary", {}), "circuit"),
            (tables["output"], "probe"),
        ):
            if key in table and not table[key]:
                del table[key]
        if self.mechanics is None:
            del tables["coupling"]
        return tables

    def resolved_toml(self) -> str:
        """Return a case file without `extends` that reads back to an equal case."""
        import tomli_w

        return tomli_w.dumps(self.document())

    def _repr_html_(self) -> str:
        """The case file with its defaults, in the chosen units, for a notebook."""
        from html import escape

        import tomli_w

        from castfem.base.shown_units import shown_in
        from castfem.model.shown_units import with_units

        with shown_in(self.shown_units):
            text = tomli_w.dumps(with_units(self.document()))
        return f"<b>{escape(self.title)}</b><pre>{escape(text)}</pre>"

    def physics(self) -> dict[str, Any]:
        """Return everything that the computed fields depend on, as tables.

        Not included are the title, the output settings, the reference numbers and the followed
        length (a run may be resumed further down the strand); property files are included by
        content.
        """
        physics = self.model_dump(mode="json", exclude_none=True, exclude=_NOT_PHYSICS)
        if self.mechanics is None:
            del physics["coupling"]
        for table, key in PROPERTY_FILES:
            name = str(physics.get(table, {}).get(key, ""))
            if is_path(name):
                path = Path(name)
                content = path.read_bytes() if path.is_file() else b""
                digest = hashlib.sha256(content).hexdigest()
                physics[table][key] = f"file of SHA-256 {digest}"
        return physics

    def physics_hash(self) -> str:
        """Return a hash of `physics`."""
        return _hash(self.physics())

    def physics_record(self) -> dict[str, str]:
        """Return `physics` as JSON ("case") and its hash ("physics"), as a checkpoint keeps them.

        Writing out the whole case takes long with large tables, so a run does this once.
        """
        tables = self.physics()
        return {"physics": _hash(tables), "case": json.dumps(tables)}

    #: `castfem.model.load.changed`, which needs this class and therefore sets itself here
    changed: ClassVar[Callable[[Case, Mapping[str, Any]], Case]]

    def with_(self, changes: Mapping[str, Any] | None = None, **dotted: Any) -> Case:
        """Return a changed case: `case.with_({"casting.speed": "3 m/min"})`.

        Args:
            changes: Dotted key and new value, written as in a case file. A zone or another array
                entry is addressed by its index or name. A bare name will do for a key that only one
                table of the case has: speed for casting.speed.
            dotted: The same for bare names and keys of the top level:
                `case.with_(speed="3 m/min", title="slower")`.

        Raises:
            InputError: The changed case is not valid; all problems at once.
        """
        if changes is not None and not isinstance(changes, Mapping):
            raise InputError(
                f'with_: keys and values are needed, such as {{"casting.speed": "3 m/min"}} or '
                f'speed="3 m/min" (given: {changes!r})'
            )
        return Case.changed(self, {**(changes or {}), **dotted})


def _hash(physics: Mapping[str, Any]) -> str:
    text = json.dumps(physics, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]
