"""checkpoint.h5: the state of a run, replaced atomically, verified when it is read.

    /          attributes: format, version, physics
    /meta      the description, JSON
    /case      the part of the case that the state depends on, JSON, to name what has changed
    /arrays/*  the arrays

The HDF5 data are followed by eight bytes, a mark and the CRC-32 of all before it: HDF5 itself does
not notice a changed number, and may crash on a damaged table. The new checkpoint is written beside
the old one and renamed only when it is on disk: after a kill or a power failure one of the two is
complete.
"""

from __future__ import annotations

import io
import json
import struct
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from castfem.base.atomic_files import replacing
from castfem.base.errors import InputError, differences

if TYPE_CHECKING:
    import h5py

CHECKPOINT_NAME = "checkpoint.h5"
VERSION = 2
_MARK = b"cfck"
_ANEW = "run again without --resume"


def save_checkpoint(
    path: Path | str,
    meta: Mapping[str, Any],
    arrays: Mapping[str, NDArray[Any]],
    *,
    physics: str = "",
    case: str = "{}",
) -> None:
    """Replace the checkpoint; the previous one survives until the new one is complete.

    Args:
        path: Path of the file.
        meta: Description, in JSON types; floats are restored bit by bit, NaN included.
        arrays: Arrays by name; a "/" in a name makes a group. They are restored bit by bit.
        physics: Hash of everything in the case on which the state depends.
        case: Tables of the case as JSON. Writing out a long table takes longer than a step, so a
            run does it once.
    """
    image = _image(dict(meta), arrays, physics, case)
    with replacing(Path(path)) as temporary:
        temporary.write_bytes(image + _MARK + struct.pack("<I", zlib.crc32(image)))


def load_checkpoint(
    path: Path | str, *, physics: str | None = None, case: str = "{}"
) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Return the description and the arrays of a checkpoint.

    Args:
        path: Path of the file.
        physics: Required hash; None accepts any.
        case: Case as in `save_checkpoint`, to name the differences.

    Raises:
        InputError: There is no such file, it is not a checkpoint, it is damaged, or it belongs to
            another version or case; the message names the differences and the fix.
    """
    import h5py

    path = Path(path)
    with h5py.File(io.BytesIO(_checked(path)), "r") as file:
        _check_head(path, file, physics, case)
        arrays: dict[str, NDArray[Any]] = {}

        def collect(name: str, stored: h5py.Dataset | h5py.Group) -> None:
            if isinstance(stored, h5py.Dataset):
                arrays[name] = np.asarray(stored[()])

        file["arrays"].visititems(collect)
        return _words(file, "meta"), arrays


def _checked(path: Path) -> bytes:
    """Return the HDF5 data of the file after verifying its check sum."""
    try:
        content = path.read_bytes()
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file, nothing to resume from; {_ANEW}") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); {_ANEW}") from error
    image, tail = content[:-8], content[-8:]
    if tail[:4] != _MARK:
        raise InputError(f"{path}: is not a castfem checkpoint, or is truncated; {_ANEW}")
    if tail[4:] != struct.pack("<I", zlib.crc32(image)):
        raise InputError(f"{path}: is damaged: its checksum differs; {_ANEW}")
    return image


def _image(
    meta: dict[str, Any], arrays: Mapping[str, NDArray[Any]], physics: str, case: str
) -> bytes:
    """Return the bytes of the file: HDF5 does not survive a full disk, so it writes to memory."""
    import h5py

    with h5py.File("checkpoint", "w", driver="core", backing_store=False) as file:
        file.attrs["format"] = "castfem checkpoint"
        file.attrs["version"] = VERSION
        file.attrs["physics"] = physics
        for name, text in (("meta", json.dumps(meta, default=_json_value)), ("case", case)):
            file.create_dataset(name, data=np.frombuffer(text.encode(), dtype=np.uint8))
        file.create_group("arrays")
        for name, values in arrays.items():
            file.create_dataset(f"arrays/{name}", data=np.asarray(values))
        file.flush()
        return bytes(file.id.get_file_image())


def _words(file: h5py.File, name: str) -> dict[str, Any]:
    content: dict[str, Any] = json.loads(file[name][()].tobytes())
    return content


def _check_head(path: Path, file: h5py.File, physics: str | None, case: str) -> None:
    """Refuse other versions and other cases."""
    version = file.attrs.get("version")
    if version != VERSION:
        raise InputError(
            f"{path}: has format version {version}, this castfem reads {VERSION}; "
            f"resume with the castfem that wrote it, or {_ANEW}"
        )
    written = file.attrs.get("physics")
    if physics is not None and written != physics:
        changes = differences(_words(file, "case"), json.loads(case))
        changes = changes or f"physics {str(written)[:12]} there, {physics[:12]} here"
        raise InputError(
            f"{path}: belongs to another case ({changes}); undo the change of the case, or {_ANEW}"
        )


def _json_value(value: Any) -> Any:
    """Convert numpy scalars and arrays for JSON; anything else is a programming error."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} cannot be kept in a checkpoint")
