"""What the periodic creeping strip keeps of how it began, by law.

Two shells: that of a sound pitch, and that of `lost_roll` where every second roll is lost.  Each is
brought to its periodic state from virgin steel under the moment of a clamped strip, and from other
beginnings.  Writes a table of docs/slab_bulging.md.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks import lost_roll
from benchmarks.report import Output, table
from castfem.physics.constitutive import load_elasticity, load_law
from castfem.physics.machine.bulging import CreepingStrip, Shell, Span
from castfem.physics.machine.bulging.creep import STEPS
from castfem.physics.machine.bulging.layers import Condition, Layers
from castfem.physics.machine.bulging.shell import LAYERS

SOUND = Shell(0.03, lambda depth: 1373.15 + 390.0 * depth / 0.03)
PITCHES = {
    "sound, 310 mm": (SOUND, Span(0.31, 0.2e6, 0.02)),
    "every second roll lost": (
        lost_roll.SHELL,
        Span(2 * lost_roll.PITCH, lost_roll.PRESSURE, lost_roll.SPEEDS[0]),
    ),
}
LAWS = ("kozlowski_zhu_signed", "norton_hoff_kozlowski_signed")
STRESS = 3e6  # Pa, tension and compression by turns from layer to layer
BEGINNINGS = {"stress": (STRESS, 0.8), "moment": (0.0, 1.0), "both": (STRESS, 1.0)}
"""Stress of the layers, and the moment over the roll, of that of the periodic state."""


def off(law_name: str, shell: Shell, span: Span) -> dict[str, float]:
    """Largest bulge from virgin steel, mm, and what other beginnings add to it, %."""
    law = load_law(law_name, load_elasticity(), carbon=0.1)
    strip, layers = CreepingStrip(law), Layers(law, shell.points(LAYERS, shell.breaks(law)))
    virgin, settled = strip.periodic(layers, span, STEPS)
    assert settled
    top = float(virgin.deflection[0].max())
    found = {"bulge": 1e3 * top}
    for name, (size, share) in BEGINNINGS.items():
        stress = np.zeros_like(virgin.start.stress)
        stress[:, 2] = size * np.where(np.arange(len(stress)) % 2, 1.0, -1.0)
        start = Condition(stress, layers.virgin().state)
        begun = replace(virgin, start=start, moment=share * virgin.moment)
        other, settled = strip.periodic(layers, span, STEPS, begun)
        assert settled
        found[name] = 100.0 * (float(other.deflection[0].max()) / top - 1.0)
    return found


def main(output: Output, quick: bool) -> None:
    """A row for each law and pitch."""
    rows: list[dict[str, Any]] = [
        {"law": law, "pitch": pitch} | off(law, shell, span)
        for law in LAWS
        for pitch, (shell, span) in PITCHES.items()
    ]
    output.csv("strip_start", rows)
    show(output)


def show(output: Output) -> None:
    """The table, from the data."""
    head = {
        "law": "law", "pitch": "pitch", "bulge": "bulge, mm",
        "stress": "from stresses of ±3 MPa and 0.8 of its moment, %",
        "moment": "from no stress and its own moment, %", "both": "from ±3 MPa and its moment, %",
    }  # fmt: skip
    forms = {"bulge": ".3f"} | dict.fromkeys(BEGINNINGS, "+.1f")
    if rows := output.rows("strip_start"):
        output.insert("strip start", table(rows, head, forms))
