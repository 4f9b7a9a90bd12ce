"""A run that its user stops."""

from __future__ import annotations

from castfem.base.progress import Progress


class Interrupted(Progress):
    """Ctrl-C after so many steps."""

    def __init__(self, steps: int) -> None:
        super().__init__(verbosity=-1, terminal=False)
        self.left = steps

    def update(self, *step: object) -> None:  # type: ignore[override]
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt
