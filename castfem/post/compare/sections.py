"""Sections of several runs side by side where the runs end, each field in one scale for all."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.shown_units import said, scale_of
from castfem.post.compare.places import bar, legend, places
from castfem.post.compare.runs import Run
from castfem.post.plots.deformation import STRESS_MAP, cover_soft, draw_outlines, stress_levels
from castfem.post.plots.section import (
    STATES,
    Steel,
    draw_isotherms,
    section_triangles,
    shade,
    state_shares,
)
from castfem.post.plots.shape import Distortion, von_mises
from castfem.runs.output.fields import Fields
from castfem.runs.output.xdmf import HDF5_NAME
from castfem.runs.results.numbers import small_gap

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.tri import Triangulation

_SLENDER = 5.0  # ratio of the sides from which the picture of a strip would say nothing
_MOVES = 0.25  # of a section, by which its surface may seem to move: one factor is for all runs
_TITLE = 34  # characters as wide as a section
_CLOSED = 1e-6  # m; a gap below is none


@dataclass(frozen=True, slots=True)
class Section:
    """What is drawn of a run.

    Attributes:
        label: Of the run.
        mesh: The modelled part [mm], not distorted.
        moved: It, distorted.
        distortion: Outlines and wall; None without mechanics.
        gap: The largest one [m]; NaN without a mould.
        temperature: At its corners [degC].
        stress: Von Mises stress there [MPa]; None without mechanics.
        steel: What is solid and liquid; None if it is not known.
        strongest: The largest stress at a corner that is solid [MPa], 0 if none is.
        named: The largest stress of the run's own summary [MPa]; NaN if it has none.
    """

    label: str
    mesh: Triangulation
    moved: Triangulation
    distortion: Distortion | None
    gap: float
    temperature: NDArray[np.float64]
    stress: NDArray[np.float64] | None
    steel: Steel | None
    strongest: float
    named: float

    @classmethod
    def of(cls, run: Run) -> Section | None:
        """Reads the last time of a run; None if it has no temperature at the nodes."""
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
        """The modelled part [mm], distorted, its displacement magnified."""
        from matplotlib.tri import Triangulation

        x, y = (
            before + factor * (after - before)
            for before, after in ((self.mesh.x, self.moved.x), (self.mesh.y, self.moved.y))
        )
        return Triangulation(x, y, self.mesh.triangles)

    @property
    def places(self) -> NDArray[np.float64]:
        """Its corners (n, 2) [mm], not distorted."""
        return np.column_stack([self.mesh.x, self.mesh.y])


def draw_sections(runs: Sequence[Run], words: Callable[[str], str]) -> dict[str, Figure]:
    """Draws temperature, states, stress and shape of runs that all have a section.

    Args:
        runs: In the order in which they are shown.
        words: Makes the title of a section from the label of its run.

    Returns:
        The figures by name; none for a strip, or what not all runs have.
    """
    sections = [found for run in runs if (found := Section.of(run)) is not None]
    if len(sections) < len(runs):
        return {}
    sides = np.max([np.ptp(section.places, axis=0) for section in sections], axis=0)
    if max(sides) > _SLENDER * min(sides):
        return {}
    titles = [words(section.label) for section in sections]
    figures = {"temperature": _draw_temperature(sections, titles)}
    if all(section.steel is not None for section in sections):
        figures["states"] = _draw_states(sections, titles)
        if max(section.strongest for section in sections) > 0.0:
            figures["von_mises"] = _draw_stress(sections, titles)
    if any(section.distortion is not None for section in sections):
        figures["shape"] = _draw_shape(sections, titles)
    return figures


def _draw_temperature(sections: Sequence[Section], titles: Sequence[str]) -> Figure:
    """Temperature with solidus and liquidus."""
    figure, axes = places([s.places for s in sections], "Temperature where the runs end")
    handles: dict[str, Any] = {}
    low, high = _range(sections)
    for ax, section, title in zip(axes, sections, titles, strict=True):
        shades = shade(ax, section.mesh, section.temperature, "inferno", low, high)
        lines = draw_isotherms(ax, section.mesh, section.temperature, section.steel)
        handles |= {str(line.get_label()): line for line in lines}
        ax.set_title(title, fontsize=9)
    bar(figure, shades, "temperature [°C]")
    legend(figure, handles)
    return figure


def _range(sections: Sequence[Section]) -> tuple[float, float]:
    """Lowest and highest temperature [degC] of all."""
    low = min(float(section.temperature.min()) for section in sections)
    return low, max(max(float(section.temperature.max()) for section in sections), low + 1.0)


def _draw_shape(sections: Sequence[Section], titles: Sequence[str]) -> Figure:
    """The distorted sections, coloured by temperature, in their moulds; one factor for all."""
    shapes = [section.distortion for section in sections]
    factor = min(shape.factor(_MOVES) for shape in shapes if shape is not None)
    drawn = [
        section.places if shape is None else shape.places(factor)
        for section, shape in zip(sections, shapes, strict=True)
    ]
    title = f"Shape where the runs end, displacement and taper × {factor:g}"
    figure, axes = places(drawn, title, margin=True)
    handles: dict[str, Any] = {}
    low, high = _range(sections)
    for ax, section, shape, title in zip(axes, sections, shapes, titles, strict=True):
        mesh = section.distorted(factor)
        shades = shade(ax, mesh, section.temperature, "inferno", low, high)
        lines = draw_isotherms(ax, mesh, section.temperature, section.steel)
        if shape is not None:
            lines = [*lines, *draw_outlines(ax, shape, factor, "black")]
        handles |= {str(line.get_label()): line for line in lines}
        if math.isfinite(section.gap):
            title = _headed(title, _gap_text(section.gap))
        ax.set_title(title, fontsize=9)
    bar(figure, shades, "temperature [°C]")
    legend(figure, handles)
    return figure


def _gap_text(gap: float) -> str:
    """The largest gap [m] in words."""
    if gap < _CLOSED:
        return "no gap"
    small = small_gap(1e3 * gap, scale_of("mm", "gap").unit)
    if small is not None:
        return f"gap up to {small} µm"
    return f"gap up to {said(1e3 * gap, 'mm', '.2f', 'gap')}"


def _headed(title: str, said: str) -> str:
    """The title of a section with what is said of it, on two lines if one is too short."""
    return f"{title}: {said}" if len(title) + len(said) < _TITLE else f"{title}:\n{said}"


def _draw_states(sections: Sequence[Section], titles: Sequence[str]) -> Figure:
    """What is solid, mushy and liquid, with the share that is solid."""
    from matplotlib.patches import Patch

    figure, axes = places(
        [s.places for s in sections], "State of the steel where the runs end", bar=False
    )
    for ax, section, title in zip(axes, sections, titles, strict=True):
        assert section.steel is not None
        kelvin = section.temperature + ZERO_CELSIUS
        solidus = section.steel.solidus
        liquidus = max(section.steel.liquidus, float(np.nextafter(solidus, np.inf)))
        low = min(float(kelvin.min()), solidus) - 1.0
        high = max(float(kelvin.max()), liquidus) + 1.0
        levels = [low, solidus, liquidus, high]
        ax.tricontourf(section.mesh, kelvin, levels=levels, colors=list(STATES.values()))
        solid, *_ = state_shares(section.mesh, kelvin, section.steel)
        ax.set_title(_headed(title, f"{100.0 * solid:.1f} % solid"), fontsize=9)
    legend(figure, {k: Patch(facecolor=c, edgecolor="#444444") for k, c in STATES.items()})
    return figure


def _draw_stress(sections: Sequence[Section], titles: Sequence[str]) -> Figure:
    """Von Mises stress of what is solid, in one scale; mushy zone and liquid are grey.

    Of a run without mechanics there is an empty frame: any grey would mean soft steel.
    """
    figure, axes = places([s.places for s in sections], "Von Mises stress where the runs end")
    solid = [section for section in sections if section.strongest]
    levels = stress_levels(max(max(s.strongest, np.nan_to_num(s.named)) for s in solid))
    handles: dict[str, Any] = {}
    for ax, section, title in zip(axes, sections, titles, strict=True):
        if section.stress is None or section.steel is None:
            ax.set_title(_headed(title, "no stress"), fontsize=9)
            continue
        # what lies beyond the scale is soft, and covered; its very end would not be drawn
        values = np.clip(section.stress, levels[0], (1 - 1e-6) * levels[-1])
        shades = ax.tricontourf(section.mesh, values, levels=levels, cmap=STRESS_MAP)
        soft = cover_soft(ax, section.mesh, section.temperature + ZERO_CELSIUS, section.steel)
        handles |= {str(handle.get_label()): handle for handle in soft}
        if not section.strongest:
            title = _headed(title, "nothing is solid")
        elif math.isfinite(section.named):
            title = _headed(title, f"up to {said(section.named, 'MPa', '.3g', 'von_mises_max')}")
        ax.set_title(title, fontsize=9)
    bar(figure, shades, "von Mises stress in the solid [MPa]")
    legend(figure, handles)
    return figure
