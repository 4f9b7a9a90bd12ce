"""What a case needs of its steel, and some steels do not have."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from castfem.physics.materials import Steel


def no_emissivity(given: object, steel: Steel) -> str:
    """Return that neither a table nor the steel gives an emissivity; "" where one of them does.

    Args:
        given: That of the table, None for the steel's.
        steel: Of the case.
    """
    if given is not None or steel.has("emissivity"):
        return ""
    return f"steel {steel.name} has no emissivity; give one, emissivity = 0.8"


def no_expansion(steel: Steel) -> str:
    """Return that the steel has no thermal expansion, which mechanics need; "" where it has."""
    if steel.has("thermal_expansion"):
        return ""
    return (
        f"{steel.name} has no thermal_expansion, which [mechanics] needs; add "
        '[thermal_expansion] to its file, or steel.overrides.thermal_expansion = "13.5e-6 1/K"'
    )
