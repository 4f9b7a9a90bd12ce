"""Functions that numba compiles, kept on disk so that the next run need not compile them again.

numba keeps what it has compiled under the signature, the time of change and the length of the file
of the function that Python calls. It does not notice a change of what this function calls from
other files, nor one that keeps time and length, as a digit may in a version installed over another.
So a function that Python calls has a last argument `sources` that nobody gives and whose default
becomes a digest of all that is compiled with it: numba compiles for a default as for a type, and
the default is part of the signature. When the function is called numba looks at the types within
the default alone, not at its values; so the digest is spelt in types, or the second function of a
process would be looked up anew at each call, which takes 70 us. Whether all that is still so,
tests/support/test_compiled.py sees.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import FunctionCache
from numba.extending import is_jitted

from castfem.base.log import logger

# Divisions follow IEEE instead of raising; fastmath stays off, since it would let the compiler
# assume that no NaN and no infinity exists, which the tests must be able to see.
OPTIONS = {"nogil": True, "error_model": "numpy"}


def compiled(function: Callable[..., Any]) -> Any:
    """Compile what other compiled functions alone call: on disk it is a part of these."""
    return numba.njit(**OPTIONS)(function)


def outermost(function: Callable[..., Any]) -> Any:
    """Compile what Python calls, keeping the result on disk where a folder for it can be written.

    Args:
        function: Its last argument has to be `sources=None`.

    Raises:
        TypeError: It is not.
    """
    code = function.__code__
    if code.co_varnames[code.co_argcount - 1] != "sources" or function.__defaults__ != (None,):
        raise TypeError(f"{function.__qualname__} needs sources=None as its last argument")
    try:
        function.__defaults__ = (_digest(function),)
        kept = _Kept(function)
    except (OSError, RuntimeError):  # no text of the sources, or no place for numba's cache
        return numba.njit(**OPTIONS)(function)
    found = numba.njit(**OPTIONS)(function)
    found._cache = kept  # what njit(cache=True) does, with a cache that bears damage
    return found


class _Kept(FunctionCache):  # type: ignore[misc]
    """What numba keeps on disk: damaged files are compiled anew, a full disk keeps nothing."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """What was compiled for a signature; None if it is not there, or cannot be read."""
        try:
            return super().load_overload(sig, target_context)
        except Exception as error:  # reason: numba lets through whatever pickle meets in a file
            logger.debug("%s: damaged (%s), compiled anew", self.cache_path, error)
            with suppress(OSError):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep what was compiled, where that is possible."""
        with suppress(OSError):
            super().save_overload(sig, data)


def _digest(function: Any) -> tuple[int | float, ...]:
    """Bits that are others for other text of its file or of the files of what it calls.

    And for other constants, which may come from any file, or other options. A bit is an integer or
    a float, by value as well as by type.
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
                constants.add(f"{now.__code__.co_filename}: {name} = {value!r}")
    text = hashlib.sha256(repr((OPTIONS, sorted(constants))).encode())
    for file in sorted(files):
        text.update(Path(file).read_bytes() + b"\0")
    bits = "".join(f"{byte:08b}" for byte in text.digest()[:6])
    return tuple(0 if bit == "0" else 1.0 for bit in bits)
