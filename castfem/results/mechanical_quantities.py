"""Quantities of the strained slice: stress, movement of its surface, forces."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from castfem.results.registry import quantity

if TYPE_CHECKING:
    from castfem.results.sample import Sample


def place(at: Iterable[float]) -> str:
    """A place of the section, in words."""
    x, y = (1e3 * c for c in at)
    return f"at x = {x:.1f}, y = {y:.1f} mm"


@quantity(
    "newton_mechanics",
    unit="-",
    label="Newton iterations of the mechanics",
    row=False,
    needs=("mechanics",),
)
def newton_mechanics(sample: Sample) -> float:
    """Newton iterations of the mechanics in the step."""
    return float(sample.strained.newton)


def _largest_here(sample: Sample) -> str:
    return place(sample.strained.peak_at)


@quantity(
    "von_mises_max",
    unit="MPa",
    label="largest von Mises stress",
    place=_largest_here,
    axis="von Mises stress",
    needs=("mechanics",),
)
def von_mises_max(sample: Sample) -> float:
    """Largest von Mises stress at an integration point of the section."""
    return sample.strained.peak


def _largest_there(sample: Sample) -> str:
    most = sample.largest_stress
    return f"{place((most.x, most.y))}, {1e3 * most.position:.6g} mm below the meniscus"


@quantity(
    "way_von_mises_max",
    unit="MPa",
    label="largest von Mises stress on the way",
    column=False,
    place=_largest_there,
    needs=("mechanics",),
)
def way_von_mises_max(sample: Sample) -> float:
    """Largest von Mises stress from the meniscus to here."""
    return sample.largest_stress.stress


@quantity("von_mises", unit="MPa", label="von Mises stress, {}", each="probe", needs=("mechanics",))
def von_mises(sample: Sample, probe: str) -> float:
    """Von Mises stress at the surface."""
    return sample.strained.surface_stress[probe]


@quantity(
    "displacement", unit="mm", label="outward displacement, {}", each="probe", needs=("mechanics",)
)
def displacement(sample: Sample, probe: str) -> float:
    """Displacement of the surface, outwards."""
    return sample.strained.moved[probe]


@quantity(
    "size",
    unit="mm",
    label="size at {}",
    axis="size",
    labels={"corner": "diagonal"},
    each="centred_probe",
    needs=("mechanics",),
)
def size(sample: Sample, probe: str) -> float:
    """Size of the section through each probe that ends in its centre.

    It is twice the distance of the surface from the centre; of `corner` the diagonal.
    """
    return sample.strained.across[probe]


@quantity("axial_strain", unit="-", label="axial strain", needs=("mechanics",))
def axial_strain(sample: Sample) -> float:
    """Axial strain of the slice at the origin."""
    return sample.strained.strain


@quantity(
    "axial_force",
    unit="kN",
    label="axial force, modelled part",
    row=False,
    axis="axial force,\nmodelled part",
    needs=("mechanics",),
)
def axial_force(sample: Sample) -> float:
    """Axial force of the stress, modelled part."""
    balance = sample.strained.balance
    return 0.0 if balance is None else float(balance.axial[0])


@quantity(
    "force_error",
    unit="-",
    label="relative error of the forces",
    row=False,
    axis="relative error of\nthe forces",
    needs=("mechanics",),
)
def force_error(sample: Sample) -> float:
    """Largest relative error of a node's forces or of the axial force."""
    balance = sample.strained.balance
    return 0.0 if balance is None else max(balance.forces_error, balance.axial_error)
