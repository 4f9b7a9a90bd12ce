"""Samples the slice after each step and at the end of the run, in SI."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from castfem.fem import reductions
from castfem.model.build.simulation import Simulation
from castfem.model.build.start import starting_enthalpy
from castfem.physics.coupling.staggered import StrandState
from castfem.physics.coupling.subcycling import SubSteps
from castfem.physics.mould.mould import is_below
from castfem.physics.thermal.stepper import ThermalState
from castfem.runs.results.sample import (
    BeyondData,
    LargestStress,
    MouldExtremes,
    Sample,
    SmoothStress,
)

if TYPE_CHECKING:
    from castfem.physics.mechanics.state import MechanicalResult
    from castfem.runs.results.crack_tracking import QualitySampler
    from castfem.runs.results.mechanical import MechanicalSampler
    from castfem.runs.results.sample import MechanicalSample
    from castfem.runs.results.spray_range import SprayRange


@dataclass(slots=True)
class Sampler:
    """Samples a run, and keeps what the summary needs from the whole run."""

    simulation: Simulation
    #: samples the strained slice; None without mechanics
    mechanics: MechanicalSampler | None = None
    worst_balance: float = 0.0  #: largest relative heat balance error of a step
    #: position at which the last vertex passed the solidus, m; None while liquid is left
    metallurgical_length: float | None = None
    liquid_end: float | None = None  #: position at which it passed the liquidus, m
    #: mean heat flux from the meniscus to the slice or the end of the mould, W/m2; None without a
    #: mould, or if the run does not begin at the meniscus
    mould_flux: float | None = None
    extremes: MouldExtremes | None = None  #: extremes of the contact in the mould; None without one
    #: largest stress along the way
    largest_stress: LargestStress = field(default_factory=LargestStress)
    beyond_data: BeyondData = field(default_factory=BeyondData)
    #: smooth approximation of that stress; None if not requested
    smooth_stress: SmoothStress | None = None
    #: evaluates the crack indexes; None without [quality]
    quality: QualitySampler | None = None
    #: compares sprayed surfaces with the tables of their nozzles; None without tables
    sprays: SprayRange | None = None
    warmed: float = 0.0  #: rise of the highest temperature above that of the start, K
    _begun: float = np.inf
    _hottest: float = np.inf
    _time: float = 0.0
    _perimeter: float = 0.0
    _mould_exit: float | None = None
    _surface: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Find the surface vertex nearest to the start of each probe."""
        if self.simulation.strained is not None:
            from castfem.runs.results.mechanical import MechanicalSampler

            self.mechanics = MechanicalSampler(
                self.simulation.strained,
                self.simulation.probes,
                self.simulation.centred_probes,
                smooth=bool(self.simulation.case.output.smooth),
            )
            if self.simulation.case.output.smooth:
                self.smooth_stress = SmoothStress()
        if self.simulation.case.mould is not None:
            self.extremes = MouldExtremes(self.simulation.case.mould.length)
        if self.simulation.case.quality is not None:
            from castfem.runs.results.crack_tracking import QualitySampler

            ends = getattr(self.simulation.case.mechanics, "until", None) is not None
            self.quality = QualitySampler(self.simulation, None if ends else self.mechanics)
        secondary = self.simulation.case.secondary
        if secondary is not None and any(model.table is not None for model in secondary.nozzle):
            from castfem.runs.results.spray_range import SprayRange

            self.sprays = SprayRange(self.simulation)
        start = self.simulation.case.casting.start
        if start is None or start.at == "meniscus":
            self._mould_exit = self.simulation.case.mould_exit()
        self._perimeter = self.simulation.zones.perimeter()
        section = self.simulation.section
        space_points = section.vertex_space.tabulate_dof_coordinates()[: section.owned, :2]
        on_surface = self.simulation.zones.surface_vertices()
        for name, (start, _) in self.simulation.probes.lines.items():
            distance = np.linalg.norm(space_points[on_surface] - np.asarray(start), axis=1)
            nearest = float(distance.min()) if distance.size else np.inf
            best = -reductions.largest(section.comm, np.array([-nearest]))
            mine = np.isfinite(nearest) and nearest <= best * (1 + 1e-12)
            owner = -reductions.largest(
                section.comm, np.array([-float(section.comm.rank if mine else section.comm.size)])
            )
            if owner == section.comm.rank:
                dof = int(on_surface[int(distance.argmin())])
                self._surface[name] = dof

    @property
    def surface_vertices(self) -> dict[str, int]:
        """Owned vertex nearest to the start of each probe that is on this rank."""
        return dict(self._surface)

    def read(
        self,
        strand: StrandState,
        substeps: SubSteps | None,
        mechanical: MechanicalResult | None = None,
    ) -> Sample:
        """Sample the committed state (collective)."""
        simulation, state = self.simulation, strand.thermal
        profiles = simulation.probes.sample(state.point.temperature, state.point.conduction)
        if self.mechanics is not None and simulation.problem.shape is not None:
            assert strand.mechanical is not None
            profiles = self.mechanics.displaced(profiles, strand.mechanical)
        steel = simulation.steel
        self.follow(state)
        balance = 0.0 if substeps is None else substeps.balance
        self.worst_balance = max(self.worst_balance, abs(balance))
        sample = Sample(
            simulation=simulation,
            state=strand,
            time=state.time,
            position=simulation.machine.position(state.time),
            step=0.0 if substeps is None else substeps.step,
            newton=0 if substeps is None else substeps.newton,
            profiles=profiles,
            shell={n: p.isotherm_depth(steel.solidus) for n, p in profiles.items()},
            liquidus={n: p.isotherm_depth(steel.liquidus) for n, p in profiles.items()},
            cell={n: p.cell_at(steel.solidus) for n, p in profiles.items()},
            flux=self._surface_flux(state),
            removed=state.removed * simulation.section.multiplicity,
            temperature_range=state.extremes,
            balance=balance,
            mechanics=self._read_mechanics(strand, mechanical),
            metallurgical_length=self.metallurgical_length,
            liquid_end=self.liquid_end,
            mould_flux=self.mould_flux,
        )
        self.largest_stress.note(sample)
        sample.largest_stress = replace(self.largest_stress)
        if self.smooth_stress is not None:
            self.smooth_stress.note(sample)
            sample.smooth_stress = replace(self.smooth_stress)
        self.beyond_data.note(sample)
        sample.beyond_data = BeyondData(dict(self.beyond_data.worst))
        if self.extremes is not None:
            self.extremes.note(sample)
            sample.extremes = replace(self.extremes)
        if self.quality is not None:
            sample.quality = self.quality.note(strand, sample.position, self._centre(sample))
        return sample

    def _read_mechanics(
        self, strand: StrandState, result: MechanicalResult | None
    ) -> MechanicalSample | None:
        if self.mechanics is None or strand.strained is None:
            return None
        return self.mechanics.read(strand.strained, result)

    def _centre(self, sample: Sample) -> float:
        """Temperature on the centre line, K; NaN if no probe ends there."""
        probes = self.simulation.centred_probes
        return float(sample.profiles[probes[0]].temperature[-1]) if probes else np.nan

    def memory(self) -> dict[str, float | None]:
        """Numbers kept over the whole run, for a checkpoint."""
        return {
            "worst_balance": self.worst_balance,
            "metallurgical_length": self.metallurgical_length,
            "liquid_end": self.liquid_end,
            "mould_flux": self.mould_flux,
            "hottest": self._hottest,
            "begun": self._begun,
            "warmed": self.warmed,
            "time": self._time,
            **({} if self.extremes is None else self.extremes.memory()),
            **({} if self.mechanics is None else self.largest_stress.memory()),
            **({} if self.smooth_stress is None else self.smooth_stress.memory()),
            **self.beyond_data.memory(),
        }

    def recall(self, memory: dict[str, float | None]) -> None:
        """Restore `memory`."""
        self.worst_balance = memory["worst_balance"] or 0.0
        self.metallurgical_length = memory["metallurgical_length"]
        self.liquid_end = memory.get("liquid_end")  # missing in an older checkpoint
        self.mould_flux = memory.get("mould_flux")
        self._hottest = memory["hottest"] or np.inf
        self._begun = memory.get("begun") or np.inf  # missing in an older checkpoint
        self.warmed = memory.get("warmed") or 0.0
        self._time = memory["time"] or 0.0
        if self.extremes is not None:
            self.extremes.recall(memory)
        self.largest_stress.recall(memory)
        if self.smooth_stress is not None:
            self.smooth_stress.recall(memory)
        self.beyond_data.recall(memory)

    def heat_gained(self, state: ThermalState) -> float:
        """Change of the modelled part's enthalpy since the meniscus, J/m (negative when cooled)."""
        simulation = self.simulation
        start = starting_enthalpy(simulation)
        volume = (
            simulation.problem.area * state.filled if state.filled.size else simulation.problem.area
        )
        if isinstance(start, float):  # steel as poured, whose enthalpy the liquid brings along
            change = float(volume @ (state.enthalpy - start))
        else:
            change = float(volume @ state.enthalpy - simulation.problem.area @ start)
        return reductions.total(simulation.section.comm, change)

    def _surface_flux(self, state: ThermalState) -> dict[str, float]:
        problem = self.simulation.problem
        flow = problem.surface_flow(state.point, state.rate, state.time)
        share = self.simulation.zones.perimeter_share()  # of the present surface
        names = list(self.simulation.probes.lines)
        local = np.zeros(len(names))
        for i, name in enumerate(names):
            # A face without a law is insulated.
            dof = self._surface.get(name)
            if dof is not None and share[dof] > 0.0:
                local[i] = flow[dof] / share[dof]
        flux = reductions.totals(self.simulation.section.comm, local)
        return {name: float(flux[i]) for i, name in enumerate(names)}

    def follow(self, state: ThermalState) -> None:
        """Update results that depend on all steps: liquid core, mould flux, spray range."""
        self._note_closing(state, state.extremes[1])
        self._note_mould_flux(state)
        if self.sprays is not None:
            self.sprays.note(state.time, state.point.temperature)

    def _note_mould_flux(self, state: ThermalState) -> None:
        """Update the mean flux while the slice is in the mould."""
        end, position = self._mould_exit, self.simulation.machine.position(state.time)
        if end is None or is_below(position, end) or not state.time > 0.0:
            return
        removed = state.removed * self.simulation.section.multiplicity
        self.mould_flux = removed / (self._perimeter * state.time)

    def _note_closing(self, state: ThermalState, hottest: float) -> None:
        """Update where the hottest vertex passes liquidus and solidus."""
        steel = self.simulation.steel
        self.liquid_end = self._passed(state, hottest, steel.liquidus, self.liquid_end)
        self.metallurgical_length = self._passed(
            state, hottest, steel.solidus, self.metallurgical_length
        )
        if not np.isfinite(self._begun):
            self._begun = hottest
        self.warmed = max(self.warmed, hottest - self._begun)
        self._hottest, self._time = hottest, state.time

    def _passed(
        self, state: ThermalState, hottest: float, level: float, known: float | None
    ) -> float | None:
        """Position at which the hottest vertex passed a temperature, m, linear in the step."""
        if hottest >= level:
            return None
        if known is not None:
            return known
        share = 1.0
        if np.isfinite(self._hottest) and self._hottest > level:
            share = (self._hottest - level) / (self._hottest - hottest)
        time = self._time + share * (state.time - self._time)
        return self.simulation.machine.position(time)
