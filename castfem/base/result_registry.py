"""The registry of results: what a run gives for its slice, each declared once.

    @quantity("contact_share", unit="percent", label="share in contact", needs=("mould",))
    def contact_share(sample: Sample) -> float:
        '''Of the surface.'''
        return sample.contact.share

is all that a quantity takes: its column in history.csv with name and unit, its row in summary.json
and in the tables of `castfem show`, its words on the axis of a figure and its line in
docs/output.md follow, and `[[reference]]`, `[optimise]` and `--units` know its name. The function
gives SI (K, m, s, Pa ...); it is called on all ranks, so that it may add up over them. Its
docstring is what docs/output.md says of it.

The registry stands below the case, whose references and objectives name results, and knows neither
a simulation nor a solver. castfem's own quantities are declared by the modules of `MODULES`, which
are imported when the first name is looked up. They import no solver: tables and figures of a
finished run need the words alone.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, lru_cache
from importlib import import_module
from typing import Any, Literal, TypeVar

from castfem.base import units
from castfem.base.shown_quantity import Quantity, si_unit

MODULES = (
    "castfem.runs.results.thermal_quantities",
    "castfem.runs.results.mechanical_quantities",
    "castfem.runs.results.contact_quantities",
    "castfem.runs.results.quality_quantities",
    "castfem.runs.results.hot_tearing_quantities",
    "castfem.runs.results.closed_form_quantities",
)
"""Modules that declare quantities, in the order of the columns; others come behind."""
_NEEDS_MODULE = (
    "castfem.runs.results.needs"  # whose table NEEDS has the names that `needs` may give
)
PROBES = ("mid_face", "narrow_face", "corner", "diagonal", "tip", "fillet")
"""Probes of all shapes; in a half or whole section there are more, their images."""
AT_FRACTION = re.compile(r"fs([1-9]\d?)_(\w+)")
"""Names of the shell to a solid fraction in percent, at a probe (`output.shell_at`)."""

Computed = TypeVar("Computed", bound=Callable[..., float | None])
Each = Literal["", "probe", "centred_probe"]


def _nothing(*_: Any) -> float | None:
    return None


@dataclass(frozen=True, slots=True, kw_only=True)
class QuantityDefinition:
    """What a quantity is called, in which units it is shown, and how it is computed.

    As a decorator, `castfem.quantity`, it declares a function: a column, a result, a row of tables.
    """

    #: of column and result; of a quantity at the probes `NAME_PROBE`
    name: str = field(kw_only=False)
    unit: str = field(kw_only=False)  #: in history.csv; "-" for none
    label: str = field(kw_only=False)  #: in tables, without unit; {} stands for the probe
    #: what a simulation must have, of `castfem.runs.results.needs.NEEDS`
    needs: tuple[str, ...] = ()
    #: whether it is taken at each probe, or at those that end in the centre of the section
    each: Each = ""
    shown: str = ""  #: unit in summary.json and tables, if not that of the history
    column: bool = True  #: whether it is a column of history.csv
    row: bool = True  #: whether it is a result in summary.json
    #: the result that it follows in the summary, if not in the order of declaration
    after: str = ""
    #: where in the section the value was found, shown after the label; "" for nowhere
    place: Callable[[Any], str] | None = None
    labels: Mapping[str, str] = field(default_factory=dict)  #: labels at single probes that differ
    axis: str = ""  #: on the axis of a figure, if not the label
    of_way: bool = False  #: whether it hangs on all steps so far, not on the last alone
    #: the maximum to which it is a smooth approximation; such a quantity is computed where it is
    #: asked for
    smooth_twin_of: str = ""
    says: str = ""  #: what docs/output.md says of it, if not the docstring of the function
    #: the function: its value in SI from the sample of a step, at the probes from a sample and the
    #: probe's name; None where it does not exist
    compute: Callable[..., float | None] = _nothing

    def __call__(self, compute: Computed) -> Computed:
        """Declare a function.

        Raises:
            ValueError: There is one of that name, or something it needs is not known.
        """
        if self.name in _declared:
            raise ValueError(f"two quantities are named {self.name}")
        if unknown := set(self.needs) - import_module(_NEEDS_MODULE).NEEDS.keys():
            raise ValueError(f"{self.name}: unknown entries in needs: {', '.join(sorted(unknown))}")
        _declared[self.name] = replace(self, compute=compute)
        return compute

    @property
    def about(self) -> str:
        """What docs/output.md says of it."""
        return " ".join((self.says or inspect.getdoc(self.compute) or "").split())

    @property
    def axis_label(self) -> str:
        """Its words on the axis of a figure, without unit."""
        return self.axis or self.label.replace(", {}", "").replace(" at {}", "")

    @property
    def measured(self) -> str:
        """A unit that measures it, "1" for a plain number."""
        unit = self.shown or self.unit
        return "1" if unit == "-" else unit

    def named(self, probe: str = "") -> str:
        """Name of the result, at a probe or of the whole slice."""
        return f"{self.name}_{probe}" if probe else self.name

    @property
    def of_strained(self) -> bool:
        """Whether it is read off the strained slice as it is here."""
        return not self.of_way and not _strained().isdisjoint(self.needs)

    def value(self, sample: Any, probe: str = "") -> float | None:
        """Its value in SI from a sample (`castfem.runs.results.sample.Sample`).

        None where it is of mechanics that have ended above.
        """
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


@cache
def _strained() -> frozenset[str]:
    return frozenset(import_module(_NEEDS_MODULE).STRAINED)


quantity = QuantityDefinition
_declared: dict[str, QuantityDefinition] = {}
_families: dict[re.Pattern[str], Callable[[int], QuantityDefinition]] = {}


def quantity_family(pattern: re.Pattern[str], of: Callable[[int], QuantityDefinition]) -> None:
    """Declare quantities at the probes whose names hold a number.

    Args:
        pattern: Of their names; its groups are the number and the probe.
        of: The definition by its number.
    """
    _families[pattern] = of


def _by_name() -> Mapping[str, QuantityDefinition]:
    """All quantities, those of `MODULES` among them."""
    for module in MODULES:
        import_module(module)
    return _declared


def declared() -> list[QuantityDefinition]:
    """All quantities in the order of the columns: castfem's own as declared, then all others."""
    order = {module: i for i, module in enumerate(MODULES)}
    everything = _by_name().values()
    return sorted(everything, key=lambda d: order.get(d.compute.__module__, len(order)))


def in_summary_order() -> list[QuantityDefinition]:
    """The results in the order of summary.json: as declared, but for those put `after` another."""
    rows = [d for d in declared() if d.row]
    ordered = [d for d in rows if not d.after]
    for definition in (d for d in rows if d.after):
        before = next(i for i, d in enumerate(ordered) if d.name == definition.after)
        ordered.insert(before + 1, definition)
    return ordered


def find(name: str) -> tuple[QuantityDefinition, str] | None:
    """The definition behind the name of a column or result, and its probe; None if there is none.

    What is named so stands before what begins so: `gap_max` is no gap at a probe `max`.
    """
    everything = _by_name()
    exact = everything.get(name)
    if exact is not None and not exact.each:
        return exact, ""
    begins = [d for d in everything.values() if d.each and name.startswith(f"{d.name}_")]
    if begins:
        longest = max(begins, key=lambda d: len(d.name))
        return longest, name.removeprefix(f"{longest.name}_")
    for pattern, of in _families.items():
        if (found := pattern.fullmatch(name)) is not None:
            return of(int(found[1])), found[2]
    return None


def _find_known(name: str) -> QuantityDefinition | None:
    """The definition behind a name, without a probe or at one that some section has."""
    found = find(name)
    if found is None:
        return None
    definition, probe = found
    known = not definition.each or any(f"{probe}_".startswith(f"{one}_") for one in PROBES)
    return definition if known else None


def unit_of(name: str) -> str | None:
    """A unit that measures a result, "1" for a plain number; None if there is no such result."""
    definition = _find_known(name)
    return definition.measured if definition is not None and definition.row else None


def usual_unit(name: str) -> str | None:
    """The same of a result or column, at the probes also without the name of a probe."""
    definition = _by_name().get(name) or _find_known(name)
    return None if definition is None else definition.measured


def result_names() -> Iterator[str]:
    """The names of results, those at probes without the images of symmetry."""
    for d in declared():
        if d.row:
            yield from (d.named(probe) for probe in (PROBES if d.each else ("",)))


def smooth_twins() -> dict[str, str]:
    """Smooth twins of maxima, and of which."""
    return {d.name: d.smooth_twin_of for d in declared() if d.smooth_twin_of}


def fault(name: str, value: str) -> tuple[str, str] | None:
    """The key of a reference that is wrong and why; None if it can be compared."""
    unit = unit_of(name)
    if unit is None:
        near = units.nearest(name, result_names())
        return "quantity", f'("{name}") is no result of a run{near}'
    if units.parse_any(value)[1] == si_unit(unit):
        return None
    wanted = "a plain number" if unit == "1" else f'a unit such as "{unit}"'
    return "value", f'("{value}") does not measure {name}; it has {wanted}'


def general_label(name: str, label: str) -> str:
    """What a result is called in whatever run: without the place where one run has it."""
    found = find(name)
    if found is None or found[0].place is None:
        return label
    return found[0].result(0.0, found[1]).label


def probe_label(probe: str) -> str:
    """What a probe is called."""
    return probe.replace("mid_face", "mid-face").replace("_", " ")


@lru_cache(maxsize=64)
def _scale(unit: str) -> tuple[float, float]:
    """Factor and zero of a unit: the value in it is factor * SI - zero."""
    return (1.0, 0.0) if unit == "-" else units.factor_and_zero(si_unit(unit), unit)
