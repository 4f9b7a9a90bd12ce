"""`castfem watch`: runs at work in the terminal, and as a page that a browser reads again."""

from __future__ import annotations

from pathlib import Path

from castfem.base.errors import RunFailure
from castfem.cli import parallel
from castfem.cli.options import above_zero

_TERMINAL, _LINES = 1.0, 10.0  # s between two looks: at a terminal, and elsewhere


def watch_folder(folder: Path, html: Path | None, every: str, *, wait: bool = False) -> int:
    """Show a run, or the runs of a sweep, until they have ended; return the exit status.

    Args:
        folder: Of the run, or of the sweep.
        html: File of the page, None for none.
        every: Time between two looks, with unit; empty for the default.
        wait: Wait for runs that have not begun, or are to be taken up again.

    Raises:
        InputError: The folder holds no run, or `every` is no time.
        RunFailure: The page cannot be written.
    """
    from castfem.post.watch.terminal import Viewing, watch

    console = parallel.console()
    usual = _TERMINAL if console.is_terminal else _LINES
    interval = above_zero("--every", every, "s") if every else usual
    page = None
    if html is not None:
        from castfem.post.watch.page import Page

        page = Page(folder, html, max(interval, _LINES) if not every else interval, wait=wait)
    try:
        well = watch(folder, Viewing(console, interval, page, wait))
    except KeyboardInterrupt:
        print("watched no longer; what is at work goes on")
        return 0
    if page is not None:
        print(f"page in {html}")
    return 0 if well else RunFailure.exit_status
