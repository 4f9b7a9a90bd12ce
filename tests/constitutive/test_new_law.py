"""A new constitutive law needs its class, and a branch of the kernel only for a new flow curve."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from castfem.base.errors import InputError
from castfem.base.quantities import Kind
from castfem.base.types import Array
from castfem.model import TensileCase, load_any
from castfem.physics.constitutive.base import Parameter
from castfem.physics.constitutive.elasticity import Curve
from castfem.physics.constitutive.flow_laws import FlowCurve, RadialReturn
from castfem.physics.constitutive.kernel import constants
from castfem.physics.constitutive.parameters import law_from, load_elasticity
from castfem.runs.output.history import read_history
from castfem.runs.tensile.tensile_test import run

TEST = """
title = "a law of its own"
[tensile]
material = {{ {law} }}
temperature = "1100 degC"
young = "20 GPa"
poisson = 0.3
steps = 50
[[tensile.segment]]
rate = "1e-3 1/s"
duration = "10 s"
"""
# At 1100 degC, 200 K above 900 degC.
SOFTENED = 'law = "softened", level = "60 MPa", rate = "2e-3 1/K"'
PLASTIC = f'law = "perfectly_plastic", yield_stress = "{60 * math.exp(-0.4)!r} MPa"'


@pytest.fixture
def softened(monkeypatch: pytest.MonkeyPatch) -> None:
    """Register a law for the test that uses this fixture."""
    monkeypatch.setattr(RadialReturn, "laws", dict(RadialReturn.laws))

    @dataclass(frozen=True, slots=True)
    class Softened(RadialReturn):
        """Perfect plasticity: q <= level exp(-rate (T - 900 degC))."""

        level: Curve
        rate: float = 1e-3

        name: ClassVar[str] = "softened"
        parameters: ClassVar[Mapping[str, Parameter]] = {
            "level": Parameter(Kind("Pa", "MPa", above=0.0, label="stress", sample="20 MPa"))
        }
        numbers: ClassVar[Mapping[str, Kind]] = {"rate": Kind("1/K", "1/K", least=0.0)}
        kind: ClassVar[int] = constants.PLASTIC

        def own_columns(self, temperature: Array) -> list[Array]:
            return [self.level(temperature) * np.exp(-self.rate * (temperature - 1173.15))]

        def flow_curve(self, temperature: float) -> FlowCurve:
            limit = self.own_columns(np.full(1, temperature))[0][0]
            return lambda strain, rate: np.full_like(strain, limit)


PAGE = Path(__file__).parents[2] / "docs" / "laws.md"


@pytest.fixture
def page_law_file(monkeypatch: pytest.MonkeyPatch) -> str:
    """Register the law of docs/laws.md with the code of the page; return its parameter file."""
    monkeypatch.setattr(RadialReturn, "laws", dict(RadialReturn.laws))
    _, _, text = PAGE.read_text(encoding="utf-8").partition("### A law of your own")
    code, file = re.findall(r"^```(?:python|toml)\n(.*?)^```", text, re.M | re.S)[:2]
    exec(compile(code, str(PAGE), "exec"), {"__name__": __name__})
    return str(file)


def stress(folder: Path, law: str) -> Array:
    """Run the tensile test with this law; return the stress history, MPa."""
    path = folder / "test.toml"
    path.write_text(TEST.format(law=law))
    case = load_any(path)
    assert isinstance(case, TensileCase)
    run(case, folder / law[7:12])
    history = read_history(folder / law[7:12] / "history.csv")
    return history["stress"].to_numpy(float)


@pytest.mark.usefixtures("softened")
def test_new_law_runs(tmp_path: Path) -> None:
    """The stress is that of perfect plasticity with the same yield stress, and the closed form."""
    found = stress(tmp_path, SOFTENED)
    assert found == pytest.approx(stress(tmp_path, PLASTIC), rel=1e-12)
    assert found[-1] == pytest.approx(60.0 * np.exp(-0.4), rel=1e-12)


def test_law_of_the_page_runs(page_law_file: str, tmp_path: Path) -> None:
    """At constant rate the stress tends to that of the closed form."""
    (tmp_path / "my_law.toml").write_text(page_law_file)
    path = tmp_path / "test.toml"
    path.write_text(TEST.replace("{{ {law} }}", '"./my_law.toml"'))
    case = load_any(path)
    assert isinstance(case, TensileCase)
    run(case, tmp_path / "run")
    found = read_history(tmp_path / "run" / "history.csv")["stress"].to_numpy(float)
    creep = 3e10 * math.exp(-400e3 / (8.314462618 * 1373.15))  # 1/s at 1 MPa
    assert found[-1] == pytest.approx((1e-3 / creep) ** (1.0 / 4.5), rel=1e-6)


@pytest.mark.usefixtures("softened")
def test_missing_kernel_columns_are_rejected(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Without them the kernel would read beyond the columns of the law."""
    law = RadialReturn.laws["softened"]
    monkeypatch.setattr(law, "own_columns", RadialReturn.own_columns)
    with pytest.raises(TypeError, match=r"Softened.own_columns returns 0 columns, .* takes 1"):
        stress(tmp_path, SOFTENED)


@pytest.mark.usefixtures("softened")
def test_parameters_of_a_new_law_are_checked(tmp_path: Path) -> None:
    for law, words in (
        ('law = "softned", level = "60 MPa"', r'"softned"\) is not known.*did you mean "?softened'),
        ('law = "softened"', 'level: is missing; the stress, such as "20 MPa"'),
        ('law = "softened", level = "60 MPa", rate = "2 K"', r"rate: .*2 K"),
        ('law = "softened", level = "60 MPa", rates = 1', "rates: unknown key.*did you mean rate"),
    ):
        with pytest.raises(InputError, match=words):
            stress(tmp_path, law)


def test_parameters_without_default_are_required(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(RadialReturn, "laws", dict(RadialReturn.laws))

    @dataclass(frozen=True, slots=True)
    class Needing(RadialReturn):
        level: float
        side: str

        name: ClassVar[str] = "needing"
        numbers: ClassVar[Mapping[str, Kind]] = {
            "level": Kind("Pa", "MPa", label="stress", sample="20 MPa")
        }
        words: ClassVar[Mapping[str, tuple[str, ...]]] = {"side": ("hot", "cold")}

    with pytest.raises(InputError) as caught:
        law_from({"law": "needing"}, load_elasticity(), "mine.toml")
    assert caught.value.problems == (
        'mine.toml: level: is missing; the stress, such as "20 MPa"',
        "mine.toml: side: is missing; hot, cold",
    )
