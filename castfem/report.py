"""The summary of a run: what was measured, in engineer's units, beside the case's references."""

from __future__ import annotations

from typing import TYPE_CHECKING

from castfem.output.summary import Comparison, Quantity, Reference, Summary, Zone, compare

if TYPE_CHECKING:
    from castfem.march import March
    from castfem.measure import Reading


PROBES = {"mid_face": "mid-face", "narrow_face": "narrow face", "corner": "corner"}


def summarise(march: March, status: str) -> Summary:
    """The summary of `march` as it stands."""
    scene, reading = march.scene, march.reading
    found = {} if reading is None else quantities(march, reading)
    return Summary(
        title=scene.case.title,
        status=status,
        quantities=found,
        references=_comparisons(march, found),
        balances={"heat": _heat_balance(march)},
        steps={
            "accepted": march.steps,
            "rejected": march.rejected,
            "limited to backward Euler": march.limited,
            "Newton iterations": scene.problem.iterations,
        },
        wall_time=dict(scene.watch.seconds),
        zones=tuple(Zone(s.name, s.start, s.end) for s in scene.zones.spans),
    )


def _comparisons(march: March, final: dict[str, Quantity]) -> tuple[Comparison, ...]:
    """Each reference beside our value where it holds, if the run has come there."""
    found: list[Comparison] = []
    length = march.scene.case.casting.length
    for r in march.scene.case.reference:
        here = final if r.at is None or r.at == length else march.snapshots.get(r.at)
        if here is not None:
            inner = r.at if here is not final else None
            reference = Reference(r.quantity, r.si, r.unit or "-", r.source, at=inner)
            found += compare([reference], here)
    return tuple(found)


def quantities(march: March, reading: Reading) -> dict[str, Quantity]:
    """The results of the slice where `reading` was taken."""
    scene = march.scene
    speed, whole = scene.case.casting.speed, scene.section.multiplicity
    found = {
        "solidus": Quantity(scene.steel.solidus, "degC", "solidus"),
        "liquidus": Quantity(scene.steel.liquidus, "degC", "liquidus"),
        "position": Quantity(reading.position, "m", "position"),
        "time": Quantity(reading.time, "s", "time"),
    }
    for name, profile in reading.profiles.items():
        where = PROBES.get(name, name.replace("_", " "))
        surface = float(profile.temperature[0])
        found |= {
            f"shell_{name}": Quantity(reading.shell[name], "mm", f"shell, {where}"),
            f"liquidus_depth_{name}": Quantity(reading.liquidus[name], "mm", f"liquidus, {where}"),
            f"surface_temperature_{name}": Quantity(surface, "degC", f"surface, {where}"),
            f"heat_flux_{name}": Quantity(reading.flux[name], "kW/m^2", f"heat flux, {where}"),
        }
    removed = reading.removed
    found |= {
        "heat_removed": Quantity(removed, "MJ/m", "heat removed per m"),
        "cooling_power": Quantity(removed * speed, "kW", "cooling power to here"),
        "heat_removed_slice": Quantity(
            removed / whole * speed,
            "kJ",
            "heat removed, modelled slice of 1 s",
        ),
        "temperature_max": Quantity(reading.temperature_range[1], "degC", "hottest spot"),
    }
    closed = march.measure.metallurgical_length
    if closed is not None:
        found["metallurgical_length"] = Quantity(closed, "m", "metallurgical length")
    return found


def _heat_balance(march: March) -> dict[str, Quantity]:
    scene, state = march.scene, march.state
    gained = march.measure.heat_gained(state)
    return {
        "removed": Quantity(state.removed, "kJ/m", "heat out, modelled part"),
        "lost": Quantity(-gained, "kJ/m", "decrease of enthalpy, modelled part"),
        "worst_step": Quantity(
            march.measure.worst_balance, "-", "largest relative error of a step"
        ),
        "whole": Quantity(
            abs(state.removed + gained) / max(abs(state.removed), 1e-300) if state.removed else 0.0,
            "-",
            "relative error over the run",
        ),
        "multiplicity": Quantity(
            float(scene.section.multiplicity), "-", "modelled parts in the section"
        ),
    }
