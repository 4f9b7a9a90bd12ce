"""Warnings on a finished run: balances of heat and force, and heat without a source."""

from __future__ import annotations

from collections.abc import Iterator

from castfem.model import Case
from castfem.runs.output.summary import Summary

HEAT = 1e-7
"""Relative error of the heat balance over a run: rounding leaves some 1e-12."""
FORCES = 10.0
"""Times mechanics.tolerance: relative error of the forces that a solved step may have."""
WARMER = 0.1
"""K, by which a strand that is cooled may be warmer than at its start: what heat of flow does."""


def run_warnings(summary: Summary, case: Case, warmed: float) -> Iterator[str]:
    """Yield what is not right in a run, a line each.

    Args:
        summary: Of the run.
        case: Of the run.
        warmed: How far its highest temperature has risen above that of the start, K.
    """
    heat = summary.balances.get("heat", {})
    if "whole" in heat and not abs(heat["whole"].value) <= HEAT:
        yield (
            f"the heat balance is open by {abs(heat['whole'].value):.1e} of the heat, more than "
            f"{HEAT:g}: look at the steel's data and the fluxes"
        )
    tolerance = 0.0 if case.mechanics is None else case.mechanics.tolerance
    allowed = max(FORCES * tolerance, HEAT)
    for name in ("axial force", "forces in the plane"):
        error = summary.balances.get(name, {}).get("error")
        if error is not None and not abs(error.value) <= allowed:
            yield (
                f"the balance of {name} is open by {abs(error.value):.1e}, more than {allowed:.1e}"
                ": stresses are off; look at elasticity, law and loads"
            )
    if warmed > WARMER:
        yield (
            f"its highest temperature has risen by {warmed:.3g} K above that of the start: heat "
            "flows into the strand, or its conductivity jumps by so much that cells round the "
            "corner warm up by themselves (docs/thermal.md); the temperature of the liquid is off"
        )
