"""A strip that freezes by the similarity solution, and is stretched evenly meanwhile."""

from __future__ import annotations

from typing import Any

from small_case import strip

from castfem.model import Case

AXIAL, AROUND = 1e-4, 2e-4  # imposed strain rates, 1/s


def over_time(rate: float) -> dict[str, object]:
    """Return a strain that grows evenly, as a table for `mechanics.planes`."""
    return {"time": [0, 60], "time_unit": "s", "value": [0, 60 * rate], "unit": "1"}


def stretched(size: float = 0.5, window: float = 0.2, **changes: Any) -> Case:
    """Return the alloy of the similarity solution, stretched evenly along and across the strand."""
    document: dict[str, object] = {
        "steel": {
            "name": "alloy_similarity",
            "overrides": {
                "youngs_modulus": "10 GPa", "poisson_ratio": 0.3,
                "thermal_expansion": {"value": "0 1/K"},
            },
        },
        "casting.temperature": "1540 degC", "casting.length": "0.5 m",
        "section": {"shape": "strip", "length": "50 mm", "width": f"{size} mm"},
        "mesh": {"surface_size": f"{size} mm", "core_size": f"{size} mm"},
        "cooling.0.surface": [{"law": "temperature", "on": ["surface"], "value": "1000 degC"}],
        "thermal.time.step": "0.1 s",
        "mechanics": {
            "law": "weiner_boley", "ferrostatic": "off", "mush": "none",
            "planes": {
                "a0": over_time(AXIAL), "a1": "0 1/m", "a2": "0 1/m", "across": over_time(AROUND),
            },
            "held": [
                {"on": ["side_low", "side_high"], "component": "y"},
                {"on": ["surface"], "component": "x"},
            ],
        },
        "coupling": {"interval": f"{window} s"},
        "quality": {"hot_tearing": ["won", "clyne_davies"]},
        "output": {"figures": False, "fields": []},
    }  # fmt: skip
    return strip(document | changes)
