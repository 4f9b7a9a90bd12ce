"""The tables [section] and [mesh]: the cross-section of the strand and its cells.

Each shape of section is one class here, with its sizes, its boundary groups and the cavity around
it. `castfem.meshes.build.BUILDERS` names the function that meshes it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from castfem.base.errors import CaseError
from castfem.base.quantities import Distance, Kind, Length
from castfem.base.table_notation import Curve
from castfem.base.tables import Tabled
from castfem.model.base import TableModel, Variants, written
from castfem.physics import mould as wall

Size = Callable[[str], float]
"""Size of a cavity at the meniscus by the name that [mould] and [section] give it, m."""
Symmetry = Literal["quarter", "half", "whole"]
Bulge = Annotated[Tabled, Curve(Kind("m", "mm", label="offset", sample="0.2 mm"), "way")]
_SYMMETRY = "part that is modelled; half is the side x >= 0"


class Section(Variants):
    """Base of the shapes; a new one is a subclass with its own `shape`, groups and cavity."""

    tag_key = "shape"
    kinds: ClassVar[dict[str, Any]] = {}

    groups: ClassVar[dict[str, str]] = {}
    """Boundary groups of the quarter, and how a name splits where the quarter is mirrored: "y" into
    intrados and extrados (half and whole), "x" into right and left (whole)."""
    mould_sizes: ClassVar[tuple[str, ...]] = ()
    """Names of the sizes that a mould of this shape may set."""
    one_taper: ClassVar[bool] = True
    """Whether its mould has a single taper; otherwise each face may have its own."""
    has_corner: ClassVar[bool] = True
    """Whether the section has a corner (for mesh.corner_size)."""

    def outer_groups(self) -> tuple[str, ...]:
        """Return the boundary groups on the surface of the strand, without lines of symmetry."""
        symmetry, names = getattr(self, "symmetry", "quarter"), []
        for name, mirrors in self.groups.items():
            if name == "corner" and getattr(self, "corner_radius", None) == 0.0:
                continue
            split = [name]
            if "y" in mirrors and symmetry != "quarter":
                split = [f"{name}_{side}" for side in ("intrados", "extrados")]
            if "x" in mirrors and symmetry == "whole":
                split = [f"{part}_{side}" for part in split for side in ("right", "left")]
            names += split
        return tuple(names)

    def cooled_groups(self) -> tuple[str, ...]:
        """Return the groups on which a heat law without `on` holds."""
        return self.outer_groups()

    def barred(self) -> tuple[str, ...]:
        """Return the tilts of the slice (a1, a2) that its symmetry keeps at zero."""
        symmetry = getattr(self, "symmetry", "whole")
        return {"quarter": ("a1", "a2"), "half": ("a1",)}.get(symmetry, ())

    def outline(self) -> tuple[float | None, float | None]:
        """Return its width and height, m; None for a faulty value."""
        return getattr(self, "width", None), getattr(self, "height", None)

    def halves(self) -> tuple[float | None, float | None]:
        """Return half the thickness and half the largest dimension, m; None for a faulty value."""
        width, height = self.outline()
        if width is None or height is None:
            return None, None
        return 0.5 * min(width, height), 0.5 * max(width, height)

    def is_curved(self) -> bool:
        """Return whether part of its surface is an arc."""
        return bool(getattr(self, "corner_radius", 0.0))

    def cavity(self, size: Size, hot: float) -> wall.Cavity:
        """Return the cavity of its mould.

        Args:
            size: Returns a size at the meniscus by its name, m; that of the section if none is
                given.
            hot: Ratio of hot to cold lengths.

        Raises:
            ValueError: This shape has no mould.
        """
        raise ValueError(f"a {self.tag} cannot have a mould")


class Rectangle(Section):
    """Billet, bloom or slab: a rectangle with rounded or sharp corners."""

    groups: ClassVar[dict[str, str]] = {"wide_face": "y", "narrow_face": "x", "corner": "xy"}
    mould_sizes: ClassVar[tuple[str, ...]] = ("width", "height", "corner_radius")
    one_taper: ClassVar[bool] = False

    shape: Literal["rectangle"]
    width: Length
    """size in x, along the wide face"""
    height: Length
    """size in y, along the narrow face (thickness of a slab)"""
    corner_radius: Distance = written("0 mm")
    """radius of the corners; 0 mm for sharp ones"""
    symmetry: Symmetry = Field("quarter", description=_SYMMETRY)
    bulge: Bulge | None = None
    """distance of the outline at the meniscus from the rectangle, over the length round a quarter
    from the middle of the narrow face; written by `castfem section`"""

    def cavity(self, size: Size, hot: float) -> wall.Cavity:
        """See `Section.cavity`."""
        return wall.RectangleCavity(size("width"), size("height"), size("corner_radius"))


class Round(Section):
    """Round bloom."""

    groups: ClassVar[dict[str, str]] = {"surface": "y"}
    mould_sizes: ClassVar[tuple[str, ...]] = ("diameter",)
    has_corner: ClassVar[bool] = False

    shape: Literal["round"]
    diameter: Length
    """diameter of the section"""
    symmetry: Symmetry = Field("quarter", description=_SYMMETRY)

    def outline(self) -> tuple[float | None, float | None]:
        """See `Section.outline`."""
        return self.diameter, self.diameter

    def is_curved(self) -> bool:
        """See `Section.is_curved`."""
        return True

    def cavity(self, size: Size, hot: float) -> wall.Cavity:
        """See `Section.cavity`."""
        return wall.RoundCavity(size("diameter"))


class BeamBlank(Section):
    """Beam blank: a web between two flanges whose inner flanks slope."""

    groups: ClassVar[dict[str, str]] = {
        "narrow_face": "x",
        "corner": "xy",
        "tip": "xy",
        "shoulder": "xy",
        "flank": "xy",
        "fillet": "xy",
        "web": "y",
    }

    shape: Literal["beam_blank"]
    width: Length
    """size in x, over the outer faces of the flanges"""
    height: Length
    """size in y, of the flanges from tip to tip"""
    web_thickness: Length
    """thickness of the web, in y"""
    flange_thickness: Length
    """thickness of a flange at its tip, in x, with the flank extended"""
    root_thickness: Length
    """thickness of a flange at the surface of the web, likewise"""
    fillet_radius: Length
    """radius between web and flank (concave)"""
    shoulder_radius: Length
    """radius between flank and tip (convex)"""
    corner_radius: Length
    """radius between tip and outer face (convex)"""
    symmetry: Symmetry = Field("quarter", description=_SYMMETRY)

    def halves(self) -> tuple[float | None, float | None]:
        """See `Section.halves`; the thickness is that of the web."""
        thin, (_, large) = self.web_thickness, super().halves()
        return (None if large is None or thin is None else 0.5 * thin), large

    def is_curved(self) -> bool:
        """See `Section.is_curved`."""
        return True

    def cavity(self, size: Size, hot: float) -> wall.Cavity:
        """See `Section.cavity`; its sizes are those of the section."""
        from castfem.meshes.beam_blank import surface_pieces

        pieces = surface_pieces(
            (0.5 * self.width, 0.5 * self.height, 0.5 * self.web_thickness),
            self.flange_thickness,
            self.root_thickness,
            (self.fillet_radius, self.shoulder_radius, self.corner_radius),
        )
        segments: list[wall.Segment] = []
        for piece in pieces:
            start, end = _scaled(piece.start, hot), _scaled(piece.end, hot)
            if piece.length <= 1e-9 * self.width:
                continue
            if piece.centre is None:
                segments.append(wall.Straight(start, end))
            else:
                segments.append(wall.Circular(start, end, _scaled(piece.centre, hot)))
        return wall.FreeCavity(tuple(segments), self.width / hot, self.height / hot)


def _scaled(point: tuple[float, float], hot: float) -> tuple[float, float]:
    return point[0] / hot, point[1] / hot


class Strip(Section):
    """A strip normal to the surface: one-dimensional heat flow, for comparisons and tests."""

    groups: ClassVar[dict[str, str]] = dict.fromkeys(
        ("surface", "core_end", "side_low", "side_high"), ""
    )
    has_corner: ClassVar[bool] = False

    shape: Literal["strip"]
    length: Length
    """size in x, from the surface into the strand"""
    width: Length
    """size in y"""

    def cooled_groups(self) -> tuple[str, ...]:
        """See `Section.cooled_groups`; sides and inner end are not on the strand's surface."""
        return ("surface",)

    def halves(self) -> tuple[float | None, float | None]:
        """See `Section.halves`; it is cooled from one side."""
        return self.length, self.length

    def cavity(self, size: Size, hot: float) -> wall.Cavity:
        """See `Section.cavity`."""
        raise ValueError("a strip cannot have a mould; leave out [mould]")


class Mesh(TableModel):
    """Cells of the section, graded from the surface to the core."""

    cell: Literal["quadrilateral", "triangle"] = "quadrilateral"
    """cell shape"""
    order: Literal[1, 2] = 1
    """geometric order of the cells"""
    surface_size: Length = Field(examples=["0.5 mm"])
    """cell size at the surface, normal to it"""
    corner_size: Length | None = Field(None, examples=["0.5 mm"])
    """cell size along the surface at a corner; by default surface_size"""
    face_size: Length | None = Field(None, examples=["5 mm"])
    """cell size along the surface at mid-face; by default core_size"""
    core_size: Length = Field(examples=["8 mm"])
    """cell size in the core"""
    surface_depth: Distance = written("0 mm")
    """depth to which the surface sizes extend"""
    core_depth: Length | None = Field(None, examples=["40 mm"])
    """depth at which core_size is reached; by default half the thickness"""


@contextmanager
def meshing() -> Iterator[None]:
    """Return a context in which the section of a case is meshed."""
    try:
        yield
    except ValueError as error:
        raise CaseError(f"mesh: {error}") from error
