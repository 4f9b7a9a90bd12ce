"""A caster that follows its plant: it reads a growing file, and saves its state after each row.

It writes the same files as a run with the complete record: each slice is simulated with the rows so
far, up to the last of them.
"""

from __future__ import annotations

import math
import time
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from castfem.base import log
from castfem.base.atomic_files import write_csv, write_json
from castfem.base.errors import InputError
from castfem.base.shown_units import place_said
from castfem.model.load import portable
from castfem.model.shipped_cases import CASE_NAME
from castfem.runs.caster.files import cells
from castfem.runs.caster.plant_file import PAUSE
from castfem.runs.caster.run import HEADING
from castfem.runs.interrupt import Interrupt, Stopped
from castfem.runs.output.folder import NOW_NAME, NOW_ROWS_NAME, PROPERTIES_NAME, OutputFolder

if TYPE_CHECKING:
    from castfem.model import Case
    from castfem.runs.caster.plant_file import PlantFile
    from castfem.runs.caster.run import CasterRun


def grown(case: Case, source: PlantFile) -> Case:
    """Return the case with the rows so far, and outputs up to the last row or its end."""
    assert case.caster is not None
    until = source.last if case.caster.end is None else min(source.last, case.caster.end)
    moments = tuple(moment for moment in case.caster.moments if moment <= until)
    caster = case.caster.model_copy(
        update={"plant": source.plant(), "end": until, "longest_gap": None, "moments": moments}
    )
    return case.model_copy(update={"caster": caster})


def first_looked_at(case: Case, source: PlantFile, ranks: int) -> Case:
    """Wait for the rows up to the second output time; return the case with them.

    Raises:
        InputError: It cannot be followed.
    """
    if ranks > 1 or case.mechanics is not None:
        reason = "leave out [mechanics]" if ranks == 1 else "start castfem caster without mpirun"
        raise InputError(f"{source.path}: only thermal runs on one rank can follow it: {reason}")
    while True:
        found = grown(case, source)
        assert found.caster is not None
        if len(found.caster.instants) > 1:
            return found
        time.sleep(PAUSE)
        source.take()


def follow(
    run: CasterRun, case: Case, source: PlantFile, output: OutputFolder, interrupt: Interrupt
) -> None:
    """Continue with each new row, until a signal or the end of the case.

    Args:
        run: A run begun with the rows so far.
        case: The case whose plant record grows.
        source: The growing file.
        output: Output folder.
        interrupt: Receives signals to stop.

    Raises:
        RunFailure: A slice failed.
        Stopped: The run was stopped; everything is saved.
    """
    assert case.caster is not None
    end = math.inf if case.caster.end is None else case.caster.end
    try:
        _advance(run, source, output, interrupt, time.monotonic())
        while source.last < end:
            before, begun = len(source), time.monotonic()
            if not source.take():
                _wait(run, interrupt)
            elif _grow(run, case, source, before):
                _advance(run, source, output, interrupt, begun)
        run.save()
    finally:
        text, files = portable(grown(case, source), PROPERTIES_NAME)
        output.write_inputs({CASE_NAME: text.encode(), **files})


def _grow(run: CasterRun, case: Case, source: PlantFile, before: int) -> bool:
    """Read the new rows; rows that make the case invalid are dropped, the last one first."""
    while len(source) > before:
        try:
            run.grow(grown(case, source))
        except InputError as error:
            source.drop_last(str(error))
        else:
            return True
    return False


def _wait(run: CasterRun, interrupt: Interrupt) -> None:
    """Check for a stop, save if needed, and pause."""
    try:
        interrupt.check()
    except Stopped:
        run.save()
        raise
    if not run.is_saved:
        run.save()
    time.sleep(PAUSE)


def _advance(
    run: CasterRun,
    source: PlantFile,
    output: OutputFolder,
    interrupt: Interrupt,
    begun: float,
) -> None:
    """Advance the strand to the last row, which was read at `begun`, and write its state."""
    run.advance(interrupt, None)
    if run.latest is None:
        return
    (row, rows), taken = run.latest, time.monotonic() - begun
    heading = run.heading
    write_csv(
        output / NOW_ROWS_NAME,
        [[f"{name} [{unit}]" for name, unit in heading], *cells(rows, [n for n, _ in heading])],
    )
    content = {
        "clock": row["time"], "last_row": source.last, "rows": len(source),
        "left_out": source.left_out, "written": datetime.now(UTC).isoformat(timespec="seconds"),
        "seconds": round(taken, 3), "strand": dict(row), "slices": [dict(one) for one in rows],
        "units": dict([*HEADING, *heading]),
    }  # fmt: skip
    write_json(output / NOW_NAME, content)
    log.logger.info(
        "%g s: %d slices, the pool ends %s; %.1f s", row["time"], len(rows),
        _ends(float(row["metallurgical_length"])), taken,
    )  # fmt: skip


def _ends(pool: float) -> str:
    return f"at {place_said(pool)}" if math.isfinite(pool) else "below the machine"
