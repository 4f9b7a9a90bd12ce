"""The figures of a run, drawn from the files in its folder at any time and without a display."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.atomic_files import saving
from castfem.base.errors import CastfemError
from castfem.base.log import logger
from castfem.base.messages import said_in_a_line
from castfem.base.shown_units import shown_in
from castfem.post.plots.bending import BENDING_FIGURES
from castfem.post.plots.deformation import SHAPE_FIGURES, STRESS_MAP
from castfem.post.plots.history import HISTORY_FIGURES
from castfem.post.plots.mechanics import MECHANICS_FIGURES
from castfem.post.plots.section import SECTION_FIGURES, Steel
from castfem.post.plots.strand import draw_stack
from castfem.post.plots.style import Abscissa, look, save
from castfem.runs.output.chosen_units import units_of_run
from castfem.runs.output.fields import Fields
from castfem.runs.output.folder import ALL_FIGURES, CASE_NAME, FIGURES_NAME, MAPS_NAME, ROWS_NAME
from castfem.runs.output.history import HISTORY_NAME, read_history
from castfem.runs.output.summary import Summary
from castfem.runs.output.xdmf import HDF5_NAME

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

    from castfem.physics.machine.rolls import Rolls

_OTHERS = SHAPE_FIGURES | {"stack": draw_stack}
_SECONDARY = "\n[secondary]\n"  # in the case of a run
_DEFECTS = "\ndefect = [", "[[machine.defect]]"  # likewise: short, and long
_SHADED = {"temperature": ("inferno",), "stack": ("inferno", STRESS_MAP)}  # by colour maps


def draw_figures(folder: Path | str) -> list[Path]:
    """Draws all figures for which the folder has the data, into its `figures`.

    Columns, fields and probes that a run does not have are left out; so is a figure of which
    nothing is left. One that cannot be drawn costs a warning, not the others.

    Args:
        folder: Of a run, which may still be at work.

    Returns:
        The files written.

    Raises:
        InputError: A file is damaged.
        RunFailure: They cannot be written.
    """
    path = Path(folder)
    summary = Summary.load(path)
    drawn: list[Path] = []
    with look(), shown_in(units_of_run(path)):
        if (path / HDF5_NAME).is_file():
            drawn += _draw_section(path, summary)
        if (path / HISTORY_NAME).is_file():
            drawn += _draw_history(path, summary)
        if any((path / name).is_file() for name in (MAPS_NAME, ROWS_NAME)):
            drawn += _draw_maps(path, summary)
    return drawn


def _draw_maps(path: Path, summary: Summary | None) -> list[Path]:
    """The figures over the surface of the strand."""
    from castfem.post.plots.caster_view import draw_caster
    from castfem.post.plots.maps import draw_maps
    from castfem.runs.output.surface_maps import SurfaceMaps

    maps = SurfaceMaps(path)
    abscissa = Abscissa(maps.time, maps.position, summary.zones if summary else ())
    return [
        *_drawn(path, "maps", lambda: draw_maps(maps, abscissa)),
        *_drawn(path, "caster", lambda: draw_caster(maps, _with_defects(path))),
    ]


def _drawn(
    path: Path, name: str, draw: Callable[[], Figure | None], maps: tuple[str, ...] = ()
) -> list[Path]:
    """The file of a figure, if there is something to draw and it could be drawn."""
    try:
        figure = draw()
        return [] if figure is None else [save(figure, _target(path, name), maps=maps)]
    except CastfemError:
        raise
    except Exception as error:
        logger.warning("%s.png could not be drawn (%s)", name, said_in_a_line(error))
        return []


def _target(path: Path, name: str) -> Path:
    """The file of a figure, its folder made."""
    assert name in ALL_FIGURES, f"{name}: not listed, it would outlive its run"
    target = path / FIGURES_NAME / f"{name}.png"
    with saving(target):
        target.parent.mkdir(exist_ok=True)
    return target


def _draw_section(path: Path, summary: Summary | None) -> list[Path]:
    """The figures over the section: temperature and states where the mould ends, else at the end.

    Far below its mould a strand is solid and says nothing of its shell.
    """
    drawn = []
    with Fields(path) as fields:
        if "temperature" not in fields.names:
            return []
        steel = _steel(fields, summary)
        index = _state_at_exit(fields, summary)
        for name, draw in SECTION_FIGURES.items():
            made = partial(draw, fields, steel, index=index)
            drawn += _drawn(path, name, made, _SHADED.get(name, ()))
        for name, draw in _OTHERS.items():
            drawn += _drawn(path, name, partial(draw, fields, steel), _SHADED.get(name, ()))
    return drawn


def _state_at_exit(fields: Fields, summary: Summary | None) -> int:
    """Index of the state nearest to the mould's exit; that of the last if the run ends above."""
    positions = np.asarray(fields.positions, float)
    ends = None if summary is None else summary.mould_exit
    if ends is None or positions[-1] <= ends:
        return len(positions) - 1
    return int(np.argmin(np.abs(positions - ends)))


def _draw_history(path: Path, summary: Summary | None) -> list[Path]:
    """The figures along the strand."""
    table = read_history(path / HISTORY_NAME)
    if len(table) < 2:
        return []
    time = table["time"].to_numpy()
    position = table["position"].to_numpy() if "position" in table else np.full(len(time), np.nan)
    abscissa = Abscissa(time, position, summary.zones if summary else (), _defects(path))
    steel = Steel.of(_known(summary))
    if steel is None and (path / HDF5_NAME).is_file():
        with Fields(path) as fields:
            steel = _steel(fields, summary)
    drawn = []
    for name, draw in (HISTORY_FIGURES | MECHANICS_FIGURES | BENDING_FIGURES).items():
        drawn += _drawn(path, name, partial(draw, table, abscissa, steel))
    return drawn + _draw_roll_to_roll(path, table, abscissa)


def _defects(path: Path) -> tuple[tuple[float, str], ...]:
    """The rolls of a run that have a defect: position [m] and what is wrong."""
    rolls = _with_defects(path)
    pairs = () if rolls is None else rolls.pairs
    return tuple((p.position, f"#{i} {p.defect}") for i, p in enumerate(pairs, 1) if p.defect)


def _with_defects(path: Path) -> Rolls | None:
    """The rolls of a run whose case has defects; None of another."""
    case = path / CASE_NAME
    text = case.read_text(encoding="utf-8") if case.is_file() else ""
    if not any(mark in text for mark in _DEFECTS):
        return None
    from castfem.model import load_case

    machine = load_case(case).machine
    return None if machine is None else machine.pairs()


def _draw_roll_to_roll(path: Path, table: pandas.DataFrame, abscissa: Abscissa) -> list[Path]:
    """Surface temperatures above what the faces meet, of a case with [secondary]."""
    case = path / CASE_NAME
    if not case.is_file() or _SECONDARY not in case.read_text(encoding="utf-8"):
        return []
    from castfem.model import load_case
    from castfem.post.plots.secondary import draw_roll_to_roll

    return _drawn(path, "roll_to_roll", lambda: draw_roll_to_roll(table, abscissa, load_case(case)))


def _known(summary: Summary | None) -> dict[str, float]:
    """The quantities of a summary by name, in SI."""
    return {name: q.value for name, q in summary.quantities.items()} if summary else {}


def _steel(fields: Fields, summary: Summary | None) -> Steel | None:
    """Solidus and liquidus, from the summary or, before there is one, from the fields."""
    return Steel.of(_known(summary)) or Steel.of(fields.attributes)
