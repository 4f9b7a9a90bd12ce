"""The strand in space: slices at the positions of the rolls, read by VTK's formats."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import meshio
import numpy as np
import pytest
from synthetic_maps import LENGTH, THICK, WIDE, rolls, write_maps

from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.cli.app import app
from castfem.meshes import SectionMesh
from castfem.meshes.build import build
from castfem.physics.machine.side import Side
from castfem.runs.output.stacked_slices import between, write_strand
from castfem.runs.output.surface_maps import SurfaceMaps
from castfem.runs.output.xdmf import FieldWriter

AT = (0.0, 0.9, 1.5, LENGTH)
HALF = 0.5 * WIDE
EVERY = 0.02
SIZES = {"surface_size": 0.01, "core_size": 0.02}


def section(cell: str = "quadrilateral", order: int = 1) -> SectionMesh:
    """Return half of the slab; quadrilaterals of first order are numbered as for the maps."""
    return build(
        "rectangle", width=WIDE, height=THICK, symmetry="half", cell=cell, order=order, **SIZES
    )


def kelvin(mesh: SectionMesh, position: float) -> Array:
    return 1500.0 - 100.0 * position + 300.0 * mesh.points[:, 0]


def write_fields(folder: Path, mesh: SectionMesh) -> None:
    """Write temperature, 1 mm of motion inwards, 2 mm across, axial stress, at four positions."""
    with FieldWriter(folder, mesh.points, mesh.cells, mesh.cell, mesh.order) as fields:
        for position in AT:
            count = len(mesh.points)
            stress = np.zeros((count, 4))
            stress[:, 2] = 1e6 * position
            fields.write(
                50.0 * position,
                position,
                {
                    "temperature": kelvin(mesh, position),
                    "displacement": np.tile([2e-3, 1e-3], (count, 1)),
                    "stress": stress,
                },
            )


def strand(folder: Path, mesh: SectionMesh, every: float = EVERY) -> tuple[meshio.Mesh, Side]:
    """Return the file, as meshio reads it, and its side view."""
    side = Side(rolls(), THICK, LENGTH)
    write_fields(folder, mesh)
    target = folder / "strand.vtu"
    points, cells = write_strand(folder, target, side, every)
    found = meshio.read(target)
    assert (len(found.points), len(found.cells[0].data)) == (points, cells)
    return found, side


def volumes(points: Array, cells: Array) -> Array:
    """Return volumes of hexahedra, by six tetrahedra round a diagonal; positive in VTK's order."""
    corners = points[cells]
    ring = (1, 2, 3, 7, 4, 5, 1)
    tetrahedra = [(0, a, b, 6) for a, b in pairwise(ring)]
    parts = []
    for a, b, c, d in tetrahedra:
        edges = (corners[:, b] - corners[:, a], corners[:, c] - corners[:, a])
        normal = np.cross(*edges)
        parts.append(np.einsum("ij,ij->i", normal, corners[:, d] - corners[:, a]) / 6.0)
    return np.asarray(np.sum(parts, axis=0))


def test_strand_has_the_volume_of_its_path(tmp_path: Path) -> None:
    """Its area times the length of its middle (Pappus), no cell inverted."""
    found, side = strand(tmp_path, section())
    (block,) = found.cells
    assert block.type == "hexahedron"
    each = volumes(found.points, block.data)
    assert each.min() > 0.0
    inside = side.s <= LENGTH
    middle = 0.5 * (side.extrados + side.intrados)[inside]
    length = np.linalg.norm(np.diff(middle, axis=0), axis=1).sum()
    assert length < LENGTH - 0.005  # positions are those of the extrados
    assert each.sum() == pytest.approx(HALF * THICK * length, rel=1e-4)
    assert found.points[:, 2].max() == pytest.approx(0.0, abs=1e-12)
    assert found.points[:, 1].min() == pytest.approx(0.0) and found.points[:, 1].max() == HALF


def test_faces_are_on_the_arcs_of_the_rolls(tmp_path: Path) -> None:
    """Between rolls 4 and 6 the extrados has a radius of 4 m, the intrados one of 3.9 m."""
    found, side = strand(tmp_path, section())
    position = found.point_data["position"]
    arc = (position > 1.2) & (position < 1.6)
    centre = side.at(side.extrados, 1.4) + 4.0 * side.at(side.inward, 1.4)
    radius = np.hypot(*(found.points[arc][:, [0, 2]] - centre).T)
    assert radius.max() == pytest.approx(4.0, abs=2e-6)
    assert radius.min() == pytest.approx(4.0 - THICK, abs=2e-6)


def test_values_are_linear_between_the_slices(tmp_path: Path) -> None:
    mesh = section()
    found, side = strand(tmp_path, mesh)
    position, count = found.point_data["position"].reshape(-1, len(mesh.points)), len(mesh.points)
    rows = position[:, 0]
    assert all(np.abs(rows - at).min() < 1e-6 for at in AT)
    assert np.diff(rows).max() < EVERY + 1e-6  # in single precision
    expected = np.array([kelvin(mesh, z) for z in rows])
    assert found.point_data["temperature"].reshape(-1, count) == pytest.approx(expected, abs=1e-3)
    stress = found.point_data["axial_stress"].reshape(-1, count)
    assert stress == pytest.approx(np.broadcast_to(1e6 * rows[:, None], stress.shape), rel=1e-5)
    moved = found.point_data["displacement"].reshape(-1, count, 3)
    inward = side.inward_at(rows.astype(float))
    assert moved[..., 1] == pytest.approx(np.full(moved.shape[:2], 2e-3))
    for i in (0, 1):
        assert moved[:, 5, 2 * i] == pytest.approx(1e-3 * inward[:, i], abs=1e-9)


@pytest.mark.parametrize("every", [0.025, 0.4])
def test_indexes_are_only_on_the_surface(tmp_path: Path, every: float) -> None:
    """Their largest value is in the file for any distance of its rows."""
    mesh = section()
    line = write_maps(tmp_path)
    found, _ = strand(tmp_path, mesh, every)
    values = found.point_data["I1"].reshape(-1, len(mesh.points))
    inside = np.setdiff1d(np.arange(len(mesh.points)), line.nodes)
    assert np.isnan(values[:, inside]).all() and np.isfinite(values[:, line.nodes]).all()
    rows = found.point_data["position"].reshape(values.shape)[:, 0]
    row, vertex = np.unravel_index(int(np.nanargmax(values)), values.shape)
    assert rows[row] == pytest.approx(2.125, abs=1e-5)
    assert mesh.points[vertex] == pytest.approx([HALF, 0.5 * THICK])
    assert np.nanmax(values) == pytest.approx(30e6) == SurfaceMaps(tmp_path)["I1"].max()


@pytest.mark.parametrize(
    ("cell", "order", "solid"),
    [("triangle", 1, "wedge"), ("triangle", 2, "wedge"), ("quadrilateral", 2, "hexahedron")],
)
def test_other_cells(tmp_path: Path, cell: str, order: int, solid: str) -> None:
    mesh = section(cell, order)
    found, _ = strand(tmp_path, mesh, every=0.2)
    (block,) = found.cells
    rows = len(between(np.array(AT), 0.2))
    assert block.type == solid and len(block.data) == len(mesh.cells) * (rows - 1)
    assert np.unique(block.data).tolist() == list(range(len(found.points)))
    # The first face points into a hexahedron, out of a wedge: VTK's volumes are positive.
    first, second, third = (found.points[block.data[:, i]] for i in (0, 1, 2))
    last = found.points[block.data[:, block.data.shape[1] // 2]]
    normal = np.cross(second - first, third - first)
    inwards = np.einsum("ij,ij->i", normal, last - first) > 0.0
    assert inwards.all() if solid == "hexahedron" else not inwards.any()


def test_single_slice_is_no_strand(tmp_path: Path) -> None:
    mesh = section()
    with FieldWriter(tmp_path, mesh.points, mesh.cells, mesh.cell, mesh.order) as fields:
        fields.write(0.0, 0.0, {"temperature": kelvin(mesh, 0.0)})
    with pytest.raises(InputError, match="has 1 slices"):
        write_strand(tmp_path, tmp_path / "a.vtu", Side(rolls(), THICK, LENGTH), 0.1)
    assert not (tmp_path / "a.vtu").exists()


def test_command_writes_the_strand_or_reports_errors(tmp_path: Path) -> None:
    from bent_case import bent
    from click.testing import CliRunner
    from small_case import small

    write_fields(tmp_path, section())
    runner = CliRunner()
    (tmp_path / "case.toml").write_text(bent().resolved_toml())
    done = runner.invoke(app, ["strand", str(tmp_path), "--every", "500 mm"])
    assert done.exit_code == 0, done.output
    assert meshio.read(tmp_path / "strand.vtu").cells[0].type == "hexahedron"
    (tmp_path / "case.toml").write_text(small().resolved_toml())
    for words, message in (
        (["strand", str(tmp_path)], "machine: the table is missing"),
        (["strand", str(tmp_path / "none")], "holds no run of castfem"),
        (["strand", str(tmp_path), "--every", "5 K"], "--every 5 K"),
    ):
        done = runner.invoke(app, words)
        assert done.exit_code != 0
        assert message in str(done.exception) + done.output


@pytest.mark.parametrize(("cell", "order"), [("quadrilateral", 1), ("triangle", 2)])
def test_vtk_reads_the_strand(tmp_path: Path, cell: str, order: int) -> None:
    """ParaView's own reader: every cell has its volume, every field exists."""
    vtk = pytest.importorskip("vtk", reason="make test-paraview brings VTK")
    found, _ = strand(tmp_path, section(cell, order))
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(tmp_path / "strand.vtu"))
    sizes = vtk.vtkCellSizeFilter()
    sizes.SetInputConnection(reader.GetOutputPort())
    sizes.Update()
    grid = sizes.GetOutput()
    assert grid.GetNumberOfCells() == len(found.cells[0].data)
    volume = grid.GetCellData().GetArray("Volume")
    each = np.array([volume.GetValue(i) for i in range(grid.GetNumberOfCells())])
    assert each.min() > 0.0
    if cell == "quadrilateral":
        assert each.sum() == pytest.approx(volumes(found.points, found.cells[0].data).sum())
    for name, values in found.point_data.items():
        array = grid.GetPointData().GetArray(name)
        assert np.array_equal(array.GetTuple(7), np.atleast_1d(values[7]))
