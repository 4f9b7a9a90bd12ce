"""`castfem mould --hot`: how heat distorts a mould; its dimensions cold and at work.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from castfem.base.constants import ZERO_CELSIUS
from castfem.cli.drawing import aligned, check_picture, drawing, print_rows
from castfem.model import Case

if TYPE_CHECKING:
    from castfem.physics.mould.hot.model import HotWall
    from castfem.studies.mould_fit.coupled import Drawing, Turn

_ROWS = 12
"""Steps of the table along the mould."""
_TOLD = (
    ("heat_removed", "heat removed", "MJ/m", 1e-6),
    ("shell_mid_face", "shell, mid-face", "mm", 1e3),
    ("shell_corner", "shell, corner", "mm", 1e3),
    ("mould_gap_max", "largest gap", "mm", 1e3),
    ("mould_mean_pressure_max", "largest mean pressure", "MPa", 1e-6),
    ("mould_contact_least", "least share in contact", "%", 1e2),
    ("von_mises_max", "von Mises at the exit", "MPa", 1e-6),
)
"""Result of a strand, how it is called, unit, and what makes that of SI."""


def draw_hot_mould(case: Case, picture: Path, origin: str, *, coupled: bool) -> None:
    """Compute the hot mould of a case; print and draw it, write wall and tube beside the picture.

    Args:
        case: The case.
        picture: File of the picture; the wall goes into a CSV file of the same name, the tube into
            a file for ParaView.
        origin: What the user called the case, for messages.
        coupled: Whether strand and tube go round until they agree.

    Raises:
        InputError: The case has no tube, or a file cannot be written.
        RunFailure: A run of the strand or a solver fails.
    """
    from mpi4py import MPI

    from castfem.model.build_mould import nominal_mould
    from castfem.model.wall_shape import write_wall
    from castfem.physics.mould.hot.vtk_file import write_tube
    from castfem.post.plots.hot_mould import draw
    from castfem.studies.mould_fit.coupled import MOST, hot_mould_of, table_of
    from castfem.studies.mould_fit.coupled import drawing as drawn

    check_picture(picture)
    table, comm = table_of(case, origin), MPI.COMM_WORLD
    first = comm.rank == 0

    def told(number: int, turn: Turn) -> None:
        if first and turn.strand is not None:
            print(f"iteration {number}: {_changed(turn)}", flush=True)

    turns = hot_mould_of(case, comm, origin, MOST if coupled else 1, told)
    wall, solid = turns[-1].wall, picture.with_suffix(".vtu")
    write_tube(solid, wall)
    if not first:
        return
    found = drawn(table, nominal_mould(table, case.section), wall)
    if coupled and turns[0].strand is None:
        given = "flux" if table.tube is not None and table.tube.hot_face is None else "hot_face"
        print(f"mould.tube.{given} heats the tube: the strand is not run, nothing to repeat\n")
    print_rows(hot_rows(wall))
    print()
    print("\n".join(size_lines(found, wall)))
    if len(turns) > 1:
        print()
        print("\n".join(turn_lines(turns)))
    if found.displacement is not None:
        target = picture.with_suffix(".csv")
        write_wall(target, found.displacement, f"{case.title}: wall at work, from its drawing")
        print(f'\nwall in {target}: to run in it, mould.displacement = {{ file = "{target}" }}')
    print(f"\ntube in {solid}, for ParaView: temperature, displacement, von_mises")
    with drawing(picture):
        draw(found, wall, picture, case.title)


def hot_rows(wall: HotWall) -> list[tuple[str, str]]:
    """Return label and value of what characterises a tube at work."""
    from castfem.physics.mould.hot.copper import SOFTENS

    heated, distorted = wall.heated, wall.distorted
    hottest = heated.hottest
    most = f"{SOFTENS - ZERO_CELSIUS:.0f} degC"
    soft = f" - warning: above {most} the copper softens" if hottest > SOFTENS else ""
    x, y, z = (1e3 * part for part in distorted.largest_at)
    rows = [
        ("hot face", f"at most {hottest - ZERO_CELSIUS:.0f} degC{soft}"),
        ("water side", f"at most {float(wall.outer.max()) - ZERO_CELSIUS:.0f} degC"),
    ]
    if heated.supplied == heated.supplied:
        off = abs(heated.supplied - heated.removed) / abs(heated.supplied)
        rows.append(("heat", f"{4e-3 * heated.supplied:.1f} kW, balance {off:.1e}"))
    rows += [
        ("length", f"{1e3 * wall.longer:+.2f} mm"),
        (
            "von Mises",
            f"{1e-6 * distorted.largest_stress:.0f} MPa (elastic), the largest, "
            f"at x = {x:.0f}, y = {y:.0f}, {z:.0f} mm below the meniscus",
        ),
    ]
    for name, solved in (("conduction", heated.solved), ("elasticity", distorted.solved)):
        how = f", {solved.iterations} iterations" if solved.iterations else ""
        rows.append((name, f"{solved.unknowns} unknowns, {solved.method}{how}"))
    return rows


def size_lines(found: Drawing, wall: HotWall) -> list[str]:
    """Return the table of dimensions cold and at work, and the temperatures of both faces."""
    import numpy as np

    mould = found.cold
    names = [name for name in mould.dimensions(0.0) if name != "height" or _unequal(found)]
    head = ["position [mm]"]
    head += [f"{name} {state} [mm]" for name in names for state in ("cold", "hot")]
    columns = {"hot face": wall.hot[:, 0]}
    if wall.corner is not None:
        columns["corner"] = wall.hot[:, wall.corner]
    columns["water side"] = wall.outer[:, 0]
    rows = [[*head, *(f"{name} [degC]" for name in columns)]]
    for z in np.linspace(0.0, mould.length, _ROWS + 1):
        cold, hot = found.cold.dimensions(float(z)), found.hot.dimensions(float(z))
        sizes = [f"{1e3 * size[name]:.3f}" for name in names for size in (cold, hot)]
        faces = [
            float(np.interp(z, wall.displacement.positions, column)) - ZERO_CELSIUS
            for column in columns.values()
        ]
        rows.append([f"{1e3 * z:.4g}", *sizes, *(f"{value:.0f}" for value in faces)])
    return aligned(rows)


def _unequal(found: Drawing) -> bool:
    """Return whether width and height are not the same somewhere."""
    ends = (found.hot.dimensions(z) for z in (0.0, found.hot.length))
    return any(abs(size["width"] - size["height"]) > 1e-7 for size in ends)


def turn_lines(turns: Sequence[Turn]) -> list[str]:
    """Return what the turns have done to strand and wall, a column for each."""
    rows = [["iteration", *(str(number) for number in range(1, len(turns) + 1))]]
    for name, label, unit, factor in _TOLD:
        values = [turn.strand.value(name) for turn in turns if turn.strand is not None]
        if all(value == value for value in values):
            rows.append([f"{label} [{unit}]", *(f"{factor * value:.4g}" for value in values)])
    hottest = [f"{turn.wall.heated.hottest - ZERO_CELSIUS:.1f}" for turn in turns]
    moved = ["-" if turn.moved != turn.moved else f"{1e6 * turn.moved:.2f}" for turn in turns]
    rows += [["hot face [degC]", *hottest], ["wall moved [um]", *moved]]
    return aligned(rows)


def _changed(turn: Turn) -> str:
    hottest = turn.wall.heated.hottest - ZERO_CELSIUS
    if turn.moved != turn.moved:
        return f"hot face at most {hottest:.0f} degC"
    return (
        f"hot face at most {hottest:.0f} degC, wall moved by {1e6 * turn.moved:.1f} um, heat by "
        f"{100.0 * turn.heat:+.2f} %"
    )
