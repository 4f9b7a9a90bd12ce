"""Checks of mechanical states against the range of validity of the model.

Newton's method finds any equilibrium of the equations: a slice of negative thickness, a shell
turned over, or a bulge as large as the strand are solutions, too. So each state is checked before
it is accepted. Coherent solid is checked strictly; liquid has an artificial small stiffness and may
distort, and is checked only for what would make the rest meaningless. docs/mechanics.md has the
limits and their reasons.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import ufl

from castfem.base.types import Array, Flags
from castfem.fem import dof_values, reductions
from castfem.fem.compat import Tabulation
from castfem.forms.finite_strain import deformation
from castfem.physics.constitutive.base import Law, equivalent_stress
from castfem.physics.mechanics.generalized_plane_strain import LOADS
from castfem.physics.mechanics.state import MechanicalState

if TYPE_CHECKING:
    from castfem.physics.mechanics.fields import Fields
    from castfem.physics.mechanics.interactions import Interactions
    from castfem.physics.mechanics.quadrature import Points


LOOK = "look at loads, supports, mould and cooling"
NO_SHELL = "there is no shell yet that could carry a load: let that begin later, or leave it out"


@dataclass(frozen=True, slots=True)
class Limits:
    """Range of validity of a strain measure."""

    name: str  #: its name in messages
    strain: float  #: largest strain of solid since it froze
    #: smallest and largest thickness e (37) of the slice, over the undeformed one
    thickness: tuple[float, float]
    #: difference of the displacements of two points along x or y, relative to the section's extent
    size: float
    rotation: float  #: rotation of the solid, rad
    mend: str  #: advice if a limit is exceeded
    folded: float = 0.1  #: relative area of a cell below which it counts as folded
    #: elastic strain of the mean stress: hundreds of MPa, which no hot steel carries
    compressed: float = 0.02
    fresh: float = 50.0  #: below the solidus, K: warmer steel has just frozen
    scant: float = 0.01  #: relative area of the section below which the solid is no shell yet


SMALL = Limits(
    "small strain", 0.1, (0.9, 1.1), 0.1, 0.2, f'{LOOK}; mechanics.strain = "large" goes farther'
)
LARGE = Limits("large strain", 1.0, (1.0 / 3.0, 3.0), 0.3, np.inf, LOOK)


@dataclass(frozen=True, slots=True)
class Judged:
    """A criterion for a state."""

    values: Array  #: values on this rank (n,); larger is worse
    places: Array  #: their places (n, 2), m
    limit: float  #: limit of the values
    message: str  #: message, with placeholders for the value and its negative
    loaded: bool = False  #: whether an external load makes it large where there is no shell yet
    #: returns an addition to the message (collective); None for none
    more: Callable[[], str] | None = None


class Validity:
    """Checks the states of one section.

    Args:
        points: Its quadrature points.
        fields: Displacement and generalized strains in the forms.
        law: Constitutive law.
        large: Whether strain is large.
        interactions: Interactions with the surface.
    """

    def __init__(
        self, points: Points, fields: Fields, law: Law, large: bool, interactions: Interactions
    ) -> None:
        self._points, self._law, self._large = points, law, large
        self._interactions = interactions
        self._limits = LARGE if large else SMALL
        if not (large or law.elasticity.solidity.memory):
            # Fed liquid turns before it freezes, as a corner fills; this is included, too.
            self._limits = replace(SMALL, rotation=0.6)
        self._comm = points.section.comm
        mesh = points.section.mesh
        now = deformation(fields.u, fields.generalized_strains, mesh)
        f = now.gradient
        seen = ufl.as_vector([f[0, 0], f[0, 1], f[1, 0], f[1, 1], now.thickness, *now.position])
        self._now = Tabulation(mesh, seen, points.deviator.points)

    def unborne(self, loads: Mapping[str, float], temperature: Array) -> str:
        """Reason why no shorter step would carry a load either; "" if one may (collective).

        Applies where hardly anything is solid, and elasticity alone would strain it too far: in a
        shorter step even less is solid, and flow strains it further.

        Args:
            loads: External loads at the end of a failed step by name: "force" (N), "moment_x",
                "moment_y" (N m).
            temperature: Temperatures at the points then (count,), K.
        """
        if not loads:
            return ""
        volume, place = self._points.deviator.volume, self._points.deviator.position
        at = temperature[: len(volume)]
        solid = at <= self._law.elasticity.solidity.solidus
        stiff = self._law.elasticity.moduli(at)[2] * volume
        sums = [volume[solid].sum(), volume.sum(), stiff.sum(), *(stiff @ place**2)]
        frozen, whole, *bearing = reductions.totals(self._comm, [float(one) for one in sums])
        far = [np.abs(along).max(initial=0.0) for along in place.T]
        lever = [1.0, *reductions.largest_of(self._comm, far)]
        if frozen >= self._limits.scant * whole:
            return ""
        for name, load in loads.items():
            axis = LOADS.index(name)
            strain = abs(load) * lever[axis] / bearing[axis]
            if strain > max(1.0 - self._limits.thickness[0], self._limits.strain):
                return f"mechanics.planes.{name}: {NO_SHELL}"
        return ""

    def refusal(self, state: MechanicalState, temperature: Array) -> str:
        """Reason why a new state is not accepted; "" if it is (collective).

        Args:
            state: State with the present displacement of the fields.
            temperature: Temperatures at the points (count,), K.
        """
        solid = temperature <= self._law.elasticity.solidity.solidus
        with np.errstate(invalid="ignore", divide="ignore"):
            judged = self._judged(state, temperature, solid)
        found = reductions.largest_of(self._comm, [j.values.max(initial=-np.inf) for j in judged])
        for one, worst in zip(judged, found, strict=True):
            if not worst <= one.limit:  # NaN is beyond any limit
                _, x, y = reductions.peak(self._comm, one.values, one.places)
                at = f" at x = {1e3 * x:.4g} mm, y = {1e3 * y:.4g} mm" if np.isfinite(x) else ""
                more = "" if one.more is None else one.more()
                excess = one.message.format(worst, -worst) + more
                message = f"beyond {self._limits.name}: {excess}{at}"
                early = one.loaded and not reductions.any_of(self._comm, bool(solid.any()))
                return f"{message}; {NO_SHELL if early else self._limits.mend}"
        return ""

    def _judged(self, state: MechanicalState, temperature: Array, coherent: Flags) -> list[Judged]:
        """All criteria for a state, independent ones first (collective)."""
        limits, place = self._limits, self._points.deviator.position
        now = self._now.values().reshape(len(place), 7)
        f, thickness, moved = now[:, :4], now[:, 4], now[:, 5:] - place
        area = f[:, 0] * f[:, 3] - f[:, 1] * f[:, 2]
        skew, trace = f[:, 2] - f[:, 1], f[:, 0] + f[:, 3]
        turned = np.abs(np.arctan2(skew, trace))
        solid, mean = coherent[: len(place)], coherent[len(place) :]
        thinnest, thickest = limits.thickness
        message = "the slice is {{{}:.3g}} times as thick as it was (at {} {:.2g})"
        found = [
            Judged(-thickness, place, -thinnest, message.format(1, "least", thinnest), True),
            Judged(thickness, place, thickest, message.format(0, "most", thickest), True),
            Judged(-area[solid], place[solid], -limits.folded, "the shell folds"),
        ]
        if self._large:  # its equations are written on the deformed slice
            found.append(Judged(-area, place, 0.0, "the liquid folds"))
        else:
            message = f"the shell turns by {{0:.3g}} rad (at most {limits.rotation:g})"
            fresh = partial(self._fresh, turned, temperature[: len(place)])
            found.append(Judged(turned[solid], place[solid], limits.rotation, message, more=fresh))
        shell = reductions.any_of(self._comm, bool(solid.any()))
        found += self._bulges(place, moved[solid] if shell else moved)
        distorted = np.inf if self._large else _distortion(f[solid], thickness[solid])
        borne = self._borne(state, temperature, solid, distorted)
        message = f"the shell is strained by {{0:.3g}} (at most {limits.strain:g})"
        found.append(Judged(borne, place[solid], limits.strain, message))
        most = limits.compressed
        message = f"its mean stress alone strains the shell by {{0:.3g}} (at most {most:g})"
        squeezed = self._squeezed(state, temperature, mean)
        found.append(Judged(squeezed, self._points.mean.position[mean], most, message))
        return found + self._pressed(state)

    def _fresh(self, turned: Array, temperature: Array) -> str:
        """Additional text if steel that has just frozen is turned, not the shell (collective).

        Its cells have turned while liquid, which follows the shell without stiffness, and have kept
        that on freezing.
        """
        fresh = self._limits.fresh
        set_ = temperature <= self._law.elasticity.solidity.solidus - fresh
        most = reductions.largest(self._comm, turned[set_])
        if not 0.0 <= most < 0.5 * self._limits.rotation:
            return ""
        most = round(most, 9)
        return (
            f", and no more than {most:.2g} rad where it is {fresh:g} K below its solidus: cells "
            "of the front that turned as liquid; another mesh.core_size, or liquid that presses "
            "(mechanics.ferrostatic)"
        )

    def _pressed(self, state: MechanicalState) -> list[Judged]:
        """Elastic strain along each axis that pressure on the surface would cause."""
        if not self._interactions:
            return []
        local = dof_values.with_ghosts(self._points.section.vertex_space, state.temperature)
        limit = self._limits.compressed
        message = f"the wall's pressure alone strains it by {{0:.3g}} (at most {limit:g})"
        pairs = self._interactions.with_states(state.interactions)
        found = [one.strain_by_pressure(its, local) for one, its in pairs]
        return [Judged(*one, limit, message) for one in found if one is not None]

    def _bulges(self, place: Array, moved: Array) -> list[Judged]:
        """Relative displacement of points of the shell, or of the whole section, over its size.

        (Collective.)
        """
        ends = [*place.T, *-place.T, *moved.T, *-moved.T]
        high = reductions.largest_of(self._comm, [v.max(initial=-np.inf) for v in ends])
        share = (high[4:6] + high[6:]) / (high[:2] + high[2:4])
        nowhere = np.full((1, 2), np.nan)
        message = f"bulge or shrinkage is {{0:.3g}} of the section (at most {self._limits.size:g})"
        return [Judged(share[[i]], nowhere, self._limits.size, message) for i in range(2)]

    def _borne(
        self, state: MechanicalState, temperature: Array, solid: Flags, distorted: Array | float
    ) -> Array:
        """Strain of the solid deviator's points since they froze.

        Accumulated strain grows under reversing loads although the shell is only strained by
        `distorted` at present: the smaller of the two counts, which is the former for a shell that
        froze distorted.
        """
        shear = self._law.elasticity.moduli(temperature[: len(solid)][solid])[0]
        elastic = equivalent_stress(state.stress[: len(solid)][solid]) / (3.0 * shear)
        path = self._law.strain(state.internal[: len(solid)][solid])
        return np.asarray(elastic + np.minimum(path, distorted))

    def _squeezed(self, state: MechanicalState, temperature: Array, solid: Flags) -> Array:
        """Elastic strain along each axis from the mean stress, at solid points of its rule."""
        deviator_points = self._points.deviator_points
        bulk = self._law.elasticity.moduli(temperature[deviator_points:][solid])[1]
        mean = state.stress[deviator_points:, :3][solid].mean(axis=1)
        return np.asarray(np.abs(mean) / (3.0 * bulk))


def _distortion(gradient: Array, thickness: Array) -> Array:
    """Equivalent strain (n,) without its mean, from gradients (n, 4) and thicknesses (n,)."""
    xx, yy, zz = gradient[:, 0] - 1.0, gradient[:, 3] - 1.0, thickness - 1.0
    shear, mean = 0.5 * (gradient[:, 1] + gradient[:, 2]), (xx + yy + zz) / 3.0
    square = (xx - mean) ** 2 + (yy - mean) ** 2 + (zz - mean) ** 2 + 2.0 * shear**2
    return np.asarray(np.sqrt(2.0 / 3.0 * square))
