"""The mesh that a case asks for, and why it may not be had."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from castfem.base.errors import CaseError


@contextmanager
def meshing() -> Iterator[None]:
    """Return a block in which the section of a case is meshed.

    Raises:
        CaseError: What the mesher refuses: too many cells, cells that would be bad.
    """
    try:
        yield
    except ValueError as error:
        raise CaseError(f"mesh: {error}") from error
