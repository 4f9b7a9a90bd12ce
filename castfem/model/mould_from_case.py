"""Builds the wall that [mould] describes, and checks that it fits the section."""

from __future__ import annotations

from castfem.base.tables import as_function
from castfem.model.mould import Mould
from castfem.model.section import Section
from castfem.physics import mould as wall

SIZES = ("width", "height", "diameter", "corner_radius")
"""Keys of [mould] that are sizes of the cavity."""


def build_mould(table: Mould, section: Section) -> wall.Mould:
    """Return the wall that [mould] describes.

    A size that is left out is that of the strand at the meniscus, at working temperature: the
    liquid fills the cavity.

    Raises:
        ValueError: The section has no mould, or the taper does not fit it; the text says why.
    """
    expansion = wall_expansion(table)
    hot = 1.0 if expansion is None else expansion.factor(0.0)
    tapers = wall_tapers(table)
    temperature = None if table.wall_temperature is None else as_function(table.wall_temperature)
    if table.displacement is not None:
        cavity = wall_cavity(table, section, hot)
        return wall.DisplacedMould(cavity, table.length, tapers, table.displacement, temperature)
    cavity = wall_cavity(table, section, hot)
    return wall.Mould(cavity, table.length, tapers, temperature, expansion)


def wall_expansion(table: Mould) -> wall.Expansion | None:
    """Return how a cold mould grows until it is at work; None if its sizes are those at work.

    Raises:
        ValueError: Its temperature at work is not given.
    """
    if table.condition == "working" or table.displacement is not None:
        return None
    copper = table.copper
    mean = table.wall_temperature if copper.temperature is None else copper.temperature
    if mean is None:
        raise ValueError(
            'a cold mould needs its temperature at work: wall_temperature = "160 degC"'
        )
    return wall.Expansion(copper.expansion, copper.cold, as_function(mean))


def wall_cavity(table: Mould, section: Section, hot: float) -> wall.Cavity:
    """Return the cavity with its sizes at the meniscus; `hot` is hot over cold lengths."""

    def size(name: str) -> float:
        given = getattr(table, name, None)
        return float(getattr(section, name) / hot if given is None else given)

    return section.cavity(size, hot)


def wall_tapers(table: Mould) -> wall.Tapers:
    """Return the taper profiles; a face without its own taper has that of all faces, if any."""
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


def nominal_mould(table: Mould, section: Section) -> wall.Mould:
    """Return the mould with sizes and taper as written: neither hot nor displaced."""
    return wall.Mould(wall_cavity(table, section, 1.0), table.length, wall_tapers(table))


def hot_lengths(table: Mould) -> float | None:
    """Return the ratio of hot to cold lengths at the meniscus, None if it cannot be computed."""
    try:
        expansion = wall_expansion(table)
    except ValueError:  # reported by another check
        return None
    return 1.0 if expansion is None else expansion.factor(0.0)
