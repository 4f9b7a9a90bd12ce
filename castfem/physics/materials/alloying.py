"""Effects of alloying elements on the iron-carbon diagram, and regressions over the composition.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from castfem.physics.materials.alloyed_iron import AlloyedIron
from castfem.physics.materials.iron_carbon import (
    ASSESSED,
    MAX_CARBON,
    PASCON,
    Diagram,
    DiagramName,
    IronCarbon,
    Lines,
)

MAX_ALLOYING = 5.0  # wt% of one element, above which linear corrections have no meaning

# Drop of the liquidus and the solidus, K per wt%; used by the public PyCasting model [F].
LIQUIDUS_DROP = {
    "C": 78.0, "Si": 7.5, "Mn": 4.9, "P": 34.4, "S": 38.0,
    "Cr": 1.3, "Ni": 3.1, "Cu": 4.7, "Al": 3.6,
}  # fmt: skip
SOLIDUS_DROP = {
    "C": 200.0, "Si": 16.0, "Mn": 6.0, "P": 93.0, "S": 1100.0, "Cr": 1.7, "Ni": 3.9,
}  # fmt: skip
REGRESSION_START = 1809.15  # K (1536 degC), pure iron in both regressions
# Rise of the delta -> gamma temperature, K per wt%: [Won2001] by [Microsegregation]; of P [M].
TRANSFORMATION_RISE = {"Si": -60.0, "Mn": 12.0, "P": -140.0, "S": -160.0}
ELEMENTS = tuple(LIQUIDUS_DROP)


# Elements of the assessed diagram (`alloyed_iron`): their rise of the delta -> gamma temperature of
# iron, K per wt%, fitted to [PovodenKaradeniz2016], and the largest content, wt%. Beyond it, and
# for the other elements, only the regression of the liquidus is available.
FITTED = {"Mn": (17.0, 2.0), "Si": (-38.0, 0.6)}


def check_composition(composition: Mapping[str, float]) -> list[str]:
    """Return the faults of a composition in wt%, one text per element ("Mn: ...")."""
    problems = []
    for element, content in composition.items():
        most = MAX_CARBON if element == "C" else MAX_ALLOYING
        if not math.isfinite(content) or not 0.0 <= content <= most:
            problems.append(f"{element}: {content:g} wt% is out of range; 0 ... {most:g} wt%")
    return problems


def diagram_of(composition: Mapping[str, float], name: DiagramName) -> Diagram:
    """Return the diagram of a composition in wt%, by the name of a kind of diagram.

    Raises:
        ValueError: As for `alloyed`; or a segregated steel has no carbon, or too much of it.
    """
    if name == "segregated":
        from castfem.physics.materials.microsegregation import segregated  # only if needed

        return segregated(composition)
    return alloyed(composition, name)


def alloyed(
    composition: Mapping[str, float], diagram: DiagramName = "assessed"
) -> IronCarbon | AlloyedIron:
    """Iron-carbon diagram shifted by the alloying elements.

    In the assessed diagram manganese and silicon partition between the phases (`AlloyedIron`). For
    all other elements this is our choice: melting point, peritectic and eutectic drop together, by
    the slopes of the liquidus regression without its carbon term, so that the lines still meet and
    the lever rule still conserves carbon; the delta-gamma point moves by Won and Thomas' slopes.
    Segregation of P and S, which lowers the true solidus further, is not part of an equilibrium
    diagram: see `regression_solidus`.

    Args:
        composition: wt% by element symbol; elements left out count as 0.
        diagram: Curves fitted to an assessed database, or the straight lines of the thesis.

    Raises:
        ValueError: An element is out of range, or the shifted diagram is out of order.
    """
    problems = check_composition(composition)
    if problems:
        raise ValueError("; ".join(problems))
    drop = rise = 0.0
    dissolved = dict.fromkeys(FITTED, 0.0)
    for element, content in composition.items():
        if element == "C":
            continue
        within = 0.0
        if diagram == "assessed" and element in FITTED:
            raised, most = FITTED[element]
            dissolved[element] = within = min(content, most)
            rise += raised * within
        drop += LIQUIDUS_DROP[element] * (content - within)
        rise += TRANSFORMATION_RISE.get(element, 0.0) * (content - within)
    plain = PASCON if diagram == "pascon" else ASSESSED
    lines = Lines(
        plain.liquid_delta.lowered(drop),
        plain.delta.lowered(drop),
        plain.liquid_gamma.lowered(drop),
        plain.gamma.lowered(drop),
        plain.transformation + rise,
        plain.bends,
    )
    carbon = composition.get("C", 0.0)
    if any(dissolved.values()):
        return AlloyedIron(carbon, lines, (dissolved["Mn"], dissolved["Si"]))
    return IronCarbon(carbon, lines, lines.liquid_gamma.first[0])


def regression_liquidus(composition: Mapping[str, float]) -> float:
    """Liquidus in K from a linear regression over the composition in wt%; PyCasting's set [F]."""
    return REGRESSION_START - sum(LIQUIDUS_DROP.get(e, 0.0) * w for e, w in composition.items())


def regression_solidus(composition: Mapping[str, float]) -> float:
    """Solidus in K from a linear regression over the composition in wt%; PyCasting's set [F].

    For C below about 0.17 wt%; unlike the equilibrium diagram it includes the effect of segregated
    P and S. Cu and Al have no coefficient.
    """
    return REGRESSION_START - sum(SOLIDUS_DROP.get(e, 0.0) * w for e, w in composition.items())
