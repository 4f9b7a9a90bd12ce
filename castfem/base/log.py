"""Logging: one logger, "castfem", that speaks on rank 0 and leaves the root logger alone.

Messages go to the terminal (stderr) and, once a run has its folder, to `run.log`. Modules use
`logging.getLogger("castfem")` or a child of it.
"""

from __future__ import annotations

import logging
import sys
from contextlib import suppress
from pathlib import Path

logger = logging.getLogger("castfem")
logger.setLevel(logging.INFO)

FILE_ONLY = {"file_only": True}
"""`extra` of a record that goes to the log file but not to the terminal."""
TERMINAL_ONLY = {"terminal_only": True}
"""`extra` of one that goes to the terminal but not to the log file."""


class _Terminal(logging.Handler):
    """Writes to whatever stderr is at the time, so that a progress bar can stand below."""

    def filter(self, record: logging.LogRecord) -> bool:
        return not getattr(record, "file_only", False) and bool(super().filter(record))

    def emit(self, record: logging.LogRecord) -> None:
        """Write one record as a plain line."""
        try:
            sys.stderr.write(self.format(record) + "\n")
            sys.stderr.flush()
        except Exception:
            self.handleError(record)


class _LogFile(logging.FileHandler):
    """The log of a run: that it cannot be written, as on a full disk, is said once, in one line."""

    has_warned = False

    def filter(self, record: logging.LogRecord) -> bool:
        return not getattr(record, "terminal_only", False) and bool(super().filter(record))

    def emit(self, record: logging.LogRecord) -> None:
        """Write one record; the next one tries again where this one could not."""
        try:
            super().emit(record)
        except OSError:  # it cannot even be opened again
            self.handleError(record)

    def handleError(self, record: logging.LogRecord) -> None:
        """Drop what could not be written; logging would print pages and fail at the end."""
        error = sys.exc_info()[1]
        stream, self.stream, self.mode = self.stream, None, "a"  # type: ignore[assignment]
        with suppress(OSError):
            stream.close()
        if not self.has_warned:
            self.has_warned = True
            reason = getattr(error, "strerror", None) or error
            name = Path(self.baseFilename).name
            logger.warning("%s: cannot be written (%s)", name, reason, extra=TERMINAL_ONLY)

    def close(self) -> None:
        """Close the file; what is lost of the log is no failure of a run."""
        with suppress(OSError):
            super().close()


class _Plain(logging.Formatter):
    """The bare message; from warnings on with the level in front."""

    def format(self, record: logging.LogRecord) -> str:
        text = super().format(record)
        if record.levelno >= logging.WARNING:
            return f"castfem: {record.levelname.lower()}: {text}"
        return text


def setup(verbosity: int = 0, rank: int = 0) -> logging.Logger:
    """Direct the messages of this process to the terminal; a second call starts afresh.

    Args:
        verbosity: Negative: warnings and errors only. 0: what a run does. Positive: every step.
        rank: MPI rank; all but rank 0 stay silent.
    """
    close()
    logger.propagate = False
    logger.setLevel(logging.DEBUG if verbosity > 0 else logging.INFO)
    if rank != 0:
        logger.addHandler(logging.NullHandler())
        logger.setLevel(logging.CRITICAL + 1)
        return logger
    terminal = _Terminal()
    terminal.setFormatter(_Plain("%(message)s"))
    terminal.setLevel(logging.WARNING if verbosity < 0 else logging.DEBUG)
    logger.addHandler(terminal)
    return logger


def to_file(path: Path, *, append: bool = False) -> None:
    """Send the messages of rank 0 to a file, too, instead of the file of the run before.

    Without effect on ranks that `setup` has silenced.
    """
    if not logger.isEnabledFor(logging.CRITICAL):
        return
    end_file()
    handler = _LogFile(path, mode="a" if append else "w", encoding="utf-8")
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)-7s %(message)s"))
    logger.addHandler(handler)


def end_file() -> None:
    """Close the log file; the terminal stays."""
    _drop([it for it in logger.handlers if isinstance(it, logging.FileHandler)])


def close() -> None:
    """Close and take away all handlers."""
    _drop(list(logger.handlers))


def _drop(handlers: list[logging.Handler]) -> None:
    for handler in handlers:
        logger.removeHandler(handler)
        handler.close()
