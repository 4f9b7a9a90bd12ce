"""A property of steel as a function of temperature: constant, table, or named formula.

Every property is called with temperatures in K (any shape) and returns SI values of that shape.
Where a property jumps, `side` selects the hotter ("above") or the colder ("below") value.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from castfem.base.types import Array
from castfem.physics.materials.formulas import FORMULAS, Formula
from castfem.physics.materials.iron_carbon import Diagram, Side


class Property(Protocol):
    """Interface of a property."""

    @property
    def kinks(self) -> tuple[float, ...]:
        """Temperatures at which the slope or the value jumps, K, increasing."""

    @property
    def jumps(self) -> tuple[float, ...]:
        """Kinks at which the value itself jumps."""

    @property
    def curved(self) -> bool:
        """Whether it is not linear between its kinks."""

    @property
    def span(self) -> tuple[float, float]:
        """Temperature range of its definition, K."""

    def __call__(self, temperature: npt.ArrayLike, /, side: Side = "above") -> Array:
        """Values at `temperature`."""


@dataclass(frozen=True, slots=True)
class ByFormula:
    """A named formula with its parameters, by phase if it needs the iron-carbon diagram."""

    formula: Formula  #: formula from `castfem.physics.materials.formulas.FORMULAS`
    parameters: Mapping[str, float]  #: values of all its parameters, SI
    #: iron-carbon diagram of the steel, for a formula by phase
    diagram: Diagram | None = None

    def __post_init__(self) -> None:
        if self.formula.by_phase and self.diagram is None:
            raise ValueError(f"{self.formula.name} needs the carbon content of the steel")

    @property
    def kinks(self) -> tuple[float, ...]:
        """Kinks of the formula itself and of the phase fractions."""
        own = self.formula.kinks(**self.parameters)
        phases = self.diagram.kinks if self.formula.by_phase and self.diagram else ()
        return tuple(sorted({*own, *phases}))

    @property
    def jumps(self) -> tuple[float, ...]:
        """Isothermal reactions of the steel, for a formula by phase."""
        return self.diagram.reactions if self.formula.by_phase and self.diagram else ()

    @property
    def curved(self) -> bool:
        """Formulas always count as curved."""
        return True

    @property
    def span(self) -> tuple[float, float]:
        """Formulas are extrapolated to all temperatures; their source states their range."""
        return 0.0, np.inf

    def __call__(self, temperature: npt.ArrayLike, side: Side = "above") -> Array:
        """Evaluate the formula."""
        t = np.asarray(temperature, float)
        if self.formula.by_phase and self.diagram is not None:
            return self.formula.evaluate(t, self.diagram.phases(t, side), **self.parameters)
        return self.formula.evaluate(t, **self.parameters)


def named(name: str, diagram: Diagram | None = None, **parameters: float) -> ByFormula:
    """Return the property from the formula `name`, with defaults for parameters left out."""
    formula = FORMULAS[name]
    defaults = {key: p.default for key, p in formula.parameters.items()}
    return ByFormula(formula, {**defaults, **parameters}, diagram)
