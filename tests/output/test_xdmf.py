"""fields.xdmf + fields.h5: read by other programs, never half written, cheap."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import get_args
from xml.etree import ElementTree

import h5py
import meshio
import numpy as np
import pytest
from synthetic_run import rectangle

from castfem.base.errors import InputError, RunFailure
from castfem.model.casting import FieldName
from castfem.runs.output.fields import Fields
from castfem.runs.output.layout import UNITS, components, triangulate, vtk_cells
from castfem.runs.output.xdmf import FieldWriter

KINDS = [("triangle", 1), ("quadrilateral", 1), ("triangle", 2), ("quadrilateral", 2)]
MESHIO = {
    ("triangle", 1): "triangle",
    ("quadrilateral", 1): "quad",
    ("triangle", 2): "triangle6",
    ("quadrilateral", 2): "quad9",
}


def some_fields(points: np.ndarray, cells: np.ndarray, k: int) -> tuple[dict, dict]:
    """Return point and cell fields of every shape, different at every time."""
    x, y = points.T
    tensor = np.stack([x + k, 2 + x, 3 + y, 4 + x * y], axis=1)
    at_points = {
        "temperature": 1500.0 + 100 * x + k,
        "displacement": np.column_stack([0.01 * x * k, -0.02 * y]),
        "stress": tensor,
    }
    at_cells = {"mises": np.arange(len(cells)) + 0.5 * k, "strain": np.ones((len(cells), 2, 2)) * k}
    return at_points, at_cells


def write_some(folder: Path, cell: str, order: int, count: int = 3) -> tuple:
    points, cells = rectangle(4, 3, 0.06, 0.05, cell, order)
    with FieldWriter(folder, points, cells, cell, order, dtype=np.float64) as writer:
        for k in range(count):
            writer.write(0.1 * k, 0.006 * k, *some_fields(points, cells, k))
    return points, cells


@pytest.mark.parametrize(("cell", "order"), KINDS)
def test_meshio_reads_all_fields_of_a_time_from_one_grid(tmp_path, cell, order):
    points, cells = write_some(tmp_path, cell, order)
    with meshio.xdmf.TimeSeriesReader(tmp_path / "fields.xdmf") as reader:
        found_points, blocks = reader.read_points_cells()
        assert reader.num_steps == 3
        assert np.array_equal(found_points, np.column_stack([points, 0 * points[:, 0]]))
        assert [block.type for block in blocks] == [MESHIO[cell, order]]
        assert np.array_equal(blocks[0].data, vtk_cells(cells, cell, order))
        for k in range(3):
            when, at_points, at_cells = reader.read_data(k)
            assert when == 0.1 * k
            mine, mine_cells = some_fields(points, cells, k)
            assert set(at_points) == set(mine)
            assert set(at_cells) == set(mine_cells)
            assert np.array_equal(at_points["temperature"], mine["temperature"])
            assert np.array_equal(at_points["displacement"][:, :2], mine["displacement"])
            assert not at_points["displacement"][:, 2].any()
            xx, yy, zz, xy = mine["stress"].T
            nil = np.zeros_like(xx)
            full = np.stack([xx, xy, nil, xy, yy, nil, nil, nil, zz], axis=1)
            assert np.array_equal(at_points["stress"].reshape(-1, 9), full)
            assert np.array_equal(at_cells["mises"][0], mine_cells["mises"])


@pytest.mark.parametrize(("cell", "order"), KINDS)
def test_vtk_reads_one_unstructured_grid(tmp_path, cell, order):
    vtk = pytest.importorskip("vtk")
    if not hasattr(vtk, "vtkXdmfReader"):
        pytest.skip("this VTK is built without XDMF, as Debian's")
    points, cells = write_some(tmp_path, cell, order)
    reader = vtk.vtkXdmfReader()
    reader.SetFileName(str(tmp_path / "fields.xdmf"))
    reader.UpdateInformation()
    key = vtk.vtkStreamingDemandDrivenPipeline.TIME_STEPS()
    assert np.allclose(reader.GetOutputInformation(0).Get(key), [0.0, 0.1, 0.2], atol=1e-15)
    reader.UpdateTimeStep(0.2)
    grid = reader.GetOutputDataObject(0)
    assert grid.IsA("vtkUnstructuredGrid")  # not a multi-block: Warp and colouring see all arrays
    at_points, at_cells = some_fields(points, cells, 2)
    for name, values in at_points.items():
        array = grid.GetPointData().GetArray(name)
        expected = components(values, len(points), name)
        assert array.GetNumberOfComponents() == np.atleast_1d(expected[7]).size
        assert np.array_equal(array.GetTuple(7), np.atleast_1d(expected[7]))
    assert grid.GetCellData().GetArray("mises").GetValue(3) == at_cells["mises"][3]


@pytest.mark.parametrize(("cell", "order"), KINDS)
def test_node_order_is_that_of_vtk(cell, order):
    """VTK's own shape functions map each node of a written cell to its position."""
    vtk = pytest.importorskip("vtk")
    points, cells = rectangle(2, 2, 3.0, 2.0, cell, order)
    kinds = {
        ("triangle", 1): vtk.vtkTriangle,
        ("quadrilateral", 1): vtk.vtkQuad,
        ("triangle", 2): vtk.vtkQuadraticTriangle,
        ("quadrilateral", 2): vtk.vtkBiQuadraticQuad,
    }
    for nodes in vtk_cells(cells, cell, order):
        shape = kinds[cell, order]()
        for i, node in enumerate(nodes):
            shape.GetPoints().SetPoint(i, *points[node], 0.0)
        corner = points[nodes[:3]]
        places = np.array(shape.GetParametricCoords()).reshape(-1, 3)
        for i, place in enumerate(places):
            x, weights = [0.0] * 3, [0.0] * len(nodes)
            shape.EvaluateLocation(vtk.reference(0), place, x, weights)
            assert np.allclose(x[:2], points[nodes[i]], atol=1e-14)
            straight = corner[0] + place[0] * (corner[1] - corner[0])
            side = corner[2] - (corner[0] if cell == "triangle" else corner[1])
            assert np.allclose(x[:2], straight + place[1] * side, atol=1e-14)


@pytest.mark.parametrize(("cell", "order"), KINDS[2:])
def test_node_order_agrees_with_dolfinx(cell, order):
    dolfinx = pytest.importorskip("dolfinx")
    kind = getattr(dolfinx.mesh.CellType, cell)
    count = {("triangle", 1): 3, ("triangle", 2): 6, ("quadrilateral", 1): 4}.get((cell, order), 9)
    place_in_vtk = dolfinx.cpp.io.perm_vtk(kind, count)
    ours = vtk_cells(np.arange(count)[None, :], cell, order)[0]
    assert np.array_equal(ours, np.argsort(place_in_vtk))


@pytest.mark.parametrize(("cell", "order"), KINDS)
def test_triangles_for_drawing_cover_the_mesh(cell, order):
    points, cells = rectangle(4, 3, 0.06, 0.05, cell, order, power=1.5)
    plane, triangles, parents = triangulate(points, vtk_cells(cells, cell, order), cell, order)
    a, b, c = plane[triangles].transpose(1, 0, 2)
    area = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    assert area.min() > 0
    assert area.sum() == pytest.approx(0.06 * 0.05, rel=1e-13)
    linear = 3 + points @ [2.0, -1.0]
    assert np.allclose(linear[parents].mean(axis=1), 3 + plane @ [2.0, -1.0], atol=1e-15)


def test_every_field_has_its_unit_in_the_files(tmp_path):
    assert set(UNITS) == {name for kind in get_args(FieldName) for name in get_args(kind) or [kind]}
    points, cells = rectangle(2, 2, 0.06, 0.05, "quadrilateral", 1)
    gap = np.full(len(points), np.nan)
    gap[:2] = 1e-4
    with FieldWriter(tmp_path, points, cells, "quadrilateral", 1) as writer:
        writer.write(0.0, 0.0, {"temperature": gap + 1500.0, "gap": gap})
    grid = ElementTree.parse(tmp_path / "fields.xdmf").find("Domain/Grid/Grid")
    information = {item.get("Name"): item.get("Value") for item in grid.findall("Information")}
    assert (
        information["units"] == "time [s], position [m], coordinates [m], gap [m], temperature [K]"
    )
    with h5py.File(tmp_path / "fields.h5") as file:
        found = {name: str(v.attrs["unit"]) for name, v in file["steps/000000"].items()}
    assert found == {"temperature": "K", "gap": "m"}
    with meshio.xdmf.TimeSeriesReader(tmp_path / "fields.xdmf") as reader:
        reader.read_points_cells()
        read = reader.read_data(0)[1]["gap"].ravel()
    assert np.array_equal(read, gap.astype(np.float32), equal_nan=True)


def test_single_precision_is_default_and_times_are_double(tmp_path):
    points, cells = rectangle(2, 2, 1.0, 1.0, "triangle", 1)
    values = 1500.0 + np.pi * np.arange(len(points))
    with FieldWriter(tmp_path, points, cells, "triangle", 1) as writer:
        writer.write(1 / 3, 0.02 / 3, {"temperature": values})
    with Fields(tmp_path) as fields:
        assert fields.times[0] == 1 / 3
        assert fields.positions[0] == 0.02 / 3
        assert np.array_equal(fields.values("temperature"), values.astype(np.float32))
        assert np.array_equal(fields.points[:, :2], points)


def test_large_fields_are_compressed_and_read_back(tmp_path):
    points, cells = rectangle(199, 99, 1.0, 1.0, "quadrilateral", 1)
    values = np.round(points @ [3.0, 5.0], 2)
    with FieldWriter(tmp_path, points, cells, "quadrilateral", 1) as writer:
        writer.write(0.0, 0.0, {"t": values, "v": np.outer(values, [1, 0, 0])})
    with Fields(tmp_path) as fields:
        assert np.array_equal(fields.values("t"), values.astype(np.float32))
        assert np.array_equal(fields.values("v")[:, 0], values.astype(np.float32))
    with h5py.File(tmp_path / "fields.h5") as file:
        assert file["steps/000000/t"].compression == "gzip"
        stored = file["steps/000000/v"].id.get_storage_size()
        assert stored < 0.5 * 12 * len(points)


def test_resume_drops_later_times_and_continues(tmp_path):
    points, cells = rectangle(3, 3, 1.0, 1.0, "quadrilateral", 1)
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    for folder in (whole, cut):
        folder.mkdir()
        with FieldWriter(folder, points, cells, "quadrilateral", 1) as writer:
            for k in range(6):
                writer.write(0.1 * k, 0.01 * k, {"t": points[:, 0] + k})
    with FieldWriter.resume(cut, 0.1 * 3) as writer:
        assert writer.times == [0.0, 0.1, 0.2, 0.1 * 3]
        before = (cut / "fields.xdmf").read_text()
        assert before.count("<Time") == 4
        with pytest.raises(ValueError, match="not after"):
            writer.write(0.25, 0.0, {"t": points[:, 0]})
        with pytest.raises(ValueError, match="differ"):
            writer.write(0.4, 0.04, {"other": points[:, 0]})
        for k in (4, 5):
            writer.write(0.1 * k, 0.01 * k, {"t": points[:, 0] + k})
    assert (cut / "fields.xdmf").read_bytes() == (whole / "fields.xdmf").read_bytes()
    with Fields(cut) as one, Fields(whole) as other:
        for k in range(6):
            assert np.array_equal(one.values("t", k), other.values("t", k))
    assert sorted(p.name for p in cut.iterdir()) == ["fields.h5", "fields.xdmf"]


def test_resume_before_the_first_time_begins_again(tmp_path):
    write_some(tmp_path, "triangle", 1)
    with FieldWriter.resume(tmp_path, -1.0) as writer:
        assert writer.times == []
        assert not (tmp_path / "fields.xdmf").exists()  # few programs read one without a grid
        writer.write(0.5, 0.0, {"anything": np.zeros(20)})
    with Fields(tmp_path) as fields:
        assert fields.names == ("anything",)
        assert fields.times.tolist() == [0.5]


def test_resume_with_other_fields_is_refused_by_name(tmp_path):
    write_some(tmp_path, "triangle", 1)
    names = {"displacement", "mises", "strain", "stress", "temperature"}
    FieldWriter.resume(tmp_path, 9.0, names).close()
    with pytest.raises(
        InputError,
        match=r"holds displacement, mises, strain, stress, temperature; set output\.fields to",
    ):
        FieldWriter.resume(tmp_path, 9.0, ["temperature"])
    FieldWriter.resume(tmp_path, -1.0, ["temperature"]).close()  # none is kept


def test_damaged_and_missing_files_are_input_errors(tmp_path):
    for folder_content in (None, b"no hdf5 at all", "foreign"):
        folder = tmp_path / str(folder_content)[:9]
        folder.mkdir()
        if isinstance(folder_content, bytes):
            (folder / "fields.h5").write_bytes(folder_content)
        elif folder_content:
            h5py.File(folder / "fields.h5", "w").close()
        with pytest.raises(InputError, match=r"fields\.h5: .* run again without --resume") as error:
            FieldWriter.resume(folder, 1.0)
        assert len(error.value.problems) == 1
        with pytest.raises(InputError, match=r"fields\.h5"):
            Fields(folder)


@pytest.mark.parametrize(
    ("points", "fields", "message"),
    [
        (None, {"t": np.zeros(3)}, "not 4 rows"),
        (None, {"a/b": np.zeros(4)}, "cannot be named"),
        (np.zeros((4, 4)), {}, "points are"),
    ],
)
def test_wrong_shapes_and_names_are_refused(tmp_path, points, fields, message):
    square = np.array([[0, 0], [1, 0], [0, 1], [1, 1]], float)
    with pytest.raises(ValueError, match=message):
        mesh = square if points is None else points
        with FieldWriter(tmp_path, mesh, [[0, 1, 2, 3]], "quadrilateral", 1) as writer:
            writer.write(0.0, 0.0, fields)


def test_files_are_complete_after_every_write(tmp_path):
    """As another process sees them while the writer still has the file open."""
    points, cells = rectangle(3, 3, 1.0, 1.0, "triangle", 2)
    writer = FieldWriter(tmp_path, points, cells, "triangle", 2)
    for k in range(4):
        writer.write(float(k), 0.0, {"t": points[:, 0] * k})
        code = f"""
import meshio
with meshio.xdmf.TimeSeriesReader({str(tmp_path / "fields.xdmf")!r}) as reader:
    reader.read_points_cells()
    assert reader.num_steps == {k + 1}
    assert reader.read_data({k})[1]["t"].max() == {k}
"""
        if k == 3:
            subprocess.run([sys.executable, "-c", code], check=True)
    writer.close()


def test_file_system_without_links_gets_complete_files(tmp_path, monkeypatch):
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", refuse)
    write_some(tmp_path, "triangle", 1)
    with meshio.xdmf.TimeSeriesReader(tmp_path / "fields.xdmf") as reader:
        assert reader.num_steps == 3


def test_missing_folder_is_a_run_failure(tmp_path):
    with pytest.raises(RunFailure, match=r"fields\.h5: cannot be written \(No such file"):
        FieldWriter(tmp_path / "nowhere", np.zeros((3, 2)), [[0, 1, 2]], "triangle", 1)
