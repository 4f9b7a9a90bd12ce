"""By what a run was made: effort, versions, its case, and what the cases of several differ in."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from castfem.model.shipped_cases import CASE_NAME
from castfem.post.compare.runs import Run
from castfem.post.report.show import how_it_ended
from castfem.runs.output.run_record import RunRecord
from castfem.runs.output.summary import Summary


def effort(record: RunRecord, summary: Summary) -> str:
    """Steps and machine time in a sentence."""
    steps = ", ".join(f"{name} {value:.6g}" for name, value in summary.steps.items())
    seconds = sum(record.wall_time.values())
    memory = "" if record.memory_mb is None else f", {record.memory_mb:.0f} MB"
    return f"Steps: {steps}. {seconds:.1f} s on {record.ranks} rank(s){memory}."


def provenance(run: Run, record: RunRecord) -> list[tuple[str, str]]:
    """By what the run was made."""
    rows = [("folder", str(run.folder)), ("how it ended", how_it_ended(record))]
    rows += [("started", record.started), ("ended", record.ended)]
    rows += [("command", command) for command in record.commands]
    rows += [("versions", ", ".join(f"{n} {v}" for n, v in record.versions.items()))]
    rows += [(f"SHA-256 of {name}", digest) for name, digest in record.files.items()]
    return [(name, value) for name, value in rows if value]


def case_text(folder: Path) -> str:
    """The case as it was run, empty if it cannot be read."""
    try:
        return (folder / CASE_NAME).read_text(encoding="utf-8")
    except OSError:
        return ""


def differing_keys(runs: Sequence[Run]) -> Iterator[tuple[str, list[str]]]:
    """Keys of the cases that are not the same in all runs, with their values."""
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
