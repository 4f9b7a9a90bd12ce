"""Functions compiled by numba and cached on disk for later runs.

numba itself caches beside the file of the function called from Python, and does not notice changes
in functions from other files. Here the cache is in the user's cache folder, named by a digest of
all source that is compiled together: every change is noticed, and all installations with the same
source share one compilation.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.sigutils import normalize_signature
from numba.extending import is_jitted

from castfem.base.libraries import cache_folder
from castfem.base.log import logger

# Divisions follow IEEE instead of raising; fastmath is off, since it would assume that NaN and
# infinity do not exist, which the code tests for.
OPTIONS = {"nogil": True, "error_model": "numpy"}


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function that only compiled functions call; it is cached as a part of these."""
    return numba.njit(**OPTIONS)(function)


def outermost(function: Callable[..., Any]) -> Any:
    """Compile a function that Python calls, with the result cached on disk if possible."""
    found = numba.njit(**OPTIONS)(function)
    with suppress(OSError):  # no source text: compiled in each process
        found._cache = _Kept(function)  # as njit(cache=True) does, with our own folder
    return found


class _Locator:
    """Gives numba the cache folder of a function, through numba's interface."""

    def __init__(self, function: Any) -> None:
        self._digest = _digest(function)

    @classmethod
    def from_function(cls, function: Any, _file: str) -> _Locator:
        return cls(function)

    def get_cache_path(self) -> str:
        return str(cache_folder() / "kernels" / self._digest)

    def ensure_cache_path(self) -> None:
        os.makedirs(self.get_cache_path(), exist_ok=True)

    def get_source_stamp(self) -> str:
        return self._digest

    def get_disambiguator(self) -> str:
        return ""


class _Storage(CompileResultCacheImpl):  # type: ignore[misc]
    _locator_classes = (_Locator,)


class _Kept(FunctionCache):  # type: ignore[misc]
    """numba's cache on disk: damaged files are compiled again, on a full disk nothing is stored."""

    _impl_class = _Storage

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled code of a signature; None if it is missing or cannot be read."""
        try:
            found = super().load_overload(sig, target_context)
            if found is not None and found.signature.args != normalize_signature(sig)[0]:
                raise ValueError("compiled for other types by a process at the same time")
            return found
        except Exception as error:  # reason: numba passes on any pickle error
            logger.debug("%s: damaged (%s), compiled again", self.cache_path, error)
            with suppress(OSError):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Store compiled code, if possible."""
        with suppress(OSError):
            super().save_overload(sig, data)


def _digest(function: Any) -> str:
    """Digest of the source files of a function and of all it calls.

    Constants, which may come from any file, options and numba's version are included.
    """
    files, constants = set[str](), set[str]()
    seen, waiting = set[Any](), [function]
    while waiting:
        now = waiting.pop()
        if now in seen:
            continue
        seen.add(now)
        files.add(now.__code__.co_filename)
        for name in now.__code__.co_names:
            value = now.__globals__.get(name)
            if is_jitted(value):
                waiting.append(value.py_func)
            elif isinstance(value, int | float | str | tuple):
                constants.add(f"{Path(now.__code__.co_filename).name}: {name} = {value!r}")
    text = hashlib.sha256(repr((numba.__version__, OPTIONS, sorted(constants))).encode())
    for file in sorted(files):
        text.update(Path(file).read_bytes() + b"\0")
    return text.hexdigest()[:16]
