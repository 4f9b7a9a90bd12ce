"""Derivatives of a slice in its mould: closed form of a block, differences of billet runs.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest
from sensitivity.test_mechanical_derivatives import Marks

import castfem
from castfem.base.errors import InputError
from castfem.cli.sensitivity import remarks
from castfem.model import Case
from castfem.model.build import simulation as building
from castfem.model.build.simulation import build, case_steel
from castfem.model.load import from_document
from castfem.physics.materials import Steel
from castfem.runs.loop import TimeLoop
from castfem.runs.results.registry import columns_of
from castfem.runs.results.run_state import RunState
from castfem.studies.sensitivity import mechanical
from castfem.studies.sensitivity.coupled import CoupledCheckpoint
from castfem.studies.sensitivity.followed_run import follow
from castfem.studies.sensitivity.parameters import Parameter, read_parameters
from castfem.studies.sensitivity.result import Sensitivity

HALF, CELL, YOUNG, POISSON = 0.05, 0.0125, 40e9, 0.3
TAPER, MOULD, DEPTH = 5e-4, 0.4, 0.2  # 1/m; length of the mould and of the run, m


def block(method: str, taper: str = "0.05 %/m") -> Case:
    """Return a quarter of a square block, uniformly warm, pushed into a tapered mould."""
    return from_document(
        {
            "title": "elastic block in a tapered mould",
            "casting": {"speed": "3 m/min", "length": "200 mm", "temperature": "1000 degC"},
            "steel": {"name": "weiner_boley"},
            "section": {
                "shape": "rectangle", "width": "100 mm", "height": "100 mm", "symmetry": "quarter",
            },
            "mesh": {
                f"{place}_size": "12.5 mm" for place in ("surface", "corner", "face", "core")
            },
            "cooling": [{"name": "mould", "surface": [{"law": "flux", "value": "0 W/m^2"}]}],
            "mould": {"length": "400 mm", "taper": taper, "contact": method},
            "mechanics": {"law": "weiner_boley", "liquid": "elastic", "ferrostatic": "off"},
            "coupling": {"interval": "2 s"},
            "thermal": {"time": {"step": "2 s"}},
            "output": {"figures": False, "fields": []},
        }
    )  # fmt: skip


@pytest.mark.parametrize("method", ["penalty", "nitsche"])
def test_block_has_the_derivatives_of_its_closed_form(method: str) -> None:
    """Pressure, face and axial strain by the taper (300): w = w0 (1 - t z / (1 + t h)).

    Compressed equally along x and y, free along z: p = E / (1 - nu) closure / w0, and
    nu / (1 - nu) of twice the closure along z; the penalty yields by p over its stiffness.
    """
    found = castfem.sensitivities(
        block(method), "mould.taper", "contact_pressure_max,displacement_mid_face,axial_strain"
    )
    slope = {name: slopes["mould.taper"] for name, slopes in found.gradient.items()}
    by_taper = 0.01 * HALF * DEPTH / (1.0 + TAPER * MOULD) ** 2  # closure of a half, m by %/m
    stiff = YOUNG / (1.0 - POISSON) / HALF  # Pa/m
    if method == "penalty":
        wall = 10.0 * YOUNG / (3.0 * (1.0 - 2.0 * POISSON)) / CELL
        by_taper *= wall / (wall + stiff)
    assert slope["contact_pressure_max"] == pytest.approx(stiff * by_taper, rel=1e-6)
    assert slope["displacement_mid_face"] == pytest.approx(-by_taper, rel=1e-6)
    axial = 2.0 * POISSON / (1.0 - POISSON) * by_taper / HALF
    assert slope["axial_strain"] == pytest.approx(axial, rel=1e-6)
    assert not found.kinks


def test_maximum_has_the_derivative_of_its_place() -> None:
    """A mould that opens again beyond 100 mm: at its exit pressure and stress have fallen.

    The run is kept in memory, which samples only what is requested on the way.
    """
    worst = {
        "mould_pressure_max": "contact_pressure_max", "way_von_mises_max": "von_mises_max",
    }  # fmt: skip
    opens = [{"to": "100 mm", "taper": "0.05 %/m"}, {"to": "400 mm", "taper": "-0.02 %/m"}]
    case, taper = block("penalty").with_({"mould.taper": opens}), "mould.taper.0.taper"
    found = castfem.sensitivities(case, taper, [*worst, *worst.values()])
    at_maximum = castfem.sensitivities(
        case.with_({"casting.length": "100 mm"}), taper, list(worst.values())
    )
    for way, here in worst.items():
        assert found.quantities[way].value == at_maximum.quantities[here].value
        assert found.quantities[way].value > 1.1 * found.quantities[here].value
        slope = at_maximum.gradient[here][taper]
        assert found.gradient[way][taper] == pytest.approx(slope, rel=1e-9), way


def test_face_moved_in_time_depends_on_the_speed() -> None:
    """By 0.1 um/s: after z / v the block is stretched by that, and narrower by nu of it."""
    document = block("penalty").document()
    del document["mould"]
    document["mechanics"]["held"] = [
        {
            "on": ["narrow_face"], "component": "x",
            "value": {"time": [0, 10], "time_unit": "s", "value": [0, 1], "unit": "um"},
        }
    ]  # fmt: skip
    found = castfem.sensitivities(
        from_document(document), "casting.speed", "displacement_mid_face,axial_strain"
    )
    slope = {name: 60.0 * slopes["casting.speed"] for name, slopes in found.gradient.items()}
    drawn = -0.1e-6 * DEPTH / 0.05**2  # of a half by the speed of 0.05 m/s, m/(m/s)
    assert slope["displacement_mid_face"] == pytest.approx(-POISSON * drawn, rel=1e-6)
    assert slope["axial_strain"] == pytest.approx(-POISSON * drawn / HALF, rel=1e-6)


def test_imminent_change_of_contact_is_reported() -> None:
    """A mould without taper, whose wall the block just touches: with taper it is compressed."""
    case, name = block("penalty", "0 %/m"), "mould.taper=0.1 %/m"
    found = castfem.sensitivities(case, name, "contact_pressure_max")
    assert found.kinks and found.kinks[0].position == pytest.approx(0.1)
    (line,) = (one for one in remarks(found) if one.startswith("by mould.taper"))
    assert "points of the surface are about to touch the mould or to leave it 100 mm below" in line
    assert found.to_json()["kinks"][0]["points"] == found.kinks[0].points


BILLET: Mapping[str, Any] = {
    "title": "coarse billet in a mould with friction",
    "casting": {"speed": "3.6 m/min", "length": "45 mm", "superheat": "10 K"},
    "steel": {"name": "carbon_042"},
    "section": {
        "shape": "rectangle", "width": "60 mm", "height": "60 mm", "corner_radius": "5 mm",
        "symmetry": "quarter",
    },
    "mesh": {
        "order": 2, "surface_size": "3 mm", "corner_size": "3 mm", "face_size": "10 mm",
        "core_size": "10 mm",
    },
    "cooling": [{"name": "mould", "surface": [
        {"law": "contact", "coefficient": "2500 W/(m^2 K)", "wall": "160 degC",
         "gap_conductivity": "0.15 W/(m K)"},
    ]}],
    "mould": {
        "length": "400 mm", "taper": "1 %/m",
        "friction": {"law": "coulomb", "coefficient": 0.2},
    },
    "mechanics": {"law": "norton_hoff_kozlowski", "tolerance": 1e-12},
    "coupling": {"interval": "0.25 s", "window_error": "500 K", "settled": "0.02 K"},
    "thermal": {"time": {"step": "0.25 s"}},
    "output": {"figures": False, "fields": []},
}  # fmt: skip
READ = (
    "heat_removed", "von_mises_max", "axial_strain", "displacement_mid_face", "gap_corner",
    "surface_temperature_corner", "contact_pressure_max", "contact_pressure_mid_face",
    "friction_pull",
)  # fmt: skip


@cache
def billet() -> Case:
    """Return a billet with heat by gap, shape and flow; windows are repeated about four times."""
    return from_document(BILLET)


@cache
def found() -> Sensitivity:
    """Return the derivatives of the billet by the taper."""
    return castfem.sensitivities(billet(), "mould.taper", ",".join(READ))


@cache
def together() -> Sensitivity:
    """Return derivatives by two less important parameters, followed by the taper."""
    names = "casting.superheat", "steel.density", "mould.taper"
    return castfem.sensitivities(billet(), ",".join(names), ",".join(READ))


def short() -> Case:
    return billet().with_({"casting.length": "15 mm"})


def results(case: Case, columns: Sequence[str] = READ) -> tuple[RunState, dict[str, float]]:
    """Return the end of a plain run, and its results."""
    simulation = build(case, MPI.COMM_SELF)
    simulation.problem.tolerance = 1e-12
    loop = TimeLoop(simulation)
    sample = loop.run()
    having = {one.named(probe): (one, probe) for one, probe in columns_of(simulation)}
    read = {name: float(having[name][0].value(sample, having[name][1]) or 0.0) for name in columns}
    simulation.destroy()
    return loop.run_state, read


def check(
    case: Case, names: list[str], columns: Sequence[str], share: float, *rel: float
) -> Sensitivity:
    """Compare derivatives with differences of runs, a share of each parameter to both sides.

    The share is small: with larger ones other points freeze or touch. `rel` is for each result.
    """
    found = castfem.sensitivities(case, names, list(columns))
    for one in read_parameters(case, case_steel(case), names):
        by = share * one.value
        ends = [results(one.case_at(case, one.value + s * by), columns)[1] for s in (1.0, -1.0)]
        for result, near in zip(columns, rel, strict=True):
            known = (ends[0][result] - ends[1][result]) / (2.0 * by)
            slope = found.gradient[result][one.name]
            assert slope == pytest.approx(known, rel=near), (one.name, result)
    return found


def test_billet_in_its_mould_has_the_differences_of_runs() -> None:
    """Contact, friction, gap, repeated windows, shape and heat of flow together.

    By a ten-thousandth: with more, other points freeze. The pressure at mid-face is that of the
    liquid behind it: 1 %/m changes it by 5e-5 of itself.
    """
    case, name = billet(), "mould.taper"
    (parameter,) = read_parameters(case, case_steel(case), [name])
    by = 1e-4 * parameter.value
    ends = [results(parameter.case_at(case, parameter.value + s * by)) for s in (1.0, -1.0)]
    for run, _ in ends:
        assert run.counts.coupling_iterations > run.counts.windows + 1
    for result in READ:
        known = (ends[0][1][result] - ends[1][1][result]) / (2.0 * by)
        assert found().gradient[result][name] == pytest.approx(known, rel=1e-4), result


def test_cut_windows_are_cut_equally_in_compared_runs() -> None:
    """Their lengths are from a ladder, and do not change: only the parameter has an effect."""
    case = billet().with_({"coupling.window_error": "0.1 K"})
    assert check(case, ["mould.taper"], READ, 1e-4, *[1e-3] * len(READ)).cut == 5


def test_steel_of_variable_density_keeps_its_mass() -> None:
    """The enthalpy of a moving slice depends on density at the solidus, and on the pouring."""
    steel = {"steel.name": "plain_carbon", "steel.composition": {"C": 0.123, "Mn": 0.6, "Si": 0.2}}
    columns = ("heat_removed", "axial_strain", "von_mises_max")
    names = ["steel.composition.C", "casting.superheat"]
    check(billet().with_(steel), names, columns, 1e-5, 3e-3, 3e-3, 3e-3)


def test_computed_steel_has_the_differences_of_runs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """By a hundred-thousandth: with more, other points freeze and touch."""
    steel = {"name": "plain_carbon", "composition": {"C": 0.2}, "diagram": "pascon"}
    case = billet().with_({"steel": steel})
    names, columns = ["steel.density", "steel.composition.C", "steel.thermal_expansion"], READ[:3]
    slopes = castfem.sensitivities(case, ",".join(names), ",".join(columns)).gradient
    for one in read_parameters(case, case_steel(case), names):
        ends = []
        for value in (one.value * (1.0 + 1e-5), one.value * (1.0 - 1e-5)):
            with monkeypatch.context() as patch:
                patch.setattr(building, "case_steel", partial(_steel_at, one, value))
                ends.append(results(one.case_at(case, value), columns)[1])
        for result in columns:
            known = (ends[0][result] - ends[1][result]) / (2e-5 * one.value)
            assert slopes[result][one.name] == pytest.approx(known, rel=5e-6), (one.name, result)


def _steel_at(parameter: Parameter, value: float, case: Case) -> Steel:
    return parameter.steel_at(case_steel(case), value)


def test_gap_by_the_speed_is_read_at_the_end() -> None:
    """At the end of the run, not at the time of the run."""
    case, name, columns = billet(), "casting.speed", ("gap_corner", "gap_max", "von_mises_max")
    slopes = castfem.sensitivities(case, name, ",".join(columns)).gradient
    (parameter,) = read_parameters(case, case_steel(case), [name])
    ends = []
    for share in (1e-4, -1e-4):
        window = f"{0.25 / (1.0 + share)!r} s"  # at the same places of the strand
        held = {"coupling.interval": window, "thermal.time.step": window}
        moved = parameter.case_at(case, parameter.value * (1.0 + share))
        ends.append(results(moved.with_(held), columns)[1])
    for result in columns:
        known = (ends[0][result] - ends[1][result]) / (2e-4 * parameter.value)
        assert slopes[result][name] == pytest.approx(known, rel=1e-3), result


@pytest.mark.parametrize(
    ("changes", "name", "share", "near"),
    [
        ({"mould.taper": "4 %/m"}, "mould.taper", 1e-3, (1e-6, 1e-6, 1e-6)),
        ({"section.corner_radius": "0 mm"}, "mould.taper", 1e-3, (1e-6, 1e-6, 1e-6)),
        (
            {"mould.width": "60.3 mm", "mould.height": "60.3 mm"}, "mould.width", 3e-6,
            (1e-6, 5e-3, 1e-4),
        ),
    ],
)  # fmt: skip
def test_fast_closing_or_distant_mould(
    changes: dict[str, str], name: str, share: float, near: tuple[float, ...]
) -> None:
    """Corners leave while faces are pushed in; nothing touches the wall when the strand begins.

    Heat leaves a sharp corner through two gaps. With a distant wall the stress is that of the
    liquid and hardly depends on the wall.
    """
    columns = ("heat_removed", "von_mises_max", "displacement_mid_face")
    check(billet().with_(changes), [name], columns, share, *near)


def test_pressure_of_deep_liquid_depends_on_the_density() -> None:
    """Also in omitted cells, whose effect in a run differs from that in compared runs.

    By a hundred-thousandth: with more, other points freeze.
    """
    case, names, by = billet(), ("axial_strain", "von_mises_max"), 1e-5
    (density,) = {float(case_steel(case).density(t)) for t in (1000.0, 1900.0)}
    ends = []
    for sign in (1.0, -1.0):
        moved = {"steel.overrides.density": f"{density * (1.0 + sign * by)!r} kg/m^3"}
        ends.append(results(case.with_(moved))[1])
    gradient = castfem.sensitivities(case, "steel.density", ",".join(names)).gradient
    for name in names:
        known = (ends[0][name] - ends[1][name]) / (2.0 * 100.0 * by)  # by a per cent
        assert gradient[name]["steel.density"] == pytest.approx(known, rel=1e-4), name


def test_simultaneous_parameters_are_independent() -> None:
    """The taper after two less important ones: each has its own right-hand side and scalars."""
    for result in READ:
        single = found().gradient[result]["mould.taper"]
        assert together().gradient[result]["mould.taper"] == pytest.approx(single, rel=1e-5), (
            result
        )  # to the tolerance of the solver


def test_weak_parameter_is_separated_from_the_residual(monkeypatch: pytest.MonkeyPatch) -> None:
    """The remaining imbalance of a run is no change by its parameter.

    The differences are a thousand times smaller, below the imbalance of a loose tolerance.
    """
    names = ["von_mises_max", "axial_strain", "heat_removed"]
    known = together().gradient
    loose = billet().with_({"mechanics.tolerance": 1e-6})
    monkeypatch.setattr(mechanical, "TOLERANCES", mechanical.StepTolerances(narrow=5e-5))
    weak = castfem.sensitivities(loose, "casting.superheat", ",".join(names)).gradient
    for name in names:
        slope = known[name]["casting.superheat"]
        assert weak[name]["casting.superheat"] == pytest.approx(slope, rel=1e-4), name


def test_resumed_billet_has_the_same_derivatives(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the last digit: contact, open gap, shape and heat of flow continue unchanged.

    A checkpoint of the time before steps began with their rates is refused.
    """
    opening = billet().with_({"mould.taper": "-5 %/m"})
    found = castfem.sensitivities(opening, "mould.taper", ",".join(READ))
    half = opening.with_({"casting.length": "30 mm"})
    castfem.sensitivities(half, "mould.taper", ",".join(READ), folder=tmp_path)
    whole = CoupledCheckpoint.is_whole

    def of_earlier(description: dict[str, Any]) -> bool:
        slopes = [{n: v for n, v in s.items() if n != "scalar_rate"} for s in description["slopes"]]
        return whole(description | {"slopes": slopes})

    with monkeypatch.context() as earlier:
        earlier.setattr(CoupledCheckpoint, "is_whole", staticmethod(of_earlier))
        with pytest.raises(InputError, match=r"an earlier castfem, .* without --resume"):
            castfem.sensitivities(
                opening, "mould.taper", ",".join(READ), folder=tmp_path, resume=True
            )
    again = castfem.sensitivities(
        opening, "mould.taper", ",".join(READ), folder=tmp_path, resume=True
    )
    assert again.gradient == found.gradient
    assert again.kinks == found.kinks


def test_followed_billet_is_the_plain_one_bit_by_bit() -> None:
    simulation = build(short(), MPI.COMM_SELF)
    marks = Marks(follow(simulation, ["mould.taper"]))
    loops = TimeLoop(simulation, marks), TimeLoop(build(short(), MPI.COMM_SELF))
    for loop in loops:
        loop.run()
    one, other = (loop.run_state.state for loop in loops)
    assert np.array_equal(one.thermal.enthalpy, other.thermal.enthalpy)
    assert np.array_equal(one.mechanical.displacement, other.mechanical.displacement)


@pytest.mark.mpi
def test_ranks_agree() -> None:
    names = "heat_removed,axial_strain,von_mises_max"
    one, many = (
        castfem.sensitivities(short(), "mould.taper", names, comm=comm).gradient
        for comm in (MPI.COMM_SELF, MPI.COMM_WORLD)
    )
    for name, slopes in one.items():
        assert many[name]["mould.taper"] == pytest.approx(slopes["mould.taper"], rel=1e-5), name
