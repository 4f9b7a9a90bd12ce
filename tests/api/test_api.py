"""The interface for scripts: load, change, run, and the contents of a result."""

from __future__ import annotations

import gc
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib import pyplot
from runs.billet_runs import cells
from small_case import write_small

import castfem
from castfem.base.errors import InputError
from castfem.base.shown_units import ShownUnits, shown_in
from castfem.cli.options import case_and_target
from castfem.model import load_case


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    return castfem.load(write_small(tmp_path_factory.mktemp("case")))


@pytest.fixture(scope="module")
def result(case):
    with castfem.run(case) as found:
        yield found


def test_import_is_light():
    """Neither `import castfem` nor its public names load anything heavy."""
    code = (
        "import sys, castfem; assert 'run' in dir(castfem);"
        "print([m for m in ('numpy', 'mpi4py', 'pydantic', 'dolfinx') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_unknown_name():
    with pytest.raises(AttributeError, match="has no attribute 'nosuch'"):
        castfem.nosuch  # noqa: B018


def test_load_by_name_and_path(tmp_path, monkeypatch):
    assert castfem.load("billet125/idealised").casting.speed == pytest.approx(0.06)
    write_small(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert castfem.load("small").casting.length == pytest.approx(0.06)
    with pytest.raises(castfem.InputError, match="did you mean billet125/idealised"):
        castfem.load("billet125/idealized")


def test_accuracy_of_load_is_that_of_the_commands(tmp_path):
    path = write_small(tmp_path)
    coarse, plain = castfem.load(path, accuracy="coarse"), castfem.load(path, "default")
    assert coarse == case_and_target(str(path), None, (), "x", "coarse")[0]
    assert coarse.mesh.core_size == pytest.approx(1.5 * plain.mesh.core_size)
    assert plain == castfem.load(path) and coarse.title == f"{plain.title}; coarse accuracy"
    with pytest.raises(castfem.InputError, match="did you mean fine"):
        castfem.load(path, accuracy="fin")


def test_quantities_are_in_si(result):
    """They agree with the table in displayed units."""
    shown = result.summary.quantities["surface_temperature_mid_face"]
    assert shown.unit == "K" and shown.shown_unit == "degC"
    assert result.quantities["surface_temperature_mid_face"] == shown.value
    assert shown.value - 273.15 == pytest.approx(shown.shown, abs=1e-9)
    assert result.quantities["position"] == pytest.approx(0.06)


def test_history(result):
    table = result.history
    assert table.attrs["units"]["position"] == "m"
    assert list(table["time"]) == pytest.approx(np.arange(21) * 0.05)
    last = table["surface_temperature_mid_face"].iloc[-1] + 273.15
    assert last == pytest.approx(result.quantities["surface_temperature_mid_face"], abs=1e-6)


def test_fields(result):
    assert result.times == pytest.approx([0.0, 0.5, 1.0])
    assert result.positions == pytest.approx([0.0, 0.03, 0.06])
    end = result.fields()
    assert (end.time, end.position) == pytest.approx((1.0, 0.06))
    kelvin = end["temperature"]
    assert kelvin.shape == (len(end.points),)
    assert kelvin.min() == pytest.approx(
        result.history["temperature_min"].iloc[-1] + 273.15, abs=1e-3
    )
    start = result.fields(position=0.0)["temperature"]
    assert np.ptp(start) < 1e-3
    assert result.fields(time=0.6).time == pytest.approx(0.5)
    assert result.fields(time="600 ms").time == pytest.approx(0.5)
    assert result.fields(position="25 mm").position == pytest.approx(0.03)
    with pytest.raises(castfem.InputError, match=r"^fields: position 3 kg: .*kg"):
        result.fields(position="3 kg")
    assert end.cells.max() < len(end.points)


def test_missing_fields_are_reported(result):
    with pytest.raises(castfem.InputError, match=r"no field stretch; there are .*temperature"):
        result.fields()["stretch"]
    with pytest.raises(castfem.InputError, match=r"written from 0 to 0\.06 m"):
        result.fields(position=0.1)
    with pytest.raises(castfem.InputError, match="not both"):
        result.fields(time=0.1, position=0.1)


def test_folder(case, tmp_path):
    found = castfem.run(case.with_(speed="3 m/min"), tmp_path / "out")
    again = castfem.Result(tmp_path / "out")
    assert again.quantities == pytest.approx(found.quantities)
    assert again.case.casting.speed == pytest.approx(0.05)
    found.close()
    assert (tmp_path / "out" / "history.csv").is_file()
    with pytest.raises(castfem.InputError, match="holds no finished run"):
        castfem.Result(tmp_path)


def test_temporary_folder_is_removed(case):
    found = castfem.run(case)
    folder = found.folder
    assert folder.is_dir()
    kept = found.summary
    del found
    gc.collect()
    assert not folder.exists()
    assert kept.quantities["position"].value == pytest.approx(0.06)
    with castfem.run(case) as closed:
        folder = closed.folder
    assert not folder.exists()


def test_failure_leaves_nothing(case, monkeypatch, tmp_path):
    """The temporary folder of a failed run is removed, and its log is closed."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with pytest.raises(castfem.InputError, match="nosuch"):
        castfem.run(case.with_({"steel.name": "nosuch"}))
    assert list(tmp_path.iterdir()) == []


def test_resume_names_the_differences(case, tmp_path):
    castfem.run(case, tmp_path / "run")
    with pytest.raises(castfem.InputError, match=r"casting\.speed: 3\.6 m/min there, 3 m/min here"):
        castfem.run(case.with_(speed="3 m/min"), tmp_path / "run", resume=True)
    begun = castfem.run(case, tmp_path / "nothing", resume=True)
    assert begun.quantities["position"] == pytest.approx(case.casting.length)
    further = castfem.run(case.with_(length="90 mm"), tmp_path / "run", resume=True)
    assert further.quantities["position"] == pytest.approx(0.09)


def test_run_of_another_case_is_kept(case, tmp_path):
    castfem.run(case, tmp_path / "run")
    castfem.run(case, tmp_path / "run")
    slower = case.with_(speed="3 m/min")
    with pytest.raises(castfem.InputError, match=r"another case \(casting\.speed.*overwrite=True"):
        castfem.run(slower, tmp_path / "run")
    with pytest.raises(castfem.InputError, match=r"has reached 0\.06 m.*overwrite=True"):
        castfem.run(case.with_(length="30 mm"), tmp_path / "run")
    assert castfem.Result(tmp_path / "run").case == case
    castfem.run(slower, tmp_path / "run", overwrite=True)
    assert castfem.Result(tmp_path / "run").case == slower


def test_arguments_of_a_wrong_type_are_reported_in_one_line(case, result):
    for wrong in (
        lambda: castfem.run(None),
        lambda: case.with_({3: "x"}),
        lambda: case.with_("speed"),
        lambda: result.fields(time="3"),
        lambda: result.fields(position=[0.03]),
    ):
        with pytest.raises(castfem.InputError) as caught:
            wrong()
        assert len(str(caught.value).splitlines()) == 1


def test_excessive_flux_is_reported(case):
    flux = {"law": "flux", "value": "40 MW/m^2"}
    changed = case.with_({"cooling.0.surface": [flux], "casting.length": "300 mm"})
    with pytest.raises(castfem.RunFailure) as caught:
        castfem.run(changed)
    message = str(caught.value)
    assert (
        "more heat is taken than there is" in message
        and "at x = " in message
        and 'law = "flux"' in message
    )


def test_notebook_shows_case_and_result(case, result):
    shown = result._repr_html_()
    assert shown.startswith("<table>") and "shell, mid-face" in shown
    odd = case.with_(title="a < b")
    assert "a &lt; b" in odd._repr_html_() and "[casting]" in odd._repr_html_()
    # In the chosen units.
    si = case.with_({"output.units": {"system": "si", "time": "min"}})._repr_html_()
    assert "speed = &quot;3.6 m/min&quot;" in case._repr_html_()
    assert "speed = &quot;0.06 m/s&quot;" in si and "wall = &quot;433.15 K&quot;" in si
    kelvin = result._summary.quantities["surface_temperature_mid_face"].value
    assert f"<td>{kelvin - 273.15:.5g}</td><td>°C</td>" in shown
    with shown_in(ShownUnits.read("si")):
        assert f"<td>{kelvin:.5g}</td><td>K</td>" in result._repr_html_()


def test_columns_are_plotted_along_the_strand(result):
    axes = result.plot("shell_mid_face", "shell_corner")
    drawn = axes.get_lines()[0]
    assert drawn.get_ydata() == pytest.approx(result.history["shell_mid_face"])
    assert drawn.get_xdata() == pytest.approx(result.history["position"])
    assert axes.get_ylabel() == "[mm]" and len(axes.get_lines()) == 2
    assert result.plot("surface_temperature_corner", axes=axes) is axes
    pyplot.close("all")


def test_field_is_plotted_on_the_section(result):
    place = float(result.positions[-1])
    axes = result.section(at=place)
    low, high = axes.collections[0].get_clim()
    kelvin = result.fields(position=place)["temperature"]
    assert high == pytest.approx(kelvin.max() - 273.15, abs=2.0)
    assert low == pytest.approx(kelvin.min() - 273.15, abs=2.0)
    assert axes.get_title() == f"{1e3 * place:.5g} mm below the meniscus"
    assert result.section(at=f"{1e3 * place} mm").get_title() == axes.get_title()
    pyplot.close("all")


def test_invalid_plots_are_reported(result):
    with pytest.raises(InputError, match="no column shel"):
        result.plot("shel")
    with pytest.raises(InputError, match="different units"):
        result.plot("shell_mid_face", "surface_temperature_corner")
    with pytest.raises(InputError, match="fields were written"):
        result.section(at="5 m")


ROOT = Path(__file__).parents[2]
# The omissions of the page, and its mesh and steps.
AS_BY_HAND = (
    "casting.length=150 mm",
    *cells(2, 8, 12),
    "mesh.surface_depth=5 mm",
    "mesh.core_depth=20 mm",
    "thermal.time.step=0.1 s",
    "coupling.interval=0.1 s",
    "coupling.passes=1",
    "coupling.follow_shape=false",
    "coupling.dissipation=0",
    "output.every=1 h",
    "output.figures=false",
)


def test_page_computes_the_results_of_the_case(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = (ROOT / "docs" / "by_hand.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    assert len([line for line in code.splitlines() if line]) <= 45
    found: dict[str, Any] = {}
    exec(compile(code, "docs/by_hand.md", "exec"), found)
    assert capsys.readouterr().out.startswith("heat removed 0.6")
    case = load_case(ROOT / "cases" / "billet125" / "taper_0.toml", AS_BY_HAND)
    with castfem.run(case, tmp_path / "run") as result:
        history = result.history.iloc[-1]
    heat, strain = found["hot"].removed, found["strained"].generalized_strains[0]
    assert history["time"] == pytest.approx(found["hot"].time)
    assert 4.0 * heat == pytest.approx(history["heat_removed"], rel=1e-9)
    assert strain == pytest.approx(history["axial_strain"], rel=1e-7)
