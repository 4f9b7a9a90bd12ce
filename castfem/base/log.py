"""Logging: one logger, "castfem", which logs on rank 0 and leaves the root logger alone.

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
"""`extra` of a record for the log file only."""
TERMINAL_ONLY = {"terminal_only": True}
"""`extra` of a record for the terminal only."""


class _Terminal(logging.Handler):
    """Writes to the current stderr, so that a progress bar can stay below."""

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
    """Log file of a run; that it cannot be written, as on a full disk, is reported once."""

    has_warned = False

    def filter(self, record: logging.LogRecord) -> bool:
        return not getattr(record, "terminal_only", False) and bool(super().filter(record))

    def emit(self, record: logging.LogRecord) -> None:
        """Write one record; after a failure the next one tries again."""
        try:
            super().emit(record)
        except OSError:  # it cannot be reopened
            self.handleError(record)

    def handleError(self, record: logging.LogRecord) -> None:
        """Drop what could not be written; logging would print tracebacks and fail at the end."""
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
        """Close the file; a lost part of the log is no failure of a run."""
        with suppress(OSError):
            super().close()


class _Plain(logging.Formatter):
    """The message alone; from warnings on with its level."""

    def format(self, record: logging.LogRecord) -> str:
        text = super().format(record)
        if record.levelno >= logging.WARNING:
            return f"castfem: {record.levelname.lower()}: {text}"
        return text


def setup(verbosity: int = 0, rank: int = 0) -> logging.Logger:
    """Send the messages of this process to the terminal; a second call starts afresh.

    Args:
        verbosity: Negative: warnings and errors only. 0: the main events. Positive: every step.
        rank: MPI rank; only rank 0 logs.
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
    """Also send the messages of rank 0 to a file, replacing the file of a previous run.

    No effect on ranks that `setup` has silenced.
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
    """Close and remove all handlers."""
    _drop(list(logger.handlers))


def _drop(handlers: list[logging.Handler]) -> None:
    for handler in handlers:
        logger.removeHandler(handler)
        handler.close()
