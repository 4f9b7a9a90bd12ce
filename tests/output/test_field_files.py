"""The HDF5 files of the fields: one per time, gathered at the end; full disks, damaged files."""

from __future__ import annotations

import resource
from pathlib import Path

import h5py
import meshio
import numpy as np
import pytest
from synthetic_run import rectangle

from castfem.base.errors import RunFailure
from castfem.runs.output import field_files
from castfem.runs.output.fields import Fields
from castfem.runs.output.xdmf import FieldWriter

from .test_xdmf import some_fields


def unfinished(folder: Path, count: int) -> tuple[FieldWriter, np.ndarray, np.ndarray]:
    """Return a writer that has not been closed, and its mesh."""
    points, cells = rectangle(4, 3, 0.06, 0.05, "triangle", 1)
    writer = FieldWriter(folder, points, cells, "triangle", 1)
    for k in range(count):
        writer.write(0.1 * k, 0.006 * k, some_fields(points, cells, k)[0])
    return writer, points, cells


def test_times_have_their_own_files_until_closing(tmp_path):
    writer, _, _ = unfinished(tmp_path, 3)
    single = [f"fields/{k:06d}.h5" for k in range(3)]
    assert sorted(str(p.relative_to(tmp_path)) for p in tmp_path.glob("fields/*")) == single
    text = (tmp_path / "fields.xdmf").read_text()
    assert [text.count(f">{name}:") for name in single] == [3, 3, 3]
    with Fields(tmp_path) as before, Fields(tmp_path) as watching:
        assert (before.names, before.centre("stress")) == (
            ("displacement", "stress", "temperature"),
            "point",
        )
        expected = [before.values("stress", k) for k in range(3)]
        writer.close()
        with Fields(tmp_path) as after:
            assert after.times.tolist() == before.times.tolist()
            for k in range(3):
                assert np.array_equal(after.values("stress", k), expected[k])
                assert np.array_equal(watching.values("stress", k - 3), expected[k])
    assert "fields/" not in (tmp_path / "fields.xdmf").read_text()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["fields.h5", "fields.xdmf"]


def test_earlier_times_are_not_written_again(tmp_path):
    """The cost of a time does not depend on the number of times before."""
    writer, points, cells = unfinished(tmp_path, 2)
    files = [tmp_path / "fields.h5", *(tmp_path / "fields").iterdir()]
    before = [(p.stat().st_ino, p.stat().st_mtime_ns) for p in files]
    for k in range(2, 100):
        writer.write(0.1 * k, 0.006 * k, some_fields(points, cells, k)[0])
    assert [(p.stat().st_ino, p.stat().st_mtime_ns) for p in files] == before
    sizes = [p.stat().st_size for p in (tmp_path / "fields").iterdir()]
    assert len(sizes) == 100 and max(sizes) == min(sizes)
    writer.close()
    whole = (tmp_path / "fields.h5").stat().st_size
    assert whole < 100 * (13 * 4 * len(points) + 3000)


def test_unreadable_time_is_left_out_and_reported(tmp_path, told):
    """As after a power cut, on a disk that does not write what it confirms."""
    unfinished(tmp_path, 4)
    (tmp_path / "fields" / "000001.h5").write_bytes(b"")
    with Fields(tmp_path) as fields:
        assert fields.times.tolist() == [0.0, 0.2, 0.1 * 3]
    told.clear()
    writer = FieldWriter.resume(tmp_path, 0.2)
    assert writer.times == [0.0, 0.2]
    assert ["000001.h5: cannot be read" in r.message for r in told.records] == [True]
    points, cells = rectangle(4, 3, 0.06, 0.05, "triangle", 1)
    writer.write(0.3, 0.0, some_fields(points, cells, 3)[0])
    writer.close()
    with Fields(tmp_path) as fields:
        assert fields.times.tolist() == [0.0, 0.2, 0.3]
        assert fields.values("temperature", 1)[0] == 1502.0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["fields.h5", "fields.xdmf"]


@pytest.fixture
def small_files():
    """Return a function that limits the size of files, as a full disk does."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)

    def limit(size: int) -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))

    yield limit
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_full_disk_is_a_run_failure_and_spares_old_times(tmp_path, small_files):
    writer, points, cells = unfinished(tmp_path, 3)
    small_files(2000)
    with pytest.raises(
        RunFailure,
        match=r"fields/000003\.h5: cannot be written \(File too large\); free some space",
    ):
        writer.write(0.3, 0.0, some_fields(points, cells, 3)[0])
    writer.close()
    with Fields(tmp_path) as fields:
        assert fields.times.tolist() == [0.0, 0.1, 0.2]
    small_files(resource.RLIM_INFINITY)
    with FieldWriter.resume(tmp_path, 1e9) as again:
        again.write(0.3, 0.0, some_fields(points, cells, 3)[0])
    with meshio.xdmf.TimeSeriesReader(tmp_path / "fields.xdmf") as reader:
        reader.read_points_cells()
        assert [reader.read_data(k)[0] for k in range(reader.num_steps)] == [0.0, 0.1, 0.2, 0.3]


@pytest.mark.parametrize("size", [500, 4000, 12_000])
def test_disk_full_at_the_end_keeps_the_single_files(tmp_path, small_files, told, size):
    """For any size of the part of the new fields.h5 that could be written."""
    writer, _, _ = unfinished(tmp_path, 12)
    before = (tmp_path / "fields.h5").read_bytes(), (tmp_path / "fields.xdmf").read_bytes()
    small_files(size)
    writer.close()
    small_files(resource.RLIM_INFINITY)
    (record,) = told.records
    assert "the fields stay in single files" in record.message
    assert "fields.h5: cannot be written (File too large)" in record.message
    assert (
        (tmp_path / "fields.h5").read_bytes(),
        (tmp_path / "fields.xdmf").read_bytes(),
    ) == before
    names = {p.name for p in tmp_path.iterdir()}
    assert names == {"fields", "fields.h5", "fields.xdmf"}
    FieldWriter.resume(tmp_path, 1e9).close()
    with Fields(tmp_path) as fields:
        assert len(fields.times) == 12
    assert {p.name for p in tmp_path.iterdir()} == {"fields.h5", "fields.xdmf"}


def test_missing_filter_is_reported_once(tmp_path, told, monkeypatch):
    values = np.random.default_rng(1).random((20_000, 3))

    def stored() -> tuple[str | None, int]:
        with h5py.File(tmp_path / "some.h5", "w") as file:
            field_files.store(file, "large", values)
        with h5py.File(tmp_path / "some.h5") as file:
            assert (file["large"][()] == values).all()
            return file["large"].compression, len(told.records)

    assert stored() == ("gzip", 0)
    field_files._can_compress.cache_clear()
    monkeypatch.setattr(h5py.h5z, "filter_avail", lambda _: False)
    assert [stored(), stored()] == [(None, 1), (None, 1)]
    assert "uncompressed" in told.text
    field_files._can_compress.cache_clear()
