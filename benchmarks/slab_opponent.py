"""The thermal slab as a plain script on scikit-fem: half a section down a caster, roll by roll.

It takes nothing of castfem but a name for arrays.  What it reads are the files that a script would
be given: the rolls, the tables h(T, W) and h(T), the circuits of cases/slab1200/sprays.toml.  The
steel comes as tables over the temperature.  As far as it goes no water falls off the extrados.

The unknown is the conduction integral u = int k dT, so that the stiffness is assembled once, the
matrix stays symmetric and a Newton step only changes a diagonal: nodal enthalpies with a row-sum
mass matrix, nodal fluxes likewise.  Steps go from one change of the cooling to the next.
"""

from __future__ import annotations

import csv
import math
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from time import process_time

import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.sparse import csc_matrix
from skfem import FacetBasis, MeshQuad, MeshTri

from benchmarks.plain_heat import HeatBalance, element_of, graded, laplacian, march, mass
from benchmarks.slab_line import SlabLine
from castfem.base.types import Array

STEFAN_BOLTZMANN, KELVIN, WATER = 5.670374419e-8, 273.15, 1000.0
UNITS = {
    "mm": 1e-3, "m": 1.0, "deg": math.pi / 180.0, "degC": 1.0, "L/min": 1e-3 / 60.0,
    "m/min": 1.0 / 60.0, "W/(m^2 K)": 1.0,
}  # fmt: skip
Flux = Callable[[Array], tuple[Array, Array]]
"""Heat flux and its slope, W/m2 and W/m2K (n,), of surface temperatures (n,), degC."""


def number(text: str) -> float:
    """A quantity with its unit, in SI but for degC."""
    value, unit = text.split(maxsplit=1)
    return float(value) * UNITS[unit]


def columns(path: Path) -> dict[str, list[str]]:
    """The columns of a CSV file with comments, by the first word of their headings."""
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if line[0] != "#"]
    head, *rows = csv.reader(lines, skipinitialspace=True)
    return {h.split()[0]: [row[i] for row in rows] for i, h in enumerate(head)}


@dataclass(frozen=True)
class Steel:
    """Tables over the temperature (n,), degC.

    Attributes:
        temperature: The temperatures. enthalpy: J/m3. conduction: int k dT, W/m.
        emissivity: Of the surface.
        start: Temperature at the meniscus.
    """

    temperature: Array
    enthalpy: Array
    conduction: Array
    emissivity: Array
    start: float


@dataclass
class Face:
    """A face of the strand: from where on which fluxes cool it.

    Attributes:
        nodes: Its nodes (n,). weights: Their shares of its length (n,), m.
        starts: Positions, m. fluxes: What holds from each on.
    """

    nodes: Array
    weights: Array
    starts: list[float] = field(default_factory=list)
    fluxes: list[Flux] = field(default_factory=list)

    def changes(self) -> Iterator[float]:
        """Positions at which something else begins to cool it, m."""
        for start, one, other in zip(self.starts[1:], self.fluxes, self.fluxes[1:], strict=False):
            if one != other:
                yield start

    def flux(self, position: float) -> Flux:
        """What cools it from a position, m, on."""
        at = np.searchsorted(self.starts, position + 1e-9) - 1
        return self.fluxes[max(int(at), 0)]


class Caster:
    """What the case files say of the machine.

    Args:
        folder: That of the case. steel: Gives the emissivity.
    """

    def __init__(self, folder: Path, steel: Steel) -> None:
        base, own = (tomllib.loads((folder / f).read_text()) for f in ("base.toml", "sprays.toml"))
        self.steel, self.table, section = steel, own["secondary"], base["section"]
        self.width, self.height = number(section["width"]), number(section["height"])
        self.speed = number(base["casting"]["speed"])
        rolls = columns(folder / base["machine"]["rolls"])
        self.rolls, self.diameters = (
            1e-3 * np.array(rolls[name], float) for name in ("position", "diameter")
        )
        mould = own["cooling"][0]
        self.mould_end = number(mould["to"])
        law = mould["surface"][0]
        self.mould = linear(number(law["coefficient"]), number(law["wall"]))
        self.ambient, self.water = (
            number(self.table[name]) for name in ("ambient", "water_temperature")
        )
        run_off = columns(folder / self.table["run_off"]["file"])
        self.run_off = [np.array(run_off[name], float) for name in ("temperature", "value")]
        spray = columns(folder / self.table["nozzle"][0]["table"]["file"])
        t, w, h = (np.array(spray[name], float) for name in ("temperature", "water", "value"))
        t, w = np.unique(t), np.unique(w)
        self.spray = RectBivariateSpline(t, w, h.reshape(len(t), len(w)), kx=1, ky=1)

    def gap(self, roll: int) -> tuple[float, float]:
        """Where the clear distance below a roll (from 1) begins and ends, m."""
        i, half = roll - 1, 0.5 * self.diameters
        return self.rolls[i] + half[i], self.rolls[i + 1] - half[i + 1]

    def contact(self, roll: int, wide: bool) -> tuple[float, float]:
        """Where a roll (from 1) touches, m; the narrow face is touched at no length."""
        angle = number(self.table["contact"]["angle"]) if wide else 0.0
        half, at = 0.25 * angle * self.diameters[roll - 1], self.rolls[roll - 1]
        return at - half, at + half

    def rows(self, name: str, places: Array) -> Iterator[tuple[int, float, float, Array]]:
        """Rows of nozzles on a face: roll above, start, end, m, and water at places, kg/(m2 s)."""
        models = {model["name"]: model for model in self.table["nozzle"]}
        for circuit in self.table["circuit"]:
            if not any(name.startswith(on) for on in circuit["on"]):
                continue
            model, high = models[circuit["nozzle"]], number(circuit["stand_off"])
            sizes = [number(model[key]) for key in ("angle", "angle_along")]
            across, along = (2.0 * high * math.tan(0.5 * angle) for angle in sizes)
            nozzles, (first, last) = (
                np.array([number(x) for x in circuit["across"]]),
                circuit["rolls"],
            )
            flow, edge = circuit["flow"], model["edge"]
            per_minute = np.interp(60.0 * self.speed, flow["speed"], flow["value"])
            sprayed = 1 if circuit["on"][0].startswith("wide_face_") else 2
            each = UNITS["L/min"] * per_minute / (sprayed * len(nozzles) * (last - first))
            apart = np.abs(places[:, None] - nozzles) / (0.5 * across)
            shape = np.clip((1.0 - apart) / edge, 0.0, 1.0).sum(axis=1)
            water = WATER * each / along * shape / (across * (1.0 - 0.5 * edge))
            for roll in range(first, last):
                middle = 0.5 * sum(self.gap(roll))
                yield roll, middle - 0.5 * along, middle + 0.5 * along, water

    def cooled(self, name: str, face: Face, places: Array, end: float) -> None:
        """Tell a face what cools it, from the meniscus to a position, m."""
        wide, rows = name.startswith("wide"), list(self.rows(name, places))
        face.starts, face.fluxes = [0.0], [self.mould]
        share = self.table["contact"]["share"]
        above, roll = self.mould_end, 0
        touched: tuple[float, float] | None = None
        while above < end:
            low, high = self.contact(roll + 1, wide)
            found, pitch = self._open(above, low, wide, [r[1:] for r in rows if r[0] == roll])
            if touched is not None and touched[1] - touched[0] > 1e-9:
                length = touched[1] - touched[0]
                face.starts.append(touched[0])
                face.fluxes.append(shared(share / (1.0 - share) / length, pitch))
            face.starts += [start for start, _ in found]
            face.fluxes += [flux for _, flux in found]
            roll, above, touched = roll + 1, high, (low, high)

    def _open(
        self, begin: float, end: float, wide: bool, rows: list[tuple[float, float, Array]]
    ) -> tuple[list[tuple[float, Flux]], list[tuple[float, Flux]]]:
        """Fluxes between two rolls: with their starts, and with their lengths."""
        radiation = self.radiation
        wet = self.beside_radiation(convection(*self.run_off, self.water)) if wide else radiation
        found: list[tuple[float, Flux]] = [(begin, radiation)]
        for start, stop, water in rows:
            found += [(start, self.beside_radiation(self.sprayed(water))), (stop, wet)]
        stops = [start for start, _ in found[1:]] + [end]
        pitch = [(stop - one[0], one[1]) for one, stop in zip(found, stops, strict=True)]
        return found, pitch

    def radiation(self, t: Array) -> tuple[Array, Array]:
        """Radiation to rolls and surroundings."""
        eps = np.interp(t, self.steel.temperature, self.steel.emissivity)
        rise = np.interp(t + 1.0, self.steel.temperature, self.steel.emissivity) - eps
        hot, cold = t + KELVIN, self.ambient + KELVIN
        black = STEFAN_BOLTZMANN * (hot**4 - cold**4)
        return eps * black, 4.0 * STEFAN_BOLTZMANN * eps * hot**3 + rise * black

    def beside_radiation(self, other: Flux) -> Flux:
        """Radiation and something else."""

        def flux(t: Array) -> tuple[Array, Array]:
            (q, dq), (more, slope) = self.radiation(t), other(t)
            return q + more, dq + slope

        return flux

    def sprayed(self, water: Array) -> Flux:
        """Heat to the water of sprays, of a flow at each node, kg/(m2 s)."""

        def flux(t: Array) -> tuple[Array, Array]:
            h, excess = self.spray.ev(t, water), t - self.water
            return h * excess, h + (self.spray.ev(t + 1.0, water) - h) * excess

        return flux


def linear(coefficient: float, ambient: float) -> Flux:
    """A constant coefficient, W/m2K, against a temperature, degC."""
    return lambda t: (coefficient * (t - ambient), np.full_like(t, coefficient))


def convection(temperatures: Array, coefficients: Array, ambient: float) -> Flux:
    """A coefficient over the surface temperature against an ambient temperature, degC."""

    def flux(t: Array) -> tuple[Array, Array]:
        h = np.interp(t, temperatures, coefficients)
        rise = np.interp(t + 1.0, temperatures, coefficients) - h
        return h * (t - ambient), h + rise * (t - ambient)

    return flux


def shared(factor: float, pitch: list[tuple[float, Flux]]) -> Flux:
    """Heat to a roll: a share of what its pitch loses, by lengths, m, and fluxes."""

    def flux(t: Array) -> tuple[Array, Array]:
        told = [(length, other(t)) for length, other in pitch]
        return tuple(factor * sum(n * both[i] for n, both in told) for i in (0, 1))  # type: ignore[return-value]

    return flux


def tensor_mesh(caster: Caster, fine: float, keep: float, face: float, core: float) -> MeshQuad:
    """Quadrilaterals of the half x > 0, graded to its three faces; lengths in m."""
    x = graded(fine, keep, face, 0.5 * caster.width)
    y = graded(fine, keep, core, 0.5 * caster.height)
    return MeshQuad.init_tensor(x, np.concatenate([-y[:0:-1], y]))


class Slab(HeatBalance):
    """Half the slab on its way down the caster to `end`, m.

    Args:
        mesh: Of the half. caster: What cools it. end: How far it goes, m. linear: "splu" or "cg".
    """

    def __init__(
        self, mesh: MeshQuad | MeshTri, caster: Caster, end: float, linear: str = "splu"
    ) -> None:
        steel = caster.steel
        capacity = np.diff(steel.enthalpy) / np.diff(steel.temperature)
        super().__init__(mesh, linear, float(np.median(capacity)))
        self.stiffness = csc_matrix(laplacian.assemble(self.basis))
        self.stiffness.sort_indices()
        self.steel, self.speed = steel, caster.speed
        self._of_u = np.array([steel.temperature, steel.enthalpy])
        self._slopes = np.diff(self._of_u, axis=1) / np.diff(steel.conduction)
        self.faces = []
        x, y, half = mesh.p[0], mesh.p[1], 0.5 * caster.height
        sides = {
            "wide_face_intrados": (lambda p: p[1] > half - 1e-9, x),
            "wide_face_extrados": (lambda p: p[1] < -half + 1e-9, x),
            "narrow_face": (lambda p: p[0] > 0.5 * caster.width - 1e-9, y),
        }
        for name, (on, across) in sides.items():
            facets = mesh.facets_satisfying(on, True)
            basis = FacetBasis(mesh, element_of(mesh), facets=facets, intorder=2)
            weights = np.asarray(mass.assemble(basis).sum(axis=1)).ravel()
            face = Face(np.flatnonzero(weights), weights[weights != 0.0])
            caster.cooled(name, face, across[face.nodes], end)
            self.faces.append(face)
        places = {round(place, 9) for face in self.faces for place in face.changes()}
        self.changes = [*sorted(place for place in places if place < end), end]
        self.mid_face = int(np.argmin(x + np.abs(y - half)))
        self.corner = int(np.argmax(x + y))

    def temperature(self, u: Array) -> Array:
        """T (n,), degC."""
        return np.interp(u, self.steel.conduction, self.steel.temperature)

    def _per_u(self, u: Array) -> Array:
        """dT/du and dH/du (2, n)."""
        table = self.steel.conduction
        i = np.clip(np.searchsorted(table, u, side="right") - 1, 0, len(table) - 2)
        return np.asarray(self._slopes[:, i])

    def stored(self, u: Array) -> Array:
        """Enthalpy tested by every node, J/m."""
        return np.asarray(self.area * np.interp(u, self.steel.conduction, self.steel.enthalpy))

    def _surface(self, u: Array, time: float) -> Iterator[tuple[Array, Array, Array]]:
        """Nodes of each face, heat that leaves them, W/m, and its slope with T."""
        for face in self.faces:
            q, dq = face.flux(self.speed * time)(self.temperature(u[face.nodes]))
            yield face.nodes, face.weights * q, face.weights * dq

    def flow(self, u: Array, time: float) -> Array:
        """Heat that leaves every node, W/m."""
        out = np.asarray(self.stiffness @ u)
        for nodes, heat, _ in self._surface(u, self._within(time)):
            out[nodes] += heat
        return out

    def _within(self, time: float) -> float:
        """A time within the step that ends there: what begins with its end is not felt."""
        return time - 1e-6

    def jacobian(self, u: Array, tau: float, time: float) -> csc_matrix:
        """d(stored)/du + tau d(flow)/du; symmetric."""
        warmer, fuller = self._per_u(u)
        diagonal = self.area * fuller
        for nodes, _, slope in self._surface(u, self._within(time)):
            diagonal[nodes] += tau * slope * warmer[nodes]
        return self.with_diagonal(self.stiffness * tau, diagonal)

    def instants(self, largest: float, first: float | None = None) -> list[float]:
        """Ends of the steps, s: from one change of the cooling to the next.

        Args:
            largest: Step, s.
            first: After each change, from where on steps double; without it all are even.
        """
        found = [0.0]
        for change in self.changes:
            left = change / self.speed - found[-1]
            sizes, step = [], largest if first is None else first
            while sum(sizes) < left - 1e-9:
                sizes.append(step)
                step = min(2.0 * step, largest)
            sizes = [size * left / sum(sizes) for size in sizes]
            found += (found[-1] + np.cumsum(sizes)).tolist()
        return found[1:]


def advance(slab: Slab, instants: list[float], scheme: str = "sdirk2") -> SlabLine:
    """Take the slab down the caster; results after every step."""
    steel, found = slab.steel, []
    poured = np.interp(steel.start, steel.temperature, steel.conduction)
    begun = np.full(len(slab.area), poured)
    first = float(slab.stored(begun).sum())
    slab.newton = 0
    start = process_time()
    for time, u, s in march(slab, begun, instants, scheme):
        surface = slab.temperature(u[[slab.mid_face, slab.corner]])
        found.append((slab.speed * time, *surface, 2e-6 * (first - float(s.sum()))))
    seconds = process_time() - start
    return SlabLine(*np.array(found).T, len(begun), slab.newton, seconds)
