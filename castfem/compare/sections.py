"""Sections of several runs side by side where the runs end, each field in one scale for all."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from castfem.compare.runs import Run
from castfem.output.fields import Fields
from castfem.output.plot_section import (
    STATES,
    Steel,
    draw_isotherms,
    section_triangles,
    shade,
    state_shares,
)
from castfem.output.plot_shape import STRESS_MAP, cover_soft, stress_levels
from castfem.output.shape import von_mises
from castfem.output.style import CELSIUS, new_figure
from castfem.output.xdmf import HDF5_NAME

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.tri import Triangulation

_ACROSS = 3  # sections side by side
_CELL = 2.2  # inches, the longer side of a section
_LEFT, _RIGHT, _ABOVE, _BELOW = 0.6, 1.0, 0.65, 0.85  # inches around them all
_BESIDE, _BETWEEN = 0.4, 0.55  # inches from one to the next
_SLENDER = 5.0  # ratio of the sides from which the picture of a strip would say nothing


@dataclass(frozen=True, slots=True)
class Section:
    """What is drawn of a run.

    Attributes:
        label: Of the run.
        mesh: The modelled part [mm], not distorted.
        temperature: At its corners [degC].
        stress: Von Mises stress there [MPa]; None without mechanics.
        steel: What is solid and liquid; None if it is not known.
        strongest: The largest stress at a corner that is solid [MPa], 0 if none is.
        named: The largest stress of the run's own summary [MPa]; NaN if it has none.
    """

    label: str
    mesh: Triangulation
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
            stress, strongest = None, 0.0
            if pascal is not None and steel is not None:
                stress = 1e-6 * section_triangles(fields, pascal, mirrored=False)[1]
                strongest = 1e-6 * float(pascal[kelvin <= steel.solidus].max(initial=0.0))
        most = run.summary.quantities.get("von_mises_max")
        named = math.nan if most is None else 1e-6 * most.value
        return cls(run.label, mesh, drawn - CELSIUS, stress, steel, strongest, named)


def draw_sections(runs: Sequence[Run], words: Callable[[str], str]) -> dict[str, Figure]:
    """Draws temperature, states and stress of runs that all have a section.

    Args:
        runs: In the order in which they are shown.
        words: Makes the title of a section from the label of its run.

    Returns:
        The figures by name; none for a strip, or what not all runs have.
    """
    sections = [found for run in runs if (found := Section.of(run)) is not None]
    if len(sections) < len(runs):
        return {}
    sides = _sides(sections)
    if max(sides) > _SLENDER * min(sides):
        return {}
    titles = [words(section.label) for section in sections]
    figures = {"temperature": _draw_temperature(sections, titles)}
    if all(section.steel is not None for section in sections):
        figures["states"] = _draw_states(sections, titles)
        if max(section.strongest for section in sections) > 0.0:
            figures["von_mises"] = _draw_stress(sections, titles)
    return figures


def _draw_temperature(sections: Sequence[Section], titles: Sequence[str]) -> Figure:
    """Temperature with solidus and liquidus."""
    figure, axes = _places(sections, "Temperature where the runs end")
    low = min(float(section.temperature.min()) for section in sections)
    high = max(max(float(section.temperature.max()) for section in sections), low + 1.0)
    handles: dict[str, Any] = {}
    for ax, section, title in zip(axes, sections, titles, strict=True):
        shades = shade(ax, section.mesh, section.temperature, "inferno", low, high)
        lines = draw_isotherms(ax, section.mesh, section.temperature, section.steel)
        handles |= {str(line.get_label()): line for line in lines}
        ax.set_title(title, fontsize=9)
    _bar(figure, shades, "temperature [°C]")
    _legend(figure, handles)
    return figure


def _draw_states(sections: Sequence[Section], titles: Sequence[str]) -> Figure:
    """What is solid, mushy and liquid, with the share that is solid."""
    from matplotlib.patches import Patch

    figure, axes = _places(sections, "State of the steel where the runs end", bar=False)
    for ax, section, title in zip(axes, sections, titles, strict=True):
        assert section.steel is not None
        kelvin = section.temperature + CELSIUS
        solidus = section.steel.solidus
        liquidus = max(section.steel.liquidus, float(np.nextafter(solidus, np.inf)))
        low = min(float(kelvin.min()), solidus) - 1.0
        high = max(float(kelvin.max()), liquidus) + 1.0
        levels = [low, solidus, liquidus, high]
        ax.tricontourf(section.mesh, kelvin, levels=levels, colors=list(STATES.values()))
        solid, *_ = state_shares(section.mesh, kelvin, section.steel)
        ax.set_title(f"{title}: {100.0 * solid:.1f} % solid", fontsize=9)
    _legend(figure, {k: Patch(facecolor=c, edgecolor="#444444") for k, c in STATES.items()})
    return figure


def _draw_stress(sections: Sequence[Section], titles: Sequence[str]) -> Figure:
    """Von Mises stress of what is solid, in one scale; mush and liquid are grey."""
    figure, axes = _places(sections, "Von Mises stress where the runs end")
    solid = [section for section in sections if section.strongest]
    levels = stress_levels(max(max(s.strongest, np.nan_to_num(s.named)) for s in solid))
    handles: dict[str, Any] = {}
    for ax, section, title in zip(axes, sections, titles, strict=True):
        assert section.steel is not None
        assert section.stress is not None
        # what lies beyond the scale is soft, and covered; its very end would not be drawn
        values = np.clip(section.stress, levels[0], (1 - 1e-6) * levels[-1])
        shades = ax.tricontourf(section.mesh, values, levels=levels, cmap=STRESS_MAP)
        soft = cover_soft(ax, section.mesh, section.temperature + CELSIUS, section.steel)
        handles |= {str(handle.get_label()): handle for handle in soft}
        if not section.strongest:
            title = f"{title}: nothing is solid"
        elif math.isfinite(section.named):
            title = f"{title}: up to {section.named:.3g} MPa"
        ax.set_title(title, fontsize=9)
    _bar(figure, shades, "von Mises stress in the solid [MPa]")
    _legend(figure, handles)
    return figure


def _sides(sections: Sequence[Section]) -> tuple[float, float]:
    """Width and height [mm] in which each of them fits."""
    return (
        max(float(np.ptp(section.mesh.x)) for section in sections),
        max(float(np.ptp(section.mesh.y)) for section in sections),
    )


def _places(
    sections: Sequence[Section], title: str, *, bar: bool = True
) -> tuple[Figure, list[Axes]]:
    """A figure with axes [mm] of one scale for all sections, placed by hand."""
    sides = _sides(sections)
    wide, high = (_CELL * side / max(sides) for side in sides)
    across = min(_ACROSS, len(sections))
    down = math.ceil(len(sections) / across)
    right = _RIGHT if bar else 0.2
    width = _LEFT + across * wide + (across - 1) * _BESIDE + right
    height = _ABOVE + down * high + (down - 1) * _BETWEEN + _BELOW
    figure = new_figure(width, height, layout="none")
    figure.suptitle(title, fontsize=10.5, y=1.0 - 0.12 / height)
    axes = []
    for number, section in enumerate(sections):
        row, column = divmod(number, across)
        left = _LEFT + column * (wide + _BESIDE)
        bottom = _BELOW + (down - 1 - row) * (high + _BETWEEN)
        ax = figure.add_axes((left / width, bottom / height, wide / width, high / height))
        ax.grid(False)
        ax.tick_params(labelsize=8)
        ax.locator_params(nbins=5)
        ax.set_xlim(section.mesh.x.min(), section.mesh.x.min() + sides[0])
        ax.set_ylim(section.mesh.y.min(), section.mesh.y.min() + sides[1])
        if column == 0:
            ax.set_ylabel("y [mm]")
        if number + across >= len(sections):
            ax.set_xlabel("x [mm]")
        axes.append(ax)
    return figure, axes


def _bar(figure: Figure, shades: Any, label: str) -> None:
    """The scale of the colours to the right of all sections."""
    width, height = figure.get_size_inches()
    left = width - _RIGHT + 0.15
    tall = height - _ABOVE - _BELOW
    place = figure.add_axes((left / width, _BELOW / height, 0.14 / width, tall / height))
    figure.colorbar(shades, cax=place, label=label)


def _legend(figure: Figure, handles: Mapping[str, Any]) -> None:
    """The legend below everything."""
    figure.legend(
        list(handles.values()),
        list(handles),
        loc="lower center",
        ncols=max(len(handles), 1),
        frameon=False,
    )
