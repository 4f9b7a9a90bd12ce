"""Levels of fidelity of a run, and the idealised mould of a case.

    thermal   temperature alone, on the section as cold: no mechanics, the mould follows the strand
    coarse    cells 1.5 times as large, coupling windows twice as long
    default   the case as it is
    fine      cells 0.625 times as large, coupling windows half as long

Costs and errors for the billet of chapter V: docs/mould_design.md. Equation numbers are those of
[Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from castfem.base import units
from castfem.base.errors import InputError
from castfem.base.tables import Table
from castfem.model.load import from_document
from castfem.model.mechanics import Way
from castfem.studies.accuracy.sizes import DEFAULT, LEVELS

if TYPE_CHECKING:
    from castfem.model import Case

THERMAL = "thermal"
WORDS = (THERMAL, *LEVELS)
_WALL = "mould"  # a contact law's word for mould.wall_temperature
# Only the liquid supports a shell without a wall; with this stiffness it bulges as in V.2.1.1.
_SUPPORT = {
    "liquid": "elastic",
    "liquid_stiffness": 1e-3,
    "mush": "geometric",
    "ferrostatic": "proportional",
}


def check_word(word: str) -> None:
    """Refuse what is no level of fidelity."""
    if str(word) not in WORDS:
        near = units.nearest(str(word), WORDS)
        raise InputError(f"fidelity must be one of {', '.join(WORDS)}, got {word!r}{near}")


def at_level(case: Case, word: str) -> Case:
    """Return a case as a level of fidelity has it."""
    check_word(word)
    if word == DEFAULT:
        return case
    if word == THERMAL:
        return _changed(case, lambda tables: _remove_mould(tables, case, mechanics=False))
    level = LEVELS[word]

    def refine(tables: dict[str, Any]) -> None:
        mesh = tables["mesh"]
        for key in [key for key in mesh if key.endswith("_size")]:
            mesh[key] = units.format(level.cells * getattr(case.mesh, key), "m", "mm")
        if case.mechanics is not None:
            window = case.coupling.interval
            length, unit = (window.length, "m") if isinstance(window, Way) else (window, "s")
            tables["coupling"]["interval"] = units.format(level.window * length, unit, unit)

    return _changed(case, refine)


def idealised(case: Case) -> Case:
    """Return the case in its idealised mould (V.2.1), which follows the strand.

    There is no gap and no contact pressure; with mechanics the elastic liquid of the thesis
    supports the shell. A case without [mould] is returned as it is.
    """
    if case.mould is None:
        return case
    return _changed(case, lambda tables: _remove_mould(tables, case, mechanics=True))


def _remove_mould(tables: dict[str, Any], case: Case, mechanics: bool) -> None:
    tables.pop("mould", None)
    tables.pop("quality", None)
    if mechanics and "mechanics" in tables:
        tables["mechanics"] |= {**_SUPPORT, "strain": "small"}
        tables["mechanics"].pop("mush", None)
    else:
        for key in ("mechanics", "coupling"):
            tables.pop(key, None)
    tables.get("output", {}).pop("fields", None)
    if case.mould is None or case.mould.wall_temperature is None:
        return
    wall = _over_time(case, case.mould.wall_temperature)
    for zone in tables["cooling"]:
        for law in zone["surface"]:
            if law.get("law") == "contact" and law.get("wall", _WALL) == _WALL:
                law["wall"] = wall


def _over_time(case: Case, wall: float | Table) -> str | dict[str, Any]:
    """A wall temperature along the mould as a surface law takes it: over time."""
    if not isinstance(wall, Table):
        return units.format(wall, "K", "degC")
    times = [case.casting.travel.time_at(position) for position in wall.arguments]
    return {"time": times, "time_unit": "s", "value": list(wall.values), "unit": "K"}


def _changed(case: Case, change: Callable[[dict[str, Any]], None]) -> Case:
    tables = case.document()
    change(tables)
    return from_document(tables, case.title)
