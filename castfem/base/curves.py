"""Values that are one number, or a table over one of several arguments, or a name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from castfem.base.csv_files import UnreadableError, read_csv
from castfem.base.table_notation import Curve
from castfem.base.tables import Table
from castfem.base.units import nearest

if TYPE_CHECKING:
    pass


@dataclass(frozen=True, slots=True)
class CurveOverEither(Curve):
    """Annotation of a field that takes a single value, or a table over one of several arguments.

    Attributes:
        others: What a table may depend on instead of `over`.
    """

    others: tuple[str, ...]

    @property
    def arguments(self) -> str:
        """What a table of it may depend on, in words."""
        *most, last = (self.over, *self.others)
        return f"{', '.join(most)} or {last}"

    def read(self, given: object) -> Any:
        """Return the value in SI, or a table; raise ValueError if it is neither."""
        return self._of(given).read(given)

    def write(self, value: Any) -> Any:
        """Return what reads back to the same value."""
        return self._of(value).write(value)

    def _of(self, given: object) -> Curve:
        """The annotation of what is given, by what it depends on."""
        over = self.over
        for other in self.others:
            of_other = isinstance(given, Table) and given.over == other
            if isinstance(given, Mapping):
                of_other = other in given or _first_of_file(given.get("file")) == other
            over = other if of_other else over
        return Curve(self.kind, over)

    def json_schema(self) -> dict[str, Any]:
        """Return the schema: that of a `Curve` over the one, with the tables over the others."""
        found, *more = (Curve(self.kind, over).json_schema() for over in (self.over, *self.others))
        found["anyOf"] = [*found["anyOf"], *(one["anyOf"][1] for one in more)]
        found["description"] = found["description"].removesuffix(self.over) + self.arguments
        return found


@dataclass(frozen=True, slots=True)
class CurveOrName(CurveOverEither):
    """Annotation of a field that takes a name out of a register, too.

    Attributes:
        register: Names and what they stand for.
    """

    register: Mapping[str, Any] = field(hash=False)

    def read(self, given: object) -> Any:
        """Return the name, the value in SI, or a table; raise ValueError if it is none of them."""
        if isinstance(given, str) and given in self.register:
            return given
        try:
            return CurveOverEither.read(self, given)
        except ValueError as error:
            if isinstance(given, Mapping):
                raise
            near = nearest(given, self.register) if isinstance(given, str) else ""
            names = ", ".join(self.register)
            raise ValueError(f"{error}; or the name of a formula, {names}{near}") from None

    def write(self, value: Any) -> Any:
        """Return what reads back to the same value."""
        return value if isinstance(value, str) else CurveOverEither.write(self, value)

    def json_schema(self) -> dict[str, Any]:
        """Return the schema: that of the values, or the names."""
        known = CurveOverEither.json_schema(self)
        known["anyOf"] = [{"enum": list(self.register)}, *known["anyOf"]]
        return known


def _first_of_file(path: object) -> str | None:
    """Name of the first column of a CSV file; None of one that `Curve` will refuse."""
    try:
        headings = read_csv(Path(str(path))).headings if isinstance(path, str) else []
    except UnreadableError:
        return None
    return headings[0].name if headings else None
