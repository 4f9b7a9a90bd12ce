"""Makes the pictures of the how-tos: runs the commands of a page and draws what they leave.

Run it by `tools/browser.sh .castfem docs/how_to_pictures.py`, or with the names of pages: `taper`;
all but `report` do without the browser: `.castfem/bin/python docs/how_to_pictures.py taper`. A
picture holds the hash of what its page had run; a test compares it with the page as it is.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shlex
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from PIL import Image

HERE = Path(__file__).parent
PAGES = HERE / "how_to"
BLOCK = re.compile(r"((?:^(?!```)[^\n]+\n)*)\n```(toml|text|sh)\n(.*?)^```$", re.M | re.S)
WIDTH, COLOURS = 760, 128  # pixels, and a palette: lines on white need few
SIZE, DPI = (7.6, 2.7), 200
MID, CORNER, THIRD = "#0072b2", "#d55e00", "#009e73"  # Okabe and Ito, as in castfem's figures


def files_and_commands(page: str) -> tuple[dict[str, str], list[list[str]]]:
    """Files that a how-to has its reader write, and the commands of castfem that it has run."""
    files, commands = dict[str, str](), list[list[str]]()
    for before, kind, text in BLOCK.findall((PAGES / f"{page}.md").read_text(encoding="utf-8")):
        if kind == "sh":
            lines = text.replace("\\\n", " ").splitlines()
            commands += [words for line in lines if (words := shlex.split(line, comments=True))]
        elif named := re.findall(r"`(\w+\.(?:toml|csv))`", before):
            files[named[-1]] = text
    return files, [words for words in commands if words[0] == "castfem"]


def fingerprint(page: str) -> str:
    """Hash of what the picture of a how-to is made from: its files and commands.

    With the files of `my_billet` where the page goes on from them.
    """
    own = files_and_commands(page)
    shared = files_and_commands("my_billet")[0] if "my_billet.toml" in json.dumps(own) else {}
    said = (shared, *own)
    return hashlib.sha256(json.dumps(said).encode()).hexdigest()[:16]


def beside(count: int = 2) -> tuple[Figure, list[Axes]]:
    """A small figure with panels beside one another."""
    from castfem.post.plots.style import new_figure

    figure = new_figure(*SIZE, layout="constrained")
    return figure, list(figure.subplots(1, count, squeeze=False)[0])


def curve(axes: Axes, run: Path, column: str, colour: str, label: str, line: str = "-") -> None:
    """A column of a run over the position, m."""
    import castfem

    history = castfem.Result(run).history
    axes.plot(history["position"], history[column], line, color=colour, label=label)


def along(axes: Axes, label: str, *, legend: bool = True, zones: tuple[float, ...] = ()) -> None:
    """Names the axes of curves over the position, and marks where zones end, m."""
    axes.set_xlabel("below the meniscus [m]")
    axes.set_ylabel(label)
    axes.set_xlim(left=0.0)
    for end in zones:
        axes.axvline(end, color="#bbbbbb", lw=0.8, zorder=0)
    if legend:
        axes.legend(frameon=False)


def my_billet(there: Path) -> Figure:
    """Shell and surface on the way down, with the ends of the zones."""
    figure, (shell, surface) = beside()
    for probe, colour, label in (("mid_face", MID, "mid-face"), ("corner", CORNER, "corner")):
        curve(shell, there / "coarse", f"shell_{probe}", colour, label)
        curve(surface, there / "coarse", f"surface_temperature_{probe}", colour, label)
    along(shell, "shell [mm]", zones=(0.8, 1.3, 5.0))
    along(surface, "surface [°C]", legend=False, zones=(0.8, 1.3, 5.0))
    return figure


def my_steel(there: Path) -> Figure:
    """Shell and surface of both steels."""
    figure, (shell, surface) = beside()
    for run, colour in (("shipped", MID), ("mine", CORNER)):
        curve(shell, there / run, "shell_mid_face", colour, run)
        curve(surface, there / run, "surface_temperature_mid_face", colour, run)
    along(shell, "shell, mid-face [mm]")
    along(surface, "surface, mid-face [°C]", legend=False)
    return figure


def taper(there: Path) -> Figure:
    """What the taper does to gap and stress."""
    figure, (gap, stress) = beside()
    for value, colour in (("0", CORNER), ("0.8", MID), ("1.6", THIRD)):
        (run,) = there.glob(f"tapers/taper_{value}_*")
        curve(gap, run, "gap_corner", colour, f"{value} %/m")
        curve(stress, run, "von_mises_max", colour, f"{value} %/m")
    along(gap, "gap, corner [mm]")
    along(stress, "largest von Mises stress [MPa]", legend=False)
    return figure


def spray_water(there: Path) -> Figure:
    """Surface and shell with three flows."""
    figure, (surface, shell) = beside()
    for flow, colour in (("150", CORNER), ("300", MID), ("600", THIRD)):
        (run,) = there.glob(f"water/*{flow}_L_min*")
        curve(surface, run, "surface_temperature_mid_face", colour, f"{flow} L/min")
        curve(shell, run, "shell_mid_face", colour, f"{flow} L/min")
    along(surface, "surface, mid-face [°C]", zones=(5.0,))
    along(shell, "shell, mid-face [mm]", legend=False, zones=(5.0,))
    return figure


def asymmetric_cooling(there: Path) -> Figure:
    """Surface and shell of the face with half the water and of the one opposite."""
    figure, (surface, shell) = beside()
    for probe, colour, label in (
        ("mid_face", CORNER, "intrados, half the water"),
        ("mid_face_extrados", MID, "extrados"),
    ):
        curve(surface, there / "clogged", f"surface_temperature_{probe}", colour, label)
        curve(shell, there / "clogged", f"shell_{probe}", colour, label)
    along(surface, "surface, mid-face [°C]", zones=(0.8,))
    along(shell, "shell, mid-face [mm]", legend=False, zones=(0.8,))
    return figure


def slab(there: Path) -> Figure:
    """Surface down the machine, where it is bent, and where most steels are brittle."""
    figure, (surface,) = beside(1)
    for probe, colour in (("mid_face_intrados", MID), ("corner_intrados", CORNER)):
        label = probe.replace("_intrados", "").replace("_", "-")
        curve(surface, there / "heat", f"surface_temperature_{probe}", colour, label)
    surface.axhspan(700.0, 900.0, color="#eeeeee", zorder=0, label="brittle, most steels")
    for name, (first, last) in {
        "bending": (2.322, 4.110),
        "straightening": (14.272, 16.832),
    }.items():
        surface.axvspan(first, last, color="#56b4e9", alpha=0.25, zorder=0)
        surface.text(0.5 * (first + last), 1450.0, name, ha="center", va="top", fontsize="small")
    surface.set_ylim(300.0, 1500.0)
    along(surface, "surface, intrados [°C]")
    return figure


def locked_roll(there: Path) -> Figure:
    """Effort in the strand with the rolls in order and with #48 locked."""
    figure, (effort, index) = beside()
    for run, colour, line, label in (
        ("locked", CORNER, "-", "#48 locked"),
        ("in_order", MID, "--", "in order"),
    ):
        curve(effort, there / run, "effort", colour, label, line)
        curve(index, there / run, "axial_stress_corner_intrados", colour, label, line)
    along(effort, "effort in the strand [kN]")
    along(index, "axial stress, inner corner [MPa]", legend=False)
    return figure


def cluster(there: Path) -> Figure:
    """Shell at the mould's exit over the speed, for both superheats."""
    import pandas

    table = pandas.read_csv(there / "study" / "sweep.csv")
    figure, (shell,) = beside(1)
    rows = table.groupby("casting.superheat [K]")
    for (superheat, group), colour in zip(rows, (MID, CORNER), strict=True):
        speed, depth = group["casting.speed [m/min]"], group["shell_mid_face [mm]"]
        shell.plot(speed, depth, "o-", color=colour, label=f"superheat {superheat:g} K")
    shell.set_xlabel("casting speed [m/min]")
    shell.set_ylabel("shell at 800 mm [mm]")
    shell.legend(frameon=False)
    return figure


def calibrate(there: Path) -> Figure:
    """What was measured, and the surface of the case as it was and as fitted."""
    import pandas

    runs = {float(one.name.split("_")[2]): one for one in there.glob("fitted/machine_factor_*")}
    found = json.loads((there / "fitted" / "calibration.json").read_text(encoding="utf-8"))
    fitted = min(runs, key=lambda factor: abs(factor - found["keys"][0]["value"]))
    figure, (surface,) = beside(1)
    for factor, colour, label in ((4.0, "#999999", "as it was"), (fitted, MID, "fitted")):
        text = f"{label}, factor {factor:.2f}"
        curve(surface, runs[factor], "surface_temperature_mid_face", colour, text)
    position, measured, spread = pandas.read_csv(there / "pyrometer.csv").to_numpy(float).T
    surface.errorbar(
        position, measured, yerr=2.0 * spread, fmt="ko", ms=4, capsize=3, label="measured"
    )
    along(surface, "surface, mid-face [°C]", zones=(0.8, 1.3))
    return figure


def error(there: Path) -> Figure:
    """The shell of each run beside what is stated."""
    found = json.loads((there / "checked" / "error.json").read_text(encoding="utf-8"))
    one = found["quantities"]["shell_mid_face"]
    figure, panels = beside()
    label = f"{one['value']:.2f} ± {one['error']:.2f}"
    texts = (
        ("mesh", "cells, over those of the case"),
        ("step", "error allowed in a step, likewise"),
    )
    for axes, (size, text) in zip(panels, texts, strict=True):
        values = {float(k): v for k, v in one["from"][size]["values"].items()}
        low, high = one["value"] - one["error"], one["value"] + one["error"]
        axes.axhspan(low, high, color="#cfe5f3", zorder=0, label=label)
        axes.semilogx(values.keys(), values.values(), "o-", color=MID, label="runs")
        axes.set_xlabel(text)
        axes.set_xticks([0.5, 1.0, 2.0], ["0.5", "1", "2"])
        axes.minorticks_off()
        axes.set_ylabel("shell, mid-face [mm]")
    panels[1].sharey(panels[0])
    panels[0].legend(frameon=False)
    return figure


def report(there: Path) -> Image.Image:
    """The head of the page in the browser that `tools/browser.sh` has started."""
    from PIL import Image
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        port = os.environ["CASTFEM_BROWSER"]
        browser = playwright.chromium.connect_over_cdp(f"http://127.0.0.1:{port}")
        page = browser.new_context(viewport={"width": 1060, "height": 660}).new_page()
        page.goto((there / "speeds.html").as_uri())
        page.screenshot(path=there / "head.png")
    return Image.open(there / "head.png").convert("RGB")


PICTURES: dict[str, Callable[[Path], Figure | Image.Image]] = {
    function.__name__: function
    for function in (
        *(my_billet, my_steel, taper, spray_water, asymmetric_cooling, slab, locked_roll),
        *(cluster, calibrate, error, report),
    )
}


def picture(page: str) -> Path:
    """Where the picture of a how-to stands."""
    return HERE / "figures" / f"how_to_{page}.png"


def save(page: str, drawn: Figure | Image.Image) -> None:
    """Save a picture at its final size, with few colours and the hash of its page."""
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    if not isinstance(drawn, Image.Image):
        with tempfile.TemporaryDirectory() as folder:
            drawn.savefig(Path(folder) / "one.png", dpi=DPI)
            drawn = Image.open(Path(folder) / "one.png").convert("RGB")
    size = (WIDTH, round(drawn.height * WIDTH / drawn.width))
    small = drawn.resize(size, Image.Resampling.LANCZOS).quantize(COLOURS)
    info = PngInfo()
    info.add_text("made from", fingerprint(page))
    small.save(picture(page), optimize=True, pnginfo=info)


def run(page: str) -> Iterator[Path]:
    """A folder in which the commands of a how-to have been run."""
    from castfem.cli import execute

    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        files, commands = files_and_commands(page)
        for name, text in (files_and_commands("my_billet")[0] | files).items():
            Path(name).write_text(text, encoding="utf-8")
        for words in commands:
            if "--collect" in words:  # behind sbatch, which is not here: its runs
                execute([word for word in words[1:] if word != "--collect"])
            if execute(words[1:]):
                raise SystemExit(f"{page}: {shlex.join(words)} failed")
        yield Path(folder)
        os.chdir(HERE)


def main() -> None:
    """Make the pictures of the pages named on the command line, or all."""
    for page in sys.argv[1:] or PICTURES:
        for folder in run(page):
            save(page, PICTURES[page](folder))


if __name__ == "__main__":
    main()
