"""The tables [section] and [mesh]: the cross-section of the strand and its cells."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag

from castfem.case.base import TableModel, written
from castfem.values.quantities import Distance, Length

Symmetry = Literal["quarter", "half", "whole"]
_SYMMETRY = "part that is modelled; half is the side x >= 0"


class Rectangle(TableModel):
    """Billet, bloom or slab: a rectangle, its corners rounded or sharp."""

    shape: Literal["rectangle"]
    width: Length = Field(description="size in x, along the wide face")
    height: Length = Field(description="size in y, along the narrow face (thickness of a slab)")
    corner_radius: Distance = Field(
        written("0 mm"), description="radius of the corners; 0 mm for sharp ones"
    )
    symmetry: Symmetry = Field("quarter", description=_SYMMETRY)


class Round(TableModel):
    """Round bloom."""

    shape: Literal["round"]
    diameter: Length = Field(description="diameter of the section")
    symmetry: Symmetry = Field("quarter", description=_SYMMETRY)


class BeamBlank(TableModel):
    """Beam blank: a web between two flanges whose inner flanks slope."""

    shape: Literal["beam_blank"]
    width: Length = Field(description="size in x, over the outer faces of the flanges")
    height: Length = Field(description="size in y, of the flanges from tip to tip")
    web_thickness: Length = Field(description="thickness of the web, in y")
    flange_thickness: Length = Field(
        description="thickness of a flange at its tip, in x, the flank drawn through"
    )
    root_thickness: Length = Field(
        description="thickness of a flange at the surface of the web, likewise"
    )
    fillet_radius: Length = Field(description="radius between web and flank (concave)")
    shoulder_radius: Length = Field(description="radius between flank and tip (convex)")
    corner_radius: Length = Field(description="radius between tip and outer face (convex)")
    symmetry: Symmetry = Field("quarter", description=_SYMMETRY)


class Strip(TableModel):
    """A strip normal to the surface: one-dimensional heat flow, for comparisons and tests."""

    shape: Literal["strip"]
    length: Length = Field(description="size in x, from the surface into the strand")
    width: Length = Field(description="size in y")


def _shape(section: Any) -> str | None:
    if isinstance(section, dict):
        return section.get("shape")
    return getattr(section, "shape", None)


Section = Annotated[
    Annotated[Rectangle, Tag("rectangle")]
    | Annotated[Round, Tag("round")]
    | Annotated[BeamBlank, Tag("beam_blank")]
    | Annotated[Strip, Tag("strip")],
    Discriminator(_shape),
]


class Mesh(TableModel):
    """Cells of the section, graded from the surface to the core."""

    cell: Literal["quadrilateral", "triangle"] = Field("quadrilateral", description="cell shape")
    order: Literal[1, 2] = Field(1, description="order of the cells' geometry")
    surface_size: Length = Field(
        description="cell size at the surface, normal to it", examples=["0.5 mm"]
    )
    corner_size: Length | None = Field(
        None,
        description="cell size along the surface at a corner; by default surface_size",
        examples=["0.5 mm"],
    )
    face_size: Length | None = Field(
        None,
        description="cell size along the surface at mid-face; by default core_size",
        examples=["5 mm"],
    )
    core_size: Length = Field(description="cell size in the core", examples=["8 mm"])
    surface_depth: Distance = Field(
        written("0 mm"), description="depth over which the sizes at the surface are kept"
    )
    core_depth: Length | None = Field(
        None,
        description="depth at which core_size is reached; by default half the thickness",
        examples=["40 mm"],
    )


# Boundary groups of the quarter by shape, and how a name splits where the quarter is mirrored:
# "y" into intrados and extrados (half and whole), "x" into right and left (whole).
_GROUPS: dict[str, dict[str, str]] = {
    "rectangle": {"wide_face": "y", "narrow_face": "x", "corner": "xy"},
    "round": {"surface": "y"},
    "beam_blank": {
        "narrow_face": "x",
        "corner": "xy",
        "tip": "xy",
        "shoulder": "xy",
        "flank": "xy",
        "fillet": "xy",
        "web": "y",
    },
}


def outer_groups(section: Any) -> tuple[str, ...]:
    """Return the names of the boundary groups on the strand's surface.

    They are those the mesh of the section has, without the lines of symmetry.

    Args:
        section: One of the section models, valid.
    """
    if isinstance(section, Strip):
        return ("surface", "core_end", "side_low", "side_high")
    names = []
    for name, mirrors in _GROUPS[section.shape].items():
        if name == "corner" and section.corner_radius == 0.0:
            continue
        split = [name]
        if "y" in mirrors and section.symmetry != "quarter":
            split = [f"{name}_{side}" for side in ("intrados", "extrados")]
        if "x" in mirrors and section.symmetry == "whole":
            split = [f"{part}_{side}" for part in split for side in ("right", "left")]
        names += split
    return tuple(names)


def barred(section: Any) -> tuple[str, ...]:
    """Return the tilts of the slice, of a1 and a2, that the section's symmetry keeps at zero."""
    symmetry = getattr(section, "symmetry", "whole")
    return {"quarter": ("a1", "a2"), "half": ("a1",)}.get(symmetry, ())


def cooled_groups(section: Any) -> tuple[str, ...]:
    """Return the groups a heat law without `on` holds on: the outer ones, a strip's surface."""
    return ("surface",) if isinstance(section, Strip) else outer_groups(section)
