"""What quantities need of a case and of its simulation, by the names in `needs`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from castfem.model.build.simulation import Simulation
    from castfem.model.case import Case
    from castfem.physics.mechanics.definition import Slice


@dataclass(frozen=True, slots=True)
class Need:
    """One of them.

    Attributes:
        tables: Tables of the case without which it cannot be met.
        also: What its simulation must have besides; None for nothing.
    """

    tables: tuple[str, ...]
    also: Callable[[Simulation], bool] | None = None

    def missing(self, case: Case) -> list[str]:
        """The tables that a case has not; [mould.oscillation] also where there is no [mould]."""
        return [table for table in self.tables if not _has_table(case, table)]

    def is_met(self, simulation: Simulation) -> bool:
        """Whether a simulation has what is needed."""
        return not self.missing(simulation.case) and (self.also is None or self.also(simulation))


def are_met(needs: Iterable[str], simulation: Simulation) -> bool:
    """Whether a simulation has all that is needed, by name."""
    return all(NEEDS[name].is_met(simulation) for name in needs)


def _has_table(case: Case, table: str) -> bool:
    outer, _, inner = table.partition(".")
    found = getattr(case, outer)
    return found is not None and (not inner or getattr(found, inner) is not None)


def _slice(simulation: Simulation) -> Slice:
    assert simulation.mechanics is not None, "of a case with [mechanics]"
    return simulation.mechanics.problem.slice


def _is_free(simulation: Simulation, strain: str) -> bool:
    """Whether a generalized strain is found by equilibrium; in a bent strand it is none."""
    return not simulation.case.bends and strain in _slice(simulation).planes.free


def _bulges(simulation: Simulation) -> bool:
    mechanics = simulation.case.mechanics
    return mechanics is not None and mechanics.bulging is not None and mechanics.bulging.bears


_ROLLED = ("mechanics", "machine")
NEEDS: Mapping[str, Need] = {
    "mechanics": Need(("mechanics",)),
    "smooth": Need(("mechanics",), lambda simulation: bool(simulation.case.output.smooth)),
    "law_data": Need(("mechanics",), lambda simulation: _slice(simulation).law.data is not None),
    "tilt_x": Need(("mechanics",), lambda simulation: _is_free(simulation, "a1")),
    "tilt_y": Need(("mechanics",), lambda simulation: _is_free(simulation, "a2")),
    "mould": Need(("mechanics", "mould")),
    "oscillation": Need(("mould.oscillation",)),
    "friction": Need(
        ("mechanics",),
        lambda simulation: any(one.has_friction for one in _slice(simulation).interactions),
    ),
    "bulging": Need(_ROLLED, _bulges),
    "machine": Need(("machine",)),
    "quality": Need(("quality",)),
    "bending": Need(_ROLLED, lambda simulation: simulation.case.bends),
    "extraction": Need(
        _ROLLED, lambda simulation: getattr(_slice(simulation).planes, "effort", None) is not None
    ),
    "closed_form": Need(("verification",)),
}
