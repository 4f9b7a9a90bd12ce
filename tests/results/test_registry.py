"""A quantity is declared once: column, unit, label, result and page come from the registry."""

from __future__ import annotations

import inspect
import math
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pandas
import pytest
from named_result import assert_named_everywhere
from ranks import needs_mpirun, python_on
from small_case import small, write_small

sys.path.insert(0, str(Path(__file__).parents[1] / "runs"))
from billet_runs import billet
from runs.bulging_slab import slab
from test_drawn_cases import drawn

import castfem
from castfem.base import result_registry as registry
from castfem.base.result_registry import (
    QuantityDefinition,
    declared,
    find,
    in_summary_order,
    quantity,
)
from castfem.base.shown_quantity import si_unit
from castfem.fem import reductions
from castfem.model import load_case
from castfem.model.build.simulation import build
from castfem.post.plots.history import axis_label
from castfem.runs import loop
from castfem.runs.loop import TimeLoop
from castfem.runs.output.history import read_history
from castfem.runs.output.summary_file import Summary
from castfem.runs.results import registry as of_simulation
from castfem.runs.results.headline import HEADLINE
from castfem.runs.results.labels import last_quantities, probes_with
from castfem.runs.results.mechanical import smooth_peak
from castfem.runs.results.needs import CRITERIA, are_met
from castfem.runs.results.reference_table import written
from castfem.runs.results.sample import Sample, SmoothPeak, SmoothStress

ROOT = Path(__file__).parents[2]
HALF_SPACE = ROOT / "cases" / "verification" / "weiner_boley_coarse.toml"
OSCILLATION = ("mould.oscillation.stroke=6 mm", "mould.oscillation.frequency=150 1/min")
SMOOTH = "output.smooth=true"
# Requirements that a quarter of a billet in its mould does not fulfil.
OTHERS = {
    "bending", "quality", "extraction", "bulging", "edge_rolls", "tilt_x", "tilt_y", "closed_form",
}  # fmt: skip
FRICTION = ("mould.friction.law=coulomb", "mould.friction.coefficient=0.2", "casting.length=150 mm")
GIVEN = (
    'cooling.mould.surface=[{law="contact",flux="savage_pritchard",wall="160 degC",'
    'gap_conductivity="0.15 W/(m K)"}]'
)
TEARING = {
    "hot_tearing": list(CRITERIA),
    "rdg": {"shrinkage": "4 percent"},
    "ductility": {
        "temperature": ["800 degC", "950 degC"],
        "strain_rate": ["1e-3 1/s", "1e-3 1/s"],
        "reduction_of_area": ["40 percent", "60 percent"],
    },
}
THIN = (
    "section.width=20 mm", "section.height=20 mm", "section.corner_radius=2 mm",
    "mesh.face_size=4 mm", "mesh.core_size=4 mm", "casting.length=1 m", "thermal.time.step=0.5 s",
)  # fmt: skip


def declare_mean() -> Callable[[Sample], float]:
    """Declare a quantity that castfem does not have; all of it is here."""

    @quantity("temperature_mean", unit="degC", label="mean temperature")
    def mean(sample: Sample) -> float:
        """Mean temperature of the modelled part, by area."""
        area, kelvin = sample.simulation.problem.area, sample.state.thermal.point.temperature
        comm = sample.simulation.section.comm
        return reductions.total(comm, float(area @ kelvin)) / reductions.total(comm, area.sum())

    return mean


@pytest.fixture(scope="module")
def samples(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Sample, ...]]:
    """Return the last sample of a billet with friction, and of six strands.

    One has frozen, one is bent and drawn, one bulges between rolls, also at its narrow faces, one
    is free to tilt, one has a closed form, one is followed for hot tears.

    """
    thin = write_small(tmp_path_factory.mktemp("thin"))
    curved = drawn(quality={"critical_strain": 0.01} | TEARING, casting__length="0.7 m")
    sides = {
        "position": ["0.9 m", "1.1 m", "0.92 m", "1 m"],
        "diameter": ["120 mm", "120 mm", "60 mm", "60 mm"],
        "side": ["", "", "narrow", "narrow"],
    }
    rolled = slab(mechanics__bulging="elastic", casting__length="0.95 m", machine={"rolls": sides})
    cases = (
        billet("taper_1", *FRICTION, *OSCILLATION, GIVEN, SMOOTH),
        load_case(thin, THIN),
        curved,
        rolled,
        billet("idealised", "section.symmetry=whole", "casting.length=15 mm"),
        load_case(HALF_SPACE, ["casting.length=10 mm"]),
        billet("idealised", "casting.length=100 mm").with_({"quality": TEARING}),
    )
    simulations = [build(case, MPI.COMM_SELF) for case in cases]
    yield tuple(TimeLoop(simulation).run() for simulation in simulations)
    for simulation in simulations:
        simulation.destroy()


@pytest.mark.parametrize("definition", declared(), ids=lambda d: d.name)
def test_quantity_is_complete(definition: QuantityDefinition, samples: tuple[Sample, ...]) -> None:
    """Known units of one dimension, a label, a page, and a finite value."""
    d = definition
    assert d.column or d.row
    assert si_unit(d.unit) == si_unit(d.shown or d.unit)
    assert d.label and ("{}" in d.label) == bool(d.each)
    assert d.about.endswith((".", ")")) and len(d.about) > 10
    assert [e.name for e in declared() if e.label == d.label] == [d.name]
    strained, frozen, curved, rolled, free, exact, torn = samples
    sample = frozen if d.name in ("metallurgical_length", "liquid_end") else strained
    sample = curved if {"bending", "quality", "extraction"} & set(d.needs) else sample
    sample = torn if {*CRITERIA} & {*d.needs} and "bending" not in d.needs else sample
    sample = rolled if {"bulging", "edge_rolls"} & set(d.needs) else sample
    sample = free if {"tilt_x", "tilt_y"} & set(d.needs) else sample
    sample = exact if "closed_form" in d.needs else sample
    assert are_met(d.needs, sample.simulation)
    probes = {"": ("",), "probe": sample.profiles, "centred_probe": ("mid_face", "corner")}[d.each]
    for probe in probes:
        assert find(d.named(probe)) == (d, probe)
        value = d.value(sample, probe)
        assert value is not None and math.isfinite(value), probe
        result = d.result(value, probe)
        assert "{" not in result.label
        if not d.shown:
            assert d.in_unit(value) == pytest.approx(result.shown, rel=1e-14, abs=1e-30)


def test_smooth_twin_of_the_largest_stress(samples: tuple[Sample, ...]) -> None:
    """Below and close to the maximum; exact for a uniform stress; smooth where two peaks swap."""
    strained, _, _, rolled, *_ = samples
    twin, way = strained.strained.smooth, strained.smooth_stress
    assert 0.85 * strained.strained.peak < twin.stress < strained.strained.peak
    assert 0.8 * strained.largest_stress.stress < way.stress < strained.largest_stress.stress
    assert rolled.strained.smooth is rolled.smooth_stress is None  # not requested
    comm, area = MPI.COMM_SELF, np.array([1.0, 2.0, 1.0])
    assert smooth_peak(comm, np.full(3, 7e6), area).stress == pytest.approx(7e6, rel=1e-14)
    assert smooth_peak(comm, np.zeros(3), area).stress == 0.0

    def swapped(t: float) -> float:
        return smooth_peak(comm, np.array([10.0 + t, 3.0, 10.0 - t]), area).stress

    slopes = [(swapped(t + 1e-5) - swapped(t - 1e-5)) / 2e-5 for t in (-1e-3, 0.0, 1e-3)]
    assert np.abs(slopes) == pytest.approx(np.zeros(3), abs=0.02)  # the maximum's: -1 and 1
    assert swapped(3.0) == pytest.approx(13.0, rel=1e-6)


def test_smooth_twin_along_the_strand() -> None:
    """For a stress that grows with z, at any section: 32/33 of the last; then it falls.

    Restored from its memory half-way, and given each slice twice, it is the same.
    """
    positions = np.linspace(0.0, 0.6, 301)
    stresses = np.concatenate([1e7 * positions[:201] / 0.4, np.full(100, 1e6)])
    twin = SmoothStress()
    for number, (position, stress) in enumerate(zip(positions, stresses, strict=True)):
        if number == 120:
            stored, twin = twin.memory(), SmoothStress()
            twin.recall(stored)
        for _ in range(2):
            twin.add(SmoothPeak(stress, 3e-4, 3e-4), position)
    half = 0.5 * 0.002 * 1.0  # of the quadrature, to where the stress has fallen
    exact = (0.4 / 33 + half) / (0.4 / 32 + half) * 1e7
    assert twin.stress == pytest.approx(exact, rel=2e-4)


def test_sample_has_the_results_of_its_simulation(samples: tuple[Sample, ...]) -> None:
    strained, frozen, *_ = samples
    thermal = {d.name for d, _ in of_simulation.columns_of(frozen.simulation)}
    assert "shell" in thermal and not thermal & {"von_mises", "gap_max", "mould_pull"}
    assert {d.name for d, _ in of_simulation.columns_of(strained.simulation)} == {
        d.name for d in declared() if d.column and not OTHERS & set(d.needs)
    }
    assert {d.name for d, _ in of_simulation.results_of(strained.simulation)} == {
        d.name for d in in_summary_order() if not OTHERS & set(d.needs)
    }


def test_page_is_that_of_the_registry() -> None:
    page = (ROOT / "docs" / "output.md").read_text(encoding="utf-8")
    assert written(page) == page, "regenerate it: make pages"
    for d in declared():
        assert f"`{d.named('P' if d.each else '')}`" in page, d.name


def test_headline_quantities_are_results() -> None:
    for name in HEADLINE:
        found = find(name)
        assert found is not None and found[0].row, name


@pytest.fixture
def declaring(monkeypatch: pytest.MonkeyPatch) -> None:
    """Forget the declarations of a test after it."""
    declared()
    monkeypatch.setattr(registry, "_declared", dict(registry._declared))


def test_new_quantity_is_one_function(tmp_path: Path, declaring: None) -> None:
    """Declared only here: in history, summary, tables and on an axis."""
    assert len(inspect.getsource(declare_mean()).splitlines()) < 8
    case = load_case(write_small(tmp_path))
    summary = loop.run(case, tmp_path / "out", comm=MPI.COMM_SELF)
    history = read_history(tmp_path / "out" / "history.csv")
    found = history["temperature_mean"].to_numpy()
    assert history.columns[-1] == "temperature_mean"
    assert history.attrs["units"]["temperature_mean"] == "degC"
    assert found[0] == pytest.approx(history["temperature_max"].iloc[0], abs=1e-9)
    assert (found[1:] < found[:-1]).all()
    assert found[-1] > history["temperature_min"].iloc[-1]
    result = summary.quantities["temperature_mean"]
    assert result.label == "mean temperature"
    assert result.shown == pytest.approx(found[-1], rel=1e-11)
    row = {str(k): float(v) for k, v in history.iloc[-1].items()}
    assert last_quantities(row, history.attrs["units"])["temperature_mean"].label == result.label
    assert axis_label(history, "temperature_mean") == "mean temperature [°C]"
    assert_named_everywhere("temperature_mean", "1400 degC")


def test_column_of_the_manual_is_compared(declaring: None) -> None:
    """`corner_lag` of docs/output.md, without its run: declared once, valid in a case's tables."""
    page = (ROOT / "docs" / "output.md").read_text(encoding="utf-8")
    code = page.partition("### A column of your own")[2].partition("```python\n")[2]
    exec(code.partition("\nresult = ")[0], {})
    assert_named_everywhere("corner_lag", "2 mm")
    reference = {"quantity": "corner_lag", "value": "2 mm", "source": "a test"}
    found = castfem.run(small({"reference": [reference]})).summary
    (compared,) = found.references
    shell = {place: found.quantities[f"shell_{place}"].value for place in ("mid_face", "corner")}
    assert compared.ours == pytest.approx(shell["mid_face"] - shell["corner"], abs=1e-12)


@pytest.mark.parametrize("name", ["effort", "bulge_pitch", "roll_force", "shell_mid_face"])
def test_results_of_a_run_are_named_everywhere(name: str) -> None:
    assert_named_everywhere(name, f"2 {registry.unit_of(name)}")


def test_columns_have_units_and_are_no_results() -> None:
    assert registry.usual_unit("solidus_cell") == registry.usual_unit("solidus_cell_tip") == "mm"
    assert registry.unit_of("solidus_cell_tip") is registry.unit_of("temperature_core") is None
    assert registry.unit_of("shell") is None and registry.usual_unit("shell") == "mm"
    assert registry.unit_of("axial_strain") == "1" and registry.unit_of("gap_tips") is None


def test_quantity_of_the_slice_is_no_probe(declaring: None) -> None:
    """With any beginning of its name."""
    table = pandas.DataFrame({"shell_mid_face": [1.0, 2.0], "shell_lag": [0.5, 0.5]})
    assert set(probes_with(table, "shell")) == {"mid_face", "lag"}
    quantity("shell_lag", unit="mm", label="shell, corner behind mid-face")(lambda sample: 0.0)
    assert set(probes_with(table, "shell")) == {"mid_face"}
    assert find("shell_lag") == (declared()[-1], "")
    assert_named_everywhere("shell_lag", "2 mm")


def test_longer_name_has_precedence(declaring: None) -> None:
    """At the probes, too."""
    one = quantity("shell_growth", unit="mm/s", label="growth of the shell, {}", each="probe")
    one(lambda sample, probe: 0.0)
    assert find("shell_growth_corner") == (declared()[-1], "corner")
    assert_named_everywhere("shell_growth_corner", "2 mm/s")


@needs_mpirun
def test_new_quantity_may_sum_over_the_ranks(tmp_path: Path) -> None:
    imports = (
        "import sys; from collections.abc import Callable; from mpi4py import MPI; "
        "from castfem.model import load_case; "
        "from castfem.fem import reductions; from castfem.base.result_registry import quantity; "
        "from castfem.runs.results.sample import Sample; from castfem.runs import loop\n"
    )
    ran = "declare_mean()\nloop.run(load_case(sys.argv[1]), sys.argv[2], comm=MPI.COMM_WORLD)\n"
    file, found = str(write_small(tmp_path)), []
    for ranks in (1, 2):
        folder = tmp_path / str(ranks)
        code = imports + inspect.getsource(declare_mean) + ran
        done = python_on(ranks, "-c", code, file, str(folder), timeout=120.0)
        assert done.returncode == 0, done.stderr
        found.append(read_history(folder / "history.csv")["temperature_mean"].to_numpy())
        summary = Summary.load(folder)
        assert summary is not None and "temperature_mean" in summary.quantities
    assert found[0] == pytest.approx(found[1], rel=1e-9)


def test_duplicate_or_meaningless_declarations_are_refused(declaring: None) -> None:
    with pytest.raises(ValueError, match="two quantities are named shell"):
        quantity("shell", unit="mm", label="shell")(lambda sample: 0.0)
    with pytest.raises(ValueError, match="gearbox"):
        quantity("grip", unit="mm", label="grip", needs=("gearbox",))(lambda sample: 0.0)


def test_general_label_has_no_place() -> None:
    at = "largest von Mises stress, at x = 72.7, y = 72.4 mm"
    assert registry.general_label("von_mises_max", at) == "largest von Mises stress"
    assert registry.general_label("heat_removed", "heat at 600 mm") == "heat at 600 mm"
    assert registry.general_label("told by others", "its words") == "its words"
