"""matplotlib as castfem draws with it, whatever the user has set for figures of their own."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from types import ModuleType
from typing import Any

_DISPLAY = "MPLBACKEND"


def own_matplotlib() -> ModuleType:
    """Import matplotlib also where the environment names a display that this Python does not have.

    Jupyter hands its own to every program it starts. Figures of castfem need none.
    """
    display = None if "matplotlib" in sys.modules else os.environ.pop(_DISPLAY, None)
    try:
        import matplotlib
    finally:
        if display is not None:
            os.environ[_DISPLAY] = display
    if display is not None:
        with suppress(ValueError):  # for figures of the user's own, where it is there
            matplotlib.rcParams["backend"] = display
    return matplotlib


@contextmanager
def own_style(settings: Mapping[str, Any] | None = None) -> Iterator[None]:
    """Inside the block matplotlib has its defaults and these settings, none of a matplotlibrc.

    Args:
        settings: What differs from the defaults, as in a matplotlibrc.
    """
    matplotlib = own_matplotlib()
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(settings or {})
        yield
