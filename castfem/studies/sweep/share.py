"""A share of the rows of a sweep, for one of several processes that know nothing of each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

from castfem.base.errors import InputError

Row = TypeVar("Row")


@dataclass(frozen=True, slots=True)
class Share:
    """Every n-th row, from the i-th on: rows beside each other often cost alike.

    Attributes:
        number: Which share, from 1 on.
        count: Of how many.
    """

    number: int
    count: int

    @classmethod
    def read(cls, text: str) -> Share:
        """Read `3/20`.

        Raises:
            InputError: It is not written so, or there is no such share.
        """
        number, _, count = text.partition("/")
        try:
            share = cls(int(number), int(count))
        except ValueError:
            raise InputError(f"--part {text}: write it as 3/20, the third of 20 parts") from None
        if not 1 <= share.number <= share.count:
            raise InputError(f"--part {text}: the parts are 1/{share.count} to {count}/{count}")
        return share

    def of(self, rows: Sequence[Row]) -> Sequence[Row]:
        """Return the rows of this share; none where there are more shares than rows."""
        return rows[self.number - 1 :: self.count]
