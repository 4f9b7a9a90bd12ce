"""A function compiled by numba, stored as a shared library that is loaded without numba.

Importing numba and loading its cache takes 0.4 s and 90 MB in each process. A function of numbers
and addresses does not need numba at run time: its machine code is linked into a library once, in
the user's cache, in a folder named by a digest of its source files, the processor, and the versions
of numba and llvmlite. A check sum follows the code in the file, since a truncated library would
crash the process that loads it.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import platform
import subprocess
import sysconfig
import tempfile
import zlib
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from importlib import metadata
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from castfem.base.libraries import cache_folder
from castfem.base.log import logger

_CHECK = 4  # bytes of the check sum
_PROCESSOR = ("model name", "flags", "CPU part", "Features")  # lines of /proc/cpuinfo
# Functions in numba's libraries, called only to report exceptions and to free arrays.
_OF_NUMBA = ("numba_", "NRT_")
_REFUSED = 'define void @"{}"() {{ call void @llvm.trap() unreachable }}'


def addresses(*arrays: NDArray[Any], of: type = float) -> list[int]:
    """Return the addresses of arrays in memory, valid as long as the arrays exist.

    Args:
        arrays: Arrays that compiled code reads or writes.
        of: Type of their numbers; with smaller numbers the code would exceed the array.

    Raises:
        ValueError: An array is not contiguous, or has another type.
    """
    found = []
    for array in arrays:
        if not array.flags.c_contiguous:
            raise ValueError("an array for compiled code must be in one piece")
        if array.dtype != of:
            raise ValueError(f"an array for compiled code is of {array.dtype}, not {of.__name__}")
        found.append(array.ctypes.data)
    return found


def loaded(
    name: str, sources: Iterable[Path], make: Callable[[], Any], arguments: Sequence[Any]
) -> Callable[..., None]:
    """Return a function from its library, which is compiled and linked if it does not exist.

    Args:
        name: Name of the library.
        sources: All source files of the function.
        make: Compiles the function: returns a `cfunc` of numba. It must neither raise exceptions
            nor make arrays, since both need numba's libraries.
        arguments: ctypes of its arguments.
    """
    prototype = ctypes.CFUNCTYPE(None, *arguments)
    place = cache_folder() / "kernels" / _digest(sources)
    path = place / f"{name}.so"
    if (found := _opened(path, prototype)) is not None:
        return found
    made = make()
    try:
        with tempfile.TemporaryDirectory() as folder:
            content = _linked(made, name, Path(folder))
            found = _opened(_kept(content, path, Path(folder)), prototype)
        if found is not None:
            return found
    except Exception as error:  # reason: without a library the compiled function is used instead
        logger.debug("%s: not linked (%s): compiled in each process", path, error)
    found = prototype(made.address)
    found.owner = made  # type: ignore[attr-defined]  # keeps the code in memory
    return found


def _digest(sources: Iterable[Path]) -> str:
    """Return a digest of the source files, compiler options, processor and compiler version."""
    text = hashlib.sha256(_processor().encode())
    for name in ("numba", "llvmlite"):
        with suppress(metadata.PackageNotFoundError):
            text.update(f"{name} {metadata.version(name)}".encode())
    own = Path(__file__), Path(__file__).with_name("compiled.py")
    for file in (*own, *sources):
        text.update(file.read_bytes() + b"\0")
    return text.hexdigest()[:16]


def _processor() -> str:
    """Return the properties of the processor on which optimised machine code depends."""
    kind = f"{platform.system()} {platform.machine()}"
    with suppress(OSError):
        first = Path("/proc/cpuinfo").read_text(errors="replace").partition("\n\n")[0]
        lines = [line for line in first.splitlines() if line.startswith(_PROCESSOR)]
        return "\n".join([kind, *lines])
    return f"{kind} {platform.node()}"  # elsewhere code is not shared between machines


def _opened(path: Path, prototype: Any) -> Any:
    """Return the function of a library; None if the library is missing or damaged."""
    try:
        content = path.read_bytes()
        if _sum(content[:-_CHECK]) != content[-_CHECK:]:
            return None
        return prototype((path.stem, ctypes.CDLL(os.fspath(path))))
    except (OSError, AttributeError) as error:
        if not isinstance(error, FileNotFoundError):
            logger.debug("%s: damaged (%s), compiled anew", path, error)
        return None


def _sum(content: bytes) -> bytes:
    return zlib.crc32(content).to_bytes(_CHECK, "little")


def _linked(made: Any, name: str, folder: Path) -> bytes:
    """Return the content of a library with a function compiled by numba, and a check sum."""
    import llvmlite.binding as llvm

    module = llvm.parse_assembly(made.inspect_llvm())
    module.get_function(made.native_name).name = name
    lacking = [one.name for one in module.functions if one.is_declaration]
    refused = [_REFUSED.format(one) for one in lacking if one.startswith(_OF_NUMBA)]
    module.link_in(llvm.parse_assembly("\n".join(["declare void @llvm.trap()", *refused])))
    features = llvm.get_host_cpu_features().flatten()
    machine = llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=features, opt=3, reloc="pic"
    )
    code, library = folder / "code.o", folder / "code.so"
    code.write_bytes(machine.emit_object(module))
    compiler = os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc"
    words = [*compiler.split(), "-shared", "-o", str(library), str(code), "-lm"]
    subprocess.run(words, check=True, capture_output=True)
    content = library.read_bytes()
    return content + _sum(content)


def _kept(content: bytes, path: Path, other: Path) -> Path:
    """Write a library to its path or, if that is not possible, into another folder."""
    new = path.with_name(f"{path.stem}.{platform.node()}-{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        new.write_bytes(content)
        os.replace(new, path)
        return path
    except OSError as error:
        with suppress(OSError):  # an incomplete file, on a full disk
            new.unlink()
        logger.debug("%s: not kept (%s)", path, error)
        library = other / path.name
        library.write_bytes(content)
        return library
