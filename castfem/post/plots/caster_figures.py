"""The pictures of a caster's folder."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from castfem.post.plots.strand_maps import maps_figure
from castfem.post.plots.strand_moments import moments_figure
from castfem.post.plots.strand_over_time import strand_figure
from castfem.post.plots.style import save
from castfem.runs.output.folder import CASTER_FIGURES, FIGURES_NAME

if TYPE_CHECKING:
    from castfem.model import Case


def draw_caster(folder: Path, case: Case) -> list[Path]:
    """Draw a caster's files; returns the pictures."""
    (folder / FIGURES_NAME).mkdir(exist_ok=True)
    figures = (
        strand_figure(folder, case.title, case.casting.length),
        maps_figure(folder, case),
        moments_figure(folder, case),
    )
    drawn = []
    for name, figure in zip(CASTER_FIGURES, figures, strict=True):
        if figure is not None:
            path = folder / FIGURES_NAME / f"{name}.png"
            save(figure, path)
            drawn.append(path)
    return drawn
