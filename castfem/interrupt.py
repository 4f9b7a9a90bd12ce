"""Ctrl-C during a march: heeded between two steps, for within PETSc an exception would be lost."""

from __future__ import annotations

import signal
import threading
from types import FrameType
from typing import Any, Self

from castfem import log
from castfem.closing import Closing


class Interrupt(Closing):
    """While it is entered, the first Ctrl-C is only noted; a second one raises at once.

    It leaves signals alone that somebody else handles, and off the main thread, where Python
    delivers none.

    Args:
        alone: Whether this process marches alone; of several ranks each must end at once, for
            they would heed it after different steps.

    Attributes:
        wanted: Whether there was a Ctrl-C.
    """

    def __init__(self, alone: bool) -> None:
        self.wanted = False
        self._alone = alone
        self._former: Any = None

    def heed(self) -> None:
        """Stop here if that is wanted.

        Raises:
            KeyboardInterrupt: It is.
        """
        if self.wanted:
            raise KeyboardInterrupt

    def __enter__(self) -> Self:
        ours = signal.getsignal(signal.SIGINT) is signal.default_int_handler
        if self._alone and ours and threading.current_thread() is threading.main_thread():
            self._former = signal.signal(signal.SIGINT, self._note)
        return self

    def close(self) -> None:
        """Let Ctrl-C do what it did before."""
        if self._former is not None:
            signal.signal(signal.SIGINT, self._former)
            self._former = None

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self.wanted:
            signal.default_int_handler(number, frame)
        self.wanted = True
        log.logger.warning("stopping after this step; Ctrl-C once more stops at once")
