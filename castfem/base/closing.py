"""Things that are closed at the end of a `with`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from types import TracebackType
from typing import Self


class Closing(ABC):
    """Closes itself at the end of a `with`, whatever has happened in it."""

    @abstractmethod
    def close(self) -> None:
        """Let go of what is held; safe to call twice."""

    def leave(self, error: BaseException) -> None:  # noqa: B027 - most have nothing to add
        """Take note of the error that ends the `with`, before closing."""

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
