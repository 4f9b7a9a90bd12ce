"""Results of the strained slice: stress, displacement of its surface, forces."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import TYPE_CHECKING

from castfem.base.result_registry import quantity
from castfem.base.shown_units import below_meniscus
from castfem.model.machine import thickness_of

if TYPE_CHECKING:
    from castfem.runs.results.sample import Sample


of_slice = partial(quantity, needs=("mechanics",))
of_bent = partial(quantity, needs=("bending",))
of_rolls = partial(quantity, needs=("extraction",))
smooth_twin = partial(quantity, column=False, needs=("smooth",))
beyond_data = partial(quantity, column=False, needs=("mechanics", "law_data"), of_way=True)


def place(at: Iterable[float]) -> str:
    """A point of the section as text."""
    x, y = (1e3 * c for c in at)
    return f"at x = {x:.1f}, y = {y:.1f} mm"


of_slice(
    "newton_mechanics", "-", "Newton iterations of the mechanics", row=False,
    says="Newton iterations of the mechanics in the step.",
)(lambda sample: float(sample.strained.newton))  # fmt: skip


def _largest_here(sample: Sample) -> str:
    return place(sample.strained.peak_at)


of_slice(
    "von_mises_max", "MPa", "largest von Mises stress", place=_largest_here,
    axis="von Mises stress",
    says="Largest von Mises stress at an integration point of the section.",
)(lambda sample: sample.strained.peak)  # fmt: skip


def _largest_there(sample: Sample) -> str:
    most = sample.largest_stress
    return f"{place((most.x, most.y))}, {below_meniscus(most.position)}"


of_slice(
    "way_von_mises_max", "MPa", "largest von Mises stress on the way", column=False,
    place=_largest_there, of_way=True,
    says="Largest von Mises stress from the meniscus to here.",
)(lambda sample: sample.largest_stress.stress)  # fmt: skip


@smooth_twin(
    "von_mises_smooth", "MPa", "smooth approximation of the largest von Mises stress",
    smooth_twin_of="von_mises_max",
)  # fmt: skip
def von_mises_smooth(sample: Sample) -> float:
    """Mean over the section weighted by the 31st power of the stress; below `von_mises_max`.

    It remains smooth where the largest stress moves from one place to another.
    """
    found = sample.strained.smooth
    assert found is not None, "of a quantity that needs smooth"
    return found.stress


@smooth_twin(
    "way_von_mises_smooth", "MPa", "smooth approximation of the largest von Mises stress so far",
    of_way=True, smooth_twin_of="way_von_mises_max",
)  # fmt: skip
def way_von_mises_smooth(sample: Sample) -> float:
    """The same mean over the section and the way from the meniscus; below `way_von_mises_max`."""
    assert sample.smooth_stress is not None, "of a quantity that needs smooth"
    return sample.smooth_stress.stress


of_slice(
    "von_mises", "MPa", "von Mises stress, {}", each="probe",
    says="Von Mises stress at the surface.",
)(lambda sample, probe: sample.strained.surface_stress[probe])  # fmt: skip
of_slice(
    "displacement", "mm", "outward displacement, {}", each="probe",
    says="Outward displacement of the surface.",
)(lambda sample, probe: sample.strained.moved[probe])  # fmt: skip
of_slice(
    "size", "mm", "size at {}", axis="size", labels={"corner": "diagonal"}, each="centred_probe",
    says="Size of the section through each probe that ends in its centre: the distance between "
    "the surfaces on both sides of the centre; for `corner` the diagonal.",
)(lambda sample, probe: sample.strained.across[probe])  # fmt: skip
of_slice(
    "axial_strain", "-", "axial strain",
    says="Axial strain of the slice at the origin.",
)(lambda sample: sample.strained.strain)  # fmt: skip
quantity(
    "tilt_x", "1/m", "tilt: axial strain along x", needs=("tilt_x",),
    says="Gradient a1 of the axial strain along x: the curvature from uneven cooling. Only for a "
    "slice that is free to tilt, as whole sections are by default, and not bent by a machine.",
)(lambda sample: sample.strained.gradients[0])  # fmt: skip
quantity(
    "tilt_y", "1/m", "tilt: axial strain along y", needs=("tilt_y",),
    says="Gradient a2 of the axial strain along y, likewise.",
)(lambda sample: sample.strained.gradients[1])  # fmt: skip


@of_slice(
    "axial_force", "kN", "axial force, modelled part", row=False, axis="axial force,\nmodelled part"
)
def axial_force(sample: Sample) -> float:
    """Axial force of the stress in the modelled part (`effort`: whole strand)."""
    balance = sample.strained.balance
    return 0.0 if balance is None else float(balance.axial[0])


@of_slice(
    "force_error", "-", "relative error of the forces", row=False,
    axis="relative error of\nthe forces",
)  # fmt: skip
def force_error(sample: Sample) -> float:
    """Largest relative residual of the nodal forces or of the axial force."""
    balance = sample.strained.balance
    return 0.0 if balance is None else max(balance.forces_error, balance.axial_error)


def _beyond_at(kind: str) -> Callable[[Sample], str]:
    """Text for where most of the shell was beyond a limit of the data, after that limit."""

    def where(sample: Sample) -> str:
        assert sample.simulation.strained is not None
        data = sample.simulation.strained.slice.law.data
        assert data is not None
        share, position = sample.beyond_data.worst.get(kind, (0.0, 0.0))
        at = f", {below_meniscus(position)}" if share > 0.0 else ""
        return f"{'below' if kind == 'colder' else 'above'} {data.limit(kind)}{at}"

    return where


def _beyond(sample: Sample, kind: str) -> float:
    """Largest fraction so far; none before there is a shell."""
    return sample.beyond_data.worst.get(kind, (0.0, 0.0))[0]


beyond_data(
    "colder_than_data", "percent", "largest share of the shell colder than the law's data",
    place=_beyond_at("colder"),
    says="Largest fraction of the shell so far that was colder than the data of its law. This and "
    "the next two are evaluated once a twentieth of the section is solid.",
)(lambda sample: _beyond(sample, "colder"))  # fmt: skip
beyond_data(
    "hotter_than_data", "percent", "largest share of the shell hotter than the law's data",
    place=_beyond_at("hotter"),
    says="Largest fraction of the shell so far that was hotter than the data of its law.",
)(lambda sample: _beyond(sample, "hotter"))  # fmt: skip
beyond_data(
    "faster_than_data", "percent", "largest share of the shell strained faster than the law's data",
    place=_beyond_at("faster"),
    says="Largest fraction of the shell so far that was strained faster than the data of its law.",
)(lambda sample: _beyond(sample, "faster"))  # fmt: skip
of_bent(
    "axial_stress", "MPa", "axial stress, {}", each="probe",
    says="Axial stress at the surface, where a machine bends the strand.",
)(lambda sample, probe: sample.strained.axial_stress[probe])  # fmt: skip


def _declare_thickness(place: str, share: float) -> None:
    @of_bent(
        f"slice_thickness_{place}", "-", f"thickness of the slice, {place}",
        axis="thickness of the slice",
    )  # fmt: skip
    def thickness(sample: Sample) -> float:
        """Distance of the planes that bound the slice, relative to that at the meniscus."""
        mechanical, height = sample.state.mechanical, thickness_of(sample.simulation.case.section)
        assert mechanical is not None and height is not None
        a0, _, a2, _ = mechanical.generalized_strains
        return float(1.0 + a0 + a2 * share * height)


for _place, _share in (("intrados", 0.5), ("centre", 0.0), ("extrados", -0.5)):
    _declare_thickness(_place, _share)


of_bent(
    "curvature", "1/m", "curvature of the strand's middle",
    says="Curvature of the middle of the strand, imposed by the rolls.",
)(lambda sample: sample.bending.curvature)  # fmt: skip
of_bent(
    "neutral_axis", "mm", "neutral axis, y from the middle towards the intrados",
    axis="neutral axis (y)",
    says="Position y, from the middle, at which the thickness of the slice has not changed in the "
    "step; the intrados is at y > 0. Empty while the curvature is constant.",
)(lambda sample: sample.bending.axis)  # fmt: skip
of_bent(
    "bending_moment", "kN m",
    "bending moment of the whole strand, positive where it pulls the intrados",
    axis="bending moment",
    says="Moment M = int sigma_zz y da of the whole strand about its middle.",
)(lambda sample: sample.bending.moment * sample.simulation.section.multiplicity)  # fmt: skip
of_bent(
    "bending_work", "kJ/m", "work of bending and straightening, whole strand",
    axis="work of bending and straightening",
    says="Work - int M dk that a metre of the whole strand has taken from the drives so far.",
)(lambda sample: -sample.bending.work * sample.simulation.section.multiplicity)  # fmt: skip
of_rolls(
    "roll_resistance", "kN", "resistance of the rolls down to here, whole strand",
    axis="resistance",
    says="Accumulated resistance of the rolls to the whole strand, including the work of bending.",
)(lambda sample: sample.withdrawal.resistance)  # fmt: skip
of_rolls(
    "drive_force", "kN", "pull of the drives down to here, whole strand", axis="pull of the drives",
    says="Accumulated force of the drives on the whole strand.",
)(lambda sample: sample.withdrawal.drives)  # fmt: skip
of_rolls(
    "effort", "kN", "axial effort between rolls and drives, whole strand", axis="axial effort",
    says="Resistance minus drive forces, whole strand: N - kM of the slice, or N as in the thesis.",
)(lambda sample: sample.withdrawal.effort)  # fmt: skip
