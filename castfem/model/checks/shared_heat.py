"""Warnings where cases with different casting speeds have the same measured mould heat."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from castfem.base.tables import Table
from castfem.base.units import convert, format
from castfem.model.base import Faults
from castfem.model.case import Case
from castfem.model.checks.cooling import law_groups
from castfem.model.checks.registry import caution
from castfem.model.cooling import Contact, Flux
from castfem.model.heat_law import TOTALS, HeatLaw, ScaledLaw
from castfem.model.machine_from_case import build_machine

SPEED_KEY = "casting.speed"


@dataclass(frozen=True, slots=True)
class FixedHeat:
    """Heat of a law that does not change with the casting speed."""

    where: str  #: zone and boundary groups, as text
    what: str  #: the heat, as text
    speed: float  #: casting speed when the slice passes the zone, m/s


def fixed_heat(case: Case) -> Iterator[FixedHeat]:
    """Yield heat that is the same at every speed without an explicit statement."""
    start, machine = 0.0, build_machine(case)
    for zone in case.cooling:
        end = case.casting.length if zone.to is None else zone.to
        if start >= case.casting.length:
            return
        for law in zone.surface:
            what = _fixed(law) if isinstance(law, ScaledLaw) else ""
            if what:
                on = "" if law.on is None else f" on {', '.join(law.on)}"
                yield FixedHeat(zone.name + on, what, machine.speed_between(start, end))
        start = end


def _fixed(law: ScaledLaw) -> str:
    """The heat of a law that does not change with the speed, as text; "" if it does."""
    if law.measured_at is not None or law.over_speed:
        return ""
    if law.scales:
        total = law.total(0.0)
        assert total is not None, "it is scaled"
        return f"{1e-3 * total:.4g} kW in all"
    by_place = isinstance(law.curve, Table) and law.curve.over == "position"
    return "a flux over position" if by_place else ""


def shared_heat(cases: Iterable[Case]) -> list[str]:
    """Return warnings about a comparison of cases with different speeds, one line for each law."""
    met: dict[tuple[str, str], list[float]] = {}
    for case in cases:
        for one in fixed_heat(case):
            met.setdefault((one.where, one.what), []).append(one.speed)
    return [
        f"{where}: {what} at each of the casting speeds {_listed(speeds)}, though a mould takes "
        "more at a higher speed: differences between these runs are overstated; give measured_at, "
        "the speed at which this was measured (then the flux depends on the time in the mould), or "
        "the total as a table over speed (docs/thermal.md)"
        for (where, what), speeds in met.items()
        if _exceeds(max(speeds), min(speeds))
    ]


def fixed_while_varied(case: Case, keys: Iterable[str]) -> list[str]:
    """Return warnings about varying some keys of a case, if the speed is one of them."""
    if SPEED_KEY not in keys:
        return []
    return [
        f"{one.where}: {one.what} at any casting speed, though a mould takes more at a higher "
        "one: the effect of the speed is overstated; give measured_at, the speed at which this "
        "was measured, or the total as a table over speed (docs/thermal.md)"
        for one in fixed_heat(case)
    ]


@caution("cooling.*.surface.*")
def beyond_tables(case: Case, law: HeatLaw) -> Faults:
    """Report tables over the casting speed that do not include the speed of the case."""
    given = case.casting.speed
    moving = [v for v in (given.values if isinstance(given, Table) else (given,)) if v > 0.0]
    for key in TOTALS if isinstance(law, ScaledLaw) and moving else ():
        table = getattr(law, key)
        if not isinstance(table, Table):
            continue
        first, last = table.arguments[0], table.arguments[-1]
        if _exceeds(first, min(moving)) or _exceeds(max(moving), last):
            text = f"the table goes from {_speed(first)} to {_speed(last)}, the strand at"
            yield key, f"{text} {_listed(moving)}: the end value is used there"


def _exceeds(speed: float, other: float) -> bool:
    """Whether a speed is higher than another one by more than rounding."""
    return speed > (1.0 + 1e-4) * other


def _listed(speeds: Iterable[float]) -> str:
    """Different speeds in ascending order, m/min."""
    found: list[float] = []
    for speed in sorted(speeds):
        if not found or _exceeds(speed, found[-1]):
            found.append(speed)
    *most, last = (f"{convert(speed, 'm/s', 'm/min'):.4g}" for speed in found)
    return f"{', '.join(most)} and {last} m/min" if most else f"{last} m/min"


def _speed(speed: float) -> str:
    return format(speed, "m/s", "m/min")


EVEN_FLUX = "the same flux everywhere round the section: no gap opens at the corner without [mould]"


def even_zones(case: Case) -> Iterator[str]:
    """Yield the zones with the same flux at corners and faces, and no gap that lowers it."""
    start = 0.0
    for zone in case.cooling:
        if start < case.casting.length and any(is_even(case, law) for law in zone.surface):
            yield zone.name
        start = case.casting.length if zone.to is None else zone.to


def is_even(case: Case, law: HeatLaw) -> bool:
    """Whether a law prescribes the same flux at corners and faces, and no gap can lower it."""
    given = law.flux if isinstance(law, Contact) else law.value if isinstance(law, Flux) else None
    if given is None or case.mould is not None:
        return False
    if isinstance(law, Contact) and law.gap is not None:
        return False
    groups = law_groups(case.section, law)
    if getattr(case.section, "corner_radius", None) == 0.0:
        return {"narrow", "wide"} <= {name.partition("_")[0] for name in groups}
    corners = {name for name in groups if name.startswith("corner")}
    return bool(corners) and corners != groups


def fix(case: Case) -> str:
    """The fix: a lower flux at the corner, if the section has it as a separate group."""
    if getattr(case.section, "corner_radius", None) == 0.0:
        return "give the section its corner_radius, and its corner less heat"
    return 'give the corner less by a law of its own, on = ["corner"]'
