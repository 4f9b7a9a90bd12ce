"""The committed state of a march as a checkpoint holds it, and back."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from castfem.coupling.staggered import StrandState
from castfem.output.summary import Quantity
from castfem.results.summary import last_results
from castfem.time_loop.run_state import Counts

if TYPE_CHECKING:
    from castfem.mechanics.checkpoint import Archive
    from castfem.simulation.simulation import Simulation
    from castfem.time_loop.loop import TimeLoop

Array = npt.NDArray[np.float64]
Named = dict[str, Quantity]

# Arrays of the thermal state, by their name in a checkpoint.
STATE = ("enthalpy", "rate", "course")


def arrays(march: TimeLoop) -> dict[str, Array | None]:
    """The arrays of the committed state, whole on rank 0 (collective)."""
    gather, state = march.simulation.section.gather, march.state
    found = {name: gather(getattr(state.thermal, name)) for name in STATE}
    if march.simulation.problem.shape is not None:
        found["filled"] = gather(state.thermal.filled)
    if march.archive is not None and state.mechanical is not None:
        found |= march.archive.arrays(state.mechanical)
        if march.simulation.case.coupling.dissipation:
            found["heating"] = gather(state.heating)
        if march.simulation.case.coupling.order == "mechanics_first":
            found["trend"] = gather(state.trend)
    return found


def description(march: TimeLoop) -> dict[str, Any]:
    """All of the committed state that is not an array; what a checkpoint holds beside them."""
    thermal, mechanical = march.state.thermal, march.state.mechanical
    results, forces = last_results(march)
    found: dict[str, Any] = {
        "time": thermal.time,
        "removed": thermal.removed,
        "generated": thermal.generated,
        # Without end where a flux is given, which JSON has no number for.
        "allowed": [a if np.isfinite(a) else None for a in thermal.allowed or ()],
        "fed": thermal.fed,
        "counts": asdict(march.counts),
        "step": march.simulation.control.step,
        "substep": march.simulation.steps.control.step,
        "zone": march.zone,
        "measure": march.sampler.memory(),
        "snapshots": [[position, _plain(found)] for position, found in march.snapshots.items()],
        "results": _plain(results),
        "forces": {name: _plain(terms) for name, terms in forces.items()},
    }
    if march.archive is not None and mechanical is not None:
        found["mechanical"] = march.archive.description(mechanical)
    return found


def restore(march: TimeLoop, meta: dict[str, Any], by_node: dict[str, Array]) -> None:
    """Go on from a checkpoint: `description` and arrays by node (on every rank)."""
    nodes = march.simulation.section.node_of_owned
    enthalpy, rate, course = (np.asarray(by_node[name])[nodes] for name in STATE)
    filled = np.asarray(by_node["filled"])[nodes] if "filled" in by_node else None
    thermal = march.simulation.stepper.state_from(
        meta["time"], enthalpy, rate, meta["removed"], meta["generated"], course, filled,
        meta.get("fed", 0.0),
    )  # fmt: skip
    if thermal.filled.size:
        march.simulation.problem.fill(thermal.filled)
    if meta["allowed"]:
        low, high = meta["allowed"]
        thermal.allowed = low, np.inf if high is None else high
    mechanical = None
    if march.archive is not None:
        mechanical = march.archive.state(meta["mechanical"], by_node)
    heating, trend = (
        np.asarray(by_node[name])[nodes] if name in by_node else np.zeros(0)
        for name in ("heating", "trend")
    )
    march.state = StrandState(thermal, mechanical, heating, trend)
    march.counts = Counts(**meta["counts"])
    march.simulation.control.step = meta["step"]
    march.simulation.steps.control.step = meta["substep"]
    march.zone = meta["zone"]
    if march.zone >= 0:
        march.simulation.problem.set_cooling(march.simulation.zones.cooling(march.zone))
    march.sampler.recall(meta["measure"])
    march.snapshots = {position: _named(found) for position, found in meta["snapshots"]}
    march.sample = march.sampler.read(march.state, None)
    forces = {name: _named(terms) for name, terms in meta["forces"].items()}
    march.told = _named(meta["results"]), forces
    march.remember(march.sample)


def _plain(found: Named) -> dict[str, list[Any]]:
    """Quantities as a checkpoint holds them."""
    return {name: [q.value, q.shown_unit, q.label] for name, q in found.items()}


def _named(found: dict[str, list[Any]]) -> Named:
    """The inverse of `_plain`."""
    return {name: Quantity(*parts) for name, parts in found.items()}


def make_archive(simulation: Simulation) -> Archive | None:
    """What takes the mechanical state apart for checkpoints; None without mechanics."""
    if simulation.mechanics is None:
        return None
    from castfem.mechanics.checkpoint import Archive

    return Archive(simulation.mechanics.problem)
