"""Build the roll supports of the faces: wide ones, and narrow ones with rolls."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.constants import same_or_before
from castfem.base.tables import as_function
from castfem.base.types import Array
from castfem.fem.probes import LineProbes
from castfem.model.build.bulging import Face, PitchByPitch
from castfem.model.build.shell_prediction import (
    ShellPrediction,
    build_uneven_rolls,
    core_of,
    front_of,
)
from castfem.model.mechanics import Bulging
from castfem.physics.contact.roll_support import POINTS, RollSupport
from castfem.physics.contact.settings import ALWAYS
from castfem.physics.machine.bulging import (
    BulgingModel,
    CreepingStrip,
    ElasticStrip,
    ThesisPlate,
)
from castfem.physics.machine.bulging.plate import NODES

if TYPE_CHECKING:
    from castfem.fem.section import Section
    from castfem.model import Case
    from castfem.physics.constitutive.base import Law
    from castfem.physics.contact.settings import Contact
    from castfem.physics.machine import Machine
    from castfem.physics.machine.rolls import Rolls
    from castfem.physics.materials import Steel
    from castfem.physics.mechanics.slice_definition import Ferrostatic


def build_roll_supports(
    case: Case,
    table: Bulging,
    machine: Machine,
    steel: Steel,
    section: Section,
    probes: LineProbes,
    law: Law,
    liquid: Ferrostatic | None,
    wall: Contact | None,
) -> tuple[RollSupport, ...]:
    """The roll supports of a sound case, below its mould.

    One for the wide faces, and one for the narrow faces if the machine has rolls there.
    """
    from castfem.model.machine import thickness_of

    rolls = case.machine.pairs() if case.machine is not None else None
    height = thickness_of(case.section)
    assert rolls is not None and height is not None, "the case was checked"
    width = float(case.section.width)  # type: ignore[attr-defined]
    ends = None if wall is None else case.mould_exit()
    pitches = partial(
        PitchByPitch, machine=machine, probes=probes, core=core_of(liquid),
        front=front_of(steel, table.solid_fraction), ahead=ShellPrediction(steel),
    )  # fmt: skip
    left = _left_by(wall, ends, (0.0, 0.5 * height))
    faces = {g: Face(_probe(g, probes), left) for g in _faces(section, "wide_face")}
    others = tuple(g for g in section.outer_groups if g not in faces and wall is None)
    line = _Line.of(rolls, height, ends)
    model, nodes = _model(table, law, width)
    uneven, lines = None, None
    if any(pair.lost or pair.offset for pair in rolls.pairs):
        uneven, lines = build_uneven_rolls(case, table, rolls, law, nodes)
        lines = np.append(0.0, lines) if line.above else lines
    wide = RollSupport(
        on=(*faces, *others),
        foundation=pitches(
            model, nodes, rolls=line.places, offsets=line.offsets, above=line.above, faces=faces,
            others=others, half_width=0.5 * width if table.axial_strain else None, uneven=uneven,
            lines=lines,
        ),
        position=machine.position,
        between=ALWAYS if ends is None else (ends, ALWAYS[1]),
        knots=tuple(float(place) for place in line.places),
        pull=wall is None if table.pull is None else table.pull,
        points=POINTS if wall is None else wall.points,
        loose=others,
    )  # fmt: skip
    edges = None if rolls.edges is None else _Line.of(rolls.edges, width, case.mould_exit())
    # Without a modelled mould, the support of the wide faces holds the others to its first roll.
    first = wide.knots[0] if others else -np.inf
    if edges is None or not max(first, edges.places[0]) < edges.places[-1]:
        return (wide,)
    left = _left_by(wall, ends, (0.5 * width, 0.0))
    faces = {g: Face(_probe(g, probes), left) for g in _faces(section, "narrow_face")}
    strip = ElasticStrip(law.elasticity, bool(table.shear))
    elastic = partial(pitches, lambda middle: strip, NODES)
    return wide, _of_narrow_faces(edges, elastic, faces, wide, first)


def _of_narrow_faces(
    line: _Line,
    pitches: Callable[..., PitchByPitch],
    faces: dict[str, Face],
    wide: RollSupport,
    first: float,
) -> RollSupport:
    """The support of the narrow faces, from the end of the mould, or `first`, to their last roll.

    Their corners also hold them, and they are no wider than a pitch: a separately creeping strip
    would bulge, and dip below its rolls, much more than they do. `pitches` are elastic.
    """
    return RollSupport(
        on=tuple(faces),
        foundation=pitches(
            rolls=line.places, offsets=line.offsets, above=line.above, faces=faces, others=()
        ),
        position=wide.position,
        between=(max(first, float(line.places[0])), float(line.places[-1])),
        knots=tuple(float(place) for place in line.places),
        pull=False,  # a slab shrinks off them by millimetres
        points=wide.points,
    )


@dataclass(frozen=True, slots=True)
class _Line:
    """Supports of a face by rolls, including the end of the mould above them."""

    places: Array  #: m
    offsets: Array  #: offset from the first, outwards, m
    above: int  #: 1 with the end of a mould, which is not a roll

    @classmethod
    def of(cls, rolls: Rolls, size: float, end: float | None) -> _Line:
        """Supports by rolls on a section of a given size, m, below the end of a mould, m."""
        places = np.array([rolls.pairs[i].position for i in rolls.there])
        apertures = np.array([rolls.aperture(i, size) for i in rolls.there])
        above = int(end is not None and not same_or_before(float(places[0]), end))
        if above:
            places = np.append(float(end or 0.0), places)
            apertures = np.append(apertures[0], apertures)
        return cls(places, 0.5 * (apertures - apertures[0]), above)


def _faces(section: Section, name: str) -> list[str]:
    return [group for group in section.outer_groups if group.startswith(name)]


def _left_by(wall: Contact | None, end: float | None, middle: tuple[float, float]) -> float:
    """Position of the middle of a face at the end of its mould, m, outwards."""
    if wall is None or end is None:
        return 0.0
    place = np.array([middle])
    return float(wall.wall.gap_function(place, place / np.linalg.norm(place), end).gap[0])


def _probe(group: str, probes: LineProbes) -> str:
    if group.startswith("narrow_face"):
        return "narrow_face_left" if group.endswith("_left") else "narrow_face"
    if group.endswith("_extrados"):
        return "mid_face_extrados"
    return "mid_face_intrados" if "mid_face_intrados" in probes.lines else "mid_face"


def _model(table: Bulging, law: Law, width: float) -> tuple[Callable[[float], BulgingModel], int]:
    """The bulging model by the position of a pitch, and the number of nodes of its bulges."""
    if table.model == "creep":
        strip = CreepingStrip(law, shear=bool(table.shear))
        return lambda middle: strip, strip.steps // 2 + 1
    if table.model == "elastic":
        elastic = ElasticStrip(law.elasticity, bool(table.shear))
        return lambda middle: elastic, NODES
    if table.largest is None:
        plate = ThesisPlate(law.elasticity, width)
        return lambda middle: plate, NODES
    largest = as_function(table.largest)
    return lambda middle: ThesisPlate(law.elasticity, width, largest(middle)), NODES
