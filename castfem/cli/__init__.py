"""The command line. Exit status 0: success; 1: invalid input; 2: failure."""

from __future__ import annotations

import errno
import gc
import io
import os
import re
import signal
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path

from castfem.base import process
from castfem.base.errors import CastfemError, InputError
from castfem.cli import parallel

_INTERRUPTED = 130
ALL_RANKS = ("run", "sweep", "error", "optimise", "calibrate", "sensitivity", "section", "caster")
"""Commands that run cases."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit the process with its status."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    process.keep_hangup()
    # commands write pictures; Jupyter passes its display to all programs
    os.environ.pop("MPLBACKEND", None)
    for stream in (sys.stdout, sys.stderr):  # None if closed
        # "?" for characters that the terminal does not have
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    if parallel.rank_and_size()[1] == 1:  # otherwise the end of one rank ends the others
        process.stop_by_all()
    status = execute(words)
    if status == _INTERRUPTED:
        # a signal of a batch system reaches a rank twice
        signal.signal(signal.SIGUSR1, signal.SIG_IGN)
    if status != 0 and _on_all_ranks(words):
        parallel.settle()
    gc.freeze()  # the process end frees all memory: no search for garbage
    sys.exit(status)


def _on_all_ranks(words: Sequence[str]) -> bool:
    """Whether all ranks execute a command: runs and hot tubes; the rest is for rank 0 alone."""
    if words[:1] == ["mould"]:
        return "--hot" in words or "--coupled" in words
    return bool(words) and words[0] in ALL_RANKS


def execute(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    rank, _ = parallel.rank_and_size()
    first = rank == 0 and parallel.started()[0] == 0
    if not first and not _on_all_ranks(words):
        return 0
    import click

    from castfem.cli.app import app

    try:
        if _on_all_ranks(words):
            parallel.check_launcher()
        status = app(args=words or ["--help"], prog_name="castfem", standalone_mode=False)
        return status if isinstance(status, int) else 0
    except SystemExit as stop:  # after shell completion, and at a closed pipe
        return stop.code if isinstance(stop.code, int) else 0
    except click.exceptions.Abort as abort:
        cause = abort.__cause__
        if isinstance(cause, KeyboardInterrupt):
            return _interrupted(first, words)
        return _failed(cause if isinstance(cause, Exception) else abort, first, words)
    except click.ClickException as error:
        if first:
            error.show()
        return InputError.exit_status
    except KeyboardInterrupt:
        return _interrupted(first, words)
    except Exception as error:
        return _failed(error, first, words)


def _failed(error: Exception, first: bool, words: Sequence[str]) -> int:
    """Print an error on the first rank; return its exit status."""
    if not first:
        return _status(error)
    hint = HINT if words[:1] == ["run"] else ""  # no other command takes -v
    # -v, -vv and -qv
    verbose = any(word == "--verbose" or re.fullmatch("-q?v+", word) for word in words)
    return report(error, verbose=verbose, hint=hint)


def report(error: Exception, *, verbose: bool = False, hint: str = "") -> int:
    """Print an error for the user and return the exit status it stands for."""
    prefix = "castfem: "
    named = error.name if isinstance(error, ImportError) else None
    missing = (named or "").split(".")[0] in _ENVIRONMENT
    if isinstance(error, InputError):
        count = len(error.problems)
        if count > 1:
            print(f"{prefix}{count} problems", file=sys.stderr)
            prefix = "  "
        for line in error.problems:
            print(f"{prefix}{line}", file=sys.stderr)
    elif isinstance(error, CastfemError) or missing:
        print(f"{prefix}{error}", file=sys.stderr)
    elif isinstance(error, OSError) and error.errno == errno.ENAMETOOLONG:
        print(
            f"{prefix}{str(error.filename)[:40]}...: no file has such a long name", file=sys.stderr
        )
        return InputError.exit_status
    elif isinstance(error, OSError) and error.errno == errno.ENOSPC:
        where = f"{error.filename}: " if error.filename else "what is printed: "
        print(f"{prefix}{where}{error.strerror}; free some space", file=sys.stderr)
    else:
        if verbose:
            traceback.print_exception(error)
        print(
            f"{prefix}unexpected {_unexpected(error)}\n"
            f"This is a bug in castfem: please report it{'' if verbose else hint}.",
            file=sys.stderr,
        )
    sys.stderr.flush()
    return _status(error)


def _unexpected(error: Exception) -> str:
    """Kind and message of an error, and file, line and function where it was raised."""
    said = ": ".join(part for part in (type(error).__name__, str(error)) if part)
    frames = traceback.extract_tb(error.__traceback__)
    if not frames:
        return said
    path = Path(frames[-1].filename)
    package = Path(__file__).parents[1]
    if path.is_relative_to(package):
        path = path.relative_to(package.parent)
    return f"{said} ({path}:{frames[-1].lineno}, {frames[-1].name})"


_GOES_ON = {
    **dict.fromkeys(("sweep", "error", "optimise", "calibrate"), "the same command"),
    **{name: f"`castfem {name} ... --resume`" for name in ("run", "sensitivity", "caster")},
}
"""Command that continues an interrupted one, by its name."""
HINT = " (repeat with -v and add the traceback)"
_ENVIRONMENT = ("dolfinx", "ufl", "basix", "ffcx", "petsc4py", "mpi4py", "h5py", "gmsh", "numba")


def _status(error: Exception) -> int:
    return error.exit_status if isinstance(error, CastfemError) else CastfemError.exit_status


def _interrupted(first: bool, words: Sequence[str]) -> int:
    if first:
        mend = _GOES_ON.get(words[0] if words else "")
        print(f"castfem: interrupted{f'; {mend} continues' if mend else ''}", file=sys.stderr)
    return _INTERRUPTED
