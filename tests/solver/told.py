"""What a solver warns of."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from castfem.log import logger


@contextmanager
def told_by(caplog: pytest.LogCaptureFixture) -> Iterator[None]:
    """Let warnings come to `caplog`, whatever has been done to the logger before."""
    before, logger.propagate = logger.propagate, False
    logger.addHandler(caplog.handler)
    try:
        with caplog.at_level("WARNING", logger.name):
            yield
    finally:
        logger.propagate = before
        logger.removeHandler(caplog.handler)
