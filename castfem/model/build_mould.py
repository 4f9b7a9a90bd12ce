"""From the table [mould] to the wall it describes, and what keeps it from fitting the section."""

from __future__ import annotations

import math
from collections.abc import Iterator

from castfem.base.tables import as_function
from castfem.base.tolerances import ROUNDING
from castfem.base.units import in_mm
from castfem.model.mould import Mould
from castfem.model.mould_tube import check_tube
from castfem.model.problems import Problem
from castfem.model.section import Section, Strip
from castfem.physics import mould as wall


def build_mould(table: Mould, section: Section) -> wall.Mould:
    """Return the wall that [mould] describes.

    Where a size is left out, the cavity in working condition has that of the strand at the
    meniscus: the liquid fills it.

    Args:
        table: A sound table.
        section: One of the section models, sound.

    Raises:
        ValueError: The section has no mould, or the taper does not fit it; told by what is wrong.
    """
    expansion = _expansion(table)
    hot = 1.0 if expansion is None else expansion.factor(0.0)
    tapers = _tapers(table)
    temperature = None if table.wall_temperature is None else as_function(table.wall_temperature)
    if table.displacement is not None:
        cavity = _cavity(table, section, hot)
        return wall.DisplacedMould(cavity, table.length, tapers, table.displacement, temperature)
    return wall.Mould(_cavity(table, section, hot), table.length, tapers, temperature, expansion)


def _expansion(table: Mould) -> wall.Expansion | None:
    if table.condition == "working" or table.displacement is not None:
        return None
    copper = table.copper
    mean = table.wall_temperature if copper.temperature is None else copper.temperature
    if mean is None:
        raise ValueError(
            'a cold mould needs its temperature at work: wall_temperature = "160 degC"'
        )
    return wall.Expansion(copper.expansion, copper.cold, as_function(mean))


def _cavity(table: Mould, section: Section, hot: float) -> wall.Cavity:
    """Return the cavity with the sizes at the meniscus; `hot` over cold lengths there."""

    def size(name: str) -> float:
        given = getattr(table, name, None)
        return float(getattr(section, name) / hot if given is None else given)

    return section.cavity(size, hot)


def _tapers(table: Mould) -> wall.Tapers:
    """Return the profiles; a face without taper of its own has that of all faces, or none."""
    profiles = {}
    for name, given in table.taper.parts.items():
        try:
            profiles[name] = given.profile(table.length)
        except ValueError as error:
            raise ValueError(f"{error}" if name == "face" else f"{name}: {error}") from None
    straight = wall.Taper.single(0.0, table.length)
    face = profiles.get("face", straight)
    return wall.Tapers(
        profiles.get("narrow_face", face), profiles.get("wide_face", face), profiles.get("corner")
    )


def check_mould(table: Mould | None, section: Section) -> Iterator[Problem]:
    """Yield what does not fit between [mould] and [section]; faulty values are None in both."""
    if table is None or section is None:
        return
    if isinstance(section, Strip):
        yield Problem(("mould",), "a strip has no mould; leave the table out")
        return
    found = list(_sizes(table, section, section.mould_sizes))
    given = None if table.taper is None else table.taper.parts
    if section.one_taper and given and set(given) != {"face"}:
        found.append(
            Problem(
                ("mould", "taper"),
                f'a section of shape "{section.tag}" has one taper for all: taper = "1 %/m"',
            )
        )
    found += [] if table.friction is None else table.friction.problems()
    if getattr(section, "bulge", None) is not None and table.displacement is None:
        found.append(
            Problem(
                ("section", "bulge"),
                "the cavity must have the strand's outline, too: mould.displacement = "
                '{ file = "wall.csv" } (castfem section writes both)',
            )
        )
    if table.tube is not None:
        found += check_tube(table.tube, section, table.length)
    yield from found
    # What may be left out is None where it is; what is faulty, too.
    fields = type(section).model_fields.items()
    sizes = [getattr(section, name, None) for name, key in fields if key.default is not None]
    needed = [table.length, table.taper, table.condition, table.copper, *sizes]
    if not found and None not in needed:
        yield from _fits(table, section)


def nominal_mould(table: Mould, section: Section) -> wall.Mould:
    """Return the mould of the sizes and the taper as they are written, neither hot nor displaced.

    Raises:
        ValueError: As `build_mould`.
    """
    return wall.Mould(_cavity(table, section, 1.0), table.length, _tapers(table))


def _sizes(table: Mould, section: Section, known: tuple[str, ...]) -> Iterator[Problem]:
    """Yield the sizes a section of this shape does not have, and those too small for the strand."""
    hot = hot_lengths(table)
    for name in ("width", "height", "diameter", "corner_radius"):
        size = getattr(table, name)
        if size is None:
            continue
        if name not in known:
            sizes = f"; allowed: {', '.join(known)}" if known else "; its sizes are the section's"
            yield Problem(
                ("mould", name), f'not a size of a section of shape "{section.tag}"{sizes}'
            )
            continue
        own = getattr(section, name)
        if own is None or hot is None:
            continue
        if name == "corner_radius":
            allowed = _widest_corner(table, section, hot)
            short = allowed is not None and size > allowed + ROUNDING * own
        else:
            allowed, short = own / hot, hot * size < own * (1.0 - ROUNDING)
        if short and allowed is not None:
            bound = "at most" if name == "corner_radius" else "at least"
            limit = "that" if allowed == own else in_mm(allowed)
            yield Problem(
                ("mould", name),
                f"({in_mm(size)}) does not let the strand in, which has {in_mm(own)}; allowed: "
                f"{bound} {limit}, or leave it out",
            )


def _widest_corner(table: Mould, section: Section, hot: float) -> float | None:
    """Return the largest corner radius of a cavity that lets the strand in, m.

    A rectangle with round corners is one of straight corners, inner, and all that is within the
    radius of it.  The strand's is inside the mould's where no direction has it reach farther.
    """
    sizes = [(getattr(section, name), getattr(table, name)) for name in ("width", "height")]
    radius = getattr(section, "corner_radius", None)
    if radius is None or any(own is None for own, _ in sizes):
        return None
    # Half of what the cavity has beyond the strand, and by how much its radius may be larger: the
    # centres of the corners lie (grown - a, grown - b) apart, and that far the strand's reaches.
    a, b = (0.0 if size is None else max(0.5 * (hot * size - own), 0.0) for own, size in sizes)
    grown = a + b + math.sqrt(2.0 * a * b)
    return float((radius + grown) / hot)


def hot_lengths(table: Mould) -> float | None:
    """Return hot over cold lengths at the meniscus, None where that cannot be told."""
    if None in (table.condition, table.copper):
        return None
    try:
        expansion = _expansion(table)
    except (TypeError, ValueError):  # told elsewhere
        return None
    return 1.0 if expansion is None else expansion.factor(0.0)


def _fits(table: Mould, section: Section) -> Iterator[Problem]:
    """Yield why the mould cannot be built, unless it is the section that is impossible."""
    key = "wall_temperature"
    try:
        _expansion(table)
        key = "taper"
        _tapers(table)
        key = ""
        straight = wall.same(wall.Taper.single(0.0, table.length))
        wall.Mould(_cavity(table, section, 1.0), table.length, straight)
        key = "taper" if table.displacement is None else "displacement"
        build_mould(table, section)
    except ValueError as error:
        if key:
            yield Problem(("mould", key), str(error))
