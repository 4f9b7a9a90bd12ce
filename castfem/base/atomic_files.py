"""Atomic writing of files, with a clear error for a full disk.

Every file that is rewritten during a run goes through `replacing`: the new text is written beside
the old one, flushed to disk, and renamed. A run that is killed at any moment leaves the old file or
the new one.
"""

from __future__ import annotations

import csv
import errno
import fcntl
import io
import json
import math
import os
import re
import time
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from castfem.base.errors import CannotWrite, RunFailure

if TYPE_CHECKING:
    from filelock import FileLock


class Closing(ABC):
    """Base of objects that are closed at the end of a `with` block, also after an error."""

    @abstractmethod
    def close(self) -> None:
        """Release the resources; may be called twice."""

    def leave(self, error: BaseException) -> None:  # noqa: B027 - optional
        """Record the error that ends the `with`, before closing."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if error is not None:
                self.leave(error)
        finally:
            self.close()


UNWRITTEN = "cannot be written"  # part of the reason of a run that ends for this
_NO_SPACE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_NO_RIGHT = (errno.EACCES, errno.EPERM, errno.EROFS)
_NO_PLACE = (errno.ENOENT, errno.ENOTDIR)
_AGAIN = ", and give the command again (--resume continues a run)"


def temporary_name(path: Path) -> Path:
    """Name beside `path` under which the next version is written."""
    return path.with_name(f".{path.name}.tmp")


def system_reason(error: BaseException) -> tuple[int | None, str]:
    """Return errno and message of the operating system behind an error.

    h5py often hides both in HDF5's own message ("errno = 28, error message = '...'").
    """
    number = getattr(error, "errno", None)
    hidden = re.search(r"errno = (\d+)", str(error))
    if hidden:
        number = int(hidden.group(1))
    if number is not None:
        return number, os.strerror(number)
    return None, str(error).splitlines()[0] if str(error) else type(error).__name__


def folder_refused(folder: Path, error: BaseException) -> str:
    """Message for a folder that cannot be written, before anything is run in it."""
    _, reason = system_reason(error.__cause__ or error)
    return f"{folder}: {UNWRITTEN} ({reason}); choose another with -o"


def fix_for(number: int | None) -> str:
    """Advice on an operating system error while a run writes."""
    if number in _NO_SPACE:
        return f"free some space{_AGAIN}"
    if number in _NO_RIGHT:
        return f"make the folder writable{_AGAIN}"
    if number in _NO_PLACE:
        return f"make the folder, or name another place{_AGAIN}"
    return f"repair the disk or the folder{_AGAIN}"


@contextmanager
def saving(path: Path) -> Iterator[None]:
    """Convert any operating system or HDF5 error into a RunFailure of one line with the fix.

    Raises:
        CannotWrite: The file cannot be written.
    """
    try:
        yield
    except (OSError, RuntimeError) as error:  # h5py raises RuntimeError when a flush fails
        if isinstance(error, RunFailure):
            raise
        number, reason = system_reason(error)
        raise CannotWrite(f"{path}: {UNWRITTEN} ({reason}); {fix_for(number)}") from error


@contextmanager
def replacing(path: Path, durable: bool = True) -> Iterator[Path]:
    """Yield a temporary path beside `path` that is renamed to it when the block has succeeded.

    Args:
        path: The file to write or to replace.
        durable: Flush the new content to disk first, so that it also survives a power failure.

    Raises:
        RunFailure: The file cannot be written; the old one is unchanged.
    """
    temporary = temporary_name(path)
    with saving(path):
        try:
            yield temporary
            if durable:
                _force_to_disk(temporary)
            os.replace(temporary, path)
            if durable:
                _force_to_disk(path.parent)
        except BaseException:
            with suppress(OSError):
                temporary.unlink()
            raise


class GrowingFile:
    """A text file that grows before its last line and is complete for every reader at any time.

    Two copies take turns: the hidden one is updated at its end and renamed over the other. The cost
    of a version is that of the added text, not of the whole.
    """

    def __init__(self, path: Path, head: str, foot: str) -> None:
        """Store the text; nothing is written before the first `publish`."""
        self._path = path
        self._body = bytearray(head.encode())
        self._foot = foot.encode()
        self._visible = 0  # bytes of the body in the visible file; 0: not written here
        self._hidden = 0  # bytes of the body in the copy; 0: no copy

    def extend(self, text: str) -> None:
        """Add text before the foot; `publish` writes it."""
        self._body += text.encode()

    def publish(self, durable: bool = False) -> None:
        """Make the whole text the content of the file, atomically.

        Args:
            durable: Flush it to disk, so that it also survives a power failure.
        """
        copy = temporary_name(self._path)
        link = self._path.with_name(f"{copy.name}2")
        with saving(self._path):
            begin = self._hidden if copy.exists() else 0
            self._hidden = 0
            with open(copy, "r+b" if begin else "wb") as file:
                file.seek(begin)
                file.write(self._body[begin:] + self._foot)
            if durable:
                _force_to_disk(copy)
            kept = bool(self._visible)
            if kept:
                with suppress(OSError):
                    link.unlink()
                try:
                    os.link(self._path, link)
                except OSError:  # a file system without links: each version is written in full
                    kept = False
            os.replace(copy, self._path)
            if kept:
                os.replace(link, copy)
                self._hidden = self._visible
            if durable:
                _force_to_disk(self._path.parent)
            self._visible = len(self._body)

    def close(self) -> None:
        """Remove the hidden copy."""
        self._hidden = 0
        with suppress(OSError):
            temporary_name(self._path).unlink()


class AppendedFile(Closing):
    """A file that grows by whole pieces: a piece cut off by a full disk or a kill is removed.

    Raises:
        CannotWrite: The file cannot be opened; also raised by the methods.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        with saving(path):
            self._handle = os.open(path, os.O_WRONLY | os.O_APPEND)

    @property
    def is_open(self) -> bool:
        """Whether it is still open."""
        return self._handle >= 0

    def append(self, piece: bytes) -> None:
        """Add a piece, which is passed to the operating system at once."""
        with saving(self._path):
            before = os.fstat(self._handle).st_size
            if os.write(self._handle, piece) != len(piece):  # the disk became full
                os.ftruncate(self._handle, before)
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def sync(self) -> None:
        """Flush the file to disk: a saved state must not lack its pieces after a power failure."""
        if self.is_open:
            with saving(self._path):
                os.fsync(self._handle)

    def close(self) -> None:
        """Close the file; without it nothing is lost."""
        if self.is_open:
            with suppress(OSError):
                os.fsync(self._handle)
            os.close(self._handle)
        self._handle = -1


def write_text(path: Path, text: str, durable: bool = True) -> None:
    """Write a text file atomically (see `replacing`)."""
    with replacing(path, durable) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_json(path: Path, content: dict[str, Any]) -> None:
    """Write JSON atomically; NaN and infinities become null, numpy values plain ones."""
    write_text(path, json.dumps(plain(content), indent=2, ensure_ascii=False) + "\n")


def write_csv(path: Path, rows: Iterable[Iterable[Any]], *, durable: bool = True) -> None:
    """Write rows of CSV atomically; see `write_text`."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    write_text(path, text.getvalue(), durable=durable)


def plain(value: Any) -> Any:
    """Copy a nested value into types of standard JSON (NaN and infinities as None)."""
    if isinstance(value, dict):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(entry) for entry in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, str | bool | int):
        return value
    return str(value)


def _force_to_disk(path: Path) -> None:
    """Flush a file or folder to disk; skipped if the file system cannot do it for folders."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError:
        if not path.is_dir():
            raise
    finally:
        os.close(handle)


# Errors of flock() on file systems without locks; ENOTSUPP has no name in Python.
_NONE = {errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOTSUP, 524}


def taken(lock: FileLock) -> bool:
    """Take a lock and return True; False if the file system has no locks (some network mounts).

    There processes cannot be kept apart, but a run must be able to write its results.

    Args:
        lock: Lock of filelock; a `timeout` of 0 does not wait, any other waits without limit.

    Raises:
        filelock.Timeout: Another process has it.
        OSError: The lock cannot be taken for another reason.
    """
    from filelock import Timeout

    while True:
        try:
            lock.acquire(timeout=0)
        except Timeout:
            if not _has_locks(Path(lock.lock_file)):
                return False
            if lock.timeout == 0:
                raise
            time.sleep(0.05)
        except NotImplementedError:  # reason: from filelock before 4 if a file system has no locks
            return False
        except OSError as error:  # from version 4 on the error of flock() itself
            if error.errno in _NONE:
                return False
            error.filename = error.filename or lock.lock_file
            raise
        else:
            return True


def _has_locks(path: Path) -> bool:
    """Whether files can be locked there.

    filelock before version 4 takes any other error for a lock held by others.
    """
    with open(path, "ab") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            return error.errno not in _NONE
    return True
