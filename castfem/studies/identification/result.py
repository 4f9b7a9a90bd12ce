"""Result of fitting the modified Norton-Hoff law: parameters, warnings, law, file, picture."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.libraries import own_style
from castfem.base.tables import Constant, Table
from castfem.base.types import Array
from castfem.physics.constitutive.elasticity import Curve, Elasticity
from castfem.physics.constitutive.flow_curves import modified_norton_hoff
from castfem.physics.constitutive.hardening_laws import NortonHoff
from castfem.studies.identification.measured import TensileData

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAMES = ("strength", "p1", "p3", "p4")
# width of an interval above which the parameter is poorly determined
WIDE = {"strength": 1.0, "p3": 0.1, "p4": 0.2}


@dataclass(frozen=True, slots=True)
class Fit:
    """Parameters at one temperature."""

    temperature: float  #: K
    values: tuple[float, float, float, float] | tuple[float, ...]  #: ln(K0 p2 / Pa), p1, p3, p4
    half_width: tuple[float, ...]
    """Half widths of their confidence intervals; infinite if undetermined, 0 if fixed."""
    at_bound: tuple[bool, ...]  #: which of them are at a bound
    points: int  #: number of points used
    rates: int  #: number of strain rates
    rms: float  #: root mean square of the residual in ln(stress)
    worst: float  #: largest residual in ln(stress)

    @property
    def strength(self) -> float:
        """K0 p2, Pa (s^p3)."""
        return math.exp(self.values[0])


@dataclass(frozen=True, slots=True)
class IdentifiedLaw:
    """A fitted law."""

    fits: tuple[Fit, ...]  #: one per temperature, increasing
    given: TensileData  #: all points of the file
    used: TensileData  #: points used in the fit
    degree: int | None
    """Degree of the polynomials over temperature; None if temperatures are fitted separately."""
    confidence: float  #: probability of the intervals, such as 0.95

    @property
    def temperature(self) -> Array:
        """K, (k,)."""
        return np.array([fit.temperature for fit in self.fits])

    def parameter(self, name: str) -> Array:
        """Values of "strength" (Pa), "p1", "p3" or "p4" at the temperatures, (k,)."""
        column = np.array([fit.values[NAMES.index(name)] for fit in self.fits])
        return np.exp(column) if name == "strength" else column

    def interval(self, name: str) -> tuple[Array, Array]:
        """Lower and upper ends of the confidence intervals, (k,) each."""
        k = NAMES.index(name)
        column = np.array([fit.values[k] for fit in self.fits])
        half = np.array([fit.half_width[k] for fit in self.fits])
        ends = column - half, column + half
        if name == "strength":
            return np.exp(ends[0]), np.exp(np.minimum(ends[1], 700.0))
        return ends

    def law(self, elasticity: Elasticity) -> NortonHoff:
        """The law for a computation, with an automatic yield limit."""
        strength, p1, p3, p4 = (self._curve(name) for name in NAMES)
        return NortonHoff(elasticity, strength, p1, p3, p4)

    def _curve(self, name: str) -> Curve:
        values = tuple(float(v) for v in self.parameter(name))
        if len(values) == 1:
            return Constant(values[0])
        return Table(
            "temperature", tuple(float(t) for t in self.temperature), values, name == "strength"
        )

    def stress(self, fit: Fit, strain: Array, rate: float) -> Array:
        """Stress of the fitted curve, Pa."""
        return modified_norton_hoff(strain, rate, fit.strength, *fit.values[1:])

    def statements(self) -> tuple[str, ...]:
        """Statements on what the data do not determine, one sentence each."""
        found = []
        for k, name in enumerate(NAMES):
            open_ = [f for f in self.fits if math.isinf(f.half_width[k])]
            held = [f for f in self.fits if f.at_bound[k]]
            label = "strength K0 p2" if name == "strength" else name
            if open_:
                found.append(
                    f"{label} cannot be found at {_places(open_)}{_cause(name, open_)}; "
                    "the value there is a guess"
                )
            if held and name == "p1":
                found.append(
                    f"p1 is held by its bound at {_places(held)}: the curves do not soften there"
                )
            elif held:
                found.append(f"{label} is held by its bound at {_places(held)}")
            vague = [f for f in self.fits if _vague(f, k)]
            if vague:
                found.append(f"{label} is known poorly at {_places(vague)}: {_why_vague(name)}")
        cold = [f for f in self.fits if f.rms > 0.1]
        if cold:
            found.append(f"the law misses the curves by more than 10 % rms at {_places(cold)}")
        return tuple(found)

    def report(self) -> str:
        """A table for the terminal: parameters with intervals, residuals, warnings."""
        percent = f"{100.0 * self.confidence:g} %"
        head = (
            f"{'T degC':>7}{'K0 p2 MPa s^p3':>20}{'p1':>18}{'p3':>19}{'p4':>19}"
            f"{'points':>8}{'rates':>7}{'rms %':>8}{'max %':>8}"
        )
        lines = [head]
        for fit in self.fits:
            cells = f"{fit.temperature - ZERO_CELSIUS:>7.0f}"
            half = 1e-6 * fit.strength * min(math.expm1(min(fit.half_width[0], 700.0)), 1e300)
            cells += f"{_with_half(1e-6 * fit.strength, half, 2):>20}"
            for k, width, digits in ((1, 18, 2), (2, 19, 4), (3, 19, 4)):
                text = _with_half(fit.values[k], fit.half_width[k], digits)
                if fit.half_width[k] == 0.0:
                    text = f"{fit.values[k]:.{digits}g} (held)"
                cells += f"{text:>{width}}"
            cells += f"{fit.points:>8}{fit.rates:>7}{100 * fit.rms:>8.2f}{100 * fit.worst:>8.2f}"
            lines.append(cells)
        lines.append(f"+- is the half width of the {percent} confidence interval")
        return "\n".join([*lines, *self.statements()])

    def to_toml(self) -> str:
        """The law as a parameter file for `castfem.physics.constitutive.load_law`."""
        how = "each temperature by itself"
        if self.degree is not None:
            how = f"polynomials of degree {self.degree} over temperature"
        strains, rates = self.used.strain, self.used.rate
        lines = [
            'law = "norton_hoff"',
            'description = "Modified Norton-Hoff law, [Pascon2003] (163), fitted to '
            f'{_text(self.used.name)}"',
            f'source = "castfem identify, {how}; strains {strains.min():.3g} to '
            f'{strains.max():.3g}, rates {rates.min():.3g} to {rates.max():.3g} 1/s"',
            'status = "C"',
            'yield_limit = "automatic"',
            "",
            f"# +- is the half width of the {100 * self.confidence:g} % confidence interval.",
            *(f"# Careful: {statement}." for statement in self.statements()),
        ]
        for fit in self.fits:
            lines.append(
                f"# {fit.temperature - ZERO_CELSIUS:.6g} degC: rms {100 * fit.rms:.2f} %, largest "
                f"{100 * fit.worst:.2f} %, {fit.points} points, {fit.rates} rates"
            )
        for k, name in enumerate(NAMES):
            lines += ["", *self._table(k, name)]
        return "\n".join(lines) + "\n"

    def _table(self, k: int, name: str) -> list[str]:
        scale = 1e-6 if name == "strength" else 1.0
        values = [f"{scale * v:.6g}" for v in self.parameter(name)]
        half = [f.half_width[k] for f in self.fits]
        note = ", ".join(_half_text(h, k == 0) for h in half)
        if len(values) == 1:
            unit = " MPa" if name == "strength" else ""
            value = f'"{values[0]}{unit}"' if unit else values[0]
            return [f"[{name}]  # +- {note}", f"value = {value}"]
        rows = ", ".join(f"{t - ZERO_CELSIUS:.6g}" for t in self.temperature)
        lines = [f"[{name}]", f"temperature = [{rows}]", 'temperature_unit = "degC"']
        lines.append(f"value = [{', '.join(values)}]")
        lines += ['unit = "MPa"'] if name == "strength" else []
        return [*lines, f"# +- {note}"]

    @own_style()
    def plot(self, path: str | os.PathLike[str]) -> Path:
        """Draw the curves with the fit, and the parameters over temperature; return the path."""
        from matplotlib.figure import Figure

        shown, panels = self.fits, 12
        if len(shown) > panels:
            chosen = np.linspace(0, len(shown) - 1, panels).round().astype(int)
            shown = tuple(shown[i] for i in chosen)
        rows = (len(shown) + 3) // 4
        figure = Figure(figsize=(13.0, 3.0 * (rows + 1)), layout="constrained")
        axes = figure.subplots(rows + 1, 4, squeeze=False)
        self._draw_curves(figure, axes[:-1].ravel(), shown)
        for name, axis in zip(NAMES, axes[-1], strict=True):
            self._draw_parameter(axis, name)
        target = Path(path)
        figure.savefig(target, dpi=120)
        return target

    def _draw_curves(self, figure: Figure, axes: Any, shown: tuple[Fit, ...]) -> None:
        """Measured points and fitted curves, one panel per temperature."""
        from matplotlib import colormaps
        from matplotlib.lines import Line2D

        rates = np.unique(self.used.rate)
        shades = colormaps["viridis"](np.linspace(0.0, 0.85, len(rates)))
        colors = dict(zip(rates, shades, strict=True))
        for axis, fit in zip(axes, shown, strict=False):
            for rate in rates:
                here = (self.given.temperature == fit.temperature) & (self.given.rate == rate)
                if not here.any():
                    continue
                e, s = self.given.strain[here], self.given.stress[here]
                axis.plot(100 * e, 1e-6 * s, ".", ms=3, color=colors[rate])
                x = np.linspace(self.used.strain.min(), e.max(), 200)
                y = self.stress(fit, x, float(rate))
                axis.plot(100 * x, 1e-6 * y, color=colors[rate])
            title = f"{fit.temperature - ZERO_CELSIUS:.0f} °C, rms {100 * fit.rms:.1f} %"
            axis.set_title(title, fontsize="medium")
            axis.set_xlabel("strain (%)")
            axis.set_ylabel("stress (MPa)")
            axis.set_ylim(bottom=0.0)
            axis.grid(True, color="0.92")
        for axis in axes[len(shown) :]:
            axis.remove()
        lines = [Line2D([], [], color=colors[rate]) for rate in rates]
        labels = [f"{rate:.3g} 1/s" for rate in rates]
        figure.legend(lines, labels, loc="outside upper center", ncols=min(len(rates), 8))

    def _draw_parameter(self, axis: Axes, name: str) -> None:
        """One parameter with its intervals; undetermined values are hollow."""
        scale = 1e-6 if name == "strength" else 1.0
        t = self.temperature - ZERO_CELSIUS
        values = scale * self.parameter(name)
        low, high = (scale * end for end in self.interval(name))
        known = np.isfinite([f.half_width[NAMES.index(name)] for f in self.fits])
        bars = np.abs(np.stack([values - low, high - values]))[:, known]
        axis.errorbar(
            t[known], values[known], yerr=bars, fmt="o-", ms=4, capsize=3, color="#0072b2"
        )
        axis.plot(t[~known], values[~known], "o", mfc="white", color="#c1272d")
        if name == "strength":
            axis.set_yscale("log")
            axis.yaxis.set_major_formatter("{x:g}")
            axis.yaxis.set_minor_formatter("{x:g}")
        axis.set_xlabel("temperature (°C)")
        axis.set_ylabel("K0 p2 (MPa s^p3)" if name == "strength" else name)
        axis.grid(True, color="0.92")


def _places(fits: list[Fit]) -> str:
    """Temperatures as a list in a sentence."""
    return ", ".join(f"{f.temperature - ZERO_CELSIUS:.0f}" for f in fits) + " degC"


def _cause(name: str, fits: list[Fit]) -> str:
    if name in ("p3", "strength") and all(f.rates == 1 for f in fits):
        return " (one strain rate only)"
    return ""


def _vague(fit: Fit, k: int) -> bool:
    """Whether an interval is finite but very wide."""
    half = fit.half_width[k]
    if math.isinf(half) or fit.at_bound[k]:
        return False
    if NAMES[k] == "p1":
        return 0.0 < abs(fit.values[k]) <= half
    return half > WIDE[NAMES[k]]


def _why_vague(name: str) -> str:
    if name == "p1":
        return "its interval holds 0, softening is not proven"
    return "the interval is as wide as the parameter's usual range"


def _with_half(value: float, half: float, digits: int) -> str:
    if math.isinf(half) or half > 1e200:
        return f"{value:.{digits}f} (open)"
    return f"{value:.{digits}f} +- {half:.{digits}f}"


def _half_text(half: float, relative: bool) -> str:
    if math.isinf(half):
        return "open"
    if half == 0.0:
        return "held"
    return f"{100.0 * half:.2g} %" if relative else f"{half:.2g}"


def _text(name: str) -> str:
    """A file name as a TOML text."""
    return name.replace("\\", "/").replace('"', "'")
