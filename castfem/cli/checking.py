"""Checks a case with its steel, reports all problems at once, and describes a valid case."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from castfem.base import log
from castfem.base.constants import ROUNDING
from castfem.base.errors import InputError
from castfem.base.tables import Table
from castfem.base.units import convert
from castfem.cli.options import read_from
from castfem.model import AnyCase, Case, Reading, TensileCase, read_case
from castfem.model.base import FaultyError
from castfem.model.checks import unusual
from castfem.model.cooling import Radiation
from castfem.model.heat_law import no_emissivity, no_expansion
from castfem.model.probe import outside
from castfem.model.problems import Problem

if TYPE_CHECKING:
    from castfem.meshes import SectionMesh
    from castfem.model.secondary import Secondary
    from castfem.physics.constitutive.base import Law
    from castfem.physics.materials import Steel


_COMPONENTS = {"displacement": 3, "stress": 9, "strain": 9, "viscoplastic_strain": 9}
# bytes on disk: of a number, an output time, a field at one time
_VALUE, _STATE, _FIELD = 4, 1200, 900


def problems_of(
    path: Path, overrides: Iterable[str], sizes: Iterable[str] = ()
) -> tuple[AnyCase | None, Steel | None, list[str]]:
    """Return a case, its steel and all problems of both and their laws; None for faulty ones.

    A tensile test has a law instead of a steel. Unusual values of a valid case are logged.

    Args:
        path: File of the case.
        overrides: Assignments of --set.
        sizes: Further assignments, of --accuracy; of their effects only too large cells are warned
            of.
    """
    sizes = tuple(sizes)
    reading = read_case(path, (*overrides, *sizes))
    problems = list(reading.problems)
    steel, law, law_carbon = None, None, None
    try:
        if isinstance(reading.case, TensileCase):
            _try_law(reading, reading.case)
        else:
            with suppress(FaultyError):  # reported by reading the case
                steel = _steel(reading)
            law, law_carbon = _try_mechanics(reading, steel)
    except InputError as error:
        problems += error.problems
    if not problems and isinstance(reading.case, Case):
        problems += _solvers(reading, reading.case)
        problems += [reading.line(one) for one in _lacking(reading.case, steel)]
    if not problems:
        scaled = tuple(f"--set: {one.partition('=')[0]}" for one in sizes)
        _print_warnings(reading, steel, law, law_carbon, scaled)
    return (None if problems else reading.case), steel, problems


def _print_warnings(
    reading: Reading,
    steel: Steel | None,
    law: Law | None,
    law_carbon: float | None,
    scaled: tuple[str, ...],
) -> None:
    """Log the warnings about a valid case.

    For sizes `scaled` by --accuracy only results that are lost through larger cells are reported.
    """
    warnings = list(reading.warnings)
    if isinstance(reading.case, Case) and steel is not None:
        found = unusual.warnings_with(reading.case, steel, law_carbon, law)
        warnings += [reading.line(problem) for problem in found]
    for warning in warnings:
        if not warning.startswith(scaled):
            log.logger.warning("%s", warning)
        elif warning.startswith("--set: mesh."):
            log.logger.warning("%s", warning.replace("--set", "--accuracy", 1))


def _steel(reading: Reading) -> Steel | None:
    table = reading.case.steel if isinstance(reading.case, Case) else None
    if table is None:
        return None
    from castfem.physics.materials import load_steel

    return load_steel(
        table.name,
        Path.cwd(),
        composition=table.composition,
        overrides=table.changes,
        origin=reading.steel,
        where=lambda keys: f"{reading.origin(('steel', *keys))}: steel",
    )


def _try_mechanics(
    reading: Reading, steel: Steel | None
) -> tuple[Law, float | None] | tuple[None, None]:
    """Build the law of the slice of a valid case with mechanics; return it with its carbon, wt%."""
    table = reading.case.mechanics if isinstance(reading.case, Case) else None
    if table is None or steel is None or reading.problems:
        return None, None
    from castfem.model.build.law import build_law
    from castfem.physics.constitutive.parameters import law_carbon

    law = build_law(table, steel, reading.law, reading.elasticity)
    return law, law_carbon(table.law)


def _lacking(case: Case, steel: Steel | None) -> Iterator[Problem]:
    """Yield data that the case needs and its steel lacks."""
    if steel is None:
        return
    if case.mechanics is not None and (lack := no_expansion(steel)):
        yield Problem(("steel", "name"), lack)
    if case.quality is not None and case.quality.hot_tearing:
        from castfem.runs.results.hot_tearing_tracking import lacks

        if (missing := lacks(case.quality, steel)) is not None:
            yield Problem(("quality", *missing[0].split(".")), missing[1])
    tables: list[tuple[tuple[str | int, ...], Radiation | Secondary]] = [
        (("cooling", i, "surface", j), law)
        for i, zone in enumerate(case.cooling)
        for j, law in enumerate(zone.surface)
        if isinstance(law, Radiation)
    ]
    if case.secondary is not None:
        tables.append((("secondary",), case.secondary))
    for path, table in tables:
        if lack := no_emissivity(table.emissivity, steel):
            yield Problem((*path, "emissivity"), lack)


def _solvers(reading: Reading, case: Case) -> list[str]:
    """Return the solver options of the case that PETSc refuses."""
    found: list[str] = []
    tables = {"thermal": case.thermal.solver}
    if case.mechanics is not None:
        tables["mechanics"] = case.mechanics.solver
    for table, options in tables.items():
        if not options:
            continue
        from castfem.model.build.law import try_solver

        try:
            try_solver(table, options)
        except InputError as error:
            found += [reading.line(Problem((table, "solver"), text)) for text in error.problems]
    return found


def _try_law(reading: Reading, case: TensileCase) -> None:
    """Build the law of a valid tensile test."""
    if not reading.problems:
        from castfem.runs.tensile.tensile_test import TensileTest

        TensileTest(case, reading.steel)


def check_case(name: str, path: Path, overrides: Iterable[str]) -> str:
    """Check a case of either kind completely; return a description of a few lines."""
    log.setup()
    try:
        case, steel, problems = problems_of(path, overrides)
    finally:
        log.close()
    if problems or case is None:
        raise InputError(problems)
    if isinstance(case, TensileCase):
        return describe_test(name, case)
    from castfem.cli.drawing import build_mesh

    assert steel is not None
    with read_from(path):
        mesh = build_mesh(case)
    for probe in case.output.probe:
        try:
            place = probe.place(mesh.probes)
            if not mesh.holds(*place):
                raise outside(case.section, probe.name, place)
        except InputError as error:
            problems += [f"{path}: {problem}" for problem in error.problems]
    problems += [f"{path}: {problem}" for problem in drive_faults(case)]
    problems += _search_faults(case, path)
    if problems:
        raise InputError(problems)
    with read_from(path):
        return describe(name, case, steel, mesh)


def _search_faults(case: Case, path: Path) -> list[str]:
    """Errors of [optimise] with which no search could begin: keys, ranges, results."""
    if case.optimise is None:
        return []
    from castfem.studies.optimisation.problem import DesignProblem

    try:
        DesignProblem(case, str(path)).check_results()
    except InputError as error:
        return list(error.problems)
    return []


def drive_faults(case: Case) -> Iterator[str]:
    """Yield an error if the drives are known to be too weak before a run."""
    machine = case.machine
    if machine is None or machine.extraction is None:
        return
    from castfem.model.machine_from_case import known_resistance
    from castfem.physics.machine.extraction.drives import StrandStopsError

    try:
        known_resistance(machine.extraction, machine)
    except StrandStopsError as error:
        yield f"machine.extraction: {error}"


def describe_test(name: str, case: TensileCase) -> str:
    """Return a description of a valid tensile test in a few lines."""
    table = case.tensile
    material = table.material
    law = material if isinstance(material, str) else material.get("law", "")
    lines = [f"{name}: valid", f"  {case.title}", f"  law {law}, {table.steps} steps a segment"]
    for segment in table.segment:
        lines.append(f"  {segment.duration:7.4g} s at {segment.rate:.4g} 1/s")
    if table.cycles > 1:
        lines.append(f"  all of this {table.cycles} times")
    return "\n".join(lines)


def _speed(speed: float | Table) -> str:
    if not isinstance(speed, Table):
        return f"{speed * 60.0:.4g} m/min"
    return f"{min(speed.values) * 60.0:.4g} to {max(speed.values) * 60.0:.4g} m/min"


def describe(name: str, case: Case, steel: Steel, mesh: SectionMesh) -> str:
    """Return a description of a valid case in a few lines: strand, time, zones."""
    casting = case.casting
    solidus = convert(steel.solidus, "K", "degC")
    liquidus = convert(steel.liquidus, "K", "degC")
    lines = [
        f"{name}: valid",
        f"  {case.title}",
        f"  {casting.length:g} m at {_speed(casting.speed)}, {casting.duration:.4g} s",
        f"  steel {steel.name}: solidus {solidus:.6g} degC, liquidus {liquidus:.6g} degC",
        f"  mesh of {len(mesh.cells)} cells",
    ]
    if case.mechanics is not None:
        from castfem.physics.constitutive.parameters import law_carbon

        walls = "free" if case.mould is None else "in a rigid mould"
        carbon = law_carbon(case.mechanics.law)
        of = "" if carbon is None else f" (numbers of a steel of {carbon:g} %C)"
        lines.append(f"  mechanics: {Path(case.mechanics.law).stem}{of}, {walls}")
    if case.machine is not None and (rolls := case.machine.pairs()) is not None:
        first, last = rolls.pairs[0].position, rolls.pairs[-1].position
        lines.append(f"  {len(rolls.pairs)} pairs of rolls, {first:g} to {last:g} m")
        if rolls.edges is not None:
            first, last = (rolls.edges.pairs[i].position for i in (0, -1))
            of_edges = f"  {len(rolls.edges.pairs)} pairs of rolls at the narrow faces, "
            lines.append(f"{of_edges}{first:g} to {last:g} m")
    for span in case.zones():
        laws = ", ".join(law.tag for _, law in span.laws) or "insulated"
        laws = "from roll to roll" if span.roll_to_roll else laws
        lines.append(f"  {span.start:7.3f} - {span.end:7.3f} m  {span.name}: {laws}")
    from castfem.cli.plant_numbers import heat_lines, water_lines

    lines += [f"  {line}" for line in heat_lines(case, steel, mesh)]
    if has_water(case):
        lines += [f"  {line}" for line in water_lines(case, steel, mesh)]
    if case.caster is not None:
        from castfem.runs.caster.demand import demand

        lines.append(f"  caster: {demand(case, mesh.vertices)}")
    return "\n".join([*lines, *_written(case, mesh)])


def _written(case: Case, mesh: SectionMesh) -> Iterator[str]:
    """Yield how many outputs of the fields a run writes, and their size."""
    if not (names := case.output_fields):
        return
    every = case.output_every
    states = 1 + math.ceil(case.casting.duration / every * (1.0 - ROUNDING))
    numbers = sum(_COMPONENTS.get(name, 1) for name in names)
    size = states * (_VALUE * numbers * len(mesh.points) + _STATE + _FIELD * len(names))
    yield (f"  fields: {states} states, {every:.4g} s apart, about {max(1e-6 * size, 0.1):.2g} MB")


def has_water(case: Case) -> bool:
    """Whether the case has any spray."""
    circuits = case.secondary is not None and case.secondary.circuit
    return bool(circuits) or any(law.tag == "spray" for z in case.cooling for law in z.surface)
