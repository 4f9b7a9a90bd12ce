"""The inputs of the billet that `billet_study` changes, one at a time."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from benchmarks.report import ROOT


@dataclass(frozen=True)
class Variant:
    """A change of the inputs.

    Attributes:
        label: What is changed. changes: Keys. moulds: To which it applies; all if empty.
        liquid: Whether it is about what is not solid yet.
    """

    label: str
    changes: tuple[str, ...]
    moulds: tuple[str, ...] = ()
    liquid: bool = False


LAWS = ROOT / "castfem" / "physics" / "constitutive" / "data"


def scaled(name: str, key: str, factor: float, folder: Path) -> str:
    """A file with the table `key` of a shipped mechanical set times `factor`."""
    text = (LAWS / f"{name}.toml").read_text(encoding="utf-8")
    before, after = text.split(f"[{key}]")

    def times(match: re.Match[str]) -> str:
        old = [float(v) for v in match[1].replace("\n", " ").split(",") if v.strip()]
        return f"\nvalue = [{', '.join(f'{factor * v:.6g}' for v in old)}]"

    after = re.sub(r"\nvalue = \[(.*?)\]", times, after, count=1, flags=re.DOTALL)
    path = folder / f"{name}_{factor:g}.toml"
    path.write_text(f"{before}[{key}]{after}", encoding="utf-8")
    return str(path)


ALPHA = "steel.overrides.thermal_expansion.value={} 1/K"
REAL = ("taper_3", "taper_1", "taper_0", "taper_minus_1", "taper_minus_3")


def variants(folder: Path) -> list[Variant]:
    """All changes of inputs."""
    h = "cooling.mould.surface.0.coefficient={} W/(m^2 K)"
    return [
        *_of_the_liquid(),
        Variant("α = 15e-6 /K (thesis, VI)", (ALPHA.format("15e-6"),)),
        Variant("α = 22e-6 /K (austenite)", (ALPHA.format("22e-6"),)),
        Variant(
            "E halved", ("mechanics.elasticity=" + scaled("elastic_steel", "young", 0.5, folder),)
        ),
        Variant(
            "E doubled", ("mechanics.elasticity=" + scaled("elastic_steel", "young", 2.0, folder),)
        ),
        Variant(
            "flow stress 30 % higher",
            ("mechanics.law=" + scaled("norton_hoff_kozlowski", "strength", 1.3, folder),),
        ),
        Variant(
            "flow stress 20 % higher",
            ("mechanics.law=" + scaled("norton_hoff_kozlowski", "strength", 1.2, folder),),
        ),
        Variant("Norton-Hoff with softening (p1)", ("mechanics.law=norton_hoff_kozlowski_p1",)),
        Variant("law of Kozlowski and Zhu", ("mechanics.law=kozlowski_zhu",)),
        Variant(
            "steel computed from 0.42 % C",
            ("steel.name=plain_carbon", "steel.composition.C=0.42"),
        ),
        Variant("h - 20 %", (h.format(1280),)),
        Variant("h + 20 %", (h.format(1920),)),
        Variant("solidus 20 K lower", ('steel.overrides.solidus.value="1432 degC"',)),
        Variant("solidus 20 K higher", ('steel.overrides.solidus.value="1472 degC"',)),
        Variant("conducts 10 % better", ('steel.overrides.conductivity.value="33 W/(m K)"',)),
        Variant(
            "specific heat 10 % higher", ('steel.overrides.specific_heat.value="770 J/(kg K)"',)
        ),
        Variant("latent heat 10 % higher", ('steel.overrides.latent_heat.value="297 kJ/kg"',)),
        Variant("large strain", ("mechanics.strain=large",)),
        Variant("heat through the undeformed slice", ("coupling.follow_shape=false",)),
        Variant("no heat of viscoplastic work", ("coupling.dissipation=0",)),
        Variant(
            "friction 0.3 (Coulomb)",
            ('mould.friction={law="coulomb", coefficient=0.3}',),
            REAL,
        ),
        Variant(
            "gap conducts 0.3 W/(m K)",
            ("cooling.mould.surface.0.gap_conductivity=0.3 W/(m K)",),
            REAL,
        ),
        *_for_the_corner(),
        *_for_the_peaks(folder),
    ]


PEAKED = ("idealised", "taper_1", "taper_3")
"""Moulds of which the thesis has the peak stress."""
LIQUID_OF_THESIS = (
    "mechanics.liquid=elastic", "mechanics.mush=linear", "mechanics.ferrostatic=proportional",
    "mechanics.strain=small",
)  # fmt: skip
AS_THESIS = "liquid elastic and modulus of the mushy zone linear in the solid"
IDEAL = ("idealised",)  # whose liquid is elastic; in the others it is fed


def _of_the_liquid() -> list[Variant]:
    """What is not solid: in the ideal mould how soft it is, in the others what it is."""
    elastic = (
        "mechanics.liquid=elastic", "mechanics.mush=geometric",
        "mechanics.ferrostatic=proportional",
    )  # fmt: skip
    soft = (
        "mechanics.strain=small",
    )  # -3 %/m is of large strain, which an elastic core is not for
    return [
        *(
            Variant(label, (f"mechanics.liquid_stiffness={value}",), IDEAL, liquid=True)
            for value, label in (
                ("1e-5", "liquid 1e-5 as stiff as the solid"),
                ("1e-4", "1e-4"),
                ("1e-2", "1e-2"),
            )
        ),
        Variant("liquid elastic, as in the ideal mould", (*elastic, *soft), REAL, liquid=True),
        Variant(
            "modulus of the mushy zone linear in the solid", ("mechanics.mush=linear",), liquid=True
        ),
        Variant(
            "modulus of the mushy zone geometric in the solid",
            ("mechanics.mush=geometric",),
            REAL,
            liquid=True,
        ),
        Variant(
            "mushy zone as soft as the liquid to 50 % solid",
            ("mechanics.coherency=0.5", "mechanics.mush=geometric"),
            liquid=True,
        ),
        Variant(
            "pressure full until all is solid", ("mechanics.ferrostatic=full",), IDEAL, liquid=True
        ),
        Variant(
            "pressure in proportion to the liquid",
            ("mechanics.ferrostatic=proportional",),
            REAL,
            liquid=True,
        ),
        Variant(
            "pressure ends where anything is solid",
            ("mechanics.ferrostatic=none",),
            IDEAL,
            liquid=True,
        ),
        Variant("no ferrostatic pressure", ("mechanics.ferrostatic=off",), IDEAL, liquid=True),
    ]


def _for_the_corner() -> list[Variant]:
    """What would make the corner of the untapered mould as cold as its face."""
    gap = "cooling.mould.surface.0.gap_conductivity={} W/(m K)"
    return [
        Variant("gap conducts 0.45 W/(m K)", (gap.format(0.45),), ("taper_0",)),
        Variant(
            "gap conducts 0.3 W/(m K), modulus of the mushy zone linear in the solid",
            (gap.format(0.3), "mechanics.mush=linear"),
            ("taper_0",),
        ),
        Variant("α = 7e-6 /K", (ALPHA.format("7e-6"),), ("taper_0",)),
    ]


def _for_the_peaks(folder: Path) -> list[Variant]:
    """Several changes at once: where each alone leaves the thesis' peaks of stress apart."""
    friction = 'mould.friction={law="coulomb", coefficient=0.3}'
    stronger = "mechanics.law=" + scaled("norton_hoff_kozlowski", "strength", 1.2, folder)
    found = [
        Variant(AS_THESIS, LIQUID_OF_THESIS, PEAKED, liquid=True),
        Variant(f"{AS_THESIS}, flow stress 20 % higher", (*LIQUID_OF_THESIS, stronger), PEAKED),
        *(
            Variant(
                f"{AS_THESIS}, liquid {stiffness} as stiff as the solid",
                (*LIQUID_OF_THESIS, f"mechanics.liquid_stiffness={stiffness}"),
                ("taper_1",),
                liquid=True,
            )
            for stiffness in ("1e-2", "1e-1")
        ),
    ]
    for percent in (20, 30):
        strength = scaled("norton_hoff_kozlowski", "strength", 1.0 + percent / 100.0, folder)
        label = f"flow stress {percent} % higher and friction 0.3"
        found.append(Variant(label, (f"mechanics.law={strength}", friction), REAL))
    return found
