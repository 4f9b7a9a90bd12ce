"""Options that several commands share."""

from __future__ import annotations

from typing import Annotated

import typer

CaseName = Annotated[
    str, typer.Argument(metavar="CASE", help="A case file, or the name of a shipped case.")
]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change a key, e.g. casting.length='20 m'."),
]
At = Annotated[
    list[str] | None,
    typer.Option("--at", metavar="POSITION", help='Results there, such as "800 mm"; repeatable.'),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Say nothing but errors.")]
Verbose = Annotated[
    int, typer.Option("--verbose", "-v", count=True, help="Say more; tracebacks of faults.")
]
