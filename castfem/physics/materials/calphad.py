"""Tables of phases (`castfem.physics.materials.phase_table`) from thermodynamic databases."""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import lru_cache, partial
from hashlib import sha256
from pathlib import Path
from types import MappingProxyType

import numpy as np

from castfem.base.atomic_files import replacing, taken
from castfem.base.csv_files import unreadable
from castfem.base.errors import CannotWrite
from castfem.base.libraries import cache_folder
from castfem.base.log import logger
from castfem.base.types import Array
from castfem.physics.materials.equilibria import SETTINGS, Equilibria, State, content
from castfem.physics.materials.freezing_paths import equilibrium_rows, scheil_rows
from castfem.physics.materials.phase_table import (
    CARBON,
    FORMAT,
    FRACTIONS,
    PhaseTable,
    Request,
    read,
    written,
)


def table_of(request: Request, composition: Mapping[str, float]) -> PhaseTable:
    """Return the table of phases of a steel: stored, cached, or computed.

    Args:
        request: The database, or a table that was computed from one.
        composition: wt% by element; the rest is iron.

    Raises:
        ValueError: There is no table; the message, one line, is about the file of the request.
    """
    path = Path(request.file)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ValueError(unreadable(path, error)) from None
    if path.suffix.lower() == ".csv":
        return _stored(data, request, composition)
    return _cached(request, written(composition), sha256(data).hexdigest())


def _stored(data: bytes, request: Request, composition: Mapping[str, float]) -> PhaseTable:
    """Read a table, which must belong to this steel."""
    table = read(data.decode("utf-8-sig", "replace"))
    asked = {"composition": written(composition), "freezing": request.freezing}
    if request.phases:
        asked["choice of phases"] = " ".join(request.phases)
    for key, text in asked.items():
        found = table.header.get(key, "none")
        if found != text:
            raise ValueError(
                f"was computed for another {key} ({found}) than asked for ({text}); "
                "name the database itself"
            )
    return table


@lru_cache(maxsize=32)
def _cached(request: Request, composition: str, digest: str) -> PhaseTable:
    """The table from the user's cache; a missing one is computed, by one process at a time."""
    from filelock import FileLock

    asked = (FORMAT, digest, composition, request.freezing, *request.phases)
    folder = cache_folder() / "phases"
    file = folder / f"{sha256(repr(asked).encode()).hexdigest()[:24]}.csv"
    amounts = {e: float(w) for e, w in (one.split() for one in composition.split(", ") if one)}
    with suppress(OSError):  # works without a writable cache
        folder.mkdir(parents=True, exist_ok=True)
        lock = FileLock(file.with_suffix(".lock"))
        taken(lock)
        try:
            with suppress(OSError, ValueError):  # missing or incomplete: computed again
                return read(file.read_text(encoding="utf-8"))
            name = Path(request.file).name
            logger.info("computing the phases of the steel by %s, once: some minutes", name)
            text = compute(request, amounts).to_text()
            with suppress(CannotWrite), replacing(file) as temporary:
                temporary.write_text(text, encoding="utf-8")
            return read(text)  # so that a run and its repetition use the same digits
        finally:
            lock.release()
    return read(compute(request, amounts).to_text())


def compute(request: Request, composition: Mapping[str, float]) -> PhaseTable:
    """Compute the table of phases of a steel with a composition in wt%, the rest iron.

    Raises:
        ValueError: It cannot be computed; the message, one line, is about the database.
    """
    if importlib.util.find_spec("pycalphad") is None:
        raise ValueError(
            'pycalphad is not installed; pip install "castfem[calphad]" (in a checkout '
            "tools/env.sh calphad), or name the table that an earlier run keeps in "
            "properties/steel/phases.csv"
        )
    path = Path(request.file)
    text = path.read_bytes()
    amounts = {e: w for e, w in composition.items() if w > 0.0}
    solve = Equilibria(path, ["Fe", *sorted(amounts)], request.phases)
    moles = solve.moles(amounts)
    import pycalphad

    header = {
        **described(path.name, text), "composition": written(amounts),
        "freezing": request.freezing, "phases": " ".join(solve.phases),
        "by": f"pycalphad {pycalphad.__version__}",
    }  # fmt: skip
    if request.phases:  # the elements may not form all of these
        header["choice of phases"] = " ".join(request.phases)
    if outside := ", ".join(beyond_range(text.decode("utf-8", "replace"), amounts)):
        header["outside"] = outside
    path_of = (
        equilibrium_rows if request.scheil is None else partial(scheil_rows, scheil=request.scheil)
    )
    faults = ""
    for solve.samples in SETTINGS.samples:
        columns = _columns(path_of(solve, moles))
        try:
            return PhaseTable(MappingProxyType(header), *columns)
        # a state was not the most stable one: try again with more starting points
        except ValueError as error:
            faults = str(error)
    raise ValueError(f"gives inconsistent equilibria ({faults}); name fewer phases in steel.phases")


def _columns(rows: Sequence[State]) -> tuple[Array, Mapping[str, Array]]:
    """Temperatures, K, and columns of a table as in `PhaseTable`."""
    temperature = np.array([row.temperature for row in rows])
    mass = np.array([row.mass / row.mass.sum() for row in rows]).T
    of_phase = np.array([row.carbon for row in rows]).T
    hot = temperature >= temperature[_least_ferrite(mass[1])]
    delta = np.where(hot, mass[1], 0.0)
    fractions = (mass[0], delta, mass[2], mass[1] - delta, mass[3], mass[4])
    rest = np.array([np.where(hot, 0.0, mass[1]), *mass[2:]])
    of_rest = np.array([np.where(hot, np.nan, of_phase[1]), *of_phase[2:]])
    there = np.where(rest.sum(axis=0) > 0.0, rest, ~np.isnan(of_rest))
    carbon = (
        of_phase[0],
        np.where(hot, of_phase[1], np.nan),
        content((np.nan_to_num(of_rest) * there).sum(axis=0), there.sum(axis=0)),
    )
    enthalpy = np.array([row.enthalpy for row in rows])
    capacity = np.array([row.capacity for row in rows])
    columns = {
        "enthalpy": enthalpy - enthalpy[0], "specific_heat": capacity,
        **dict(zip(FRACTIONS, fractions, strict=True)),
        **dict(zip(CARBON, carbon, strict=True)),
    }  # fmt: skip
    return temperature, MappingProxyType(columns)


def _least_ferrite(ferrite: Array) -> int:
    """Row from which on ferrite is called delta: that with the least, or 0."""
    least = np.flatnonzero(ferrite <= ferrite.min())
    return int(least[len(least) // 2]) if ferrite.min() == 0.0 else 0


def described(name: str, data: bytes) -> dict[str, str]:
    """Metadata of a database: name, version, hash and licence."""
    text = data.decode("utf-8", "replace")
    comments = [line.strip("$* \t\r") for line in text.splitlines() if line[:1] == "$"]
    version = re.search(
        r"(?<![a-z])(?:version|v)[ .]*(\d+(?:\.\d+)*)", " ".join([*comments[:40], name]), re.I
    )
    licence = next((line for line in comments if re.search(r"licen[cs]e", line, re.I)), "")
    return {
        "database": name, "version": version[1] if version else "not stated",
        "sha256": sha256(data).hexdigest(), "licence": licence or "licence not stated",
    }  # fmt: skip


def beyond_range(text: str, composition: Mapping[str, float]) -> list[str]:
    """Contents beyond the limits stated in the comments of a database, "C 1 (to 0.5)", wt%.

    The limits are read after "wt.%" or "weight", such as `Cr<25`; most databases state none.
    """
    comments = "\n".join(line for line in text.splitlines() if line[:1] == "$")
    stated = re.search(
        r"(?:wt\.? ?%|weight).*?((?:[A-Z][A-Za-z]? *< *[\d.]+[\s$,;]*)+)", comments, re.S
    )
    pairs = re.findall(r"([A-Z][A-Za-z]?) *< *(\d+(?:\.\d+)?)", stated[1]) if stated else []
    most = {element.capitalize(): float(limit) for element, limit in pairs}
    return [f"{e} {w:g} (to {most[e]:g})" for e, w in composition.items() if w > most.get(e, w)]
