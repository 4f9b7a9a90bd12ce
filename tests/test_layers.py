"""A module knows only what is upstream of it: what imports what has no cycle."""

from __future__ import annotations

import ast
import graphlib
from collections.abc import Iterator
from pathlib import Path

ENGINE = Path(__file__).parents[1] / "castfem"


def imported(tree: ast.Module) -> Iterator[str]:
    """Modules of castfem that a module imports, but for those that only its types need."""
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            waiting += node.orelse
            continue
        waiting += ast.iter_child_nodes(node)
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module == "castfem":
            yield from (f"castfem.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module


def test_dependence_has_one_direction() -> None:
    """Between the packages and single modules of the engine; a package is one within itself."""
    needs: dict[str, set[str]] = {}
    for file in ENGINE.rglob("*.py"):
        unit = file.relative_to(ENGINE).parts[0].removesuffix(".py")
        for name in imported(ast.parse(file.read_text(encoding="utf-8"))):
            parts = name.split(".")
            if parts[0] == "castfem" and len(parts) > 1 and parts[1] != unit:
                needs.setdefault(unit, set()).add(parts[1])
    order = list(graphlib.TopologicalSorter(needs).static_order())
    assert order.index("forms") < order.index("contact") < order.index("mechanics")
    assert order.index("case") < order.index("simulation") < order.index("time_loop")
    assert order.index("time_loop") < order.index("cli")
