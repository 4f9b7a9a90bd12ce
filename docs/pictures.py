"""Makes the pictures of README and of moulds, machine, slab and laws in docs: draws, shrinks them.

Run it by `.castfem/bin/python docs/pictures.py`, or with the names of the pictures to make.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from castfem.api import sensitivities
from castfem.cli.mould import draw_hot_mould
from castfem.model import load_any, load_case
from castfem.model.machine_from_case import known_resistance
from castfem.model.mould_from_case import build_mould
from castfem.model.tensile import TensileCase
from castfem.physics.constitutive.flow_curves import Austenite
from castfem.physics.constitutive.uniaxial import pull
from castfem.post.plots.figures import draw_figures
from castfem.post.plots.machine import draw as draw_machine
from castfem.post.plots.machine import draw_drives
from castfem.post.plots.mould import draw as draw_mould
from castfem.post.plots.studies import draw_tornado
from castfem.post.plots.style import new_figure
from castfem.runs import loop
from castfem.runs.tensile.tensile_test import TensileTest
from castfem.studies.identification.fit import identify
from castfem.studies.identification.measured import TensileData

HERE = Path(__file__).parent
WIDTH, COLOURS = 900, 256  # pixels in all, and a palette that keeps the file small
PAIR = ("temperature", "von_mises")


# The tapers the thesis reads off its idealised billet, (302) and (303).
MOULD = {
    "title": "125 mm billet, tapers of (302) and (303)",
    "mould": {
        "length": "600 mm",
        "taper": {
            "face": "-0.53 %/m",
            "corner": [{"to": "125 mm", "taper": "0 %/m"}, {"taper": "0.57 %/m"}],
        },
    },
}


def billet() -> None:
    """Put the temperature and the stress of the shell at the mould's exit side by side."""
    case = load_case(HERE.parent / "cases" / "billet125" / "idealised.toml")
    with tempfile.TemporaryDirectory() as folder:
        loop.run(case, folder)
        drawn = {path.stem: path for path in draw_figures(folder)}
        pictures = [Image.open(drawn[name]).convert("RGB") for name in PAIR]
        height = min(p.height for p in pictures)
        scaled = [p.resize((round(p.width * height / p.height), height)) for p in pictures]
        sheet = Image.new("RGB", (sum(p.width for p in scaled), height), "white")
        left = 0
        for picture in scaled:
            sheet.paste(picture, (left, 0))
            left += picture.width
        shrink(sheet, "billet")


def mould() -> None:
    """Draw what `castfem mould` draws."""
    case = load_case(HERE.parent / "cases" / "billet125" / "coupled.toml").with_(MOULD)
    assert case.mould is not None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mould.png"
        draw_mould(build_mould(case.mould, case.section), path, case.title)
        shrink(Image.open(path).convert("RGB"), "mould")


def hot_mould() -> None:
    """Draw what `castfem mould --hot` draws."""
    case = load_case(HERE.parent / "cases" / "billet125" / "hot.toml")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "hot.png"
        draw_hot_mould(case, path, "billet125/hot", coupled=False)
        shrink(Image.open(path).convert("RGB"), "hot_mould")


def machine() -> None:
    """Draw what `castfem machine --run` draws of the slab."""
    case = load_case(HERE.parent / "cases" / "slab1200" / "thermal.toml")
    rolls = None if case.machine is None else case.machine.pairs()
    assert rolls is not None
    with tempfile.TemporaryDirectory() as folder:
        solid = loop.run(case, folder).quantities["metallurgical_length"].value
        path = Path(folder) / "machine.png"
        marks = [(solid, f"solid at {solid:.4g} m")]
        draw_machine(rolls, case.section.height, path, mould_end=case.mould_exit(), marks=marks)
        shrink(Image.open(path).convert("RGB"), "machine")


def extraction() -> None:
    """Draw how the drives of the slab share the resistance of its rolls."""
    table = load_case(HERE.parent / "cases" / "slab1200" / "reference.toml").machine
    rolls = None if table is None else table.pairs()
    assert table is not None and table.extraction is not None and rolls is not None
    known = known_resistance(table.extraction, table)
    assert known is not None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "extraction.png"
        draw_drives(rolls, known, path)
        shrink(Image.open(path).convert("RGB"), "extraction")


def slab() -> None:
    """Draw the unrolled surface of the coarse slab, and the strand in its caster."""
    case = load_case(HERE.parent / "cases" / "slab1200" / "bending.toml")
    with tempfile.TemporaryDirectory() as folder:
        loop.run(case, folder)
        drawn = {path.stem: path for path in draw_figures(folder)}
        for name in ("maps", "caster"):
            shrink(Image.open(drawn[name]).convert("RGB"), f"slab_{name}")


def roll_to_roll() -> None:
    """Draw the surface temperatures of slab1200/sprays above what its faces meet."""
    case = load_case(HERE.parent / "cases" / "slab1200" / "sprays.toml")
    with tempfile.TemporaryDirectory() as folder:
        loop.run(case, folder)
        drawn = {path.stem: path for path in draw_figures(folder)}
        shrink(Image.open(drawn["roll_to_roll"]).convert("RGB"), "roll_to_roll")


def cycles() -> None:
    """Draw the peak tension of 80 cycles of temperature, with both kinds of hardening."""
    figure = new_figure(9.0, 3.4)
    for axes, swing in zip(figure.subplots(1, 2), (75, 125), strict=True):
        for name, colour in (("kozlowski_zhu", "#0072b2"), ("norton_hoff_kozlowski", "#e39c37")):
            for law, line in ((name, "--"), (f"{name}_signed", "-")):
                file = HERE.parent / "cases" / "tensile" / f"cycles_{swing}.toml"
                case = load_any(file, [f"tensile.material={law}", "output.figures=false"])
                assert isinstance(case, TensileCase)
                test = TensileTest(case)
                found = pull(
                    test.law, test.time, test.strain, test.temperature, thermal_strain=test.thermal
                )
                peak = [1e-6 * found.axial_stress[c, 0].max() for c in test.cycles]
                axes.plot(range(1, len(peak) + 1), peak, line, color=colour, label=law)
        axes.set_title(f"{swing} K about 950 degC")
        axes.set_xlabel("cycle")
        axes.set_ylim(0.0, 75.0)
    figure.axes[0].set_ylabel("peak tension [MPa]")
    figure.axes[0].legend(loc="upper left")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cycles.png"
        figure.savefig(path, dpi=150, bbox_inches="tight")
        shrink(Image.open(path).convert("RGB"), "cycles")


def sensitivity() -> None:
    """Draw what some numbers do to the billet."""
    spreads = (
        "cooling.mould.coefficient=100 W/(m^2 K)",
        *("casting.superheat=10 K", "casting.speed=0.1 m/min"),
        *("steel.conductivity=5 %", "steel.solidus=5 K"),
    )
    found = sensitivities("billet125/thermal", spreads, "heat_removed,shell_mid_face")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "sensitivity.png"
        draw_tornado(found, path)
        shrink(Image.open(path).convert("RGB"), "sensitivity")


def laws() -> None:
    """Draw the tensile tests of the thesis, and a law fitted to curves at four temperatures."""
    sys.path.insert(0, str(HERE.parent))
    from benchmarks.thesis_tensile import plot_tensile_tests

    plot_tensile_tests(HERE / "figures" / "tensile_tests.png")
    celsius, rates, strains = [900.0, 1050.0, 1200.0, 1350.0], [1e-4, 1e-3, 5e-3], (2e-3, 5e-2, 20)
    grid = np.meshgrid(np.array(celsius) + 273.15, rates, np.geomspace(*strains), indexing="ij")
    t, r, e = (values.ravel() for values in grid)
    data = TensileData(t, r, e, Austenite.at(t, 0.10).stress(e, r), "Kozlowski III, 0.10 %C")
    identify(data).plot(HERE / "figures" / "identify.png")


def shrink(picture: Image.Image, name: str) -> None:
    """Save a picture at its final size and with few colours."""
    size = (WIDTH, round(picture.height * WIDTH / picture.width))
    small = picture.resize(size, Image.Resampling.LANCZOS)
    # Of equal shares in colours; one by how often they occur would merge steps of the scales.
    small = small.quantize(COLOURS, method=Image.Quantize.FASTOCTREE)
    small.save(HERE / "figures" / f"{name}.png", optimize=True)


def main() -> None:
    """Make the pictures named on the command line, or all."""
    pictures = {
        "billet": billet,
        "mould": mould,
        "hot_mould": hot_mould,
        "machine": machine,
        "extraction": extraction,
        "roll_to_roll": roll_to_roll,
        "slab": slab,
        "cycles": cycles,
        "sensitivity": sensitivity,
        "laws": laws,
    }
    for name in sys.argv[1:] or pictures:
        pictures[name]()


if __name__ == "__main__":
    main()
