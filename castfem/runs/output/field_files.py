"""The HDF5 files of the fields, which are never modified but always replaced as a whole.

    fields.h5           the mesh, and the times that have been gathered
    fields/000012.h5    a time that has not

Adding to an HDF5 file changes its tables in place, and a kill at that moment would destroy the
whole file. Therefore each time is written to a file of its own, which gets its name when it is
complete. At the end all are gathered in a new fields.h5, which replaces the old one; only then are
the files of the single times removed. At any moment each time exists, and every file can be read.

    /                    attributes: format, version, cell, order and those of the caller
    /mesh/points         (n, 3) m
    /mesh/cells          (m, k) in VTK node order
    /steps/000000/NAME   (n,), (n, 3) or (n, 9) values; attributes: centre, unit
    /steps/000000        attributes of the group: time [s], position [m]
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from castfem.base import log
from castfem.base.atomic_files import replacing, saving, system_reason
from castfem.runs.output.layout import UNITS

if TYPE_CHECKING:
    import h5py

HDF5_NAME = "fields.h5"
SINGLE_NAME = "fields"
FORMAT = "castfem fields"
VERSION = 1

_LIBVER = ("v108", "v108")  # readable by any viewer; smaller tables than those of the first format
_SINGLE = re.compile(r"\d{6,}\.h5")
_LEFTOVER = re.compile(r"\.\d{6,}\.h5\.tmp")

Values = NDArray[Any]


@dataclass(frozen=True, slots=True)
class Step:
    """One output time on disk."""

    number: int  #: index of the time
    time: float  #: s
    position: float  #: below the meniscus, m
    file: str  #: its file, relative to the folder of the run, as the XDMF file names it

    @property
    def group(self) -> str:
        """HDF5 group of its fields."""
        return f"steps/{self.number:06d}"

    @property
    def single(self) -> bool:
        """Whether it is in a file of its own."""
        return self.file != HDF5_NAME


# Errors of HDF5 and h5py for a file that is not HDF5, incomplete or foreign.
UNREADABLE = (OSError, RuntimeError, KeyError, TypeError, ValueError)


def open_hdf5(path: Path) -> h5py.File:
    """Open for reading without a lock: a viewer may have the file open, too."""
    import h5py

    return h5py.File(path, "r", locking=False)


def begin(
    folder: Path,
    points: Values,
    cells: Values,
    facts: Mapping[str, float | int | str],
    dtype: DTypeLike,
) -> None:
    """Write a new fields.h5 without any time, replacing an existing one.

    Args:
        folder: Folder of the run.
        points: (n, 3) nodes [m].
        cells: (m, k) nodes of the cells in VTK order.
        facts: Attributes of the file.
        dtype: Type of the values.
    """
    remove_singles(folder)

    def fill(file: h5py.File) -> None:
        for key, value in {**facts, "format": FORMAT, "version": VERSION}.items():
            file.attrs[key] = value
        store(file, "mesh/points", points)
        store(file, "mesh/cells", cells)
        file.create_group("steps").attrs["dtype"] = np.dtype(dtype).name

    write_image(folder / HDF5_NAME, fill)


def add(
    folder: Path,
    number: int,
    time: float,
    position: float,
    fields: Mapping[str, tuple[str, Values]],
) -> Step:
    """Write one time to disk atomically."""
    path = folder / SINGLE_NAME / f"{number:06d}.h5"
    step = Step(number, time, position, f"{SINGLE_NAME}/{path.name}")

    def fill(file: h5py.File) -> None:
        group = file.create_group(step.group)
        group.attrs["time"], group.attrs["position"] = time, position
        for name, (centre, values) in fields.items():
            facts = store(group, name, values).attrs
            facts["centre"] = centre
            if name in UNITS:
                facts["unit"] = UNITS[name]

    with saving(path):
        path.parent.mkdir(exist_ok=True)
    write_image(path, fill)
    return step


def written(folder: Path, gathered: h5py.File) -> list[Step]:
    """Return all times on disk, in their order.

    Single times that cannot be read, such as after a power failure, are skipped with a warning.

    Raises:
        Exception: One of `UNREADABLE`: fields.h5 is damaged, or not castfem's.
    """
    if gathered.attrs.get("format") != FORMAT:
        raise ValueError("not written by castfem")
    found = {step.number: step for step in _steps(gathered, HDF5_NAME)}
    for path in singles(folder):
        if int(path.stem) in found:
            continue  # already gathered; the run was killed before removing the file
        try:
            with open_hdf5(path) as file:
                for step in _steps(file, f"{SINGLE_NAME}/{path.name}"):
                    found[step.number] = step
        except FileNotFoundError:
            raise
        except UNREADABLE as error:
            reason = system_reason(error)[1]
            log.logger.warning("%s: cannot be read (%s); this time is left out", path, reason)
    return [found[number] for number in sorted(found)]


def gather(folder: Path, steps: Iterable[Step]) -> list[Step]:
    """Write a fields.h5 with exactly these times; the single files stay.

    Returns:
        The times with their new file.

    Raises:
        RunFailure: The file cannot be written; fields.h5 is unchanged.
    """
    import h5py

    path, chosen = folder / HDF5_NAME, list(steps)
    with replacing(path) as temporary, _Patient(temporary, "w+b") as target:
        with open_hdf5(path) as old, h5py.File(target, "w", libver=_LIBVER) as new:
            for key, value in old.attrs.items():
                new.attrs[key] = value
            old.copy("mesh", new)
            new.create_group("steps").attrs["dtype"] = old["steps"].attrs["dtype"]
            for step in chosen:
                with _holding(folder, step, old) as source:
                    source.copy(step.group, new["steps"])
        if target.error is not None:
            raise target.error
    return [replace(step, file=HDF5_NAME) for step in chosen]


def singles(folder: Path) -> list[Path]:
    """Return the files of single times in the folder of a run, in their order."""
    found = _named(folder, _SINGLE)
    return sorted(found, key=lambda path: int(path.stem))


def remove_singles(folder: Path, keep: Iterable[Step] = ()) -> None:
    """Remove the files of single times except those in `keep`, the last first; keep user files."""
    kept = {folder / step.file for step in keep}
    for path in [*reversed(singles(folder)), *_named(folder, _LEFTOVER)]:
        if path not in kept:
            with saving(path):
                path.unlink(missing_ok=True)
    with suppress(OSError):  # missing, or not empty
        (folder / SINGLE_NAME).rmdir()


def _named(folder: Path, pattern: re.Pattern[str]) -> list[Path]:
    try:
        return [p for p in (folder / SINGLE_NAME).iterdir() if pattern.fullmatch(p.name)]
    except OSError:
        return []


def _steps(file: h5py.File, name: str) -> Iterator[Step]:
    for number, group in file["steps"].items():
        facts = group.attrs
        yield Step(int(number), float(facts["time"]), float(facts["position"]), name)


@contextmanager
def _holding(folder: Path, step: Step, gathered: h5py.File) -> Iterator[h5py.File]:
    if not step.single:
        yield gathered
        return
    with open_hdf5(folder / step.file) as file:
        yield file


class _Patient(io.FileIO):
    """A file object for HDF5, which does not survive a failing write: the error is stored."""

    error: OSError | None = None

    def write(self, data: Any) -> int:
        """Write all data, or store the error."""
        left = memoryview(data).cast("B")
        size = len(left)
        try:
            while left:
                left = left[super().write(left) :]
        except OSError as error:
            self.error = error
        return size

    def truncate(self, size: int | None = None) -> int:
        """Set the length, or store the error."""
        try:
            return super().truncate(size)
        except OSError as error:
            self.error = error
            return size or 0


def write_image(path: Path, fill: Callable[[h5py.File], None]) -> None:
    """Write a small HDF5 file from memory, since HDF5 does not survive a full disk."""
    import h5py

    with h5py.File("image", "w", driver="core", backing_store=False) as file:
        fill(file)
        file.flush()
        image = file.id.get_file_image()
    with replacing(path) as temporary:
        temporary.write_bytes(image)


def store(group: h5py.Group, name: str, values: Values) -> h5py.Dataset:
    """Store one array, lightly compressed if it is large.

    Below 64 kB the chunk index and the filter cost more than they save.
    """
    if values.nbytes < 65536 or not _can_compress():
        return group.create_dataset(name, data=values)
    return group.create_dataset(
        name,
        data=values,
        chunks=_chunks(values),
        compression="gzip",
        compression_opts=1,
        shuffle=True,
    )


@cache
def _can_compress() -> bool:
    """Whether HDF5 has its compression filter; warns once if not."""
    from h5py import h5z

    if h5z.filter_avail(h5z.FILTER_DEFLATE):
        return True
    log.logger.warning("fields are written uncompressed: the HDF5 of this h5py has no deflate")
    return False


def _chunks(values: Values) -> tuple[int, ...]:
    """Chunks of whole rows of about a megabyte."""
    row = values.nbytes // len(values)
    return (max(1, min(len(values), 1_000_000 // row)), *values.shape[1:])
