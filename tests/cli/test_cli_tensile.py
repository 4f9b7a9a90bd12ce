"""Tensile tests on the command line: check, run, show, and mistakes.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.thesis_tensile import TESTS
from castfem.base.errors import RunFailure
from castfem.runs.output.history import read_history

NAMES = ("constant_rate", "rate_jump", "softening", "unloading", "unloading_softening")


def test_check(castfem):
    outcome = castfem("check", "tensile/rate_jump")
    assert outcome.status == 0, outcome.err
    assert "tensile/rate_jump: valid" in outcome.out
    assert "law norton_hoff, 200 steps a segment" in outcome.out
    assert "0.4 s at 0.01 1/s" in outcome.out


@pytest.mark.parametrize(("name", "test"), list(zip(NAMES, TESTS, strict=True)), ids=NAMES)
def test_five_tests_of_the_thesis(castfem, name, test):
    """All files of a run; the stress of the law, and its analytical solution."""
    outcome = castfem("run", f"tensile/{name}", "-o", "out")
    assert outcome.status == 0, outcome.err
    written = {p.relative_to("out").as_posix() for p in Path("out").rglob("*") if p.is_file()}
    assert written - {".castfem.lock"} == {
        "case.toml", "history.csv", "summary.json", "run.json", "run.log", "figures/tensile.png",
    }  # fmt: skip
    table = read_history("out/history.csv")
    steps = 300 if name == "softening" else 200
    found = test.run(steps)
    assert table["time"].to_numpy() == pytest.approx(found.time, rel=1e-11)
    stress = 1e-6 * found.axial_stress[:, 0]
    assert table["stress"].to_numpy() == pytest.approx(stress, rel=1e-7, abs=1e-9)
    flow = found.state[:, 0, 0]
    assert table["viscoplastic_strain"].to_numpy() == pytest.approx(flow, rel=1e-7, abs=1e-12)
    gap = (table["stress"] - table["analytical_stress"]).abs().to_numpy() / stress.max()
    if name == "rate_jump":  # the memory of the law, a strain of a few p3 q/E after each change
        settled = table["strain"].to_numpy()
        settled = np.minimum(np.abs(settled - 0.004), np.abs(settled - 0.008)) > 5e-4
        assert gap[settled].max() < 0.01
    else:
        assert gap.max() < 1e-9
    summary = json.loads(Path("out/summary.json").read_text())
    assert summary["status"] == "finished"
    for reference in summary["references"]:
        assert abs(reference["relative"]) < 1e-6, reference
    reached = json.loads(Path("out/run.json").read_text())["reached"]
    assert reached["step"] == steps * len(test.segments)


def test_run_again_show_and_other_physics(castfem):
    assert castfem("run", "tensile/unloading", "-o", "out", "-q").status == 0
    assert castfem("run", "out/case.toml", "-o", "again", "-q").status == 0
    assert Path("again/history.csv").read_text() == Path("out/history.csv").read_text()
    assert castfem("run", "tensile/unloading", "-o", "out").status == 0
    Path("out/figures/tensile.png").unlink()
    shown = castfem("show", "out")
    assert shown.status == 0
    assert "stress, end of segment 2" in shown.out
    assert "tensile.png" in shown.out
    assert Path("out/figures/tensile.png").is_file()
    other = ("run", "tensile/unloading", "-o", "out", "--set", "tensile.segment.1.duration=0.2 s")
    refused = castfem(*other)
    assert refused.status == 1
    assert "tensile.segment.1.duration: 0.3 s there, 0.2 s here" in refused.err
    assert castfem(*other, "--overwrite").status == 0
    strand = castfem("run", "billet125/thermal", "-o", "out")
    assert strand.status == 1
    assert "holds a run of another case" in strand.err


def test_what_is_made_of_strands_is_refused_in_one_line(castfem):
    for name in ("one", "other"):
        assert castfem("run", "tensile/unloading", "-o", name, "-q").status == 0
    for words in (("compare", "one", "other"), ("report", "one"), ("show", "one", "--at", "1 m")):
        refused = castfem(*words)
        assert refused.status == 1
        assert "one: is a tensile test; use castfem show one" in refused.err
    watched = castfem("watch", "one")
    assert watched.status == 0
    assert "t = 12.6 s" in watched.out


@pytest.mark.parametrize("swing", [75, 125])
@pytest.mark.parametrize("material", ["norton_hoff_kozlowski", "kozlowski_zhu"])
def test_eighty_cycles(castfem, swing, material):
    """Held while heated and cooled: the signed laws repeat themselves, the others harden."""
    found = {}
    for name in (material, f"{material}_signed"):
        words = (f"tensile.material={name}", "tensile.steps=32", "output.figures=false")
        sets = [word for given in words for word in ("--set", given)]
        outcome = castfem("run", f"tensile/cycles_{swing}", "-o", name, *sets)
        assert outcome.status == 0, outcome.err
        summary = json.loads(Path(name, "summary.json").read_text())
        found[name] = {k: v["value"] for k, v in summary["quantities"].items()}
        table = read_history(Path(name, "history.csv"))
        heat = table["temperature"].to_numpy()
        assert (heat.min(), heat.max()) == (950.0 - swing, 950.0 + swing)
        last = table["stress"].to_numpy()[-33:]
        assert found[name]["tension_80"] == pytest.approx(last.max(), rel=1e-9)
        assert not table["total_strain"].any()
    plain, signed = found[material], found[f"{material}_signed"]
    assert signed["tension_80"] == pytest.approx(signed["tension_3"], rel=1e-3)
    assert signed["compression_80"] == pytest.approx(signed["compression_3"], rel=1e-3)
    assert abs(signed["growth"]) < 0.1
    assert plain["growth"] > 30.0
    # Strain in the other direction and back does not harden: the peak is that of virgin steel.
    words = (
        f"tensile.material={material}", "tensile.steps=32", "tensile.cycles=1",
        "output.figures=false", 'tensile.temperature.time=["0 s", "3.125 s", "12.5 s"]',
        f'tensile.temperature.value=["950 degC", "{950 - swing} degC", "950 degC"]',
    )  # fmt: skip
    sets = [word for given in words for word in ("--set", given)]
    assert castfem("run", f"tensile/cycles_{swing}", "-o", "cooled", *sets).status == 0
    virgin = read_history(Path("cooled", "history.csv"))["stress"].max()
    assert signed["tension_1"] == pytest.approx(virgin, rel=0.02)
    assert signed["tension_1"] < plain["tension_1"]


def test_steel_that_relaxes(castfem):
    """Held at its strain: plotted over time, no analytical solution, the stress falls."""
    words = ["--set", "tensile.material=kozlowski_zhu", "--set", "tensile.carbon=0.1"]
    hold = 'tensile.segment=[{rate="1e-3 1/s", duration="5 s"}, {rate="0 1/s", duration="60 s"}]'
    outcome = castfem("run", "tensile/constant_rate", "-o", "out", *words, "--set", hold)
    assert outcome.status == 0, outcome.err
    table = read_history("out/history.csv")
    assert table["analytical_stress"].isna().all()
    held = table["stress"].to_numpy()[200:]
    assert (np.diff(held) < 0.0).all()
    assert held[-1] < 0.5 * held[0]


def test_bar_between_walls(castfem):
    """Held, heated, then cooled a little: compressed until it flows, released elastically (214)."""
    words = []
    for key in (
        'tensile.material={law="perfectly_plastic", yield_stress="20 MPa"}',
        'tensile.segment=[{rate="0 1/s", duration="15 s"}]',
        "tensile.expansion=2e-5 1/K",
        "tensile.steps=150",
        'tensile.temperature={time=["0 s", "10 s", "15 s"], value=["1273 K", "1373 K", "1368 K"]}',
        "reference=[]",
    ):
        words += ["--set", key]
    outcome = castfem("run", "tensile/constant_rate", "-o", "out", *words)
    assert outcome.status == 0, outcome.err
    table = read_history("out/history.csv")
    heated = table["temperature"].to_numpy() + 273.15 - 1273.0
    assert table["strain"].to_numpy() == pytest.approx(-2e-5 * heated, abs=1e-12)
    assert not table["total_strain"].any()
    pressed = np.minimum(20.0, 0.4 * heated)  # 20 GPa
    released = table["time"].to_numpy() > 10.0
    stress = np.where(released, -20.0 + 0.4 * (100.0 - heated), -pressed)
    assert table["stress"].to_numpy() == pytest.approx(stress, abs=1e-6)


@pytest.mark.parametrize(
    ("assignment", "message"),
    [
        ("tensile.material=kozlowsky_zhu", "did you mean kozlowski_zhu?"),
        ("tensile.material=kozlowski_zhu", "carbon: is missing"),
        ("tensile.elasticity=elastic_steal", 'tensile.elasticity: "elastic_steal" not found'),
        ("tensile.material.p3=7", "tensile.material: p3: must not be above 1"),
        ("tensile.material.p5=7", "p5: unknown key"),
        ("tensile.young=-1 GPa", "tensile.young: must be above 0"),
    ],
)
def test_mistakes_end_with_one(castfem, assignment, message):
    for command in ("check", "run"):
        outcome = castfem(command, "tensile/constant_rate", "--set", assignment)
        assert outcome.status == 1
        assert message in outcome.err
        assert outcome.err.count("\n") == 1
    assert not Path("results").exists()


def test_tensile_test_has_no_checkpoint_and_no_mesh(castfem):
    assert castfem("run", "tensile/softening", "-o", "out", "-q").status == 0
    resumed = castfem("run", "tensile/softening", "-o", "out", "--resume")
    assert resumed.status == 1
    assert "run without --resume" in resumed.err
    mesh = castfem("mesh", "tensile/softening")
    assert mesh.status == 1
    assert "is a tensile test" in mesh.err


def test_failure_keeps_the_rows_before_it(castfem, monkeypatch):
    """The law fails after 50 steps: status 2, the reason, and 50 valid rows."""
    from castfem.physics.constitutive import uniaxial

    whole = uniaxial._balanced
    calls = []

    def balanced(*arguments):
        calls.append(arguments)
        if len(calls) > 50:
            raise RunFailure(f"tensile test: no equilibrium at {arguments[-1]:g} s")
        return whole(*arguments)

    monkeypatch.setattr(uniaxial, "_balanced", balanced)
    outcome = castfem("run", "tensile/constant_rate", "-o", "out")
    assert outcome.status == 2
    assert "no equilibrium at 3.06 s" in outcome.err
    assert len(read_history("out/history.csv")) == 51
    record = json.loads(Path("out/run.json").read_text())
    assert (record["status"], record["reached"]["step"]) == ("failed", 50)
    assert "at 3.06 s" in record["reason"]
    shown = castfem("show", "out")
    assert "failed" in shown.out and "Last of 51 steps" in shown.out


CURVES = ((1000.0, 55.2e6, 0.13, 0.15), (1200.0, 30.1e6, 0.14, 0.16))


def tensile_file(folder: Path) -> Path:
    rows = ["temperature [degC],strain rate [1/s],strain [percent],stress [MPa]"]
    for temperature, strength, p3, p4 in CURVES:
        for rate in (1e-4, 1e-3):
            for strain in np.linspace(0.003, 0.05, 12):
                stress = strength * np.sqrt(3) * (np.sqrt(3) * rate) ** p3 * strain**p4
                rows.append(f"{temperature},{rate},{100 * strain},{1e-6 * stress}")
    path = folder / "gleeble.csv"
    path.write_text("\n".join(rows) + "\n")
    return path


def test_identify_writes_its_law(castfem, tmp_path):
    target = tmp_path / "law.toml"
    outcome = castfem("identify", tensile_file(tmp_path), "-o", target, "--softening", "none")
    assert outcome.status == 0
    assert "1200" in outcome.out
    assert target.with_suffix(".png").is_file()
    from castfem.physics.constitutive import load_elasticity, load_law

    law = load_law(str(target), load_elasticity())
    found = law.p3(np.array([1273.15, 1473.15]))
    np.testing.assert_allclose(found, [0.13, 0.14], atol=1e-3)


def test_identify_overwrites_no_file_without_the_option(castfem, tmp_path):
    target = tmp_path / "law.toml"
    target.write_text("mine")
    outcome = castfem("identify", tensile_file(tmp_path), "-o", target, "--softening", "none")
    assert outcome.status == 1
    assert "law.toml: exists already" in outcome.err and "--overwrite" in outcome.err
    assert target.read_text() == "mine"
    outcome = castfem("identify", tensile_file(tmp_path), "-o", target, "--overwrite")
    assert outcome.status == 0 and "norton_hoff" in target.read_text()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["gleeble.csv", "law.png", "law.toml"]


def test_identify_refuses_unreadable_input(castfem, tmp_path):
    outcome = castfem("identify", tmp_path / "none.csv")
    assert outcome.status == 1
    assert "none.csv" in outcome.err
    outcome = castfem("identify", tensile_file(tmp_path), "--softening", "some")
    assert outcome.status == 1
    assert "positive, free, none" in outcome.err
