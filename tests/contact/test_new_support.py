"""A new kind of support, added only through the public interface of castfem."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mechanics.setups import SliceSetup, box, elastic, mapped
from mechanics.test_tangent import jacobians

from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.fem.section import Section
from castfem.forms.mechanics import Direction, Expr
from castfem.physics.contact.interaction import Interaction, Motion, Solid
from castfem.physics.contact.settings import SurfaceInteraction
from castfem.physics.mechanics.supports import PrescribedDisplacement
from contact.test_roll_support import GROUPS, PLANE_STRAIN, YOUNG


def belt_work(moved: Expr, stiffness: Expr, virtual: Direction, ds: ufl.Measure) -> ufl.Form:
    """Return int k u . v ds: a belt of stiffness k (Pa/m) pulls a face back to its position."""
    return stiffness * ufl.inner(moved, virtual.shift) * ds


@dataclass(frozen=True, slots=True)
class Belt(SurfaceInteraction):
    """A belt of stiffness k (Pa/m) that adheres to groups between two positions, m."""

    on: tuple[str, ...]
    stiffness: float
    between: tuple[float, float]

    def build(self, section: Section, solid: Solid, motion: Motion) -> StickingBelt:
        return StickingBelt(section, self, motion)


class StickingBelt(Interaction):
    name = "belt"

    def __init__(self, section: Section, belt: Belt, motion: Motion) -> None:
        super().__init__(section, motion, belt.on)
        self._belt, self._k = belt, fem.Constant(section.mesh, np.float64(0.0))
        ds = ufl.Measure("ds", domain=section.mesh, subdomain_data=section.facet_tags)
        self._ds = ds(tuple(self.tags))

    def begin(self, old: object, start: float, end: float, before: Array, after: Array) -> None:
        super().begin(old, start, end, before, after)
        self._k.value = self._belt.stiffness if end <= self._belt.between[1] else 0.0

    def virtual_work(self, virtual: Direction) -> ufl.Form:
        return belt_work(self._motion.u, self._k, virtual, self._ds)

    def tangent(self, by: Direction, virtual: Direction) -> ufl.Form:
        return belt_work(by.shift, self._k, virtual, self._ds)


def dragged(stiffness: float) -> SliceSetup:
    """Set up a block dragged by its top, on a belt up to a position of 1 m."""
    drawn = tuple(
        PrescribedDisplacement(("top",), i, lambda x, t, i=i: np.full(len(x), (1 - i) * 1e-5))
        for i in range(2)
    )
    belt = Belt(("bottom",), stiffness, (0.0, 1.0))
    return SliceSetup(
        mapped(2, 2, box(0.1, 0.04), groups=GROUPS),
        elastic(YOUNG, 0.0),
        settings={"planes": PLANE_STRAIN, "interactions": (belt,), "held": drawn},
    )


def test_new_support_acts_within_its_range() -> None:
    """The belt shears the block and releases it at the end of its range; its tangent is exact."""
    setup = dragged(1e12)
    setup.step(1.0)
    assert setup.displacement(lambda x, y: y < 1e-9).max() < 0.6e-5
    exact, found, _ = jacobians(dragged(1e12), 1e-5)
    assert np.abs(exact - found).max() < 1e-8 * np.abs(found).max()
    setup.step(2.0)
    assert setup.displacement(lambda x, y: y < 1e-9)[:, 0] == pytest.approx(1e-5, rel=1e-9)


def test_support_without_derivatives_is_rejected_by_name() -> None:
    problem = dragged(1e12).problem
    with pytest.raises(InputError, match=r"interactions: belt is not differentiated; leave it"):
        problem.of_slice(problem.slice)
