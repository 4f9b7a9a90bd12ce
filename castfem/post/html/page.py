"""`castfem report`: what the page of some runs holds, and the page itself."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

from castfem.base.atomic_files import write_text
from castfem.base.errors import InputError
from castfem.base.shown_units import (
    ShownUnits,
    label_shown,
    place_said,
    plain_unit,
    scale_of,
    shown_in,
)
from castfem.base.table import Table, pairs
from castfem.model.shipped_cases import CASE_NAME
from castfem.post.compare.runs import Run, alone, heat_shared, read_runs
from castfem.post.compare.table import SHARE, Line, cells, lines
from castfem.post.html import charts as drawn
from castfem.post.html.origin import case_text, differing_keys, effort, provenance
from castfem.post.html.sections import Section, sections
from castfem.post.plots.figures import FIGURES
from castfem.post.report.cautions import cautions, cautions_of_all
from castfem.post.report.conclusions import conclusions
from castfem.post.report.cracks import crack_places
from castfem.post.report.remarks import remarks_of
from castfem.post.report.results_table import balance_tables
from castfem.post.report.show import how_it_ended
from castfem.runs.output.chosen_units import units_of_run
from castfem.runs.output.folder import FIGURES_NAME
from castfem.runs.output.run_record import RunRecord
from castfem.runs.results.numbers import finely, unit_shown

REPORT_NAME = "report.html"
LARGEST = 3_000_000  # bytes of a page; pictures beyond it are left out
_CURVES = 60  # charts of a page at most


@dataclass(frozen=True, slots=True)
class Progress:
    """A run at work, as its page has it."""

    label: str  #: what it is called; empty where it is the only one
    state: str  #: how it stands
    share: float | None  #: of its way, 0 to 1; None where that is not known
    where: str  #: how far it has come
    results: str  #: some of its results
    left: str  #: time it will still take; empty where that is not known


@dataclass(frozen=True, slots=True)
class AtWork:
    """What stands at the head of a page of runs at work."""

    title: str  #: of the page
    status: str  #: how the runs stand
    written: str  #: when the page was written
    again: int  #: after so many seconds a browser reads the page again; 0: it has its final form
    runs: tuple[Progress, ...]  #: how far each has come
    messages: tuple[str, ...] = ()  #: the last that were said


def write(folders: Sequence[Path], target: Path, at: Sequence[float] = ()) -> Path:
    """Write the report of one run, or of several beside one another.

    Args:
        folders: Of runs, or of sweeps.
        target: The file.
        at: Positions, m, whose results the page has besides.

    Raises:
        InputError: A folder holds no run that has ended, or none has been at a position.
        RunFailure: The file cannot be written.
    """
    runs = _runs(folders)
    write_text(target, rendered(runs, at=at), durable=False)
    return target


def rendered(runs: Sequence[Run], at_work: AtWork | None = None, at: Sequence[float] = ()) -> str:
    """The page of some runs, one file without links to others.

    Args:
        runs: Those with results; there may be none yet of runs at work.
        at_work: How runs stand that have not all ended.
        at: Positions, m, whose results the page has besides.

    Raises:
        InputError: No run has been at a position.
    """
    import jinja2

    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, keep_trailing_newline=True
    )
    template = environment.from_string(_text("report.html.j2"))
    with shown_in(units_of_run(runs[0].folder) if runs else ShownUnits()):
        return template.render(_content(runs, at_work, at))


def _runs(folders: Sequence[Path]) -> list[Run]:
    """One run or several."""
    found = alone(folders[0]) if len(folders) == 1 else None
    return [found] if found is not None else read_runs(folders)


def _content(runs: Sequence[Run], at_work: AtWork | None, at: Sequence[float]) -> dict[str, Any]:
    """What the template is filled with."""
    every = lines(runs, runs[0]) if runs else []
    table = [line for line in every if len(runs) > 1 or line.unit != SHARE]
    tables = [("numbers", "Headline numbers", _numbers(runs, table))] if runs else []
    for number, position in enumerate(at):
        there = _numbers(runs, _there(runs, position))
        tables.append((f"place{number}", f"At {place_said(position)}", there))
    charts = drawn.charts(runs)[:_CURVES] if runs else []
    drawn_sections = sections([run.folder for run in runs])
    parts = [_part(run, one, len(runs)) for run, one in zip(runs, drawn_sections, strict=True)]
    for run, one in zip(runs, parts, strict=True):
        base = None if run is runs[0] else (runs[0].label, runs[0].folder, runs[0].summary)
        one["short"] = conclusions(run.folder, run.summary, base)
    for one in parts:
        if one["section"] is not None:
            one["slice_data"] = _json(_slice(one["section"]))
    keys = [(key, *values) for key, values in differing_keys(runs)] if len(runs) > 1 else []
    heads = ("key", *(run.label for run in runs))
    differences = Table(heads, keys, words=range(len(heads))) if keys else None
    size = {
        "width": drawn.WIDTH, "height": drawn.HEIGHT, "left": drawn.LEFT, "right": drawn.RIGHT,
        "top": drawn.TOP, "bottom": drawn.BOTTOM,
    }  # fmt: skip
    along = scale_of("m", "position")
    words = {name: str(size[name.lower()]) for name in ("WIDTH", "LEFT", "RIGHT")}
    words["PLACE"] = _place_in_script(along.unit)
    script = _text("report.js")
    for name, value in words.items():
        script = script.replace(name, value)
    title = runs[0].summary.title if len(runs) == 1 else f"{len(runs)} runs side by side"
    found = {
        "title": title if at_work is None else at_work.title,
        "at_work": at_work,
        "css": _text("report.css"),
        "script": script,
        "runs": parts,
        "tables": tables,
        "notes": list(_notes(runs)),
        "differences": differences,
        "charts": charts,
        "chart_data": [_json(chart.data) for chart in charts],
        "size": size,
        "along": plain_unit(along.unit),
    }
    found["parts"] = _contents(found)
    return found


def _there(runs: Sequence[Run], position: float) -> list[Line]:
    """The numbers at a position, m, which at least one of the runs has passed."""
    found = [line for line in lines(runs, runs[0], at=(position,)) if line.unit != SHARE]
    if not found:
        raise InputError(f"{runs[0].folder}: the run has not been at {place_said(position)}")
    return found


def _place_in_script(unit: str) -> str:
    """The position x of the pointer in words, in the language of the script; m is told in mm."""
    if scale_of("mm", "position").unit == "mm":
        return '(1000 * x).toFixed(0) + " mm"'
    return f'Number(x.toPrecision(4)) + " {plain_unit(unit)}"'


def _contents(found: Mapping[str, Any]) -> list[dict[str, str]]:
    """The parts of the page that are there, for its table of contents."""
    there = {
        "work": ("At work", found["at_work"] is not None),
        "short": ("In short", any(run["short"] for run in found["runs"])),
        **{key: (name, True) for key, name, _ in found["tables"]},
        "look": ("What to look at", any(run["remarks"] for run in found["runs"])),
        "cracks": ("Where it may crack", any(run["cracks"] for run in found["runs"])),
        "case": ("Cases", found["differences"] is not None),
        "section": ("Section", any(run["section"] for run in found["runs"])),
        "curves": ("Over the strand", bool(found["charts"])),
        "pictures": ("Pictures", any(run["pictures"] for run in found["runs"])),
        "balances": ("Balances", bool(found["runs"])),
        "provenance": ("Where it comes from", bool(found["runs"])),
    }
    return [{"id": key, "name": name} for key, (name, present) in there.items() if present]


def _part(run: Run, drawn_section: Section | None, count: int) -> dict[str, Any]:
    """What the page says of one run."""
    record = RunRecord.load(run.folder)
    summary = run.summary
    cracks = crack_places(run.folder, summary)
    ranking = [] if cracks is None else cracks.ranking
    return {
        "label": run.label,
        "status": "" if record.status == "finished" else how_it_ended(record),
        "remarks": list(_remarks(run)),
        "cracks": cracks,
        "ranking": Table((), ranking, words=(0, 3)) if ranking else None,
        "section": drawn_section,
        "slice_data": "",
        "pictures": list(_pictures(run.folder, LARGEST / 2 / count)),
        "balances": list(balance_tables(summary)),
        "effort": effort(record, summary),
        "unchecked": summary.unchecked,
        "provenance": pairs(provenance(run, record)),
        "case": case_text(run.folder),
    }


def _numbers(runs: Sequence[Run], table: Sequence[Line]) -> Table:
    """A row a quantity; a column a run, and one for its references if it has any."""
    referred = [any(not c.missing for c in run.summary.references) for run in runs]
    heads, rows, marks = ["quantity"], [], {}
    for run, also in zip(runs, referred, strict=True):
        heads += [run.label if len(runs) > 1 else "castfem", *(["reference"] if also else [])]
    for number, line in enumerate(table):
        texts, row = cells(line), [label_shown(line.label)]
        if len({text for text, _ in texts}) > 1:
            marks[number, -1] = "differs"
        for i, (text, reference) in enumerate(texts):
            if line.verdict(i) is False:
                marks[number, len(row)] = "missed"
            row.append(text)
            if referred[i]:
                marks[number, len(row)] = "ref"
                row.append(reference)
        rows.append((*row, unit_shown(line.scale.unit)))
    return Table((*heads, "unit"), rows, words=(0, -1), marks=marks)


def _notes(runs: Sequence[Run]) -> Iterator[str]:
    """What is wrong in comparing the runs, what cases leave out, sources of the references."""
    yield from heat_shared(runs)
    yield from shown_cautions(runs)
    sources = {c.reference.source for run in runs for c in run.summary.references if not c.missing}
    if sources:
        yield f"References: {'; '.join(sorted(sources))}. In red: a bound that is not kept."
    if runs and not any(q.error is not None for r in runs for q in r.summary.quantities.values()):
        folder = runs[0].folder
        yield f"Errors of these numbers: castfem error {folder / CASE_NAME}."


def shown_cautions(runs: Sequence[Run]) -> list[str]:
    """What the cases of the runs leave out, with the labels of several."""
    if len(runs) == 1:
        return cautions(runs[0].folder, runs[0].summary)
    return cautions_of_all({run.label: (run.folder, run.summary) for run in runs})


def _remarks(run: Run) -> Iterator[dict[str, str]]:
    """What to look at in a run."""
    for one in remarks_of(run.folder, run.summary):
        value = finely(one.value, one.unit, one.name, one.resolution)
        yield {"what": one.what, "value": value, "where": one.where}


def _slice(section_: Section) -> dict[str, Any]:
    """What the pointer and the slider need of a section."""
    fields = [{k: v for k, v in field.items() if k != "first"} for field in section_.fields]
    return {"places": section_.places, "mirrors": section_.mirrors, "fields": fields}


def _pictures(folder: Path, room: float) -> Iterator[dict[str, str]]:
    """Pictures that are no curves, as long as the page stays small."""
    for figure in FIGURES.values():
        path = folder / FIGURES_NAME / f"{figure.name}.png"
        if not figure.picture or not path.is_file():
            continue
        room -= 4 / 3 * path.stat().st_size
        if room > 0.0:
            data = base64.b64encode(path.read_bytes()).decode("ascii")
            yield {"name": figure.title, "data": data}


def _json(content: Any) -> str:
    """JSON that can stand in a page: nothing in it ends its script."""
    text = json.dumps(content, ensure_ascii=True, separators=(",", ":"), allow_nan=False)
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


def _text(name: str) -> str:
    """A file of the templates."""
    return (resources.files(__package__) / "templates" / name).read_text(encoding="utf-8")
