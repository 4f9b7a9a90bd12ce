"""Writes a hot tube to a file for ParaView."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from castfem.base.atomic_files import replacing
from castfem.base.types import Indices
from castfem.fem.rank_zero import on_root
from castfem.physics.mould.hot.model import HotWall


def write_tube(target: Path, wall: HotWall) -> None:
    """Write the quarter of a tube as a VTK unstructured grid (collective).

    Each second-order brick becomes eight hexahedra between its nodes. The tube has its cold shape,
    z upwards from the meniscus, m; nodal data are `temperature` (K), `displacement` (m) and
    `von_mises` (Pa).

    Args:
        target: Output file, with the ending .vtu.
        wall: The hot wall.

    Raises:
        RunFailure: The file cannot be written.
    """
    tube = wall.model.tube
    owned = tube.owned
    points = tube.gather(tube.scalars.tabulate_dof_coordinates()[:owned])
    kelvin = tube.gather(wall.heated.temperature.x.array[:owned])
    moved = tube.gather(wall.distorted.displacement.x.array[: 3 * owned].reshape(-1, 3))
    stress = tube.gather(wall.distorted.von_mises.x.array[:owned])

    def write() -> None:
        import meshio

        assert points is not None and moved is not None
        up = np.array([1.0, 1.0, -1.0])
        data = {"temperature": kelvin, "displacement": moved * up, "von_mises": stress}
        grid = meshio.Mesh(
            points * up, [("hexahedron", lattice(tube.shape))],
            {name: np.asarray(values, np.float32) for name, values in data.items()},
        )  # fmt: skip
        with replacing(target, durable=False) as temporary:
            meshio.write(temporary, grid, file_format="vtu", binary=True)

    on_root(tube.comm, write)


def lattice(shape: tuple[int, int, int]) -> Indices:
    """Hexahedra (n, 8) between the nodes of a block, the first face towards the lower end.

    Args:
        shape: Nodes across, around, along; node (i, j, k) has number (k * round + j) * across + i.
    """
    across, around, _ = shape
    i, j, k = np.meshgrid(*(np.arange(n - 1) for n in shape), indexing="ij")
    first = ((k * around + j) * across + i).ravel()
    face = np.array([0, 1, across + 1, across])
    layer = across * around
    return np.asarray(first[:, None] + np.concatenate([face + layer, face]))
