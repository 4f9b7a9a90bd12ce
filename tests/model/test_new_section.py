"""What a new shape of section costs: a model, a mesh function and its line in the register."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar, Literal

import pytest
from pydantic import Field
from small_case import write_small

import castfem
from castfem.base.errors import InputError
from castfem.base.quantities import Length
from castfem.meshes import BUILDERS, SectionMesh
from castfem.meshes.rectangle import rectangle
from castfem.model.build_mould import build_mould
from castfem.model.mould import Mould
from castfem.model.schema import case_schema, markdown_page
from castfem.model.section import Rectangle, Section, Size
from castfem.physics import mould


def square(
    *,
    side: float,
    cell: Literal["quadrilateral", "triangle"] = "quadrilateral",
    order: int = 1,
    **sizes: Any,
) -> SectionMesh:
    """Mesh the quarter of a sharp square."""
    own = {"cell": cell, "order": order, **sizes}
    return rectangle(width=side, height=side, corner_radius=0.0, symmetry="quarter", **own)


@pytest.fixture
def shape(monkeypatch: pytest.MonkeyPatch) -> type[Section]:
    """A shape that only the test with this fixture has."""
    monkeypatch.setattr(Section, "kinds", dict(Section.kinds))
    monkeypatch.setitem(BUILDERS, "square", f"{__name__}:square")

    class Square(Section):
        """A sharp square, of which a quarter is modelled."""

        groups: ClassVar[dict[str, str]] = {"wide_face": "y", "narrow_face": "x"}

        shape: Literal["square"]
        side: Length = Field(description="size in x and y")

        def outline(self) -> tuple[float | None, float | None]:
            return self.side, self.side

        def barred(self) -> tuple[str, ...]:
            return ("a1", "a2")

        def cavity(self, size: Size, hot: float) -> mould.Cavity:
            return mould.RectangleCavity(self.side / hot, self.side / hot, 0.0)

    return Square


@pytest.fixture
def case(tmp_path: Path) -> castfem.Case:
    """A sharp billet of 100 mm."""
    changes = {"section.corner_radius": "0 mm", "output.every": "1 s"}
    return castfem.load(write_small(tmp_path)).with_(changes)


def test_a_new_shape_runs(case: castfem.Case, shape: type[Section]) -> None:
    """As the rectangle that it is."""
    new = case.with_({"section": {"shape": "square", "side": "100 mm"}})
    runs = [castfem.run(one).history for one in (case, new)]
    assert runs[0].equals(runs[1]) and len(runs[0]) > 10


def test_a_new_shape_is_checked_and_described(case: castfem.Case, shape: type[Section]) -> None:
    new = case.with_({"section": {"shape": "square", "side": "100 mm"}})
    assert new.section.outer_groups() == ("wide_face", "narrow_face")
    with pytest.raises(InputError, match=r"on .*wide_face, narrow_face"):
        new.with_({"cooling.mould.surface.0.on": ["corner"]})
    with pytest.raises(InputError, match="larger than half the thickness of the section"):
        new.with_({"mesh.surface_size": "51 mm"})
    with pytest.raises(InputError, match=r'"sqare" is not known.*did you mean "?square'):
        case.with_({"section": {"shape": "sqare", "side": "100 mm"}})
    page = markdown_page()
    assert '### `[section], shape = "square"`' in page
    assert "| square |  | `wide_face`, `narrow_face` |" in page
    assert {"$ref": "#/$defs/Square"} in case_schema()["properties"]["section"]["anyOf"]


def test_a_new_shape_has_its_mould(case: castfem.Case, shape: type[Section]) -> None:
    table = Mould.model_validate({"length": "600 mm", "taper": "1 %/m"})
    section = shape.model_validate({"shape": "square", "side": "100 mm"})
    assert isinstance(case.section, Rectangle)
    ours, known = (build_mould(table, one) for one in (section, case.section))
    for position in (0.0, 0.3, 0.6):
        assert ours.dimensions(position) == known.dimensions(position)
    mechanics = {"mechanics": {}, "mould": {"length": "60 mm", "taper": {"corner": "1 %/m"}}}
    with pytest.raises(InputError, match='"square" has one taper for all'):
        case.with_({"section": {"shape": "square", "side": "100 mm"}, **mechanics})
