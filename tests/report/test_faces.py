"""A bent strand is told by both mid-faces first; a face that repeats another is left out."""

from __future__ import annotations

from castfem.base.shown_quantity import Quantity
from castfem.post.report.places import table_names
from castfem.runs.results.headline import headline

NAMES = ("narrow_face", "mid_face_intrados", "corner_intrados", "mid_face_extrados",
         "corner_extrados")  # fmt: skip


def slab(**values: float) -> dict[str, Quantity]:
    """Results of half a slab, whose shell at each place is 20 mm but for those given."""
    return {
        f"{kind}_{name}": Quantity(1e-3 * values.get(name, 20.0 + i), "mm", f"{kind}, {name}")
        for kind in ("shell", "surface_temperature")
        for i, name in enumerate(NAMES)
    }


def shells(names: list[str]) -> list[str]:
    return [name.removeprefix("shell_") for name in names if name.startswith("shell_")]


def test_both_mid_faces_come_first() -> None:
    order = ["mid_face_intrados", "mid_face_extrados", "narrow_face", "corner_intrados",
             "corner_extrados"]  # fmt: skip
    for found in (headline([slab()]), table_names([slab()])):
        assert shells(found) == order
        assert [n for n in found if n.startswith("surface")] == [
            f"surface_temperature_{name}" for name in order
        ]


def test_faces_that_are_cooled_alike_are_one() -> None:
    alike = slab(mid_face_extrados=21.0, corner_extrados=22.0)
    assert shells(headline([alike])) == ["mid_face_intrados", "narrow_face", "corner_intrados"]
    assert "mid_face_extrados" in shells(headline([alike, slab()]))


def test_all_parts_of_a_whole_section_have_their_place() -> None:
    parts = [f"corner_{side}_{half}" for side in ("intrados", "extrados") for half in
             ("right", "left")]  # fmt: skip
    names = ["mid_face_intrados", "mid_face_extrados", "narrow_face_right", "narrow_face_left"]
    whole = {
        f"shell_{name}": Quantity(1e-3 * i, "mm", name)
        for i, name in enumerate((*names, *parts), 1)
    }
    assert shells(headline([whole])) == [*names, *parts]
    same = {name: Quantity(0.02, "mm", name) for name in whole}
    assert shells(headline([same])) == ["mid_face_intrados", "narrow_face_right",
                                        "corner_intrados_right"]  # fmt: skip


def test_of_a_billet_nothing_changes() -> None:
    billet = {f"shell_{n}": Quantity(0.01, "mm", n) for n in ("corner", "mid_face", "narrow_face")}
    assert shells(headline([billet])) == ["mid_face", "corner"]
