"""Final sections of several runs in one figure, each field with a common scale."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.shown_units import said, scale_of
from castfem.post.compare.runs import Run
from castfem.post.plots.deformation import cover_soft, draw_outlines, fill_stress, stress_levels
from castfem.post.plots.history import low_legend
from castfem.post.plots.section import (
    Steel,
    draw_isotherms,
    fill_states,
    section_triangles,
    shade,
    state_shares,
)
from castfem.post.plots.shape import Distortion, von_mises
from castfem.post.plots.style import Margins, new_figure
from castfem.runs.output.fields import Fields
from castfem.runs.output.xdmf import HDF5_NAME
from castfem.runs.results.numbers import small_gap

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.tri import Triangulation


GRID = Margins(left=0.6, right=1.0, above=0.7, below=1.0, beside=0.4, between=0.65)
"""With a colour scale on the right."""


@dataclass(frozen=True, slots=True)
class Section:
    """Data of a run for the figures."""

    label: str  #: label of the run
    mesh: Triangulation  #: the modelled part [mm], undeformed
    moved: Triangulation  #: the modelled part, deformed
    distortion: Distortion | None  #: outlines and wall; None without mechanics
    gap: float  #: largest gap [m]; NaN without a mould
    temperature: NDArray[np.float64]  #: temperature at the corners of the triangles [degC]
    stress: NDArray[np.float64] | None  #: von Mises stress there [MPa]; None without mechanics
    steel: Steel | None  #: solidus and liquidus; None if unknown
    strongest: float  #: largest stress at a solid corner [MPa], 0 for none
    named: float  #: largest stress in the run's summary [MPa]; NaN if there is none

    @classmethod
    def of(cls, run: Run) -> Section | None:
        """Read the last time of a run; None if it has no nodal temperature."""
        if not (run.folder / HDF5_NAME).is_file():
            return None
        steel = Steel.of({name: q.value for name, q in run.summary.quantities.items()})
        with Fields(run.folder) as fields:
            if "temperature" not in fields.names or fields.centre("temperature") != "point":
                return None
            kelvin, pascal = fields.values("temperature"), von_mises(fields)
            mesh, drawn = section_triangles(fields, kelvin, mirrored=False)
            shape = Distortion.of(fields) if "displacement" in fields.names else None
            shift = 0.0 if shape is None else shape.moved
            moved, _ = section_triangles(fields, kelvin, mirrored=False, moved=shift)
            stress, strongest = None, 0.0
            if pascal is not None and steel is not None:
                stress = 1e-6 * section_triangles(fields, pascal, mirrored=False)[1]
                strongest = 1e-6 * float(pascal[kelvin <= steel.solidus].max(initial=0.0))
        named, gap = (
            math.nan if (found := run.summary.quantities.get(name)) is None else found.value
            for name in ("von_mises_max", "gap_max")
        )
        if run.summary.ends_below_mould:
            gap = math.nan
        return cls(
            label=run.label,
            mesh=mesh,
            moved=moved,
            distortion=shape,
            gap=gap,
            temperature=drawn - ZERO_CELSIUS,
            stress=stress,
            steel=steel,
            strongest=strongest,
            named=1e-6 * named,
        )

    def distorted(self, factor: float) -> Triangulation:
        """The modelled part [mm], deformed with a magnified displacement."""
        from matplotlib.tri import Triangulation

        x, y = (
            before + factor * (after - before)
            for before, after in ((self.mesh.x, self.moved.x), (self.mesh.y, self.moved.y))
        )
        return Triangulation(x, y, self.mesh.triangles)

    @property
    def places(self) -> NDArray[np.float64]:
        """Its corners (n, 2) [mm], undeformed."""
        return np.column_stack([self.mesh.x, self.mesh.y])


def draw_sections(runs: Sequence[Run], words: Callable[[str], str]) -> dict[str, Figure]:
    """Draw temperature, states, stress and shape of runs that all have a section.

    Returns:
        The figures by name; none for a strip, or for data that not all runs have.
    """
    sections = [found for run in runs if (found := Section.of(run)) is not None]
    if len(sections) < len(runs):
        return {}
    sides = np.max([np.ptp(section.places, axis=0) for section in sections], axis=0)
    if max(sides) > 5.0 * min(sides):  # not useful for a strip
        return {}
    titled = {words(section.label): section for section in sections}
    figures = {"temperature": _draw_temperature(titled)}
    if all(section.steel is not None for section in sections):
        figures["states"] = _draw_states(titled)
        if max(section.strongest for section in sections) > 0.0:
            figures["von_mises"] = _draw_stress(titled)
    if any(section.distortion is not None for section in sections):
        figures["shape"] = _draw_shape(titled)
    return figures


@dataclass(frozen=True, slots=True)
class _Drawn:
    """A drawn section: its colours, legend entries and texts."""

    shades: Any = None
    handles: Sequence[Any] = ()
    words: str = ""


def _side_by_side(
    sections: Mapping[str, Section],
    title: str,
    draw: Callable[[Axes, Section], _Drawn],
    scale: str = "",
    extents: Sequence[NDArray[np.float64]] = (),
) -> Figure:
    """Draw a picture of each section, with a common legend and colour scale.

    Args:
        sections: Sections by their titles.
        title: Title of the figure.
        draw: Draws one section.
        scale: Label of the scale; "" for none.
        extents: Points to be shown, (n, 2) [mm]; by default the undeformed corners.
    """
    shown = extents or [section.places for section in sections.values()]
    figure, axes = places(shown, title, bar=bool(scale), margin=bool(extents))
    handles: dict[str, Any] = {}
    shades = None
    for ax, (name, section) in zip(axes, sections.items(), strict=True):
        found = draw(ax, section)
        shades = found.shades or shades
        handles |= {str(handle.get_label()): handle for handle in found.handles}
        short = len(name) + len(found.words) < 34  # characters across a section
        apart = ": " if short else ":\n"
        ax.set_title(name + (apart + found.words if found.words else ""), fontsize=9)
    if scale:
        bar(figure, shades, scale)
    low_legend(figure, list(handles.values()))
    return figure


def _range(sections: Iterable[Section]) -> tuple[float, float]:
    """Lowest and highest temperature [degC] of all sections."""
    low, high = zip(*((s.temperature.min(), s.temperature.max()) for s in sections), strict=True)
    return float(min(low)), max(float(max(high)), float(min(low)) + 1.0)


def _draw_temperature(sections: Mapping[str, Section]) -> Figure:
    limits = _range(sections.values())

    def draw(ax: Axes, section: Section) -> _Drawn:
        shades = shade(ax, section.mesh, section.temperature, "inferno", *limits)
        lines = draw_isotherms(ax, section.mesh, section.temperature, section.steel)
        return _Drawn(shades, lines)

    return _side_by_side(sections, "Temperature where the runs end", draw, "temperature [°C]")


def _draw_shape(sections: Mapping[str, Section]) -> Figure:
    """The deformed sections in their moulds, coloured by temperature; one magnification for all."""
    shapes = [section.distortion for section in sections.values()]
    # relative to a section; one magnification for all runs
    factor = min(shape.factor(0.25) for shape in shapes if shape is not None)
    extents = [
        section.places if shape is None else shape.places(factor)
        for section, shape in zip(sections.values(), shapes, strict=True)
    ]
    limits = _range(sections.values())

    def draw(ax: Axes, section: Section) -> _Drawn:
        mesh = section.distorted(factor)
        shades = shade(ax, mesh, section.temperature, "inferno", *limits)
        lines = draw_isotherms(ax, mesh, section.temperature, section.steel)
        if section.distortion is not None:
            lines = [*lines, *draw_outlines(ax, section.distortion, factor, "black")]
        return _Drawn(shades, lines, _gap_text(section.gap))

    title = f"Shape where the runs end, displacement and taper × {factor:g}"
    return _side_by_side(sections, title, draw, "temperature [°C]", extents)


def _gap_text(gap: float) -> str:
    """The largest gap [m] as text; "" without a mould."""
    if math.isnan(gap):
        return ""
    if gap < 1e-6:  # m
        return "no gap"
    small = small_gap(1e3 * gap, scale_of("mm", "gap").unit)
    return f"gap up to {said(1e3 * gap, 'mm', '.2f', 'gap') if small is None else f'{small} µm'}"


def _draw_states(sections: Mapping[str, Section]) -> Figure:
    """Solid, mushy and liquid regions, with the solid fraction of the section."""

    def draw(ax: Axes, section: Section) -> _Drawn:
        assert section.steel is not None
        kelvin = section.temperature + ZERO_CELSIUS
        patches = fill_states(ax, section.mesh, kelvin, section.steel)
        solid, *_ = state_shares(section.mesh, kelvin, section.steel)
        return _Drawn(None, patches, f"{100.0 * solid:.1f} % solid")

    return _side_by_side(sections, "State of the steel where the runs end", draw)


def _draw_stress(sections: Mapping[str, Section]) -> Figure:
    """Von Mises stress of the solid, in one scale; mushy zone and liquid are grey.

    A run without mechanics has an empty frame: any grey would mean soft steel.
    """
    solid = [section for section in sections.values() if section.strongest]
    levels = stress_levels(max(max(s.strongest, np.nan_to_num(s.named)) for s in solid))

    def draw(ax: Axes, section: Section) -> _Drawn:
        if section.stress is None or section.steel is None:
            return _Drawn(words="no stress")
        shades = fill_stress(ax, section.mesh, section.stress, levels)
        soft = cover_soft(ax, section.mesh, section.temperature + ZERO_CELSIUS, section.steel)
        words = "" if section.strongest else "nothing is solid"
        if section.strongest and math.isfinite(section.named):
            words = f"up to {said(section.named, 'MPa', '.3g', 'von_mises_max')}"
        return _Drawn(shades, soft, words)

    title, scale = "Von Mises stress where the runs end", "von Mises stress in the solid [MPa]"
    return _side_by_side(sections, title, draw, scale)


def places(
    drawn: Sequence[NDArray[np.float64]], title: str, *, bar: bool = True, margin: bool = False
) -> tuple[Figure, list[Axes]]:
    """A figure with axes [mm] of one scale for all sections, placed by hand.

    Args:
        drawn: (n, 2) points to be shown in each of them [mm].
        title: Title of the figure.
        bar: Leave room for the colour scale.
        margin: Leave room around the content.
    """
    sides = np.max([np.ptp(places, axis=0) for places in drawn], axis=0)
    around = 0.04 * float(sides.max()) if margin else 0.0
    sides = sides + 2.0 * around
    wide, high = (2.2 * side / sides.max() for side in sides)  # inches, the longer side
    across = 2 if len(drawn) == 4 else min(3, len(drawn))
    down = math.ceil(len(drawn) / across)
    right = GRID.right if bar else 0.2
    width = GRID.left + across * wide + (across - 1) * GRID.beside + right
    height = GRID.above + down * high + (down - 1) * GRID.between + GRID.below
    figure = new_figure(width, height, layout="none")
    figure.suptitle(title, fontsize=10.5, y=1.0 - 0.12 / height)
    axes = []
    for number, shown in enumerate(drawn):
        row, column = divmod(number, across)
        left = GRID.left + column * (wide + GRID.beside)
        bottom = GRID.below + (down - 1 - row) * (high + GRID.between)
        ax = figure.add_axes((left / width, bottom / height, wide / width, high / height))
        ax.grid(False)
        ax.tick_params(labelsize=8)
        ax.locator_params(nbins=5)
        left, bottom = shown.min(axis=0) - around
        ax.set_xlim(left, left + sides[0])
        ax.set_ylim(bottom, bottom + sides[1])
        # Hidden labels still determine the unit of the numbers.
        ax.set_ylabel("y [mm]", visible=column == 0)
        ax.set_xlabel("x [mm]", visible=number + across >= len(drawn))
        axes.append(ax)
    return figure, axes


def bar(figure: Figure, shades: Any, label: str) -> None:
    """The colour scale to the right of all sections."""
    width, height = figure.get_size_inches()
    left = width - GRID.right + 0.15
    tall = height - GRID.above - GRID.below
    place = figure.add_axes((left / width, GRID.below / height, 0.14 / width, tall / height))
    figure.colorbar(shades, cax=place, label=label)
