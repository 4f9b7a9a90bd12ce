"""The five tensile tests of the thesis (III.2.6, Figs 58-62) on the modified Norton-Hoff law.

The thesis has no numbers for them; the parameters here are typical of austenite at 1100 degC.
The analytical curve of each test is the elastic line up to its intersection with (163), then (163).

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from castfem.base.libraries import own_style
from castfem.base.tables import Constant
from castfem.base.types import Array
from castfem.physics.constitutive.elasticity import Elasticity
from castfem.physics.constitutive.flow_curves import modified_norton_hoff, yield_limit
from castfem.physics.constitutive.hardening_laws import NortonHoff
from castfem.physics.constitutive.uniaxial import Tension, pull

if TYPE_CHECKING:
    from matplotlib.axes import Axes

YOUNG, POISSON = 20e9, 0.3
STRENGTH, P3, P4 = 31.76e6, 0.13, 0.2  # K0 p2 in Pa
TEMPERATURE = 1373.15
RATE, LENGTH = 1e-3, 0.012  # 1/s, strain at the end


@dataclass(frozen=True, slots=True)
class TensileTest:
    """A tensile test by segments of constant strain rate."""

    figure: int  #: number of the figure in the thesis
    title: str  #: title of the figure
    p1: float  #: softening parameter
    #: strain rate in 1/s and strain at the end of each segment, from strain 0
    segments: tuple[tuple[float, float], ...]

    @property
    def rates(self) -> tuple[float, ...]:
        """Distinct strain rates of loading, 1/s."""
        return tuple(dict.fromkeys(rate for rate, _ in self.segments if rate > 0.0))

    def law(self) -> NortonHoff:
        """Return the constitutive law of the test."""
        return NortonHoff(
            Elasticity.constant(YOUNG, POISSON),
            Constant(STRENGTH), Constant(self.p1), Constant(P3), Constant(P4),
        )  # fmt: skip

    def history(self, steps: int) -> tuple[Array, Array]:
        """Return times in s and axial strains, with `steps` steps per segment."""
        time: list[Array] = [np.zeros(1)]
        strain: list[Array] = [np.zeros(1)]
        for rate, end in self.segments:
            start = strain[-1][-1]
            part = np.linspace(start, end, steps + 1)[1:]
            time.append(time[-1][-1] + (part - start) / rate)
            strain.append(part)
        return np.concatenate(time), np.concatenate(strain)

    def run(self, steps: int = 200) -> Tension:
        """Integrate the law over the test."""
        return pull(self.law(), *self.history(steps), TEMPERATURE)

    def curve(self, strain: npt.ArrayLike, rate: float) -> Array:
        """Return the stress in Pa of loading at a constant rate: elastic line, then (163)."""
        onset, _ = yield_limit(YOUNG, rate, STRENGTH, self.p1, P3, P4)
        e = np.asarray(strain, float)
        flow = modified_norton_hoff(np.maximum(e, onset), rate, STRENGTH, self.p1, P3, P4)
        return np.where(e < onset, YOUNG * e, flow)


SOFT = 50.0  # top of the curve at a strain of p4/p1 = 0.004
TESTS = (
    TensileTest(58, "constant strain rate", 0.0, ((RATE, LENGTH),)),
    TensileTest(
        59, "sudden change of strain rate", 0.0,
        ((RATE, 0.004), (10.0 * RATE, 0.008), (RATE, LENGTH)),
    ),
    TensileTest(60, "softening", SOFT, ((RATE, LENGTH),)),
    TensileTest(61, "unloading", 0.0, ((RATE, 0.006), (-RATE, 0.0057), (RATE, LENGTH))),
    TensileTest(
        62, "unloading in the softening domain", SOFT,
        ((RATE, 0.008), (-RATE, 0.0079), (RATE, LENGTH)),
    ),
)  # fmt: skip


@own_style()
def plot_tensile_tests(path: str | os.PathLike[str], steps: int = 200) -> Path:
    """Draw the five tests against their analytical curves.

    Returns:
        The path written.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 6.6), layout="constrained")
    axes = figure.subplots(2, 3).ravel()
    for axis, test in zip(axes, TESTS, strict=False):
        _draw(axis, test, test.run(steps))
    handles, labels = axes[1].get_legend_handles_labels()
    axes[5].axis("off")
    axes[5].legend(handles, labels, loc="center", frameon=False)
    target = Path(path)
    figure.savefig(target, dpi=130)
    return target


def _draw(axis: Axes, test: TensileTest, found: Tension) -> None:
    strain = np.linspace(0.0, LENGTH, 600)
    for rate, color in zip(test.rates, ("#c1272d", "#e39c37"), strict=False):
        axis.plot(
            100.0 * strain, 1e-6 * test.curve(strain, rate), color=color, lw=3.0, alpha=0.55,
            label=f"analytical, {rate:g} 1/s",
        )  # fmt: skip
    axis.plot(
        100.0 * found.axial_strain[:, 0], 1e-6 * found.axial_stress[:, 0],
        color="#0072b2", lw=1.2, label="integrated",
    )  # fmt: skip
    axis.set_title(f"Fig. {test.figure}: {test.title}", fontsize="medium")
    axis.set_xlabel("strain (%)")
    axis.set_ylabel("stress (MPa)")
    axis.set_ylim(bottom=0.0)
    axis.set_xlim(0.0, 100.0 * LENGTH)
    axis.grid(True, color="0.92")
    axis.set_axisbelow(True)
