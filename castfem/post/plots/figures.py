"""The list of figures of a run, and the drawing of those for which there are data.

They are drawn from the files in the folder of a run, at any time and without a display.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.atomic_files import saving
from castfem.base.errors import CastfemError, said_in_a_line
from castfem.base.log import logger
from castfem.base.shown_units import shown_in
from castfem.model import load_case
from castfem.model.shipped_cases import CASE_NAME
from castfem.post.plots import along_strand, deformation, section
from castfem.post.plots.caster_view import draw_caster
from castfem.post.plots.maps import draw_depths, draw_maps
from castfem.post.plots.secondary import draw_roll_to_roll
from castfem.post.plots.section import Steel
from castfem.post.plots.strand import draw_stack
from castfem.post.plots.style import STYLE, Abscissa, look, save
from castfem.runs.output.fields import Fields
from castfem.runs.output.folder import ALL_FIGURES, FIGURES_NAME
from castfem.runs.output.history import HISTORY_NAME, Columns, read_columns
from castfem.runs.output.summary_file import Summary, Zone
from castfem.runs.output.surface_maps import DEPTHS, SURFACE, SurfaceMaps
from castfem.runs.output.xdmf import HDF5_NAME
from castfem.runs.results.run_case import units_of_run

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Picture

    from castfem.physics.machine.rolls import Rolls

_SECONDARY = "\n[secondary]\n"  # in the case of a run
_DEFECTS = "\ndefect = [", "[[machine.defect]]"  # in the case of a run, short and long form


@dataclass(frozen=True)
class RunData:
    """Content of the files in the folder of a run, read when a figure needs it."""

    folder: Path  #: folder of the run
    summary: Summary | None  #: its results; None before they are written
    files: ExitStack  #: keeps the fields open

    def has(self, what: str) -> bool:
        """Whether there is a "table" of two rows, "fields" of temperature, "maps", or "depths"."""
        if what == "table":
            return (self.folder / HISTORY_NAME).is_file() and len(self.table) > 1
        if what == "fields":
            return (self.folder / HDF5_NAME).is_file() and "temperature" in self.fields.names
        return SurfaceMaps.exist(self.folder, DEPTHS if what == "depths" else SURFACE)

    @cached_property
    def table(self) -> Columns:
        """The history."""
        return read_columns(self.folder / HISTORY_NAME)

    @cached_property
    def fields(self) -> Fields:
        """The fields."""
        return self.files.enter_context(Fields(self.folder))

    @cached_property
    def maps(self) -> SurfaceMaps:
        """The maps of the surface."""
        return SurfaceMaps(self.folder)

    @cached_property
    def depths(self) -> SurfaceMaps:
        """The maps over the depth."""
        return SurfaceMaps(self.folder, DEPTHS)

    @property
    def zones(self) -> tuple[Zone, ...]:
        """The cooling zones."""
        return () if self.summary is None else self.summary.zones

    @cached_property
    def abscissa(self) -> Abscissa:
        """The position of the slice over time."""
        time = self.table["time"]
        known = "position" in self.table
        position = self.table["position"] if known else np.full(len(time), np.nan)
        return Abscissa(time, position, self.zones, self.defects)

    @cached_property
    def steel(self) -> Steel | None:
        """Solidus and liquidus, from the summary or, without it, from the fields."""
        quantities = {} if self.summary is None else self.summary.quantities
        found = Steel.of({name: quantity.value for name, quantity in quantities.items()})
        return found or (Steel.of(self.fields.attributes) if self.has("fields") else None)

    @cached_property
    def case(self) -> str:
        """The text of its case; "" without one."""
        path = self.folder / CASE_NAME
        return path.read_text(encoding="utf-8") if path.is_file() else ""

    @cached_property
    def rolls(self) -> Rolls | None:
        """The rolls of a case with defects; otherwise None."""
        if not any(mark in self.case for mark in _DEFECTS):
            return None
        machine = load_case(self.folder / CASE_NAME).machine
        return None if machine is None else machine.pairs()

    @property
    def defects(self) -> tuple[tuple[float, str], ...]:
        """The rolls with a defect: position [m] and description."""
        pairs = () if self.rolls is None else self.rolls.pairs
        return tuple((p.position, f"#{i} {p.defect}") for i, p in enumerate(pairs, 1) if p.defect)

    @property
    def at_exit(self) -> int:
        """Index of the output time nearest to the mould's exit, or of the last above it.

        Far below its mould a strand is solid, and its shell has no meaning; at the meniscus it has
        none.
        """
        positions = np.asarray(self.fields.positions, float)
        ends = None if self.summary is None else self.summary.mould_exit
        if ends is None or positions[-1] <= ends:
            return len(positions) - 1
        return int(np.argmin(np.abs(positions[1:] - ends))) + 1


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure of a run."""

    name: str  #: name of its file
    title: str  #: its content, for captions
    needs: str  #: data that the run must have, as in `RunData.has`
    draw: Callable[[RunData], Picture | None]  #: draws it; None if there is nothing to show
    shaded: bool = False  #: whether it has continuous colours
    picture: bool = False  #: whether the report includes it as a picture; otherwise as curves


def _along(name: str, title: str, picture: bool = False) -> Figure:
    draw = getattr(along_strand, f"draw_{name}")
    return Figure(
        name, title, "table", lambda run: draw(run.table, run.abscissa, run.steel), picture=picture
    )


def _roll_to_roll(run: RunData) -> Picture | None:
    if _SECONDARY not in run.case:
        return None
    return draw_roll_to_roll(run.table, run.abscissa, load_case(run.folder / CASE_NAME))


def _stack(run: RunData) -> Picture | None:
    """The strand from its slices, unless these are too few."""
    return None if len(run.fields.positions) < STYLE.slices else draw_stack(run.fields, run.steel)


FIGURES = {
    figure.name: figure
    for figure in (
        Figure("temperature", "Temperature of the section", "fields",
               lambda run: section.draw_temperature(run.fields, run.steel, index=run.at_exit),
               shaded=True),
        Figure("states", "State of the steel in the section", "fields",
               lambda run: section.draw_states(run.fields, run.steel, index=run.at_exit)),
        Figure("von_mises", "Von Mises stress in the section", "fields",
               lambda run: deformation.draw_von_mises(run.fields, run.steel)),
        Figure("shape", "Shape of the section", "fields",
               lambda run: deformation.draw_shape(run.fields, run.steel)),
        Figure("stack", "Slices stacked along the strand", "fields",
               _stack, shaded=True),
        _along("surface_temperature", "Surface temperature"),
        _along("shell", "Shell: depths of solidus and liquidus"),
        _along("heat", "Heat flux, heat removed"),
        _along("steps", "Time steps, iterations, errors"),
        _along("tensile", "Stress over strain"),
        _along("stress", "Von Mises stress"),
        _along("size", "Size of the section"),
        _along("axial", "Axial strain and force"),
        _along("contact", "Gap, contact pressure, friction"),
        _along("extraction", "Resistance of the rolls, drives, effort", picture=True),
        _along("slice", "Thickness of the slice, neutral axis, axial stress", picture=True),
        _along("bulging", "Bulge between rolls, force on the rolls", picture=True),
        Figure("roll_to_roll", "Surface temperature from roll to roll", "table", _roll_to_roll),
        Figure("maps", "Surface unrolled: temperature, low ductility, crack indexes", "maps",
               lambda run: draw_maps(
                   run.maps, Abscissa(run.maps.time, run.maps.position, run.zones)
               ),
               picture=True),
        Figure("depths", "Criteria of hot tearing over the depth", "depths",
               lambda run: draw_depths(
                   run.depths, Abscissa(run.depths.time, run.depths.position, run.zones)
               ),
               picture=True),
        Figure("caster", "Strand between its rolls", "maps",
               lambda run: draw_caster(run.maps, run.rolls), picture=True),
    )
}  # fmt: skip
"""All figures of a run by name, in the order of drawing."""


def draw_figures(folder: Path | str) -> list[Path]:
    """Draw all figures for which the folder has data, into its `figures`.

    Columns, fields and probes that a run does not have are left out, and so is a figure without
    content. A figure that cannot be drawn gives a warning, and the others are drawn.
    """
    path, drawn = Path(folder), []
    with ExitStack() as files, look(), shown_in(units_of_run(path)), _cleared() as clear:
        run = RunData(path, Summary.load(path), files)
        for figure in FIGURES.values():
            if run.has(figure.needs) and (file := _drawn(figure, run)) is not None:
                drawn.append(file)
                clear()
    return drawn


@contextmanager
def _cleared() -> Iterator[Callable[[], object]]:
    """Yield a function that frees earlier figures, which are in reference cycles with their pixels.

    Older objects and what earlier figures have left are excluded from the garbage search, which
    makes it fast; without it a dozen figures would be in memory at once.
    """
    frozen, enabled = gc.get_freeze_count() > 0, gc.isenabled()

    def clear() -> None:
        gc.collect()
        gc.freeze()

    gc.disable()
    gc.freeze()
    try:
        yield clear
    finally:
        if not frozen:
            gc.unfreeze()
        if enabled:
            gc.enable()


def _drawn(figure: Figure, run: RunData) -> Path | None:
    """Draw a figure; return its file if there was something to draw and it succeeded."""
    assert figure.name in ALL_FIGURES, f"{figure.name}: not listed, it would outlive its run"
    try:
        picture = figure.draw(run)
        if picture is None:
            return None
        target = run.folder / FIGURES_NAME / f"{figure.name}.png"
        with saving(target):
            target.parent.mkdir(exist_ok=True)
        return save(picture, target, shaded=figure.shaded)
    except CastfemError:
        raise
    except Exception as error:
        logger.warning("%s.png could not be drawn (%s)", figure.name, said_in_a_line(error))
        return None
