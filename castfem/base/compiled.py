"""Functions that numba compiles, kept on disk so that the next run need not compile them again.

By itself numba keeps it beside the file of the function that Python calls, and does not notice a
change of what this function calls from other files. Here it is kept in the user's cache, in a
folder named by a digest of all that is compiled together: every change is noticed, and all
checkouts and installations with the same text share one compilation.
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

# Divisions follow IEEE instead of raising; fastmath stays off, since it would let the compiler
# assume that no NaN and no infinity exists, which the tests must be able to see.
OPTIONS = {"nogil": True, "error_model": "numpy"}


def compiled(function: Callable[..., Any]) -> Any:
    """Compile what other compiled functions alone call: on disk it is a part of these."""
    return numba.njit(**OPTIONS)(function)


def outermost(function: Callable[..., Any]) -> Any:
    """Compile what Python calls, keeping the result on disk where that is possible."""
    found = numba.njit(**OPTIONS)(function)
    with suppress(OSError):  # no text of the sources: compiled in each process
        found._cache = _Kept(function)  # what njit(cache=True) does, with folder and care of ours
    return found


class _Locator:
    """Tells numba in which folder a function is kept, by numba's names."""

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
    """What numba keeps on disk: damaged files are compiled anew, a full disk keeps nothing."""

    _impl_class = _Storage

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """What was compiled for a signature; None if it is not there, or cannot be read."""
        try:
            found = super().load_overload(sig, target_context)
            if found is not None and found.signature.args != normalize_signature(sig)[0]:
                raise ValueError("compiled for other types by a process at the same time")
            return found
        except Exception as error:  # reason: numba lets through whatever pickle meets in a file
            logger.debug("%s: damaged (%s), compiled anew", self.cache_path, error)
            with suppress(OSError):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep what was compiled, where that is possible."""
        with suppress(OSError):
            super().save_overload(sig, data)


def _digest(function: Any) -> str:
    """Digest of the text of its file and of the files of what it calls.

    And of their constants, which may come from any file, of the options and of numba.
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
