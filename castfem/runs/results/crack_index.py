"""Registry of crack indexes: where along its way the strand may crack; each is declared once.

    @crack_index("tension", unit="MPa", label="axial tension", needs=("mechanics",))
    def tension(step: SliceStep) -> Array:
        '''Axial tension, whatever the temperature.'''
        return np.maximum(step.axial_stress, 0.0)

is the complete definition of an index. A case with the table [quality] computes it after each step
at all vertices. Its largest value is a column of history.csv (`tension_max`); the largest along the
way is a result with its place, roll and time (`way_tension_max`; with a bending machine also those
of bending and straightening). Its values on the surface are a map in surface_maps.h5, a figure and
tables of `castfem show`. Values are in SI.

An index that accumulates finds its value before the step in `step.value`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from castfem.base.result_registry import quantity
from castfem.base.types import Array, Flags

if TYPE_CHECKING:
    from castfem.model.quality import Quality
    from castfem.physics.materials import Steel
    from castfem.runs.results.crack_state import Tearing
    from castfem.runs.results.sample import Sample

Where = Literal["surface", "section"]
BENDS = ("bending", "straightening")
"""Phases of the strand for which the largest values of the indexes are results."""


@dataclass(frozen=True, slots=True)
class SliceStep:
    """The slice before and after a step, at the vertices of this rank."""

    settings: Quality  #: the table [quality] of the case
    steel: Steel  #: steel of the strand
    duration: float  #: duration of the step, s; 0 at the meniscus
    #: averaging time of the rates, s: the step, or if that is very short also time before it
    rated: float
    place: Array  #: x and y (n, 2), m, of the undeformed section
    temperature: Array  #: after the step (n,), K
    earlier: Array  #: before the step
    rated_from: Array  #: at the start of `rated`
    #: after the step (n,), Pa, positive in tension; mean of the quadrature points around each
    #: vertex, weighted by area and distance; zero without mechanics
    axial_stress: Array
    strain_rate: Array  #: axial, over `rated` (n,), 1/s: exact, from the motion of the planes
    step_rate: Array  #: axial, over the step
    pitch_rate: Array  #: axial, mean over the last roll pitch (n,), 1/s
    value: Array  #: value of the index before the step (n,); zero at the meniscus
    #: temperatures at the limits of the brittle range of solid fraction, K
    brittle: tuple[float, float]
    #: values of the hot tearing criteria; None if the case names none
    tearing: Tearing | None = None

    @property
    def in_band(self) -> Flags:
        """Whether the temperature is in the low-ductility range after the step (n,)."""
        low, high = self.settings.band
        return np.asarray((self.temperature > low) & (self.temperature < high))

    @property
    def mechanical_rate(self) -> Array:
        """Axial strain rate without thermal expansion (n,), 1/s."""
        return self._mechanical(self.strain_rate, self.rated_from, self.rated)

    @property
    def mechanical_strain(self) -> Array:
        """Axial strain increment of the step without thermal expansion (n,)."""
        return self.duration * self._mechanical(self.step_rate, self.earlier, self.duration)

    def _mechanical(self, rate: Array, earlier: Array, duration: float) -> Array:
        """Axial strain rate over a duration, without thermal expansion (n,), 1/s."""
        if not duration > 0.0:
            return np.zeros_like(rate)
        strain = self.steel.thermal_strain
        grown = strain(self.temperature) - strain(earlier)
        return np.asarray(rate - grown / duration)

    def share_within(self, low: float, high: float) -> Array:
        """Fraction of the step with the temperature between two limits (K), linear in time."""
        from castfem.physics.materials.hot_tearing import share_within  # only needed in runs

        return share_within(self.earlier, self.temperature, low, high)


Computed = Callable[[SliceStep], Array]


def _nothing(step: SliceStep) -> Array:
    return np.zeros_like(step.value)


@dataclass(frozen=True, slots=True, kw_only=True)
class CrackIndex:
    """Name and definition of a crack index.

    As a decorator, `crack_index`, it declares a function as an index with a map, columns and
    results.
    """

    name: str = field(kw_only=False)  #: name of the index and its map
    unit: str = field(kw_only=False)  #: unit in which it is shown
    label: str = field(kw_only=False)  #: label in tables
    #: parts that a simulation must have, from `castfem.runs.results.needs.NEEDS`
    needs: tuple[str, ...] = ()
    #: region in which it is evaluated: the surface, or the whole section, without a map
    on: Where = "surface"
    accumulates: bool = False  #: whether it continues from its values before the step
    #: whether `tearing` provides it: such an index is differentiated, and has a map over the depth
    followed: bool = False
    #: the function: values in SI after a step for each vertex of the surface, or each point of the
    #: section (n,)
    compute: Computed = _nothing

    def __call__(self, compute: Computed) -> Computed:
        """Declare a function.

        Raises:
            ValueError: A quantity has that name already, or one of `needs` is unknown.
        """
        name, unit, label = self.name, self.unit, self.label

        def largest(sample: Sample) -> float:
            return sample.judged.largest[name].value

        def on_the_way(sample: Sample) -> float:
            return sample.judged.worst[name].value

        def place(sample: Sample) -> str:
            return sample.judged.words(sample.judged.worst[name])

        about = (compute.__doc__ or "").strip()
        where = "of the surface" if self.on == "surface" else "of the section"
        largest.__doc__ = f"{about} The largest {where} here."
        on_the_way.__doc__ = f"{about} The largest {where} from the meniscus to here."
        # Their place in files and tables is that of the module that declares the index.
        largest.__module__ = on_the_way.__module__ = compute.__module__
        # A crack may open anywhere along the way, so mechanics that end earlier give no index.
        own = tuple("throughout" if need == "mechanics" else need for need in self.needs)
        together = (*own, "quality")
        quantity(f"{name}_max", unit=unit, label=label, row=False, needs=together)(largest)
        quantity(
            f"way_{name}_max", unit=unit, label=f"largest {label} on the way", column=False,
            place=place, of_way=self.followed, needs=together,
        )(on_the_way)  # fmt: skip
        for phase in () if self.accumulates else BENDS:
            _declare_within(phase, name, unit, label, about, compute, together)
        _declared[name] = replace(self, compute=compute, needs=own)
        return compute


crack_index = CrackIndex
_declared: dict[str, CrackIndex] = {}


def _declare_within(
    phase: str, name: str, unit: str, label: str, about: str, compute: Computed,
    needs: tuple[str, ...],
) -> None:  # fmt: skip
    """Declare the largest value of an index in bending or straightening."""

    def largest(sample: Sample) -> float | None:
        worst = sample.judged.within(phase, name)
        return None if worst is None else worst.value

    def place(sample: Sample) -> str:
        return sample.judged.words(sample.judged.within(phase, name))

    largest.__doc__ = f"{about} The largest in {phase}; none before."
    largest.__module__ = compute.__module__
    quantity(
        f"{phase}_{name}_max", unit=unit, label=f"largest {label}, {phase}", column=False,
        place=place, needs=(*needs[:-1], "bending", "quality"),
    )(largest)  # fmt: skip


def declared_indexes() -> tuple[CrackIndex, ...]:
    """All crack indexes, castfem's own first."""
    return tuple(
        sorted(
            _declared.values(), key=lambda one: not one.compute.__module__.startswith("castfem.")
        )
    )
