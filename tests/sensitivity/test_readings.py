"""Derivatives of results, as given by the command and scripts, and the error of their scatter."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from sensitivity.replay import bare, built, differences, followed

import castfem
from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.model.build.simulation import case_steel
from castfem.model.load import from_document
from castfem.physics.closed_forms.solidification import ThreeZones
from castfem.physics.thermal.stepper import ThermalState
from castfem.runs.loop import TimeLoop
from castfem.studies.sensitivity.followed_run import CHECKPOINT_NAME
from castfem.studies.sensitivity.fronts import FRONTS, Scatter
from castfem.studies.sensitivity.parameters import read_parameters

STEADY = {
    "title": "steady strip",
    "casting": {"speed": "1 m/min", "length": "60 m", "temperature": "900 degC"},
    "steel": {"name": "neumann_steel"},
    "section": {"shape": "strip", "length": "20 mm", "width": "2 mm"},
    "mesh": {"surface_size": "2 mm", "core_size": "2 mm"},
    "cooling": [
        {
            "name": "both ends",
            "surface": [
                {"law": "convection", "on": ["surface"], "coefficient": "1000 W/(m^2 K)",
                 "ambient": "100 degC"},
                {"law": "temperature", "on": ["core_end"], "value": "1200 degC"},
            ],
        },
    ],
    "thermal": {"time": {"step": "200 s"}},
    "output": {"figures": False, "fields": []},
}  # fmt: skip


def test_steady_wall_has_the_derivatives_of_its_resistances() -> None:
    """Q = (T - Ta) / (1/h + l/k), after an hour; k by a per cent, h by its unit."""
    found = castfem.sensitivities(
        from_document(STEADY),
        ["cooling.0.convection.coefficient", "steel.conductivity", "cooling.0.ambient",
         "cooling.0.temperature.value"],
        "heat_flux_mid_face,surface_temperature_mid_face",
    )  # fmt: skip
    flux = found.quantities["heat_flux_mid_face"].value
    resistance = 1100.0 / flux
    slopes = found.gradient["heat_flux_mid_face"]
    h, k = "cooling.0.convection.coefficient", "steel.conductivity"
    assert slopes[h] == pytest.approx(flux / resistance / 1000.0**2, rel=1e-8)
    assert slopes[k] == pytest.approx(flux * (1.0 - 1e-3 / resistance) / 100.0, rel=1e-8)
    assert slopes["cooling.0.ambient"] == pytest.approx(-1.0 / resistance, rel=1e-8)
    assert slopes["cooling.0.temperature.value"] == pytest.approx(1.0 / resistance, rel=1e-8)
    surface = found.gradient["surface_temperature_mid_face"]
    assert surface["cooling.0.ambient"] == pytest.approx(1.0 - 1e-3 / resistance, rel=1e-8)


def test_a_steady_wall_whose_conductivity_changes_over_its_depth() -> None:
    """With I the integral of k from T to the hot end, h (T - Ta) l = s I; T by s, in per cent."""
    k = {"temperature": [200, 1200], "temperature_unit": "degC", "value": [60, 20],
         "unit": "W/(m K)"}  # fmt: skip
    case = from_document(STEADY).with_({"steel.overrides": {"conductivity": k}})
    found = castfem.sensitivities(
        case, ["steel.conductivity"], "surface_temperature_mid_face,temperature_core"
    )
    surface = found.quantities["surface_temperature_mid_face"].value - 273.15
    here = 60.0 - 0.04 * (surface - 200.0)
    integral = 0.5 * (here + 20.0) * (1200.0 - surface)
    assert 1000.0 * (surface - 100.0) * 0.02 == pytest.approx(integral, rel=1e-8)
    slopes = found.gradient["surface_temperature_mid_face"]
    assert slopes["steel.conductivity"] == pytest.approx(0.01 * integral / (20.0 + here), rel=1e-6)
    assert abs(found.gradient["temperature_core"]["steel.conductivity"]) < 1e-7


SIMILARITY = {
    "output.fields": [], "output.figures": False, "mesh.surface_size": "1.2 mm",
    "mesh.core_size": "1.2 mm", "section.width": "1.2 mm", "thermal.time.step": "0.2 s",
}  # fmt: skip
ALLOY = {
    "conductivity": 30.0, "density": 7200.0, "specific_heat": 700.0, "latent_heat": 272e3,
    "surface": 1273.15, "solidus": 1723.15, "liquidus": 1773.15, "initial": 1813.15,
}  # fmt: skip


def exact_slopes(key: str, by: float) -> tuple[float, float]:
    """Return derivatives of the closed form: heat removed (J/m2) and depth of the solidus (m)."""
    ends = [ThreeZones(**{**ALLOY, key: ALLOY[key] + sign * by}) for sign in (1.0, -1.0)]
    heat, depth = (e.heat(60.0) for e in ends), (e.depths(60.0)[0] for e in ends)
    return tuple((above - below) / (2.0 * by) for above, below in (heat, depth))  # type: ignore


def test_alloy_has_the_derivatives_of_its_similarity() -> None:
    """By latent heat, solidus and conductivity; its front moves in steps of 1.2 mm in 21 mm.

    The derivative of the depth on the mesh is that of a tread or a riser, 25 % off; it is
    smoothed and stated with its error.
    """
    names = {"latent_heat": 1e3, "solidus": 1.0, "conductivity": 0.3}  # SI of their units
    spreads = {"latent_heat": 30.0, "solidus": 10.0, "conductivity": 10.0}  # as requested below
    case = castfem.load("verification/alloy_similarity").with_(SIMILARITY)
    found = castfem.sensitivities(
        case,
        ["steel.latent_heat=30 kJ/kg,steel.solidus=10 K,steel.conductivity=10 %"],
        "heat_removed,shell_mid_face",
    )
    rows = {(row.name, row.parameter.name): row for row in found.rows()}
    for name, unit in names.items():
        heat, depth = exact_slopes(name, 1e-4 * ALLOY[name])
        its = found.gradient["heat_removed"][f"steel.{name}"] / 1.2e-3
        assert its == pytest.approx(unit * heat, rel=0.03 if name == "solidus" else 2e-3)
        row = rows["shell_mid_face", f"steel.{name}"]
        slope = 1e3 * unit * depth
        assert row.value == pytest.approx(slope, rel=0.08)
        assert abs(row.value - slope) < row.error
        # The error combines twice the standard error and a sixth of a cell over the spread.
        stairs = 1.2 / 6.0 / spreads[name]
        standard = 0.5 * np.sqrt(row.error**2 - stairs**2)
        assert standard < 0.4 * abs(slope)
        of_heat = rows["heat_removed", f"steel.{name}"]
        assert 0.0 < of_heat.error < 0.3 * abs(of_heat.value)


READ = "shell_corner,surface_temperature_mid_face,heat_flux_mid_face,heat_flux_corner,cooling_power"


def test_results_have_the_differences_of_runs() -> None:
    """Compared with runs on the same steps, each with its own steel, speed and times."""
    from castfem.physics.coupling.staggered import StrandState
    from castfem.runs.results.thermal import Sampler
    from castfem.studies.sensitivity.perturbed_simulation import Varied
    from castfem.studies.sensitivity.readings import Readings, asked_quantities

    case = bare({"casting.length": "60 mm", "thermal.time.step": "0.1 s"})
    run = followed(case, "casting.speed", "steel.solidus", "casting.superheat")
    quantities = asked_quantities(run.simulation, [READ])
    sample = run.loop.run_state.sample
    assert sample is not None
    _, slopes = Readings(run.simulation, run.derivatives, quantities).read(sample)

    def read(state: ThermalState, end: Varied) -> Array:
        end.enter(0)
        sampler = Sampler(end.simulation)
        its = sampler.read(StrandState(state, None, np.zeros(0)), None)
        return np.array([one.value(its, probe) for one, probe in quantities.values()])

    for number, by in enumerate((3e-4, 0.01, 0.01)):
        known = differences(run, number, by, read)
        mine = [
            one.of_mesh for one in slopes[number * len(quantities) : (number + 1) * len(quantities)]
        ]
        # Stages are solved to 1e-7 of their heat here, quotients are right to about 1e-5.
        assert mine == pytest.approx(known, rel=2e-4, abs=1e-9 * np.abs(known).max())


def test_end_of_the_pool_by_speed_and_heat_transfer() -> None:
    """A strip that freezes through: followed over all steps, evaluated at the end of its pool."""
    changes = {
        "section": {"shape": "strip", "length": "8 mm", "width": "2 mm"},
        "mesh": {"surface_size": "2 mm", "core_size": "2 mm"},
        "cooling.0.surface.0.on": ["surface"],
        "casting.length": "0.9 m", "thermal.time.step": "0.2 s",
    }  # fmt: skip
    key = "cooling.mould.coefficient"
    found = castfem.sensitivities(bare(changes), key, "metallurgical_length,liquid_end")

    def ends(coefficient: float) -> Array:
        law = {"cooling.0.surface.0.coefficient": f"{coefficient} W/(m^2 K)"}
        simulation = built(bare({**changes, **law}))
        sample = TimeLoop(simulation).run()
        simulation.destroy()
        assert sample.metallurgical_length is not None and sample.liquid_end is not None
        return np.array([sample.metallurgical_length, sample.liquid_end])

    slopes = (ends(1600.1) - ends(1599.9)) / 0.2
    mine = [found.gradient[n][key] for n in ("metallurgical_length", "liquid_end")]
    assert mine == pytest.approx(slopes, rel=1e-4)


def test_resumed_run_has_the_same_derivatives(tmp_path: Path) -> None:
    names, results = (
        "casting.speed,steel.conductivity",
        "heat_removed,shell_mid_face,mould_mean_flux",
    )
    whole = castfem.sensitivities(bare({"output.checkpoint_every": 7}), names, results)
    castfem.sensitivities(bare({"casting.length": "30 mm"}), names, results, folder=tmp_path)
    assert (tmp_path / CHECKPOINT_NAME).is_file()
    again = castfem.sensitivities(bare(), names, results, folder=tmp_path, resume=True)
    for name, slopes in whole.gradient.items():
        assert again.gradient[name] == pytest.approx(slopes, rel=1e-12, nan_ok=True)
    with open(tmp_path / "sensitivity.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["parameter"] for row in rows] == names.split(",") * 3
    assert rows[0]["unit of derivative"] == "MJ/m/(m/min)"
    slope = whole.gradient["heat_removed"]["casting.speed"]
    assert float(rows[0]["derivative"]) == pytest.approx(1e-6 * slope, rel=1e-12)
    with pytest.raises(InputError, match=r"carries derivatives by casting.speed, steel.cond"):
        castfem.sensitivities(bare(), "casting.speed", results, folder=tmp_path, resume=True)
    with pytest.raises(InputError, match=r"follows heat_removed,shell_mid_face"):
        castfem.sensitivities(bare(), names, "heat_removed", folder=tmp_path, resume=True)


WRONG = [
    ("mesh.surface_size", "--to mesh.surface_size: a run has no derivative by it: it changes the"),
    ("casting.superheet", "the case has no number there"),
    ("cooling.mould.law", r'it is not a number \("contact"\)'),
    (
        "cooling.mold.coefficient",
        r"'mold' is not an entry of cooling; .* \(mould; did you mean mould",
    ),
    ("cooling.3.coefficient", "'3' is not an entry of cooling; give an index from 0 to 0"),
    ("steel.conductance", "no number of a steel; .* did you mean conductivity"),
    ("steel.composition.C", "carbon_042 is not computed from its composition; name steel.solidus"),
    ("casting.speed=1 kg", "'kg' is the unit of a mass, a speed is needed"),
    ("casting.speed,casting.speed", "it is given twice"),
    ("", "a key of the case is needed"),
]


@pytest.mark.parametrize(("name", "text"), WRONG)
def test_invalid_parameter_is_refused_by_name(name: str, text: str) -> None:
    case = bare()
    with pytest.raises(InputError, match=text):
        read_parameters(case, case_steel(case), [name])


def test_parameter_is_in_the_unit_of_the_resolved_case() -> None:
    """With any unit in the input, derivatives are per unit of the resolved case."""
    case = castfem.load("billet125/taper_1").with_(
        **{
            "casting.speed": "60 mm/s",
            "mould.friction": {"law": "viscous", "stress": "20 kPa", "speed": "1 m/min"},
        }
    )
    names = ["casting.speed", "mould.friction.stress"]
    found = read_parameters(case, case_steel(case), names)
    assert [(one.value, one.unit) for one in found] == [(3.6, "m/min"), (0.02, "MPa")]


def test_missing_or_ambiguous_numbers_are_refused() -> None:
    strip = castfem.load("verification/neumann")
    with pytest.raises(InputError, match=r"steel.emissivity: neumann_steel has none"):
        read_parameters(strip, case_steel(strip), ["steel.emissivity"])
    mixed = castfem.load("slab1200/thermal")
    with pytest.raises(
        InputError, match=r"solid fraction of plain_carbon; name steel.composition.C"
    ):
        read_parameters(mixed, case_steel(mixed), ["steel.solidus"])
    with pytest.raises(InputError, match=r"is defined by its enthalpy; name steel.comp"):
        read_parameters(mixed, case_steel(mixed), ["steel.specific_heat"])
    (carbon,) = read_parameters(mixed, case_steel(mixed), ["steel.composition.C=0.01"])
    assert (carbon.value, carbon.unit, carbon.spread) == (0.1, "", 0.01)
    billet = castfem.load("billet125/thermal")
    with pytest.raises(InputError, match="it is 0; give its spread"):
        read_parameters(billet, case_steel(billet), ["cooling.foot spray.absorption"])


def test_invalid_result_is_refused_by_name() -> None:
    for case, name, message in (
        (bare(), "heat_removd", "is not a result.*did you mean heat_rem"),
        (bare(), "newton", "it describes steps or cells, which are held fixed"),
        (bare({"quality": {}}), "centre_solid_fraction", "crack indexes and soft red"),
    ):
        with pytest.raises(InputError, match=f"--of {name}: {message}"):
            castfem.sensitivities(case, "casting.speed", name)
    with pytest.raises(InputError) as both:
        castfem.sensitivities("billet125/taper_1", "mould.taper", "contact_share,newton_mechanics")
    one, other = both.value.problems
    assert one.startswith("--of contact_share: it counts points of the surface; ")
    assert one.endswith("; compare runs (castfem sweep)")
    assert other.startswith("--of newton_mechanics: it describes steps or cells")


def test_unsupported_parts_of_a_run_are_refused() -> None:
    for name in ("casting.length", "cooling.mould.to"):
        with pytest.raises(InputError, match=rf"{name}: .* at the end of the run"):
            castfem.sensitivities("billet125/thermal", name)


def test_place_shared_by_two_changes_is_refused() -> None:
    """A zone that begins at a station: one of them moves, the other does not."""
    case = castfem.load("billet125/thermal").with_({"casting.length": "1 m"})
    with pytest.raises(InputError, match="one of two changes that meet 600 mm below the meniscus"):
        castfem.sensitivities(case, "cooling.mould.to")


CELL = 1e-3


def readings_at(depths: np.ndarray, slopes: np.ndarray, zone: int = 0) -> Scatter:
    found = Scatter()
    for depth, row in zip(depths, slopes, strict=True):
        if found.due(zone, depth, CELL):
            found.add(depth, CELL, list(row))
    return found


def test_smooth_derivative_has_no_scatter() -> None:
    depth = np.linspace(0.0, 20e-3, 400)
    smooth = 3.0 + 200.0 * depth - 4e4 * depth**2
    assert readings_at(depth, smooth[:, None]).errors(1) == pytest.approx([0.0], abs=1e-9)


def test_steps_from_cell_to_cell_have_their_rms() -> None:
    """A wave of amplitude a with the length of a cell: a/sqrt(2)."""
    depth = np.linspace(0.0, 20e-3, 2000)
    waves = np.stack([0.5 * np.sin(2.0 * np.pi * depth / (7.0 * FRONTS.apart * CELL))] * 2, axis=1)
    errors = readings_at(depth, waves * [1.0, 10.0]).errors(2)
    assert errors == pytest.approx(
        FRONTS.times * 0.5 / np.sqrt(2.0) * np.array([1.0, 10.0]), rel=0.15
    )


def test_readings_are_within_a_cell_and_of_one_zone() -> None:
    depth = np.linspace(0.0, 30e-3, 3001)
    found = readings_at(depth, depth[:, None])
    steps = np.diff([row[0] for row in found.rows])
    assert steps == pytest.approx(FRONTS.apart * CELL, rel=0.05)
    assert found.rows[-1][0] - found.rows[0][0] <= FRONTS.cells * CELL
    assert found.due(1, depth[-1], CELL) and found.rows == []


def test_few_readings_or_no_front_have_no_scatter() -> None:
    depth = np.linspace(0.0, (FRONTS.fewest - 1.5) * FRONTS.apart * CELL, 200)
    assert np.isnan(readings_at(depth, depth[:, None]).errors(1)).all()
    assert not Scatter().due(0, 0.0, np.nan)
    assert np.isnan(Scatter().errors(3)).all()
    depth = np.linspace(0.0, 20e-3, 400)
    slopes = np.stack([depth, np.where(depth > 10e-3, np.nan, 1.0)], axis=1)
    errors = readings_at(depth, slopes).errors(2)
    assert errors[0] < 1e-9 and np.isnan(errors[1])
