"""Runs a tensile test of the constitutive law of a case, with output to a folder."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base import log
from castfem.base.constants import ZERO_CELSIUS
from castfem.base.errors import InputError, RunFailure
from castfem.base.shown_quantity import Quantity
from castfem.base.tables import as_function
from castfem.base.types import Array
from castfem.model.load import portable
from castfem.model.tensile import TABLE, TensileCase
from castfem.physics.constitutive import load_elasticity, load_law
from castfem.physics.constitutive.elasticity import Elasticity
from castfem.physics.constitutive.flow_laws import RadialReturn
from castfem.physics.constitutive.parameters import law_from, problems_at
from castfem.physics.constitutive.uniaxial import Tension, axial_stress, pull
from castfem.runs.output.folder import PROPERTIES_NAME, OutputFolder
from castfem.runs.output.history import HISTORY_NAME, History
from castfem.runs.output.summary_file import Reference, Summary, compare

if TYPE_CHECKING:
    from mpi4py import MPI

    from castfem.base.progress import Progress


class TensileTest:
    """A tensile test in SI: constitutive law and strain history.

    Attributes:
        law: Constitutive law.
        time: Times (n,), s.
        strain: Total axial strain (n,).
        rate: Strain rate of the step that ends there (n,), 1/s; 0 for the first.
        temperature: Temperatures (n,), K.
        thermal: Thermal strain (n,).
        ends: Index of the last point of each segment.
        cycles: Points of each cycle.

    Raises:
        InputError: The law cannot be used, or not at the temperatures of the test; all problems.
    """

    def __init__(self, case: TensileCase, origin: str = TABLE) -> None:
        given = self.given = case.tensile
        steps, segments = given.steps, given.segment * given.cycles
        ends = np.cumsum([0.0, *(s.duration for s in segments)])
        turns = np.cumsum([0.0, *(s.rate * s.duration for s in segments)])
        at = np.arange(len(segments) * steps + 1) / steps
        self.time = np.interp(at, np.arange(len(ends)), ends)
        self.strain = np.interp(at, np.arange(len(ends)), turns)
        self.rate = np.concatenate([[0.0], np.repeat([s.rate for s in segments], steps)])
        self.ends = [steps * (k + 1) for k in range(len(segments))]
        once = len(given.segment) * steps  # steps of a cycle
        self.cycles = [slice(k * once, (k + 1) * once + 1) for k in range(given.cycles)]
        again = np.concatenate([np.tile(self.time[:once], given.cycles), [self.time[once]]])
        self.temperature = as_function(given.temperature)(again)
        self.thermal = given.expansion * (self.temperature - self.temperature[0])
        self.law = self._law(origin)

    def _law(self, origin: str) -> RadialReturn:
        """The law, checked at the temperatures of the test."""
        given = self.given
        try:
            known = load_elasticity(given.elasticity)
        except InputError as error:
            raise problems_at(f"{origin}.elasticity", error) from None
        elasticity = Elasticity(
            known.young if given.young is None else as_function(given.young),
            known.poisson if given.poisson is None else as_function(given.poisson),
            known.solidity,
        )
        where, carbon = f"{origin}.material", given.carbon
        if isinstance(given.material, Mapping):
            law = law_from(given.material, elasticity, where, carbon=carbon)
        else:
            try:
                law = load_law(given.material, elasticity, carbon=carbon)
            except InputError as error:
                raise problems_at(where, error) from None
        try:
            law.coefficients(self.temperature[:-1], self.temperature[1:])
        except ValueError as error:
            raise InputError(f"{where}: {error}") from None
        return law

    def analytical(self) -> Array | None:
        """Stress (n,) in closed form, Pa; None if there is none.

        It holds at a constant temperature.
        """
        level = float(self.temperature[0])
        curve = self.law.flow_curve(level)
        if curve is None or (self.temperature != level).any():
            return None
        modulus = float(self.law.elasticity.young(np.full(1, level))[0])
        return axial_stress(self.strain, self.rate, modulus, curve)


def run(
    case: TensileCase,
    folder: Path | str,
    *,
    comm: MPI.Intracomm | None = None,
    resume: bool = False,
    profile: bool = False,
    progress: Progress | None = None,
) -> Summary:
    """Run a tensile test and write everything into `folder` (collective; rank 0 does the work).

    Args:
        case: The case.
        folder: Output folder.
        comm: Communicator; None for this process alone.
        resume: Refused: a test takes a second.
        profile: Has no effect.
        progress: Has no effect.

    Returns:
        The summary, on every rank.

    Raises:
        InputError: The case or the folder cannot be used.
        RunFailure: The test failed; its history so far is on disk.
    """
    if resume:
        raise InputError(f"{folder}: a tensile test has no checkpoint; run without --resume")
    if comm is None or comm.size == 1:
        return _run(case, OutputFolder(folder), 1)
    from castfem.fem.rank_zero import on_root

    summary = on_root(comm, lambda: _run(case, OutputFolder(folder), comm.size))
    found: Summary = comm.bcast(summary)
    return found


def _run(case: TensileCase, output: OutputFolder, ranks: int) -> Summary:
    begin = perf_counter()
    test = TensileTest(case)
    text, files = portable(case, PROPERTIES_NAME)
    output.begin(text, files=files, ranks=ranks)
    with output:
        log.to_file(output / "run.log", append=False)
        analytical = test.analytical()
        writer = _Writer(output / HISTORY_NAME, test, analytical)
        status, reason = "finished", ""
        try:
            with writer.history:
                pull(
                    test.law, test.time, test.strain, test.temperature,
                    thermal_strain=test.thermal, done=writer.row,
                )  # fmt: skip
        except RunFailure as error:
            status, reason = "failed", str(error)
        wall = {"test": perf_counter() - begin}
        summary = _summary(case, status, writer, wall)
        output.write_summary(summary)
        facts: dict[str, Any] = {"wall_time": wall, "reached": writer.reached}
        if status == "failed":
            output.fail(reason, **facts)
            raise RunFailure(f"{reason}; the history so far is in {output / HISTORY_NAME}")
        output.finish(**facts)
    return summary


class _Writer:
    """Writes the rows of the history during the test, and keeps the last one."""

    def __init__(self, path: Path, test: TensileTest, analytical: Array | None) -> None:
        self.test, self.analytical = test, analytical
        self.record: Tension | None = None
        self.last = 0
        columns = [
            ("time", "s"), ("strain", "-"), ("stress", "MPa"), ("viscoplastic_strain", "-"),
            ("analytical_stress", "MPa"), ("temperature", "degC"), ("work", "MJ/m^3"),
        ]  # fmt: skip
        if test.thermal.any():
            columns.insert(2, ("total_strain", "-"))
        self._total = test.thermal.any()
        self.history = History(path, columns)

    @property
    def reached(self) -> dict[str, float]:
        """Last good state."""
        return {"time": float(self.test.time[self.last]), "step": self.last}

    def flow(self, k: int) -> float:
        """Viscoplastic strain at step k."""
        if self.record is None:
            return 0.0
        return float(self.test.law.strain(self.record.state[k])[0])

    def row(self, record: Tension, k: int) -> None:
        """Write row k; before the first one also that of the start."""
        if self.record is None:
            self.record = record
            self._write(record, 0)
        self.last = k
        self._write(record, k)

    def _write(self, record: Tension, k: int) -> None:
        row = {
            "time": record.time[k],
            "strain": record.axial_strain[k, 0],
            "stress": record.axial_stress[k, 0] / 1e6,
            "viscoplastic_strain": self.flow(k),
            "temperature": self.test.temperature[k] - ZERO_CELSIUS,
            "work": record.work[k, 0] / 1e6,
        }
        if self.analytical is not None:
            row["analytical_stress"] = self.analytical[k] / 1e6
        if self._total:
            row["total_strain"] = self.test.strain[k]
        self.history.append(row)


def _summary(case: TensileCase, status: str, writer: _Writer, wall: Mapping[str, float]) -> Summary:
    """The results of the test so far."""
    found = {} if writer.record is None else _quantities(writer, writer.record)
    references = [Reference.of(given) for given in case.reference]
    return Summary(
        title=case.title,
        status=status,
        quantities=found,
        references=compare(references, found),
        steps={"accepted": writer.last},
        wall_time=dict(wall),
    )


def _quantities(writer: _Writer, record: Tension) -> dict[str, Quantity]:
    """Peak, end, end of each segment, and the difference from the closed form."""
    last = writer.last
    stress, strain = record.axial_stress[: last + 1, 0], record.axial_strain[: last + 1, 0]
    top = int(np.argmax(np.abs(stress)))
    found = {
        "stress_peak": Quantity(float(stress[top]), "MPa", "largest stress"),
        "strain_at_peak": Quantity(float(strain[top]), "percent", "strain there"),
        "stress_end": Quantity(float(stress[-1]), "MPa", "stress at the end"),
        "strain_end": Quantity(float(strain[-1]), "percent", "strain at the end"),
        "viscoplastic_strain_end": Quantity(
            writer.flow(last), "percent", "viscoplastic strain, end"
        ),
        "work": Quantity(float(record.work[last, 0]), "MJ/m^3", "viscoplastic work"),
    }
    if len(writer.test.cycles) > 1:
        found |= _of_cycles(stress, writer.test.cycles)
    elif len(writer.test.ends) > 1:
        found |= {
            f"stress_{k}": Quantity(float(stress[end]), "MPa", f"stress, end of segment {k}")
            for k, end in enumerate(writer.test.ends, start=1)
            if end <= last
        }
    if writer.analytical is not None:
        known = np.isfinite(writer.analytical[: last + 1])
        gap = np.abs(stress - writer.analytical[: last + 1])[known] / max(
            float(np.abs(stress).max()), 1e-300
        )
        found["analytical_rms"] = Quantity(
            float(np.sqrt(np.mean(gap**2))), "percent", "off the analytical, rms"
        )
        found["analytical_worst"] = Quantity(
            float(gap.max()), "percent", "off the analytical, worst"
        )
    return found


def _of_cycles(stress: Array, cycles: list[slice]) -> dict[str, Quantity]:
    """Extremes of the stress in some of the completed cycles, and their growth."""
    whole = [c for c in cycles if c.stop <= len(stress)]
    found = {}
    stable = 3  # from this cycle on a law without unlimited hardening repeats itself
    for k in sorted({1, stable, len(whole)} & set(range(1, len(whole) + 1))):
        part = stress[whole[k - 1]]
        top, low = float(part.max()), float(part.min())
        found[f"tension_{k}"] = Quantity(top, "MPa", f"largest stress, cycle {k}")
        found[f"compression_{k}"] = Quantity(low, "MPa", f"smallest stress, cycle {k}")
    if len(whole) > stable:
        first, last = (float(stress[c].max()) for c in (whole[stable - 1], whole[-1]))
        growth = last / first - 1.0 if first > 0.0 else 0.0
        text = f"growth of the largest stress since cycle {stable}"
        found["growth"] = Quantity(growth, "percent", text)
    return found
