"""Sections: a new shape, boundary groups, planes, a case with another shape."""

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
from castfem.model import from_document, load_case, read_case
from castfem.model.mould import Mould
from castfem.model.mould_from_case import build_mould
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
    """Return a shape that exists only in the test with this fixture."""
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
    """Return a sharp billet of 100 mm."""
    changes = {"section.corner_radius": "0 mm", "output.every": "1 s"}
    return castfem.load(write_small(tmp_path)).with_(changes)


def test_new_shape_runs(case: castfem.Case, shape: type[Section]) -> None:
    """With the results of the equal rectangle."""
    new = case.with_({"section": {"shape": "square", "side": "100 mm"}})
    runs = [castfem.run(one).history for one in (case, new)]
    assert runs[0].equals(runs[1]) and len(runs[0]) > 10


def test_new_shape_is_checked_and_described(case: castfem.Case, shape: type[Section]) -> None:
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


def test_new_shape_has_its_mould(case: castfem.Case, shape: type[Section]) -> None:
    table = Mould.model_validate({"length": "600 mm", "taper": "1 %/m"})
    section = shape.model_validate({"shape": "square", "side": "100 mm"})
    assert isinstance(case.section, Rectangle)
    ours, known = (build_mould(table, one) for one in (section, case.section))
    for position in (0.0, 0.3, 0.6):
        assert ours.dimensions(position) == known.dimensions(position)
    mechanics = {"mechanics": {}, "mould": {"length": "60 mm", "taper": {"corner": "1 %/m"}}}
    with pytest.raises(InputError, match='"square" has one taper for all'):
        case.with_({"section": {"shape": "square", "side": "100 mm"}, **mechanics})


SECTIONS = {
    "rectangle": {"width": "60 mm", "height": "40 mm", "corner_radius": "5 mm"},
    "sharp": {"shape": "rectangle", "width": "60 mm", "height": "40 mm"},
    "round": {"diameter": "60 mm"},
    "beam_blank": {
        "width": "300 mm",
        "height": "250 mm",
        "web_thickness": "80 mm",
        "flange_thickness": "60 mm",
        "root_thickness": "90 mm",
        "fillet_radius": "20 mm",
        "shoulder_radius": "10 mm",
        "corner_radius": "10 mm",
    },
    "strip": {"length": "50 mm", "width": "1 mm"},
}


def _case(name: str, symmetry: str | None):
    section = {"shape": name, **SECTIONS[name]}
    if symmetry:
        section["symmetry"] = symmetry
    return from_document(
        {
            "title": name,
            "casting": {"speed": "1 m/min", "length": "1 m", "superheat": "20 K"},
            "steel": {"name": "carbon_042"},
            "section": section,
            "mesh": {"surface_size": "5 mm", "core_size": "10 mm"},
            "cooling": [{"name": "mould"}],
        }
    )


@pytest.mark.parametrize(
    ("name", "symmetry"),
    [(n, s) for n in SECTIONS if n != "strip" for s in ("quarter", "half", "whole")]
    + [("strip", None)],
)
def test_groups_are_those_of_the_mesh(name, symmetry):
    meshes = pytest.importorskip("castfem.meshes", reason="no gmsh")
    case = _case(name, symmetry)
    mesh = meshes.build(**case.mesh_parameters())
    outer = {group for group in mesh.groups if not group.startswith("symmetry")}
    assert set(case.section.outer_groups()) == outer


CASES = Path(__file__).parents[2] / "cases" / "billet125"
ROUND = 'section={shape="round",diameter="125 mm"}'


@pytest.fixture
def layers(tmp_path):
    """Return a function that writes a file that extends the tapered billet."""

    def write(text: str, base: str = str(CASES / "taper_1.toml"), name: str = "case.toml") -> Path:
        path = tmp_path / name
        path.write_text(f'extends = "{base}"\n{text}')
        return path

    return write


def test_round_omits_keys_of_a_rectangle():
    reading = read_case(CASES / "taper_1.toml", [ROUND])
    assert reading.problems == () and reading.case.mesh.corner_size is None
    (line,) = [line for line in reading.warnings if "left out" in line]
    assert line.startswith("--set: section.shape") and "mesh.corner_size (" in line
    assert "coupled.toml" in line
    by_keys = load_case(CASES / "taper_1.toml", ["section.shape=round", "section.diameter=125 mm"])
    assert by_keys.physics() == reading.case.physics()


def test_sizes_and_tapers_of_the_mould_are_omitted_too(layers):
    path = layers(
        '[mould]\ncorner_radius = "4 mm"\nwidth = "126 mm"\n'
        'taper = { face = "1 %/m", corner = "2 %/m", wide_face = "1.5 %/m" }\n'
    )
    assert load_case(path).mould.corner_radius == 0.004
    table = load_case(path, [ROUND]).mould
    assert (table.corner_radius, table.width) == (None, None)
    assert list(table.taper.parts) == ["face"]
    scripted = load_case(path).with_({"section": {"shape": "round", "diameter": "125 mm"}})
    assert scripted.mould == table and scripted.mesh.corner_size is None
    above = layers('[section]\nshape = "round"\ndiameter = "125 mm"\n', path.name, "above.toml")
    assert load_case(above).mould == table
    # A rectangle of other sides omits nothing.
    section = 'section={shape="rectangle",width="124 mm",height="124 mm",corner_radius="5 mm"}'
    assert load_case(path, [section]).mould.corner_radius == 0.004


@pytest.mark.parametrize("key", ["mesh.corner_size=1 mm", "mould.width=130 mm"])
@pytest.mark.parametrize("first", [True, False])
def test_keys_set_with_the_shape_are_not_omitted(layers, key, first):
    changes = [key, ROUND] if first else [ROUND, key]
    with pytest.raises(InputError, match=key.partition("=")[0]):
        load_case(CASES / "taper_1.toml", changes)
    table, _, rest = key.partition(".")
    name, _, value = rest.partition("=")
    text = f'[section]\nshape="round"\ndiameter="125 mm"\n[{table}]\n{name}="{value}"\n'
    with pytest.raises(InputError, match=key.partition("=")[0]):
        load_case(layers(text))
    with pytest.raises(InputError, match=key.partition("=")[0]):
        load_case(CASES / "taper_1.toml", [ROUND]).with_({key.partition("=")[0]: value})


COUPLED = Path(__file__).parents[2] / "cases" / "billet125" / "coupled.toml"
HALF = "section.symmetry=half"
MIRRORED = "the section is mirrored at {} = 0; leave it out, or give section.symmetry = {}"
AT_X = MIRRORED.format("x", '"whole"')
AT_Y = MIRRORED.format("y", '"half" or "whole"')


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (["planes.a1=free"], f"planes.a1: {AT_X}"),
        (["planes.a2=0.1 1/m"], f"planes.a2: {AT_Y}"),
        (["planes.moment_y=1 kN m"], f"planes.moment_y: {AT_Y}"),
        (["planes.moment_x=1 kN m"], f"planes.moment_x: {AT_X}"),
        (["planes.moment_x=1 kN m", HALF], f"planes.moment_x: {AT_X}"),
        (["planes.across=0.001"], "planes.across: is for a strip; other sections widen by"),
    ],
)
def test_planes_excluded_by_the_section_are_refused(changes: list[str], message: str) -> None:
    with pytest.raises(InputError) as caught:
        load_case(COUPLED, [c.replace("planes", "mechanics.planes") for c in changes])
    (problem,) = caught.value.problems
    assert message in problem


@pytest.mark.parametrize(
    "changes",
    [
        ["mechanics.planes.a1=0 1/m", "mechanics.planes.moment_x=0 kN m"],
        ["mechanics.planes.a2=free", "mechanics.planes.moment_y=1 kN m", HALF],
        ["mechanics.planes.a1=0.1 1/m", "section.symmetry=whole"],
    ],
)
def test_planes_allowed_by_the_section(changes: list[str]) -> None:
    load_case(COUPLED, changes)
