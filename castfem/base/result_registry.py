"""Registry of the results of a run, each declared once.

    @quantity("contact_share", unit="percent", label="share in contact", needs=("mould",))
    def contact_share(sample: Sample) -> float:
        '''Of the surface.'''
        return sample.contact.share

is the complete definition of a quantity: it becomes a column of history.csv with name and unit, a
row in summary.json and in the tables of `castfem show`, an axis label of figures, a line in
docs/output.md, and a name for `[[reference]]`, `[optimise]` and `--units`. The function returns SI
(K, m, s, Pa ...); it is called on all ranks, so that it may sum over them. Its docstring is its
description in docs/output.md.

The registry comes before the case, whose references and objectives name results, and knows neither
simulation nor solver. castfem's own quantities are declared by the modules of `MODULES`, which are
imported at the first lookup. They import no solver, since tables and figures of a finished run only
need the names.
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
    "castfem.runs.results.crack_quantities",
    "castfem.runs.results.hot_tearing_quantities",
    "castfem.runs.results.closed_form_quantities",
)
"""Modules that declare quantities, in the order of the columns; others follow."""
_NEEDS_MODULE = "castfem.runs.results.needs"  # its table NEEDS has the names allowed in `needs`
PROBES = ("mid_face", "narrow_face", "corner", "diagonal", "tip", "fillet")
"""Probes of all shapes; half and whole sections have mirror images as well."""
AT_FRACTION = re.compile(r"fs([1-9]\d?)_(\w+)")
"""Names of the shell to a solid fraction in percent at a probe (`output.shell_at`)."""

Computed = TypeVar("Computed", bound=Callable[..., float | None])
Each = Literal["", "probe", "centred_probe"]


def _nothing(*_: Any) -> float | None:
    return None


@dataclass(frozen=True, slots=True, kw_only=True)
class QuantityDefinition:
    """Definition of a quantity: names, units, and how it is computed.

    As a decorator, `castfem.quantity`, it declares a function as a column, a result, and a row of
    tables.
    """

    #: name of column and result; at the probes `NAME_PROBE`
    name: str = field(kw_only=False)
    unit: str = field(kw_only=False)  #: unit in history.csv; "-" for none
    label: str = field(kw_only=False)  #: label in tables, without unit; {} stands for the probe
    #: parts that a simulation must have, from `castfem.runs.results.needs.NEEDS`
    needs: tuple[str, ...] = ()
    #: whether it exists for each probe, or for those that end in the centre of the section
    each: Each = ""
    shown: str = ""  #: unit in summary.json and tables, if different
    column: bool = True  #: whether it is a column of history.csv
    row: bool = True  #: whether it is a result in summary.json
    #: result after which it is listed in the summary, if not in the order of declaration
    after: str = ""
    #: place of the value in the section, shown after the label; "" for none
    place: Callable[[Any], str] | None = None
    labels: Mapping[str, str] = field(default_factory=dict)  #: different labels at single probes
    axis: str = ""  #: label on the axis of a figure, if different
    of_way: bool = False  #: whether it depends on all steps so far, not only on the last
    #: maximum to which it is a smooth approximation; such a quantity is only computed on request
    smooth_twin_of: str = ""
    says: str = ""  #: description in docs/output.md, if not the docstring of the function
    #: the function: returns the value in SI for the sample of a step (at probes for a sample and
    #: the probe's name), None if it does not exist
    compute: Callable[..., float | None] = _nothing

    def __call__(self, compute: Computed) -> Computed:
        """Declare a function.

        Raises:
            ValueError: The name exists already, or one of `needs` is unknown.
        """
        if self.name in _declared:
            raise ValueError(f"two quantities are named {self.name}")
        if unknown := set(self.needs) - import_module(_NEEDS_MODULE).NEEDS.keys():
            raise ValueError(f"{self.name}: unknown entries in needs: {', '.join(sorted(unknown))}")
        _declared[self.name] = replace(self, compute=compute)
        return compute

    @property
    def about(self) -> str:
        """Its description in docs/output.md."""
        return " ".join((self.says or inspect.getdoc(self.compute) or "").split())

    @property
    def axis_label(self) -> str:
        """Its label on the axis of a figure, without unit."""
        return self.axis or self.label.replace(", {}", "").replace(" at {}", "")

    @property
    def measured(self) -> str:
        """A unit of the same dimension, "1" for a plain number."""
        unit = self.shown or self.unit
        return "1" if unit == "-" else unit

    def named(self, probe: str = "") -> str:
        """Name of the result, at a probe or for the whole slice."""
        return f"{self.name}_{probe}" if probe else self.name

    @property
    def of_strained(self) -> bool:
        """Whether it is sampled from the strained slice at its present position."""
        return not self.of_way and not _strained().isdisjoint(self.needs)

    def value(self, sample: Any, probe: str = "") -> float | None:
        """Its value in SI from a sample (`castfem.runs.results.sample.Sample`).

        None if it belongs to mechanics that have ended.
        """
        if sample.mechanics is None and self.of_strained:
            return None
        return self.compute(sample, probe) if probe else self.compute(sample)

    def in_unit(self, value: float | None) -> float:
        """Convert a value from SI to the unit of history.csv; NaN for None."""
        if value is None:
            return float("nan")
        factor, zero = _scale(self.unit)
        return factor * float(value) - zero

    def result(self, value: float, probe: str = "", place: str = "") -> Quantity:
        """Return a value in SI as a result, with its label and shown unit."""
        label = self.labels.get(probe, self.label.format(probe_label(probe)))
        return Quantity(value, self.shown or self.unit, f"{label}, {place}" if place else label)


@cache
def _strained() -> frozenset[str]:
    return frozenset(import_module(_NEEDS_MODULE).STRAINED)


quantity = QuantityDefinition
_declared: dict[str, QuantityDefinition] = {}
_families: dict[re.Pattern[str], Callable[[int], QuantityDefinition]] = {}


def quantity_family(pattern: re.Pattern[str], of: Callable[[int], QuantityDefinition]) -> None:
    """Declare quantities at the probes whose names contain a number.

    Args:
        pattern: Pattern of the names; its groups are the number and the probe.
        of: Returns the definition for a number.
    """
    _families[pattern] = of


def _by_name() -> Mapping[str, QuantityDefinition]:
    """All quantities by name, including those of `MODULES`."""
    for module in MODULES:
        import_module(module)
    return _declared


def declared() -> list[QuantityDefinition]:
    """All quantities in the order of the columns: castfem's own first."""
    order = {module: i for i, module in enumerate(MODULES)}
    everything = _by_name().values()
    return sorted(everything, key=lambda d: order.get(d.compute.__module__, len(order)))


def in_summary_order() -> list[QuantityDefinition]:
    """The results in the order of summary.json: as declared, except those with `after`."""
    rows = [d for d in declared() if d.row]
    ordered = [d for d in rows if not d.after]
    for definition in (d for d in rows if d.after):
        before = next(i for i, d in enumerate(ordered) if d.name == definition.after)
        ordered.insert(before + 1, definition)
    return ordered


def find(name: str) -> tuple[QuantityDefinition, str] | None:
    """The definition and probe for the name of a column or result; None if unknown.

    Exact names take precedence over prefixes: `gap_max` is not a gap at a probe `max`.
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
    """The definition for a name, without a probe or at one of any section."""
    found = find(name)
    if found is None:
        return None
    definition, probe = found
    known = not definition.each or any(f"{probe}_".startswith(f"{one}_") for one in PROBES)
    return definition if known else None


def unit_of(name: str) -> str | None:
    """A unit of the dimension of a result, "1" for a plain number; None for unknown results."""
    definition = _find_known(name)
    return definition.measured if definition is not None and definition.row else None


def usual_unit(name: str) -> str | None:
    """The same for a result or column, at probes also without the name of the probe."""
    definition = _by_name().get(name) or _find_known(name)
    return None if definition is None else definition.measured


def result_names() -> Iterator[str]:
    """The names of results; at probes without mirror images."""
    for d in declared():
        if d.row:
            yield from (d.named(probe) for probe in (PROBES if d.each else ("",)))


def smooth_twins() -> dict[str, str]:
    """Smooth approximations, with the maxima they belong to."""
    return {d.name: d.smooth_twin_of for d in declared() if d.smooth_twin_of}


def fault(name: str, value: str) -> tuple[str, str] | None:
    """The faulty key of a reference and why; None if it can be compared."""
    unit = unit_of(name)
    if unit is None:
        near = units.nearest(name, result_names())
        return "quantity", f'("{name}") is not a result of a run{near}'
    if units.parse_any(value)[1] == si_unit(unit):
        return None
    wanted = "a plain number" if unit == "1" else f'a unit such as "{unit}"'
    return "value", f'("{value}") does not measure {name}; it has {wanted}'


def general_label(name: str, label: str) -> str:
    """Label of a result for any run: without the place found in one run."""
    found = find(name)
    if found is None or found[0].place is None:
        return label
    return found[0].result(0.0, found[1]).label


def probe_label(probe: str) -> str:
    """Label of a probe."""
    return probe.replace("mid_face", "mid-face").replace("_", " ")


@lru_cache(maxsize=64)
def _scale(unit: str) -> tuple[float, float]:
    """Factor and zero of a unit: the value in it is factor * SI - zero."""
    return (1.0, 0.0) if unit == "-" else units.factor_and_zero(si_unit(unit), unit)
