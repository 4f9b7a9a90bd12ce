"""Converts the committed state of a run to the content of a checkpoint and back."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from castfem.base.shown_quantity import Quantity
from castfem.base.types import Array
from castfem.physics.coupling.staggered import StrandState
from castfem.physics.coupling.step_control import StepLength
from castfem.runs.results.run_state import Counts, RunState
from castfem.runs.results.summary import last_results

Named = dict[str, Quantity]

# Arrays of the thermal state: name in the checkpoint, attribute.
STATE = {"enthalpy": "enthalpy", "rate": "rate", "course": "next_rate"}


def arrays(run: RunState) -> dict[str, Array | None]:
    """Return the arrays of the committed state, complete on rank 0 (collective)."""
    gather, state = run.simulation.section.gather, run.state
    found = {name: gather(getattr(state.thermal, own)) for name, own in STATE.items()}
    if run.simulation.problem.shape is not None:
        found["filled"] = gather(state.thermal.filled)
    if run.mechanical_checkpoint is not None and state.mechanical is not None:
        found |= run.mechanical_checkpoint.arrays(state.mechanical)
        if run.simulation.case.coupling.dissipation:
            found["heating"] = gather(state.heating)
        if run.simulation.case.coupling.order == "mechanics_first":
            found["trend"] = gather(state.trend)
    if run.sampler.quality is not None:
        found |= {name: gather(owned) for name, owned in run.sampler.quality.arrays().items()}
    return found


def description(run: RunState) -> dict[str, Any]:
    """Return everything in the committed state that is not an array (collective)."""
    thermal, mechanical = run.state.thermal, run.state.mechanical
    results, forces = last_results(run)
    found: dict[str, Any] = {
        "time": thermal.time,
        "removed": thermal.removed,
        "generated": thermal.generated,
        # Infinite where a flux is prescribed, which JSON cannot express.
        "allowed": [a if np.isfinite(a) else None for a in thermal.allowed or ()],
        "fed": thermal.fed,
        "cooling_changed": thermal.cooling_changed,
        "counts": run.counts.stored(),
        "step": (run.state.step if mechanical is None else run.state.window).step,
        "substep": run.state.step.step,
        "zone": run.zone,
        "measure": run.sampler.memory(),
        "snapshots": [[position, _plain(found)] for position, found in run.snapshots.items()],
        "results": _plain(results),
        "forces": {name: _plain(terms) for name, terms in forces.items()},
    }
    if run.mechanical_checkpoint is not None and mechanical is not None:
        found["mechanical"] = run.mechanical_checkpoint.description(mechanical)
    if run.simulation.control.most > 1.0:
        found["growth"] = run.state.window.growth
        found["strain_rate"] = run.state.strain_rate.tolist()
    if run.sampler.quality is not None:
        found["quality"] = run.sampler.quality.memory()
    return found


def restore(run: RunState, meta: dict[str, Any], by_node: dict[str, Array]) -> None:
    """Restore a checkpoint from `description` and arrays by node (on every rank)."""
    nodes = run.simulation.section.node_of_owned
    enthalpy, rate, next_rate = (np.asarray(by_node[name])[nodes] for name in STATE)
    filled = np.asarray(by_node["filled"])[nodes] if "filled" in by_node else None
    allowed = None
    if meta["allowed"]:
        low, high = meta["allowed"]
        allowed = low, np.inf if high is None else high
    thermal = run.simulation.stepper.state_from(
        meta["time"], enthalpy, rate, meta["removed"], meta["generated"], next_rate, filled,
        meta.get("fed", 0.0), allowed,
    )  # fmt: skip
    changed = meta.get("cooling_changed", False)  # missing in an older checkpoint
    thermal = replace(thermal, cooling_changed=changed)
    if thermal.filled.size:
        run.simulation.problem.fill(thermal.filled)
    mechanical = None
    if run.mechanical_checkpoint is not None:
        mechanical = run.mechanical_checkpoint.state(meta["mechanical"], by_node)
    heating, trend = (
        np.asarray(by_node[name])[nodes] if name in by_node else np.zeros(0)
        for name in ("heating", "trend")
    )
    rate = np.asarray(meta.get("strain_rate", []), float)
    window = StepLength(meta["step"], meta.get("growth", 1.0))
    step = StepLength(meta["substep"])
    run.state = StrandState(thermal, mechanical, heating, trend, rate, step, window)
    run.counts = Counts.restored(meta["counts"])
    run.zone = meta["zone"]
    if run.zone >= 0:
        run.simulation.problem.set_cooling(run.simulation.zones.cooling(run.zone))
    run.sampler.recall(meta["measure"])
    if run.sampler.quality is not None:
        run.sampler.quality.recall(meta["quality"], by_node)
    run.snapshots = {position: _named(found) for position, found in meta["snapshots"]}
    run.take_sample(None, None)
    forces = {name: _named(terms) for name, terms in meta["forces"].items()}
    run.restored = _named(meta["results"]), forces
    run.remember()


def _plain(found: Named) -> dict[str, list[Any]]:
    return {
        name: [q.value, q.shown_unit, q.label, q.error, q.resolution] for name, q in found.items()
    }


def _named(found: dict[str, list[Any]]) -> Named:
    return {name: Quantity(*parts) for name, parts in found.items()}
