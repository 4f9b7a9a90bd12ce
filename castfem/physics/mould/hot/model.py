"""The hot mould: from the heat flux of a strand, or a profile, to the working wall."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mpi4py import MPI

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.errors import RunFailure
from castfem.base.tables import Constant, Table
from castfem.base.types import Array
from castfem.fem.rank_zero import on_root
from castfem.meshes.tube import TubeMesh, graded, tube
from castfem.physics.mould.displaced import WallDisplacement
from castfem.physics.mould.hot.conduction import Conduction, FaceLoad, Heated
from castfem.physics.mould.hot.copper import MELTS, Copper
from castfem.physics.mould.hot.distortion import Distorted, Distortion, Support
from castfem.physics.mould.hot.flux import FluxMap
from castfem.physics.mould.hot.solvers import Method
from castfem.physics.mould.hot.tube import Tube
from castfem.physics.mould.mould import Mould
from castfem.physics.mould.perimeter import Places, corner_of, lengths, sides_of


@dataclass(frozen=True, slots=True)
class TubeSettings:
    """A tube around a cavity: size, cooling, support, mesh."""

    thickness: float  #: wall thickness, m
    above: float  #: length above the meniscus, m
    coefficient: Constant | Table  #: heat transfer coefficient of the water over position, W/(m2 K)
    water: Constant | Table  #: temperature of the water over position, K
    support: Support = "hung"  #: support of the tube
    #: temperature of the face towards the strand over position, K, instead of a flux
    hot_face: Constant | Table | None = None
    #: temperature of the water side over position, K, instead of water
    water_side: Constant | Table | None = None
    across: int = 2  #: number of cells through the wall
    size: float = 0.012  #: largest cell size round the wall and along it, m
    method: Method = "auto"  #: method of the linear solvers


@dataclass(frozen=True, slots=True, eq=False)
class HotWall:
    """The inner wall in the working condition, from the meniscus to the exit."""

    #: displacement from the cold wall, in the plane of each section, carried along with the copper
    #: (its axial displacement, a millimetre, moves a tapered wall by micrometres)
    displacement: WallDisplacement
    hot: Array  #: temperature of the face towards the strand (p, w), K
    outer: Array  #: temperature of the water side (p, w), K
    longer: float  #: elongation of the tube, m
    heated: Heated  #: result of the conduction
    distorted: Distorted  #: result of the elasticity
    model: HotMould  #: the tube of this wall

    @property
    def corner(self) -> int | None:
        """Index of the place in the middle of the corner; None for a round."""
        mould = self.model.mould
        return corner_of(sides_of(mould.cavity, mould.tapers, 0.0), self.displacement.ways)

    def profile(self) -> tuple[Array, Array]:
        """Return positions, and the hot face's temperature averaged around the quarter (p,), K."""
        ways = self.displacement.ways
        mean = np.trapezoid(self.hot, ways, axis=1) / (ways[-1] - ways[0])
        return self.displacement.positions, np.asarray(mean)


class HotMould:
    """The tube of a mould.

    Args:
        comm: Communicator (collective).
        mould: The cold mould, of a rectangle with rounded corners or a round.
        copper: Properties of the copper.
        settings: Wall, water, support and mesh.

    Attributes:
        tube: The tube.
        positions: Positions of the mesh's layers, m.
        places: Places of its columns.
        ways: Lengths to these, along the wall at the meniscus, m.

    Raises:
        ValueError: A wall of this cavity cannot be offset.
    """

    def __init__(
        self, comm: MPI.Comm, mould: Mould, copper: Copper, settings: TubeSettings
    ) -> None:
        self.mould, self.copper, self.settings = mould, copper, settings
        start = sides_of(mould.cavity, mould.tapers, 0.0)
        right, arc, upper = lengths(start)
        faces = math.ceil(max(right, upper) / settings.size)
        corner = max(4, math.ceil(arc / settings.size))  # more for a round
        self.places = Places.spread(start, max(faces, 1), corner)
        self.ways = self.places.ways(start)
        fine = settings.size / 3.0  # at the meniscus
        self.positions = graded(-settings.above, mould.length, fine, settings.size)
        self.tube = Tube(comm, on_root(comm, self._mesh))

    def _mesh(self) -> TubeMesh:
        """Return the mesh of the cold tube; above the meniscus it continues without taper."""
        rows = [
            self.places.on(sides_of(self.mould.cavity, self.mould.tapers, max(float(z), 0.0)))
            for z in self.positions
        ]
        inner, normals = (np.array(part) for part in zip(*rows, strict=True))
        meniscus = int(np.argmin(np.abs(self.positions)))
        return tube(
            inner, normals, self.positions, self.settings.thickness, self.settings.across,
            meniscus=meniscus,
        )  # fmt: skip

    def solve(self, flux: FluxMap | None) -> HotWall:
        """Return the working wall (collective; equal on all ranks).

        Args:
            flux: Flux into the hot face; None if its temperature is given.

        Raises:
            RunFailure: A solver does not converge, or the copper would melt.
        """
        heated = self.heat(flux)
        distorted = self.distortion().solve(heated.temperature)
        owned = self.tube.owned
        kelvin = self.tube.gather(heated.temperature.x.array[:owned])
        moved = self.tube.gather(distorted.displacement.x.array[: 3 * owned].reshape(-1, 3))
        both = None if kelvin is None or moved is None else self._read(kelvin, moved)
        wall, hot, outer, longer = self.tube.comm.bcast(both)
        return HotWall(wall, hot, outer, longer, heated, distorted, self)

    def heat(self, flux: FluxMap | None) -> Heated:
        """Return the temperature of the copper only, like `solve`."""
        heated = Conduction(self.tube, self.copper, self.settings.method).solve(self._load(flux))
        if heated.hottest > MELTS:
            raise RunFailure(
                f"mould.tube: the copper would reach {heated.hottest - ZERO_CELSIUS:.0f} degC and "
                f"melts at {MELTS - ZERO_CELSIUS:.0f} degC: check water_coefficient, thickness "
                "and the heat that it takes up (flux, or that of the strand)"
            )
        return heated

    def temperature_at(self, heated: Heated, positions: Array, way: float, depth: float) -> Array:
        """Return the temperature of the copper (n,), K, linear between the nodes (collective).

        Args:
            heated: Result of `heat`.
            positions: Positions below the meniscus (n,), m.
            way: Place around the wall, m.
            depth: Distance from the hot face, m.
        """
        from scipy.interpolate import RegularGridInterpolator

        kelvin = self.tube.gather(heated.temperature.x.array[: self.tube.owned])
        found = None
        if kelvin is not None:
            across, around, along = self.tube.shape
            grid = (self.positions, self.ways, np.linspace(0.0, self.settings.thickness, across))
            read = RegularGridInterpolator(grid, kelvin.reshape(along, around, across))
            ones = np.ones(len(positions))
            found = read(np.column_stack([positions, way * ones, depth * ones]))
        return np.asarray(self.tube.comm.bcast(found))

    def distortion(self) -> Distortion:
        """Return the elasticity of this tube."""
        return Distortion(self.tube, self.copper, self.settings.support, self.settings.method)

    def _read(self, kelvin: Array, moved: Array) -> tuple[WallDisplacement, Array, Array, float]:
        """Return displacement and temperatures below the meniscus, and the elongation."""
        across, around, along = self.tube.shape
        block = kelvin.reshape(along, around, across)
        wall = moved.reshape(along, around, across, 3)
        below = self.positions > -1e-9 * self.mould.length
        positions = self.positions[below].copy()
        positions[0] = 0.0
        inner = np.ascontiguousarray(wall[below, :, 0, :2])
        inner[:, 0, 1] = 0.0
        inner[:, -1, 0] = 0.0
        shape = WallDisplacement(positions, self.ways, inner)
        longer = float(wall[-1, :, :, 2].mean() - wall[0, :, :, 2].mean())
        return shape, block[below, :, 0], block[below, :, -1], longer

    def _load(self, flux: FluxMap | None) -> FaceLoad:
        """Return the loads on the faces at the nodes of the mesh (not collective)."""
        below = np.maximum(self.positions, 0.0)
        across, around, _ = self.tube.shape

        def spread(values: Array) -> Array:
            """Values (along, round) at all nodes of the wall's columns."""
            table = np.broadcast_to(values, (len(self.positions), around))
            return np.repeat(table.reshape(-1), across)

        def along(profile: Constant | Table) -> Array:
            return spread(np.asarray(profile(below))[:, None])

        settings = self.settings
        given = 0.0 if flux is None else spread(flux.on(self.positions, self.ways))
        return FaceLoad(
            given,
            0.0 if settings.water_side is not None else along(settings.coefficient),
            along(settings.water),
            None if settings.hot_face is None else along(settings.hot_face),
            None if settings.water_side is None else along(settings.water_side),
        )
