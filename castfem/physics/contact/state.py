"""The committed state of contact, that of one set of unknowns, and a summary."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from castfem.base.types import Array, Flags

OPEN, STICK, SLIP = 0, 1, 2
CONTACT = "contact."  # before the names of its numbers among those of the whole slice


@dataclass(frozen=True, slots=True)
class ContactState:
    """State at this rank's facet points; nothing ever writes into its arrays.

    Attributes:
        friction: On the strand, in the plane along (-n_y, n_x) and along the strand (n, 2), Pa.
        withdrawal_resistance: Axial force of the friction that has acted on the strand so far, N,
            and its moments with x and y, N m, (3,).
        stress: At the points, Mandel (n, 4), Pa; no rows with the penalty, which needs none.
        internal: What the law remembers there (n, states); likewise.
        place: Where the points are now (n, 2), m. normal: Of the wall there (n, 2).
        gap: Distance to the wall along its normal (n,), m; inf where none is met.
        pressure: Contact pressure (n,), Pa.
        status: `OPEN`, `STICK` or `SLIP` (n,); without friction, as liquid, what touches slips.
        weight: Length of surface of each point (n,), m.
    """

    friction: Array
    withdrawal_resistance: Array
    stress: Array
    internal: Array
    place: Array
    normal: Array
    gap: Array
    pressure: Array
    status: npt.NDArray[np.int8]
    weight: Array

    def numbers(self) -> dict[str, Array]:
        """All but the status, by its name with "contact." before it."""
        names = (one.name for one in fields(self) if one.name != "status")
        return {f"{CONTACT}{name}": getattr(self, name) for name in names}


@dataclass(slots=True)
class ContactEvaluation:
    """Contact at one set of unknowns, by facet point; most names are those of `ContactState`.

    Attributes:
        closed: Whether points touch. slides: Whether they slide.
        stretch: Length of surface over undeformed length.
        coefficients: What the forms see (n, columns). strain: Increment (n, 4), of Nitsche's law.
    """

    place: Array
    normal: Array
    gap: Array
    pressure: Array
    friction: Array
    closed: Flags
    slides: Flags
    stretch: Array
    coefficients: Array
    strain: Array


@dataclass(frozen=True, slots=True)
class ContactSummary:
    """Contact of the whole section at one moment.

    Attributes:
        pressure: Largest contact pressure at a point, Pa. mean_pressure: Largest mean over a length
            of the surface (`castfem.physics.contact.average`), Pa.
        penetration: Largest, m; 0 if nothing touches.
        gap: Largest gap to a wall that is met, m; 0 if none is open.
        force: Of the wall on the strand, x and y, friction included, N per m of undeformed strand,
            as those of the supports.
        axial: Friction along the strand, N per m of it as it is, negative as it holds it back.
        length: Of surface that touches, m. share: Of the surface that could.
        sticking: Part of the surface that could touch that does and sticks; None without friction.
        points: Numbers of points that are open, stick and slip.
        highest: Where the pressure is largest (2,), m. highest_mean: Where its mean is (2,), m.
        widest: Where the gap is (2,), m.
    """

    pressure: float
    mean_pressure: float
    penetration: float
    gap: float
    force: Array
    axial: float
    length: float
    share: float
    sticking: float | None
    points: tuple[int, int, int]
    highest: Array
    highest_mean: Array
    widest: Array
