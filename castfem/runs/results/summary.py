"""The summary of a run: results, comparison with references, and warnings."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from castfem.base.constants import same_instant
from castfem.base.shown_quantity import Quantity
from castfem.fem import reductions
from castfem.model import Case
from castfem.physics.materials.describe import property_label
from castfem.physics.thermal.mould_flux import MOULD_FLUXES
from castfem.runs.output.summary_file import CUT, Comparison, Reference, Summary, Zone, compare
from castfem.runs.results.labels import resolved
from castfem.runs.results.registry import results_of

if TYPE_CHECKING:
    from castfem.model.build.simulation import Simulation
    from castfem.physics.closed_forms import ClosedForm
    from castfem.physics.contact.state import ContactSummary
    from castfem.runs.results.run_state import RunState
    from castfem.runs.results.sample import MechanicalSample, Sample


# Properties of a steel that a thermal run does not use.
_MECHANICAL = ("thermal_expansion", "youngs_modulus", "poisson_ratio")


def summarise(run: RunState, status: str) -> Summary:
    """Return the summary of a run in its present state."""
    simulation = run.simulation
    found, forces = last_results(run)
    return Summary(
        title=simulation.case.title,
        status=status,
        quantities=found,
        references=_comparisons(run, found),
        balances={"heat": _heat_balance(run), **forces},
        steps=_steps(run),
        wall_time=dict(simulation.watch.seconds),
        zones=tuple(Zone(s.name, s.start, s.end, s.whole) for s in simulation.zones.spans),
        mould_exit=simulation.case.mould_exit(),
        unchecked=_unchecked(simulation),
    )


def _unchecked(simulation: Simulation) -> tuple[str, ...]:
    """Data of steel, law and cooling that are quoted from memory, one line for each source."""
    found = {key: o.source for key, o in simulation.steel.origins.items() if o.status == "M"}
    if simulation.case.mechanics is None:
        found = {key: source for key, source in found.items() if key not in _MECHANICAL}
    else:
        from castfem.physics.constitutive.parameters import unchecked

        law = unchecked(simulation.case.mechanics.law)
        found |= {
            f"mechanics.law {key}".removesuffix(" law"): source for key, source in law.items()
        }
    found |= {
        f"cooling {given}": MOULD_FLUXES[given].source
        for zone in simulation.case.cooling
        for law in zone.surface
        for given in (getattr(law, "flux", None), getattr(law, "value", None))
        if isinstance(given, str) and not MOULD_FLUXES[given].checked
    }
    sources: dict[str, list[str]] = {}
    for key, source in found.items():
        sources.setdefault(source or "no source given", []).append(property_label(key))
    return tuple(f"{', '.join(keys)}: {source}" for source, keys in sources.items())


def last_results(run: RunState) -> tuple[dict[str, Quantity], dict[str, dict[str, Quantity]]]:
    """Results and balances of forces of the last step, by name (collective)."""
    if run.restored is not None:
        return run.restored
    sample = run.sample
    found = {} if sample is None else quantities(sample)
    return found, _force_balances(sample)


def _steps(run: RunState) -> dict[str, float]:
    simulation, counts = run.simulation, run.counts
    found = {
        "accepted": counts.steps,
        "rejected": counts.rejected,
        "limited to backward Euler": counts.limited,
        "Newton iterations": counts.newton,
    }
    if simulation.mechanics is not None:
        found |= {
            "coupling windows": counts.windows,
            "coupling windows cut back": counts.cut_back,
            CUT: counts.cut_for_error,
            "Newton iterations, mechanics": counts.newton_mechanics,
        }
        if simulation.coupling is not None and simulation.coupling.gap is not None:
            found |= {
                "coupling iterations": counts.coupling_iterations,
                "coupling windows not converged": counts.gap_not_converged,
            }
    return {name: float(count) for name, count in found.items()}


def _comparisons(run: RunState, final: dict[str, Quantity]) -> tuple[Comparison, ...]:
    """Compare each reference with the computed value where it holds, if the run has come there."""
    found: list[Comparison] = []
    length, end = run.simulation.case.casting.length, run.simulation.control.end
    for r in run.simulation.case.reference:
        here = run.snapshots.get(r.at) if r.at is not None else final
        come = r.at is not None or same_instant(run.state.time, end, end)
        if here is not None and come:
            inner = None if r.at is None or same_instant(r.at, length, length) else r.at
            found += compare([Reference.of(r, inner)], here)
    exact, time = run.simulation.exact, run.state.thermal.time
    if exact is not None and time > 0.0:
        found += compare(_of_closed_form(exact, time), final)
    return tuple(found)


def _of_closed_form(exact: ClosedForm, time: float) -> list[Reference]:
    """Results of the summary according to the closed form at a time, s."""
    return [
        Reference(name, e.value, e.unit, exact.source, note=e.note)
        for name, e in exact.results(time).items()
    ]


def quantities(sample: Sample) -> dict[str, Quantity]:
    """Results of the slice at the time of the sample (collective)."""
    simulation = sample.simulation
    found = {}
    for definition, probe in results_of(simulation):
        value = definition.value(sample, probe)
        if value is not None:
            place = "" if definition.place is None else definition.place(sample)
            found[definition.named(probe)] = definition.result(value, probe, place)
    return resolved(found, sample.cell.get)


def _heat_balance(run: RunState) -> dict[str, Quantity]:
    simulation, state = run.simulation, run.state.thermal
    gained = run.sampler.heat_gained(state)
    open_ = abs(state.removed + gained - state.generated - state.fed)
    problem, comm = simulation.problem, simulation.section.comm
    # What came back leaves little removed: at least the heat that warms the section by a kelvin.
    kelvin = problem.curve.reference_capacity * reductions.total(comm, float(problem.area.sum()))
    fed = {}
    if simulation.problem.shape is not None:
        fed["fed"] = Quantity(state.fed, "kJ/m", "heat of liquid that was fed, modelled part")
    return {
        "removed": Quantity(state.removed, "kJ/m", "heat out, modelled part"),
        "lost": Quantity(-gained, "kJ/m", "decrease of enthalpy, modelled part"),
        "generated": Quantity(state.generated, "kJ/m", "viscoplastic work, modelled part"),
        **fed,
        "worst_step": Quantity(run.sampler.worst_balance, "-", "largest relative error of a step"),
        "whole": Quantity(
            open_ / max(abs(state.removed), kelvin), "-", "relative error over the run"
        ),
        "multiplicity": Quantity(
            float(simulation.section.multiplicity), "-", "number of modelled parts in the section"
        ),
    }


def _wall_forces(contact: ContactSummary | None) -> dict[str, Quantity]:
    """Forces of the mould on the modelled part, including friction."""
    if contact is None:
        return {}
    across, along = (float(f) for f in contact.force)
    return {
        "mould_x": Quantity(across, "kN/m", "mould along x"),
        "mould_y": Quantity(along, "kN/m", "mould along y"),
        "friction": Quantity(contact.axial, "kN/m", "friction along the strand, modelled part"),
    }


def _bending_force(mechanics: MechanicalSample) -> dict[str, Quantity]:
    """Axial force left in the strand by a bending machine."""
    if not mechanics.bending_force:
        return {}
    label = "left by bending and straightening, kM - int M dk, modelled part"
    return {"bending": Quantity(mechanics.bending_force, "kN", label)}


def _force_balances(sample: Sample | None) -> dict[str, dict[str, Quantity]]:
    """Balances of the forces on the slice at the end of the run."""
    if sample is None or sample.mechanics is None or sample.mechanics.balance is None:
        return {}
    mechanics, balance = sample.mechanics, sample.mechanics.balance
    along, moment_x, moment_y = (float(v) for v in balance.axial)
    return {
        "axial force": {
            "force": Quantity(along, "kN", "axial force of the stress, modelled part"),
            "external": Quantity(mechanics.load, "kN", "external axial force, modelled part"),
            "friction": Quantity(
                mechanics.withdrawal_resistance,
                "kN",
                "friction accumulated on the way here, modelled part",
            ),
            **_bending_force(mechanics),
            "reaction": Quantity(
                along - mechanics.load - mechanics.withdrawal_resistance - mechanics.bending_force,
                "kN",
                "remainder, carried by the planes (0 where they are free)",
            ),
            "moment_x": Quantity(moment_x, "kN m", "moment of the stress with lever arm x"),
            "moment_y": Quantity(moment_y, "kN m", "moment of the stress with lever arm y"),
            "error": Quantity(balance.axial_error, "-", "relative error of the axial equilibrium"),
        },
        "forces in the plane": {
            **_wall_forces(mechanics.contact),
            "support_x": Quantity(float(balance.support[0]), "kN/m", "supports along x"),
            "support_y": Quantity(float(balance.support[1]), "kN/m", "supports along y"),
            "error": Quantity(
                balance.forces_error, "-", "largest relative error of the forces of a node"
            ),
        },
    }


def run_warnings(summary: Summary, case: Case, warmed: float) -> Iterator[str]:
    """Yield the warnings about a run, one line each."""
    # over a run; rounding alone gives about 1e-12
    heat, most = summary.balances.get("heat", {}), 1e-7
    if "whole" in heat and not abs(heat["whole"].value) <= most:
        yield (
            f"the heat balance does not close: {abs(heat['whole'].value):.1e} of the heat is "
            f"missing (allowed: {most:g}); check the steel's data and the fluxes"
        )
    tolerance = 0.0 if case.mechanics is None else case.mechanics.tolerance
    allowed = max(10.0 * tolerance, most)  # of an accepted step
    for name in ("axial force", "forces in the plane"):
        error = summary.balances.get(name, {}).get("error")
        if error is not None and not abs(error.value) <= allowed:
            yield (
                f"the balance of {name} does not close: its relative error is "
                f"{abs(error.value):.1e} (allowed: {allowed:.1e}), so that stresses are wrong; "
                "check elasticity, law and loads"
            )
    if warmed > 0.1:  # K: the heating by viscoplastic work is smaller
        yield (
            f"the highest temperature of the strand has risen by {warmed:.4g} K above that of the "
            "start: heat flows into the strand, or its conductivity jumps by so much that cells "
            "round the corner warm up by themselves (docs/thermal.md), which makes the temperature "
            "of the liquid wrong"
        )
