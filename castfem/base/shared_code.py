"""A function that numba compiles, kept as a shared library that is loaded without numba.

To import numba and to load what it keeps on disk takes a process 0.4 s and 90 MB.  A function of
numbers and addresses needs nothing of that: its machine code is linked into a library once, in the
user's cache, in a folder named by a digest of all files it is made of, of the processor, and of the
versions of numba and llvmlite.  Behind its code the library has a check sum, since a file that is
cut off would end the process that loads it.
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
# What only the reporting of exceptions and the freeing of arrays would call, in libraries of numba.
_OF_NUMBA = ("numba_", "NRT_")
_REFUSED = 'define void @"{}"() {{ call void @llvm.trap() unreachable }}'


def addresses(*arrays: NDArray[Any], of: type = float) -> list[int]:
    """Where arrays lie in memory, for as long as they are there.

    Args:
        arrays: Arrays that compiled code reads or writes.
        of: Type of their numbers; the code would go beyond shorter ones.

    Raises:
        ValueError: One is not in one piece, or of other numbers.
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
    """A function that is compiled now, or was by an earlier process.

    Args:
        name: Of its library.
        sources: All files it is made of.
        make: Compiles it: returns a `cfunc` of numba, which neither raises exceptions nor makes
            arrays, for what numba has for that is not there.
        arguments: Types of its arguments, of ctypes.
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
    except Exception as error:  # reason: what is compiled does as well, whatever hinders linking it
        logger.debug("%s: not linked (%s): compiled in each process", path, error)
    found = prototype(made.address)
    found.owner = made  # type: ignore[attr-defined]  # whose code it is
    return found


def _digest(sources: Iterable[Path]) -> str:
    """Digest of the files, of how they are compiled, of the processor and of the compiler."""
    text = hashlib.sha256(_processor().encode())
    for name in ("numba", "llvmlite"):
        with suppress(metadata.PackageNotFoundError):
            text.update(f"{name} {metadata.version(name)}".encode())
    own = Path(__file__), Path(__file__).with_name("compiled.py")
    for file in (*own, *sources):
        text.update(file.read_bytes() + b"\0")
    return text.hexdigest()[:16]


def _processor() -> str:
    """What machine code that uses all of the processor depends on."""
    kind = f"{platform.system()} {platform.machine()}"
    with suppress(OSError):
        first = Path("/proc/cpuinfo").read_text(errors="replace").partition("\n\n")[0]
        lines = [line for line in first.splitlines() if line.startswith(_PROCESSOR)]
        return "\n".join([kind, *lines])
    return f"{kind} {platform.node()}"  # elsewhere code is not shared between machines


def _opened(path: Path, prototype: Any) -> Any:
    """The function of a library; None where there is none, or a damaged one."""
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
    """A library with the code of a function of numba, and its check sum."""
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
    """Write a library where it is kept, or, where that is not possible, into another folder."""
    new = path.with_name(f"{path.stem}.{platform.node()}-{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        new.write_bytes(content)
        os.replace(new, path)
        return path
    except OSError as error:
        with suppress(OSError):  # a part of it, on a full disk
            new.unlink()
        logger.debug("%s: not kept (%s)", path, error)
        library = other / path.name
        library.write_bytes(content)
        return library
