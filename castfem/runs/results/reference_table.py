"""Writes the tables of columns and results in docs/output.md from the registry of quantities.

    python -m castfem.runs.results.reference_table docs/output.md

updates each of them between its two marks.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable
from pathlib import Path

from castfem.base.result_registry import QuantityDefinition, declared, in_summary_order

_BLOCK = re.compile(r"(<!-- quantities: (.+?) -->\n).*?(<!-- end of quantities -->)", re.DOTALL)


def blocks() -> dict[str, str]:
    """Text of each block, by name."""
    everything = declared()
    columns = [d for d in everything if d.column]
    found = {
        f"columns, {need or 'every run'}": _columns(d for d in columns if _last_need(d) == need)
        for need in dict.fromkeys(_last_need(d) for d in columns)
    }
    return found | {"results": _results(in_summary_order())}


def written(page: str) -> str:
    """The page with updated blocks."""
    texts = blocks()
    return _BLOCK.sub(lambda m: f"{m[1]}\n{texts[m[2]]}\n{m[3]}", page)


def _last_need(definition: QuantityDefinition) -> str:
    return definition.needs[-1] if definition.needs else ""


def _name(definition: QuantityDefinition) -> str:
    return f"`{definition.name}_P`" if definition.each else f"`{definition.name}`"


def _columns(definitions: Iterable[QuantityDefinition]) -> str:
    rows = (f"| {_name(d)} | {d.unit} | {d.about} |\n" for d in definitions)
    return "| column | unit | description |\n|---|---|---|\n" + "".join(rows)


def _results(definitions: Iterable[QuantityDefinition]) -> str:
    rows = (
        f"| {_name(d)} | {d.shown or d.unit} | {d.label.format('P')} | {_last_need(d)} |\n"
        for d in definitions
    )
    return "| result | unit | label | needs |\n|---|---|---|---|\n" + "".join(rows)


if __name__ == "__main__":
    path = Path(sys.argv[1])
    path.write_text(written(path.read_text(encoding="utf-8")), encoding="utf-8")
