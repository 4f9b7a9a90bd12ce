"""`castfem report`: collects the content of the page of some runs, and renders it."""

from __future__ import annotations

import base64
import json
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

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
from castfem.post.html.graphics import FRAME, Section, sections
from castfem.post.html.graphics import charts as charts_of
from castfem.post.plots.figures import FIGURES
from castfem.post.report.cautions import cautions, cautions_of_all
from castfem.post.report.conclusions import conclusions
from castfem.post.report.cracks import crack_places
from castfem.post.report.remarks import remarks_of
from castfem.post.report.show import how_it_ended
from castfem.post.report.tables import balance_tables
from castfem.runs.output.folder import CASTER_NAME, FIGURES_NAME
from castfem.runs.output.run_record import RunRecord
from castfem.runs.output.summary_file import Summary
from castfem.runs.results.numbers import finely, unit_shown
from castfem.runs.results.run_case import units_of_run

if TYPE_CHECKING:
    import jinja2

REPORT_NAME = "report.html"
LARGEST = 3_000_000  # bytes of a page; further pictures are left out


@dataclass(frozen=True, slots=True)
class Progress:
    """Progress of a running run on the page."""

    label: str  #: its label; "" for a single run
    state: str  #: its state
    share: float | None  #: fraction completed, 0 to 1; None if unknown
    where: str  #: the position reached
    results: str  #: some of its results
    left: str  #: remaining time; "" if unknown


@dataclass(frozen=True, slots=True)
class AtWork:
    """Head of the page of runs in progress."""

    title: str  #: title of the page
    status: str  #: status of the runs
    written: str  #: time at which the page was written
    again: int  #: seconds after which a browser reloads the page; 0 for the final page
    runs: tuple[Progress, ...]  #: progress of each run
    messages: tuple[str, ...] = ()  #: last log messages


def write(folders: Sequence[Path], target: Path, at: Sequence[float] = ()) -> Path:
    """Write the report of one run, of several in comparison, or of a caster."""
    if len(folders) == 1 and (folders[0] / CASTER_NAME).is_file():
        from castfem.post.html.caster import write_caster

        if at:
            raise InputError(f"{folders[0]}: --at is of a run; of a caster use a pyrometer")
        return write_caster(folders[0], target)
    found = alone(folders[0]) if len(folders) == 1 else None
    runs = [found] if found is not None else read_runs(folders)
    write_text(target, rendered(runs, at=at), durable=False)
    return target


def rendered(runs: Sequence[Run], at_work: AtWork | None = None, at: Sequence[float] = ()) -> str:
    """The page of some runs, one file without external links."""
    with shown_in(units_of_run(runs[0].folder) if runs else ShownUnits()):
        return template("report.html.j2").render(_content(runs, at_work, at))


def template(name: str) -> jinja2.Template:
    """Return a template of a page."""
    import jinja2

    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, keep_trailing_newline=True
    )
    return environment.from_string(text_of(name))


def _content(runs: Sequence[Run], at_work: AtWork | None, at: Sequence[float]) -> dict[str, Any]:
    every = lines(runs, runs[0]) if runs else []
    table = [line for line in every if len(runs) > 1 or line.unit != SHARE]
    tables = [("numbers", "Headline numbers", _numbers(runs, table))] if runs else []
    for number, position in enumerate(at):
        there = [line for line in lines(runs, runs[0], at=(position,)) if line.unit != SHARE]
        if not there:
            raise InputError(f"{runs[0].folder}: the run has not reached {place_said(position)}")
        tables.append((f"place{number}", f"At {place_said(position)}", _numbers(runs, there)))
    charts = charts_of(runs)[:60] if runs else []
    drawn_sections = sections([run.folder for run in runs])
    keys = [(key, *values) for key, values in differing_keys(runs)] if len(runs) > 1 else []
    heads = ("key", *(run.label for run in runs))
    size = asdict(FRAME)
    along = plain_unit(scale_of("m", "position").unit)
    in_mm = scale_of("mm", "position").unit == "mm"
    place = f'Number(x.toPrecision(4)) + " {along}"'
    words = {name: str(size[name.lower()]) for name in ("WIDTH", "LEFT", "RIGHT")}
    words["PLACE"] = '(1000 * x).toFixed(0) + " mm"' if in_mm else place
    script = text_of("report.js")
    for name, value in words.items():
        script = script.replace(name, value)
    title = runs[0].summary.title if len(runs) == 1 else f"{len(runs)} runs side by side"
    found = {
        "title": title if at_work is None else at_work.title,
        "at_work": at_work,
        "css": text_of("report.css"),
        "script": script,
        "runs": [_part(run, runs, one) for run, one in zip(runs, drawn_sections, strict=True)],
        "tables": tables,
        "notes": list(_notes(runs)),
        "differences": Table(heads, keys, words=range(len(heads))) if keys else None,
        "charts": charts,
        "chart_data": [json_of(chart.data) for chart in charts],
        "size": size,
        "along": along,
    }
    found["parts"] = _contents(found)
    return found


def _contents(found: Mapping[str, Any]) -> list[dict[str, str]]:
    """The existing parts of the page, for its table of contents."""
    there = {
        "work": ("Running", found["at_work"] is not None),
        "short": ("Summary", any(run["short"] for run in found["runs"])),
        **{key: (name, True) for key, name, _ in found["tables"]},
        "look": ("Remarks", any(run["remarks"] for run in found["runs"])),
        "cracks": ("Crack risk", any(run["cracks"] for run in found["runs"])),
        "case": ("Cases", found["differences"] is not None),
        "section": ("Section", any(run["section"] for run in found["runs"])),
        "curves": ("Curves along the strand", bool(found["charts"])),
        "pictures": ("Pictures", any(run["pictures"] for run in found["runs"])),
        "balances": ("Balances", bool(found["runs"])),
        "provenance": ("Provenance", bool(found["runs"])),
    }
    return [{"id": key, "name": name} for key, (name, present) in there.items() if present]


def _part(run: Run, runs: Sequence[Run], section: Section | None) -> dict[str, Any]:
    record, summary, base = RunRecord.load(run.folder), run.summary, runs[0]
    cracks = crack_places(run.folder, summary)
    ranking = [] if cracks is None else cracks.ranking
    remarks = [
        {"what": r.what, "value": finely(r.value, r.unit, r.name, r.resolution), "where": r.where}
        for r in remarks_of(run.folder, summary)
    ]
    pointed = {} if section is None else {
        "places": section.places, "mirrors": section.mirrors,
        "fields": [{k: v for k, v in f.items() if k != "first"} for f in section.fields],
    }  # fmt: skip
    others = None if run is base else (base.label, base.folder, base.summary)
    return {
        "label": run.label,
        "status": "" if record.status == "finished" else how_it_ended(record),
        "short": conclusions(run.folder, summary, others),
        "remarks": remarks,
        "cracks": cracks,
        "ranking": Table((), ranking, words=(0, 3)) if ranking else None,
        "section": section,
        "slice_data": json_of(pointed),
        "pictures": list(_pictures(run.folder, LARGEST / 2 / len(runs))),
        "balances": list(balance_tables(summary)),
        "effort": effort(record, summary),
        "unchecked": summary.unchecked,
        "provenance": pairs(provenance(run.folder, record)),
        "case": case_text(run.folder),
    }


def _numbers(runs: Sequence[Run], table: Sequence[Line]) -> Table:
    """One row per quantity; one column per run, and one for its references if it has any."""
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
    """Warnings about the comparison, parts that cases leave out, sources of the references."""
    yield from heat_shared(runs)
    by_label = {run.label: (run.folder, run.summary) for run in runs}
    yield from cautions(*by_label[runs[0].label]) if len(runs) == 1 else cautions_of_all(by_label)
    sources = {c.reference.source for run in runs for c in run.summary.references if not c.missing}
    if sources:
        yield f"References: {'; '.join(sorted(sources))}. In red: a bound that is not met."
    if runs and not any(q.error is not None for r in runs for q in r.summary.quantities.values()):
        folder = runs[0].folder
        yield f"Errors of these numbers: castfem error {folder / CASE_NAME}."


def _pictures(folder: Path, room: float) -> Iterator[dict[str, str]]:
    """Pictures other than curves, as long as the page stays small."""
    for figure in FIGURES.values():
        path = folder / FIGURES_NAME / f"{figure.name}.png"
        if not figure.picture or not path.is_file():
            continue
        room -= 4 / 3 * path.stat().st_size
        if room > 0.0:
            data = base64.b64encode(path.read_bytes()).decode("ascii")
            yield {"name": figure.title, "data": data}


def json_of(content: Any) -> str:
    """JSON that can be part of a page: nothing in it ends its script."""
    text = json.dumps(content, ensure_ascii=True, separators=(",", ":"), allow_nan=False)
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


def text_of(name: str) -> str:
    """The text of a file of the page."""
    return (resources.files(__package__) / "templates" / name).read_text(encoding="utf-8")


def effort(record: RunRecord, summary: Summary) -> str:
    """Steps and machine time as a sentence."""
    steps = ", ".join(f"{name} {value:.6g}" for name, value in summary.steps.items())
    seconds = sum(record.wall_time.values())
    memory = "" if record.memory_mb is None else f", {record.memory_mb:.0f} MB"
    return f"Steps: {steps}. {seconds:.1f} s on {record.ranks} rank(s){memory}."


def provenance(folder: Path, record: RunRecord) -> list[tuple[str, str]]:
    """Provenance of the run."""
    rows = [("folder", str(folder)), ("how it ended", how_it_ended(record))]
    rows += [("started", record.started), ("ended", record.ended)]
    rows += [("command", command) for command in record.commands]
    rows += [("versions", ", ".join(f"{n} {v}" for n, v in record.versions.items()))]
    rows += [(f"SHA-256 of {name}", digest) for name, digest in record.files.items()]
    return [(name, value) for name, value in rows if value]


def case_text(folder: Path) -> str:
    """The case of the run, "" if it cannot be read."""
    try:
        return (folder / CASE_NAME).read_text(encoding="utf-8")
    except OSError:
        return ""


def differing_keys(runs: Sequence[Run]) -> Iterator[tuple[str, list[str]]]:
    """Keys of the cases that differ between runs, with their values."""
    known: list[dict[str, str]] = []
    for run in runs:
        try:
            known.append(dict(_flat(tomllib.loads(case_text(run.folder)))))
        except tomllib.TOMLDecodeError:
            known.append({})
    for key in dict.fromkeys(key for case in known for key in case):
        values = [case.get(key, "-") for case in known]
        if key.partition(".")[0] not in ("title", "reference") and len(set(values)) > 1:
            yield key, values


def _flat(table: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, str]]:
    """Dotted key and value of each entry of a case."""
    for key, value in table.items():
        inner = f"{path}{key}"
        if isinstance(value, Mapping):
            yield from _flat(value, f"{inner}.")
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            for i, entry in enumerate(value):
                yield from _flat(entry, f"{inner}.{entry.get('name', i)}.")
        else:
            yield inner, json.dumps(value, ensure_ascii=False, default=str).strip('"')
