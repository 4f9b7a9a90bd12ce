"""The two ways a run can end badly, each with the exit status the command line gives it."""

from __future__ import annotations

from collections.abc import Iterable


class CastfemError(Exception):
    """Base of every error castfem raises on purpose; `exit_status` is what the shell sees."""

    exit_status = 2


class InputError(CastfemError):
    """What the user wrote cannot be used.

    Attributes:
        problems: One line for each thing that is wrong; it names the file, the key and the mend.
    """

    exit_status = 1

    def __init__(self, problems: str | Iterable[str]) -> None:
        self.problems = (problems,) if isinstance(problems, str) else tuple(problems)
        super().__init__("\n".join(self.problems))


class CaseError(InputError):
    """What a case asks for cannot be built; its problems begin with the key, and name no file."""

    def of(self, path: object) -> InputError:
        """The same, said of the file that the case was read from."""
        return InputError(f"{path}: {problem}" for problem in self.problems)


class FolderInUse(InputError):
    """Another run is at work in the folder."""


class RunFailure(CastfemError):
    """A run could not be continued; the last good state is on disk."""

    exit_status = 2


class CannotWrite(RunFailure):
    """A file cannot be written: a full disk, a folder without rights; the run itself is sound."""
