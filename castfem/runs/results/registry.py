"""The registry of quantities: what a run tells of its slice, each declared once.

    @quantity("contact_share", unit="percent", label="share in contact", needs=("mould",))
    def contact_share(sample: Sample) -> float:
        '''Of the surface.'''
        return sample.contact.share

is all that a quantity takes: its column in history.csv with name and unit, its row in summary.json
and in the tables of `castfem show`, its words on the axis of a figure and its line in
docs/output.md follow. The function gives SI (K, m, s, Pa ...); it is called on all ranks, so that
it may add up over them. Its docstring is what docs/output.md says of it.

Quantities of the thermal problem are in `thermal_quantities`, of the strained slice in
`mechanical_quantities`, of the mould in `mould_quantities`, of bulging in `bulging_quantities`, by
which the strand is judged in `quality_quantities`. These modules import no solver: tables and
figures of a finished run need the words alone.
"""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import groupby
from typing import TYPE_CHECKING, Literal, TypeVar

from castfem.base import units
from castfem.runs.output.summary import Quantity, si_unit

if TYPE_CHECKING:
    from castfem.model.build.simulation import Simulation
    from castfem.runs.results.sample import Sample

Computed = TypeVar("Computed", bound=Callable[..., float | None])
Each = Literal["", "probe", "centred_probe"]
# What a quantity may need of a simulation. A mould goes with mechanics, friction with a mould.
NEEDS: Mapping[str, Callable[[Simulation], bool]] = {
    "mechanics": lambda simulation: simulation.mechanics is not None,
    "throughout": lambda simulation: (  # mechanics that go on to the end of the strand
        simulation.mechanics is not None
        and simulation.case.mechanics is not None
        and simulation.case.mechanics.until is None
    ),
    "smooth": lambda simulation: (
        simulation.mechanics is not None and bool(simulation.case.output.smooth)
    ),
    "law_data": lambda simulation: (
        simulation.mechanics is not None and simulation.mechanics.problem.slice.law.data is not None
    ),
    "tilt_x": lambda simulation: _is_free(simulation, "a1"),
    "tilt_y": lambda simulation: _is_free(simulation, "a2"),
    "mould": lambda simulation: simulation.case.mould is not None,
    "oscillation": lambda simulation: (
        simulation.case.mould is not None and simulation.case.mould.oscillation is not None
    ),
    "friction": lambda simulation: (
        simulation.mechanics is not None
        and any(one.has_friction for one in simulation.mechanics.problem.slice.interactions)
    ),
    "bulging": lambda simulation: (
        simulation.case.mechanics is not None
        and simulation.case.mechanics.bulging is not None
        and simulation.case.mechanics.bulging.bears
    ),
    "machine": lambda simulation: simulation.case.machine is not None,
    "quality": lambda simulation: simulation.case.quality is not None,
    "bending": lambda simulation: simulation.mechanics is not None and simulation.case.bends,
    "extraction": lambda simulation: _has_effort(simulation),
}
_STRAINED = NEEDS.keys() - {"law_data", "oscillation", "machine", "quality"}
"""Needs of quantities that are read off the strained slice, unless they are `of_way`."""
_MODULES = tuple(
    f"castfem.runs.results.{name}_quantities"
    for name in ("thermal", "mechanical", "mould", "bulging", "quality")
)
AT_FRACTION = re.compile(r"fs([1-9]\d?)_(\w+)")
"""Names of the shell to a solid fraction in percent, at a probe (`output.shell_at`)."""
_APART = {
    "castfem.runs.results.bulging_quantities": "bulging",
    "castfem.runs.results.quality_quantities": "quality",
}
"""Modules that a simulation without what they need does not load, and what that is."""


def _is_free(simulation: Simulation, strain: str) -> bool:
    """Whether a generalized strain is found by equilibrium; what a machine bends is told apart."""
    mechanics = simulation.mechanics
    if mechanics is None or simulation.case.bends:
        return False
    return strain in mechanics.problem.slice.planes.free


def _has_effort(simulation: Simulation) -> bool:
    mechanics = simulation.mechanics
    return (
        mechanics is not None
        and getattr(mechanics.problem.slice.planes, "effort", None) is not None
    )


@dataclass(frozen=True, slots=True)
class QuantityDefinition:
    """What a quantity is called, in which units it is shown, and how it is computed.

    Attributes:
        name: Of column and result; of a quantity at the probes `NAME_PROBE`.
        unit: In history.csv; "-" for none.
        label: In tables, without unit; {} stands for the probe.
        compute: Its value in SI from a sample, at the probes from a sample and the probe's name;
            None where it does not exist.
        needs: What a simulation must have, of `NEEDS`.
        each: Whether it is taken at each probe, or at those that end in the centre of the section.
        shown: Unit in summary.json and tables, if not that of the history.
        column: Whether it is a column of history.csv.
        row: Whether it is a result in summary.json.
        after: The result that it follows in the summary, if not in the order of declaration.
        place: Where in the section the value was found, shown after the label; "" for nowhere.
        labels: Labels at single probes that differ.
        axis: On the axis of a figure, if not the label.
        of_way: Whether it hangs on all steps so far, not on the last alone.
    """

    name: str
    unit: str
    label: str
    compute: Callable[..., float | None]
    needs: tuple[str, ...] = ()
    each: Each = ""
    shown: str = ""
    column: bool = True
    row: bool = True
    after: str = ""
    place: Callable[[Sample], str] | None = None
    labels: Mapping[str, str] = field(default_factory=dict)
    axis: str = ""
    of_way: bool = False

    @property
    def about(self) -> str:
        """What docs/output.md says of it."""
        return " ".join((inspect.getdoc(self.compute) or "").split())

    @property
    def axis_label(self) -> str:
        """Its words on the axis of a figure, without unit."""
        return self.axis or self.label.replace(", {}", "").replace(" at {}", "")

    def named(self, probe: str = "") -> str:
        """Its name, at a probe or of the whole slice."""
        return f"{self.name}_{probe}" if probe else self.name

    @property
    def of_strained(self) -> bool:
        """Whether it is read off the strained slice as it is here."""
        return not self.of_way and not _STRAINED.isdisjoint(self.needs)

    def value(self, sample: Sample, probe: str = "") -> float | None:
        """Its value in SI; None where it is of mechanics that have ended above."""
        if sample.mechanics is None and self.of_strained:
            return None
        return self.compute(sample, probe) if probe else self.compute(sample)

    def in_unit(self, value: float | None) -> float:
        """A value in SI as history.csv has it; NaN for none."""
        if value is None:
            return float("nan")
        factor, zero = _scale(self.unit)
        return factor * float(value) - zero

    def result(self, value: float, probe: str = "", place: str = "") -> Quantity:
        """A value in SI as a result, with its label and the unit in which it is shown."""
        label = self.labels.get(probe, self.label.format(probe_label(probe)))
        return Quantity(value, self.shown or self.unit, f"{label}, {place}" if place else label)

    def is_of(self, simulation: Simulation) -> bool:
        """Whether the simulation has it."""
        return all(NEEDS[name](simulation) for name in self.needs)


_declared: dict[str, QuantityDefinition] = {}


def quantity(
    name: str,
    *,
    unit: str,
    label: str,
    needs: tuple[str, ...] = (),
    each: Each = "",
    shown: str = "",
    column: bool = True,
    row: bool = True,
    after: str = "",
    place: Callable[[Sample], str] | None = None,
    labels: Mapping[str, str] | None = None,
    axis: str = "",
    of_way: bool = False,
) -> Callable[[Computed], Computed]:
    """Declare the decorated function as a quantity: a column, a result, a row of tables.

    The function takes the sample of a step (with `each` a probe's name as well) and returns a
    number in SI, or None where there is none. The arguments are those of `QuantityDefinition`.

    Raises:
        ValueError: There is one of that name, or something it needs is not known.
    """

    def declare(compute: Computed) -> Computed:
        if name in _declared:
            raise ValueError(f"two quantities are named {name}")
        if unknown := set(needs) - NEEDS.keys():
            raise ValueError(f"{name} needs what is not known: {', '.join(sorted(unknown))}")
        _declared[name] = QuantityDefinition(
            name, unit, label, compute, needs, each, shown, column, row, after, place,
            labels or {}, axis, of_way,
        )  # fmt: skip
        return compute

    return declare


def declared(simulation: Simulation | None = None) -> list[QuantityDefinition]:
    """All quantities in the order of the columns: castfem's own as declared, then all others.

    Args:
        simulation: Leave out modules of which it can have no quantity; None for none.
    """
    for module in _MODULES:
        need = _APART.get(module)
        if simulation is None or need is None or NEEDS[need](simulation):
            importlib.import_module(module)
    order = {module: i for i, module in enumerate(_MODULES)}
    found = sorted(_declared.values(), key=lambda d: order.get(d.compute.__module__, len(order)))
    return found if simulation is None else [*found, *_fraction_depths(simulation)]


def _fraction_depths(simulation: Simulation) -> list[QuantityDefinition]:
    """The shell to the solid fractions that the case asks for."""
    if not simulation.case.output.shell_at:
        return []
    from castfem.runs.results.fraction_depths import depth_of

    return [depth_of(round(100.0 * fraction)) for fraction in simulation.case.output.shell_at]


def columns_of(simulation: Simulation) -> Iterator[tuple[QuantityDefinition, str]]:
    """The columns of history.csv: each definition with its probe, "" for the whole slice."""
    return _at_probes(simulation, (d for d in declared(simulation) if d.column))


def results_of(simulation: Simulation) -> Iterator[tuple[QuantityDefinition, str]]:
    """The results in summary.json, likewise."""
    return _at_probes(simulation, in_summary_order(simulation))


def in_summary_order(simulation: Simulation | None = None) -> list[QuantityDefinition]:
    """The results in the order of summary.json: as declared, but for those put `after` another."""
    rows = [d for d in declared(simulation) if d.row]
    ordered = [d for d in rows if not d.after]
    for definition in (d for d in rows if d.after):
        before = next(i for i, d in enumerate(ordered) if d.name == definition.after)
        ordered.insert(before + 1, definition)
    return ordered


def _at_probes(
    simulation: Simulation, definitions: Iterable[QuantityDefinition]
) -> Iterator[tuple[QuantityDefinition, str]]:
    """Those that the simulation has; neighbours that are taken at the probes go probe by probe."""
    probes: dict[Each, tuple[str, ...]] = {
        "": ("",),
        "probe": tuple(simulation.probes.lines),
        "centred_probe": simulation.centred_probes,
    }
    having = [d for d in definitions if d.is_of(simulation)]
    for (each, _), group in groupby(having, key=lambda d: (d.each, d.needs)):
        together = list(group)
        if not each:
            yield from ((d, "") for d in together)
        else:
            yield from ((d, probe) for probe in probes[each] for d in together)


def find(name: str) -> tuple[QuantityDefinition, str] | None:
    """The definition behind the name of a column or result, and its probe; None if there is none.

    What is named so stands before what begins so: `gap_max` is no gap at a probe `max`.
    """
    everything = {d.name: d for d in declared()}
    if name in everything and not everything[name].each:
        return everything[name], ""
    for d in everything.values():
        if d.each and name.startswith(f"{d.name}_"):
            return d, name.removeprefix(f"{d.name}_")
    if (chosen := AT_FRACTION.fullmatch(name)) is not None:
        from castfem.runs.results.fraction_depths import depth_of

        return depth_of(int(chosen[1])), chosen[2]
    return None


def general_label(name: str, label: str) -> str:
    """Return what a result is called in whatever run: without the place where one run has it."""
    found = find(name)
    if found is None or found[0].place is None:
        return label
    return found[0].result(0.0, found[1]).label


def probe_label(probe: str) -> str:
    """Return what a probe is called."""
    return probe.replace("mid_face", "mid-face").replace("_", " ")


@lru_cache(maxsize=64)
def _scale(unit: str) -> tuple[float, float]:
    """Factor and zero of a unit: the value in it is factor * SI - zero."""
    return (1.0, 0.0) if unit == "-" else units.factor_and_zero(si_unit(unit), unit)
