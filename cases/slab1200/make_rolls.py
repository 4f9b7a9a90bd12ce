"""Makes rolls.csv, edge_rolls.csv and resistance.csv, the caster of the slab cases.

Run `python make_rolls.py`. edge_rolls.csv has the rolls of rolls.csv and rolls at the narrow faces.

The caster of the thesis (chapter VI) is confidential. This one is ours, and has every fact the
thesis tells of its own (VI.1 to VI.4); where it tells none, the simplest that fits stands here.
`tests/machine/test_slab_caster.py` holds the files against the facts.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

HERE = Path(__file__).parent
PAIRS, BENDING, UNBENDING = 87, (8, 15), (49, 57)  # 1/R grows, and falls, between these pairs
FIRST = 0.87  # m, pair 1
PITCHES = (0.165, 0.25, 0.335, 0.32)  # m: at the top, at #7-#8, at #47-#49, from #50 on
RADIUS, FIRST_UNBENT = 8.006, 8.400  # m, extrados: of the arc, and at #50
CLEAR = 0.035  # m, between the rolls of the vertical part: 215 mm at a pitch of 250 mm
LARGEST, ROUNDED = 0.275, 0.005  # m, diameter of the lowest rolls; diameters are multiples of 5 mm
TONNE = 9.80665e3  # N
# The thickness of a slab of 220 mm at its last roll, at 930 K above cold (alpha 15e-6 1/K), then
# up the machine: 0.1 mm a roll of soft reduction, above that 0.5 mm every eight pairs.
LAST_APERTURE = 0.2231
REDUCTION, STEP, STEP_EVERY = 1e-4, 5e-4, 8
DRIVEN = (8, 14, 20, 26, 32, 38, 44, 50, 55, 60, 67, 74, 80, 87)
EDGES, EDGE_DIAMETER = 7, 0.1  # pairs at the narrow faces, half-way from #1 on; m
CAPACITY, LEFT_AT_50, AT_55 = 175.0, 7.38, 20.0  # t: of all drives, left at #50, of #55
Rows = list[tuple[float, ...]]


def pitches(exponent: float) -> list[float]:
    """Distance of each pair from the one before, #2 to #87, m; `exponent` bends the middle part."""
    top, upper, middle, lower = PITCHES
    found = []
    for pair in range(2, PAIRS + 1):
        if pair <= 8:
            found.append(top + (upper - top) * (pair - 2) / 6)
        elif pair <= 47:
            found.append(upper + (middle - upper) * ((pair - 8) / 39) ** exponent)
        else:
            found.append(middle if pair <= 49 else lower)
    return found


def positions(exponent: float) -> list[float]:
    """Positions of the pairs, m, to the micrometre."""
    found = [FIRST]
    for pitch in pitches(exponent):
        found.append(found[-1] + pitch)
    return [round(position, 6) for position in found]


def curvatures(places: list[float]) -> list[float]:
    """1/R of the extrados at each pair, 1/m."""
    power = math.log(1.0 - RADIUS / FIRST_UNBENT) / math.log(1.0 / 8.0)  # 1.47
    start, end = (places[pair - 1] for pair in BENDING)
    found = []
    for pair, place in enumerate(places, start=1):
        bent = min(max((place - start) / (end - start), 0.0), 1.0)
        unbent = min(max((pair - UNBENDING[0]) / 8.0, 0.0), 1.0)
        found.append(bent * (1.0 - unbent**power) / RADIUS)
    return found


def angle(exponent: float) -> float:
    """Angle to the vertical below #57, rad: the integral of 1/R, linear between the pairs."""
    places = positions(exponent)
    chi = curvatures(places)
    return sum(0.5 * (chi[i] + chi[i - 1]) * (places[i] - places[i - 1]) for i in range(1, PAIRS))


def root(function: Callable[[float], float], low: float, high: float) -> float:
    """Where a function that falls is zero, by halving."""
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if function(middle) > 0.0 else (low, middle)
    return 0.5 * (low + high)


def steps() -> list[float]:
    """Resistance of each pair, t: 0.75 on the mean above #50, 0.79 at #48, 2.3 when unbending."""
    slope = (0.79 - 0.75) / (48 - 25)
    upper = [0.75 + slope * (pair - 25) for pair in range(1, 50)]
    after = (60.0 - sum(upper) - 8 * 2.3) / 10  # 60 t at 20 m, which is #67
    return [*upper, *[2.3] * 8, *[after] * 10, *[0.5] * 20]


def capacities() -> dict[int, float]:
    """Capacity of each drive, t."""
    load = sum(steps()[44:50])  # of #50: from below #44 on
    special = {50: load + LEFT_AT_50, 55: AT_55}
    each = (CAPACITY - sum(special.values())) / (len(DRIVEN) - len(special))
    return {pair: special.get(pair, each) for pair in DRIVEN}


def aperture(pair: int) -> float:
    """Distance of the rolls of a pair, m."""
    reduced = LAST_APERTURE + REDUCTION * (PAIRS - max(pair, UNBENDING[1]))
    return reduced + STEP * ((UNBENDING[1] - min(pair, UNBENDING[1])) // STEP_EVERY)


def diameter(pair: int, pitch: float) -> float:
    """Diameter of a roll, m: above #8 35 mm less than the pitch below it, then up to 275 mm."""
    if pair < 8:
        wanted = pitch - CLEAR
    else:
        grown = (min(pitch, PITCHES[2]) - PITCHES[1]) / (PITCHES[2] - PITCHES[1])
        wanted = 0.215 + (LARGEST - 0.215) * grown if pair < 47 else LARGEST
    return ROUNDED * math.floor(wanted / ROUNDED + 1e-9)


def write(name: str, header: str, rows: list[str]) -> None:
    """Write a table beside this file."""
    told = "# Made by make_rolls.py; the caster is ours and has the facts of the thesis, VI.1-VI.4."
    (HERE / name).write_text("\n".join([told, header, *rows]) + "\n", encoding="utf-8")


def main() -> None:
    """Make both tables."""
    exponent = root(lambda e: angle(e) - 0.5 * math.pi, 0.2, 5.0)
    places = positions(exponent)
    chi, gaps = curvatures(places), pitches(exponent)
    # Of the rolls above bending the pitch below counts, of the others that above.
    near = [*gaps[:7], *gaps[6:]]
    strength, rows, resistance, total = capacities(), [], [], 0.0
    for pair, (place, k, pitch, step) in enumerate(
        zip(places, chi, near, steps(), strict=True), start=1
    ):
        cells = [f"{1e3 * place:.3f}", f"{1e3 * diameter(pair, pitch):.0f}"]
        cells += [f"{1e3 * aperture(pair):.2f}", f"{1e3 / k:.3f}" if k > 1e-9 else "straight"]
        driven = pair in DRIVEN
        force = f"{1e-3 * TONNE * strength[pair]:.4f}" if driven else ""
        rows.append(", ".join([*cells, "yes" if driven else "no", force]).rstrip(", "))
        total += 1e-3 * TONNE * step
        resistance.append(f"{1e3 * place:.3f}, {total:.4f}")
    rows = [row if row.count(",") == 5 else row + "," * (5 - row.count(",")) for row in rows]
    head = (
        "position [mm], diameter [mm], aperture [mm], radius_extrados [mm], driven, capacity [kN]"
    )
    write("rolls.csv", head, rows)
    edges = [
        f"{0.5e3 * (above + below):.3f}, {1e3 * EDGE_DIAMETER:.0f}, , , , , narrow"
        for above, below in pairwise(places[: EDGES + 1])
    ]
    write("edge_rolls.csv", f"{head}, side", [f"{row}, wide" for row in rows] + edges)
    write("resistance.csv", "position [mm], value [kN]", resistance)


if __name__ == "__main__":
    main()
