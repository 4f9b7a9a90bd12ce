"""Strain at the points from the displacement, and the forms: small and large strain.

Both kinds have the same interface: `increments` for the law, and compiled forms for its response.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem

from castfem.base.types import Array
from castfem.fem.compat import Tabulation
from castfem.fem.section import Section
from castfem.forms import finite_strain, mechanics
from castfem.physics.mechanics.fields import Fields
from castfem.physics.mechanics.interactions import Interactions
from castfem.physics.mechanics.mean_stress import VolumeStiffness
from castfem.physics.mechanics.quadrature import Points
from castfem.physics.mechanics.supports import SurfaceLoads

Part = TypeVar("Part")
Other = TypeVar("Other")


@dataclass(frozen=True, slots=True)
class Parts(Generic[Part]):
    """Forms on some cells; `VolumeStiffness` adds to stiffness, column, row and corner."""

    work: Part  #: forces in the plane (vector)
    stiffness: Part  #: their derivative (matrix)
    generalized_work: Part  #: work of the stress in the direction `Fields.one` (scalar)
    #: derivative of the forces along that direction (vector); None if no generalized strain is free
    column: Part | None
    #: derivative of `generalized_work` by the displacement (vector); None if equal to `column`
    row: Part | None
    corner: Part | None  #: derivative of the work on `one` along `other` (scalar)

    def each(self, make: Callable[[str, Part], Other]) -> Parts[Other]:
        """Apply `make` to each existing form, with its name."""
        parts = {one.name: getattr(self, one.name) for one in fields(self)}
        made: dict[str, Any] = {n: None if p is None else make(n, p) for n, p in parts.items()}
        return Parts(**made)


Terms = Parts[ufl.Form]
"""Forms before compilation."""
Directions = tuple[
    mechanics.Direction, mechanics.Direction, mechanics.Direction, mechanics.Direction
]
"""Arguments of the forms: virtual displacement, displacement, `Fields.one`, `other`."""


def _with_interactions(terms: Terms, interactions: Interactions, directions: Directions) -> Terms:
    """Add the interactions with the surface; they compute the work on generalized strains."""
    nodal, moved, one, other = directions
    pairs = {"stiffness": (moved, nodal), "column": (one, nodal), "row": (nodal, one),
             "corner": (other, one)}  # fmt: skip
    for acting in interactions:
        more: dict[str, Any] = {
            name: getattr(terms, name) + acting.tangent(*pair)
            for name, pair in pairs.items()
            if getattr(terms, name) is not None
        }
        terms = replace(terms, work=terms.work + acting.virtual_work(nodal), **more)
    return terms


class Kinematics(ABC):
    """Strain from the displacement, and the corresponding forms.

    Args:
        section: The distributed section.
        points: Its quadrature points.
        fields: Functions in the forms.
        loads: Loads on its surface.
        free: Whether any generalized strain is free.
        interactions: Interactions with its surface.

    Attributes:
        active: Points of the cells that have stress.
        forms: On these cells.
        rest: Work in the plane and on `Fields.one` in all others; None if there are none.
        symmetric: Whether the tangent is symmetric if that of the law is.
        volume: Stiffness against change of volume.
        constant: Whether the change of volume per unit of each motion is independent of the
            displacement.
    """

    constant: ClassVar[bool]
    symmetric: bool
    volume: VolumeStiffness

    def __init__(
        self,
        section: Section,
        points: Points,
        fields: Fields,
        loads: SurfaceLoads,
        free: bool,
        interactions: Interactions,
        symmetric: bool = True,
    ) -> None:
        self._points, self._fields = points, fields
        self._symmetric = symmetric
        self._prepare(section, interactions)
        weights = points.mean.volume.reshape(points.linear.values.shape[:2])
        self.volume = VolumeStiffness(
            fields.u.function_space, points.linear, weights, self._rates, self.constant
        )
        space, mesh = fields.u.function_space, section.mesh
        directions = (
            mechanics.of_displacement(ufl.TestFunction(space)),
            mechanics.of_displacement(ufl.TrialFunction(space)),
            mechanics.of_generalized_strains(fields.one, mesh),
            mechanics.of_generalized_strains(fields.other, mesh),
        )
        terms = self._terms(section, loads, free, directions)
        self._compiled = _with_interactions(terms, interactions, directions).each(
            lambda name, form: section.compile_on_cells(f"mechanics.{name}", form)
        )
        self.rest: tuple[fem.Form, fem.Form] | None = None
        self.active = points.on(np.arange(section.cells, dtype=np.int32))
        self.forms = self._on(self.active.cells)

    def _on(self, cells: npt.NDArray[np.int32]) -> Parts[fem.Form]:
        """The forms on some cells and on the whole surface."""
        return self._compiled.each(lambda _, form: form.on(cells))

    def act_on(self, cells: npt.NDArray[np.int32]) -> None:
        """Set the cells of this rank that have stress from now on; others may only have pressure.

        Contributions of the others must not depend on the motion: small strain.
        """
        self.active = self._points.on(cells)
        self.forms = self._on(cells)
        others = np.setdiff1d(np.arange(self._points.section.cells, dtype=np.int32), cells)
        whole = (self._compiled.work, self._compiled.generalized_work)
        self.rest = (whole[0].on(others, False), whole[1].on(others, False))
        self.volume.on(cells.astype(np.int64))
        self._fields.clear_stress()

    @abstractmethod
    def _prepare(self, section: Section, interactions: Interactions) -> None:
        """Set up data for forms and increments."""

    @abstractmethod
    def _terms(
        self, section: Section, loads: SurfaceLoads, free: bool, directions: Directions
    ) -> Terms:
        """Forms of the stress and of the loads."""

    @abstractmethod
    def _rates(self) -> tuple[Array, Array]:
        """Change of volume per unit of each motion, see `VolumeStiffness`."""

    @abstractmethod
    def increments(self) -> tuple[Array, Array | None]:
        """Strain increments of the step (active, 4), and rotation angles of the material.

        At the points of the mean stress their trace is linear on each cell. The angles (points,)
        are those by which old stress and state are rotated for the law; None for none.
        """


class SmallStrain(Kinematics):
    """Strain linear in the displacement; the tangent is symmetric if those of law and wall are."""

    constant = True

    def _prepare(self, section: Section, interactions: Interactions) -> None:
        self.symmetric = self._symmetric and interactions.symmetric
        x, y = self._points.position.T
        # Strain of each generalized strain at the points, nonzero rows of [xx, yy, zz, xy].
        self._thickness = np.column_stack([np.ones_like(x), x, y])

    def _terms(
        self, section: Section, loads: SurfaceLoads, free: bool, directions: Directions
    ) -> Terms:
        fields, points, mesh = self._fields, self._points, section.mesh
        v = ufl.TestFunction(fields.u.function_space)
        rules = (points.deviator.measure, points.mean.measure)
        stress = mechanics.isotropic(fields.mean, fields.pressure)
        nodal, moved, one, other = (mechanics.strain(m, mesh) for m in directions)
        work = mechanics.virtual_work(fields.deviator, stress, nodal, *rules)
        for tags, traction, _ in loads.tractions:
            work -= mechanics.traction_work(traction, v, loads.measure(tags))
        for tags, pressure in loads.pressing(section):
            work -= mechanics.pressure_work(pressure, v, mesh, loads.measure(tags))

        def derivative(by: mechanics.Expr, virtual: mechanics.Expr) -> ufl.Form:
            return mechanics.stiffness(fields.tangent, by, virtual, rules[0])

        matrix = derivative(moved, nodal)
        along = mechanics.virtual_work(fields.deviator, stress, one, *rules)
        column = derivative(one, nodal) if free else None
        row = derivative(nodal, one) if free and not self.symmetric else None
        corner = derivative(other, one) if free else None
        return Parts(work, matrix, along, column, row, corner)

    def _rates(self) -> tuple[Array, Array]:
        """See `Kinematics`: equal for all displacements."""
        points = self._points
        generalized_strains = np.column_stack([self._thickness, np.ones(points.count)])[
            points.deviator_points :
        ]
        found = np.concatenate(
            [points.dilation, generalized_strains.reshape(*points.dilation.shape[:2], 4)], 2
        )
        return found, found

    def increments(self) -> tuple[Array, Array | None]:
        """See `Kinematics`."""
        fields = self._fields
        change = fields.u.x.array - fields.u_old.x.array
        strain = (self.active.strain @ change).reshape(-1, 4)
        generalized_strains = (
            fields.generalized_strains.value - fields.generalized_strains_old.value
        )
        strain[:, 1] += generalized_strains[3]
        strain[:, 2] += self._thickness[self.active.rows] @ generalized_strains[:3]
        return strain, None


class LargeStrain(Kinematics):
    """Hughes' and Winget's midpoint update on the deformed slice, see `forms.finite_strain`."""

    constant = False

    def _prepare(self, section: Section, interactions: Interactions) -> None:
        self.symmetric = False
        points, fields, mesh = self._points, self._fields, section.mesh
        self._now = finite_strain.deformation(fields.u, fields.generalized_strains, section.mesh)
        self._old = finite_strain.deformation(
            fields.u_old, fields.generalized_strains_old, section.mesh
        )
        step = finite_strain.increment(self._now, self._old)
        self._steps = [
            Tabulation(section.mesh, step, rule.points) for rule in (points.deviator, points.mean)
        ]
        moved = mechanics.of_displacement(ufl.TrialFunction(fields.u.function_space))
        self._nodal, self._along = (
            tuple(
                Tabulation(mesh, expression, points.mean.points)
                for expression in (
                    finite_strain.volume_change(self._now, self._old, by),
                    finite_strain.volume_rate(self._now, by),
                )
            )
            for by in (moved, mechanics.of_generalized_strains(fields.one, mesh))
        )

    def _terms(
        self, section: Section, loads: SurfaceLoads, free: bool, directions: Directions
    ) -> Terms:
        fields, points, mesh = self._fields, self._points, section.mesh
        now, old = self._now, self._old
        v = ufl.TestFunction(fields.u.function_space)
        rules = (points.deviator.measure, points.mean.measure)
        stress = mechanics.isotropic(fields.mean, fields.pressure)
        nodal, moved, one, other = directions
        material = (fields.tangent, fields.deviator, fields.mean, fields.pressure)

        def derivative(by: mechanics.Direction, virtual: mechanics.Direction) -> ufl.Form:
            return finite_strain.stiffness(now, old, material, by, virtual, rules)

        work = finite_strain.virtual_work(now, fields.deviator, stress, nodal, *rules)
        matrix = derivative(moved, nodal)
        column = derivative(one, nodal) if free else None
        for tags, traction, _ in loads.tractions:
            work -= mechanics.traction_work(traction, v, loads.measure(tags))
        for tags, pressure in loads.pressing(section):
            ds = loads.measure(tags)
            work -= finite_strain.pressure_work(now, pressure, v, mesh, ds)
            matrix -= finite_strain.pressure_stiffness(now, pressure, moved, v, mesh, ds)
            if column is not None:
                column -= finite_strain.pressure_stiffness(now, pressure, one, v, mesh, ds)
        along = finite_strain.virtual_work(now, fields.deviator, stress, one, *rules)
        row = derivative(nodal, one) if free else None
        corner = derivative(other, one) if free else None
        return Parts(work, matrix, along, column, row, corner)

    def _rates(self) -> tuple[Array, Array]:
        """See `Kinematics`: at the present displacement."""
        one = self._fields.one
        given = one.value.copy()
        found = [[table.values()] for table in self._nodal]
        for direction in np.eye(4):
            one.value[:] = direction
            for parts, table in zip(found, self._along, strict=True):
                parts.append(table.values())
        one.value[:] = given
        change, work = (np.concatenate(parts, axis=2) for parts in found)
        return change, work

    def increments(self) -> tuple[Array, Array | None]:
        """See `Kinematics`: midpoint increments."""
        found = np.concatenate([t.values().reshape(-1, 5) for t in self._steps])
        strain = self._points.level(np.ascontiguousarray(found[:, :4]))
        return strain, 2.0 * np.arctan(0.5 * found[:, 4])
