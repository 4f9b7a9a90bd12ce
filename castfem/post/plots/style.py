"""The style all figures share, and the run data they need."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from castfem.base.atomic_files import replacing
from castfem.base.libraries import own_style
from castfem.base.shown_units import is_chosen
from castfem.runs.output.summary_file import Zone

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_agg import RendererAgg
    from matplotlib.figure import Figure
    from PIL import Image

SOLIDUS_COLOUR = "#1b6ca8"
LIQUIDUS_COLOUR = "#c0392b"
# Colour-blind safe (Okabe and Ito); the known probes have the same colour in every figure.
_COLOURS = {"mid_face": "#0072b2", "corner": "#d55e00", "narrow_face": "#009e73"}
_OTHER_COLOURS = ("#cc79a7", "#56b4e9", "#e69f00", "#7f7f7f", "#000000")
_DEFECT = "#d55e00"  # the line at a roll with a defect


@dataclass(frozen=True, slots=True)
class Style:
    """Dimensions shared by several figures, in inches unless stated otherwise."""

    dpi: int = 160  #: pixels per inch
    width: float = 7.2  #: width of a figure over the strand's length
    left: float = 0.8  #: margin left of the panels
    right: float = 0.2  #: margin right of the panels
    top: float = 0.52  #: margin above the panels
    bottom: float = 0.48  #: margin below the panels
    between: float = 0.14  #: between two panels
    edge: float = 0.04  #: margin beside long numbers
    panel: tuple[float, float] = (3.4, 2.3)  #: width and height of a panel of a study
    label: int = 34  #: characters along the height of a panel
    shades: int = 256  #: number of colours of a scale
    #: aspect ratio from which equal axes would reduce a section to a line
    slender: float = 12.0
    wide: float = 1.6  #: aspect ratio from which the colour bar is placed below
    moves: float = 0.05  #: share of the section by which its surface may appear to move
    #: points of a segment of an outline; odd, so that one is in the middle of a face
    segment: int = 33
    #: points of an outline with an interpolated radius, because its error is magnified too
    dense: int = 400
    slices: int = 4  #: least slices of a stack: colours are linear between them
    gap: float = 0.01  #: least span of the gap axis, mm
    held: float = 1e-6  #: motion below which a surface counts as held, as in a strip, mm
    #: force below which a strand counts as free, kN or kN/m: newtons occur as slivers of solid
    #: freeze
    force: float = 0.01
    #: length of a roll beyond the edge of the strand in the picture of a caster, m
    roll_end: float = 0.06
    caster: float = 0.3  #: margin of that picture, m
    hot_times: float = 40.0  #: magnification of the distortion of a hot mould
    outline_times: float = 20.0  #: magnification of a calculated mould outline


STYLE = Style()


@dataclass(frozen=True, slots=True)
class Margins:
    """Margins of pictures that are placed by hand, inches."""

    left: float
    right: float
    above: float
    below: float
    beside: float = 0.0  #: between two pictures
    between: float = 0.0  #: between two rows, or between a frame and the end of its scale


@dataclass(frozen=True, slots=True)
class Abscissa:
    """The path of the slice: the x axis of every history plot."""

    time: NDArray[np.float64]  #: (n,) [s]
    position: NDArray[np.float64]  #: (n,) below the meniscus [m]
    zones: tuple[Zone, ...] = ()  #: cooling zones
    #: rolls with a defect: position [m] and description
    defects: tuple[tuple[float, str], ...] = ()

    @property
    def along(self) -> bool:
        """Whether the position increases, so that it can serve as axis."""
        return bool(
            len(self.position) > 1
            and np.isfinite(self.position).all()
            and (np.diff(self.position) >= 0).all()
            and self.position[-1] > self.position[0]
        )

    @property
    def scale(self) -> float:
        """Figure units per metre of position: 1000 for mm, 1 for m."""
        return 1.0 if self.position[-1] > 2.0 else 1e3  # m

    @property
    def values(self) -> NDArray[np.float64]:
        """The values along the x axis."""
        return self.position * self.scale if self.along else self.time

    @property
    def label(self) -> str:
        """Label of the x axis."""
        if not self.along:
            return "time since the meniscus [s]"
        return f"position below the meniscus [{'m' if self.scale == 1.0 else 'mm'}]"


def round_factor(most: float) -> float:
    """The largest of 1, 2, 5, 10, 20 ... not above a factor, at least 1."""
    decade = 10.0 ** math.floor(math.log10(max(most, 1.0)))
    return max(f * decade for f in (1.0, 2.0, 5.0) if f * decade <= max(most, 1.0) * (1.0 + 1e-9))


@contextmanager
def look() -> Iterator[None]:
    """Apply matplotlib settings inside the block, ignoring the user's."""
    settings: dict[Any, Any] = {
        "font.size": 9.5,
        "axes.labelsize": 9.5,
        "axes.titlesize": 10.5,
        "axes.grid": True,
        "axes.axisbelow": True,
        "axes.linewidth": 0.8,
        "axes.titley": 1.0,  # position without ticks above, set without measuring them
        "grid.color": "#d9d9d9",
        "grid.linewidth": 0.6,
        "lines.linewidth": 1.7,
        "legend.fontsize": 8.5,
        "legend.framealpha": 0.9,
        "legend.edgecolor": "#bfbfbf",
        "xtick.labelsize": 9,
        "ytick.labelsize": 9,
        "figure.constrained_layout.use": True,
    }
    with own_style(settings):
        yield


def new_figure(width: float, height: float, *, layout: Literal["none"] | None = None) -> Figure:
    """An empty figure (inches) that needs no display; matplotlib's default layout if None."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    # missing in the type stubs
    options: dict[str, Any] = {} if layout is None else {"layout": layout}
    figure = Figure(figsize=(width, height), **options)
    FigureCanvasAgg(figure)
    return figure


def head(figure: Figure, title: str, size: float = 11.5) -> None:
    """Give a figure a title, wrapped to its width."""
    # characters, each 0.58 of `size` wide
    width = 72.0 * figure.get_size_inches()[0] / (0.58 * size)
    if title:
        figure.suptitle(fill(title, int(width)), fontsize=size)


def new_panels(
    count: int, height: float, *, above: float = 0.0, below: float = 0.0
) -> tuple[Figure, list[Axes]]:
    """A figure of panels above one another with a common x axis.

    Margins are fixed: a layout search would take as long as the drawing, and the same position has
    the same place in all figures.
    """
    between = STYLE.between * (count - 1)
    total = count * height + between + STYLE.top + above + STYLE.bottom + below
    figure = new_figure(STYLE.width, total, layout="none")
    figure.subplots_adjust(
        left=STYLE.left / STYLE.width,
        right=1.0 - STYLE.right / STYLE.width,
        bottom=(STYLE.bottom + below) / total,
        top=1.0 - (STYLE.top + above) / total,
        hspace=STYLE.between / height,
    )
    axes = list(figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0])
    for panel in axes:
        panel.locator_params(axis="x", nbins=8, steps=[1, 2, 5, 10])
        panel.locator_params(axis="y", nbins=6)
    return figure, axes


def save(figure: Figure, path: Path, *, shaded: bool = False) -> Path:
    """Write a PNG in one step.

    Args:
        figure: Figure to write.
        path: File to write.
        shaded: Whether to keep all colours, for smooth shading. Otherwise 256 are kept, which
            halves the time and reduces the file to a third.
    """
    image = render(figure)
    image = image if shaded else _indexed(image)
    with replacing(path, durable=False) as temporary:
        image.save(
            temporary, format="PNG", dpi=(STYLE.dpi, STYLE.dpi), compress_type=zlib.Z_RLE
        )  # a third of the time, 5 % larger for smooth shading
    return path


@look()
def render(figure: Figure) -> Image.Image:
    """Draw a figure once; `savefig` draws it twice if a layout must be found first."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL import Image

    if is_chosen():
        from castfem.post.plots.chosen_units import in_chosen_units

        in_chosen_units(figure)
    figure.set_dpi(STYLE.dpi)
    layout = figure.get_layout_engine()
    if layout is not None:
        layout.execute(figure)
        figure.set_layout_engine("none")
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    if layout is None and _widen(figure, canvas.get_renderer()):
        canvas.draw()
    return Image.frombuffer("RGBA", canvas.get_width_height(), canvas.buffer_rgba()).convert("RGB")


def _widen(figure: Figure, renderer: RendererAgg) -> bool:
    """Move axes with fixed margins and long numbers away from the edge.

    Args:
        figure: A drawn figure, in which labels are beside the numbers: seldom is one cut.
        renderer: Renderer of the figure.

    Returns:
        Whether axes were moved.
    """
    labels = [axes.yaxis.label.get_window_extent(renderer).x0 for axes in figure.axes]
    cut = min(labels, default=0.0)
    if cut >= 0.0:
        return False
    wider = (STYLE.edge * figure.dpi - cut) / figure.bbox.width
    figure.subplots_adjust(left=figure.subplotpars.left + wider)
    return True


def _indexed(image: Image.Image) -> Image.Image:
    """An image with 256 colours at most."""
    from PIL import Image

    found = image.quantize(method=Image.Quantize.FASTOCTREE)
    colours = np.array(found.getpalette(), dtype=np.uint8)
    # brighter pixels are background
    colours[(colours.reshape(-1, 3) > 250).all(axis=1).repeat(3)] = 255
    found.putpalette(colours.tobytes())
    return found


def probe_colours(probes: list[str]) -> dict[str, str]:
    """One colour per probe."""
    own = {probe: _COLOURS.get(probe.removesuffix("_intrados")) for probe in probes}
    others = [probe for probe, colour in own.items() if colour is None]
    spare = {probe: _OTHER_COLOURS[i % len(_OTHER_COLOURS)] for i, probe in enumerate(others)}
    return {probe: colour or spare[probe] for probe, colour in own.items()}


def dress(axes: list[Axes], abscissa: Abscissa) -> None:
    """Give stacked panels their common x axis: position, time on top, the zones."""
    low, high = float(abscissa.values[0]), float(abscissa.values[-1])
    if low == high:
        low, high = low - 0.5, high + 0.5
    for panel in axes:
        panel.set_xlim(low, high)
    axes[-1].set_xlabel(abscissa.label, gid="position")
    if not abscissa.along:
        return
    strip = _draw_zones(axes, abscissa)
    _mark_defects(axes, abscissa)
    to_time, to_position = _clocks(abscissa)
    top = axes[0].secondary_xaxis(1.0 + strip, functions=(to_time, to_position))
    top.set_xlabel("time since the meniscus [s]")
    if not _is_steady(abscissa):
        top.set_xticks(_apart(abscissa, to_position))


def _mark_defects(axes: list[Axes], abscissa: Abscissa) -> None:
    """Draw a line in all panels at rolls with a defect, labelled in the last."""
    low, high = axes[0].get_xlim()
    for position, name in abscissa.defects:
        place = position * abscissa.scale
        if not low <= place <= high:
            continue
        for panel in axes:
            panel.axvline(place, color=_DEFECT, linewidth=0.9, linestyle="--", zorder=1)
        axes[-1].annotate(
            name, (place, 0.97), (-3, 0), xycoords=axes[-1].get_xaxis_transform(),
            textcoords="offset points", ha="right", va="top", rotation=90, fontsize=7.5,
            bbox={"boxstyle": "square,pad=0.1", "facecolor": "white", "alpha": 0.8, "linewidth": 0},
        )  # fmt: skip


def _is_steady(abscissa: Abscissa) -> bool:
    way, time = abscissa.position - abscissa.position[0], abscissa.time - abscissa.time[0]
    steady = time / time[-1] * way[-1] if time[-1] > 0.0 else way
    return bool(np.allclose(way, steady, rtol=0.0, atol=1e-6 * way[-1]))


def _apart(abscissa: Abscissa, to_position: Callable[[Any], Any]) -> list[float]:
    """Rounded times at least 6 % of the axis apart: many coincide where the strand stands still."""
    from matplotlib.ticker import MaxNLocator

    ends = float(abscissa.time[0]), float(abscissa.time[-1])
    times = [float(t) for t in MaxNLocator(9).tick_values(*ends) if ends[0] <= t <= ends[1]]
    room = 0.06 * float(np.ptp(abscissa.values))
    kept: list[float] = []
    for time in times:
        if not kept or to_position(time) - to_position(kept[-1]) >= room:
            kept.append(time)
    return kept


def _clocks(abscissa: Abscissa) -> tuple[Callable[[Any], Any], Callable[[Any], Any]]:
    """Time as a function of the abscissa and its inverse, linear beyond the ends."""
    steps = np.concatenate([[True], np.diff(abscissa.values) > 0])
    x, t = abscissa.values[steps], abscissa.time[steps]
    before, after = (t[1] - t[0]) / (x[1] - x[0]), (t[-1] - t[-2]) / (x[-1] - x[-2])
    span = x[-1] - x[0]
    x = np.concatenate([[x[0] - span], x, [x[-1] + span]])
    t = np.concatenate([[t[0] - span * before], t, [t[-1] + span * after]])
    return (lambda a: np.interp(a, x, t)), (lambda a: np.interp(a, t, x))


def _draw_zones(axes: list[Axes], abscissa: Abscissa) -> float:
    """Name the cooling zones in a strip above the first panel and separate them in all panels.

    Returns:
        Height of the strip as a fraction of the panel, 0 without one.
    """
    low, high = axes[0].get_xlim()
    zones = [
        (max(low, z.start * abscissa.scale), min(high, z.end * abscissa.scale), z.name)
        for z in abscissa.zones
    ]
    zones = [zone for zone in zones if zone[0] < zone[1]]
    if len(zones) < 2:
        return 0.0
    figure = axes[0].figure.get_figure(root=True)
    width, height = figure.get_size_inches()
    scale = axes[0].get_position().width * width / (high - low)  # inches per unit of the abscissa
    names = [_fitting(name, (right - left) * scale) for left, right, name in zones]
    lines = max(name.count("\n") + 1 for name, _ in names)
    inches = 0.08 + 0.115 * lines
    figure.subplots_adjust(top=figure.subplotpars.top - inches / height)
    share = inches / (axes[0].get_position().height * height)
    strip = axes[0].inset_axes((0.0, 1.0, 1.0, share))
    strip.set_xlim(low, high)
    strip.set_axis_off()
    for number, ((name, size), (left, right, _)) in enumerate(zip(names, zones, strict=True)):
        strip.axvspan(left, right, color=("#ececec", "#d5d5d5")[number % 2], linewidth=0)
        strip.text(
            (left + right) / 2,
            0.48,
            name,
            transform=strip.get_xaxis_transform(),
            ha="center",
            va="center",
            fontsize=size,
            linespacing=0.95,
            color="#333333",
        )
        for panel in axes if number else ():
            panel.axvline(left, color="#8a8a8a", linewidth=0.8, linestyle=(0, (4, 3)), zorder=1)
    return float(share)


def _fitting(name: str, inches: float) -> tuple[str, float]:
    """A name fitted to a width, and its font size: whole, one word per line, smaller, or empty."""
    words = name.replace("_", " ").split()
    for size in (7.0, 5.8):
        room = inches / (0.0085 * size)  # characters
        for text in (" ".join(words), "\n".join(words)):
            if max((len(line) for line in text.split("\n")), default=0) <= room:
                return text, size
    return "", 7.0
