"""Which bend is worse: what hardening remembers of strain, and the radii of the rolls."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks import slab_reversal as study
from castfem.model import load_case
from castfem.physics.machine import Machine

Caster = tuple[Machine, np.ndarray]


@pytest.fixture(scope="module")
def shipped() -> Caster:
    return study.caster(study.CASTERS[0], Path())


@pytest.mark.parametrize(
    ("name", "forgets", "least", "most"),
    [
        ("kozlowski_zhu_signed", None, 0.6, 0.75),
        ("kozlowski_zhu_signed", 100.0, 0.95, 1.02),
        ("kozlowski_zhu", 100.0, 0.95, 1.02),
        ("kozlowski_zhu", None, 1.1, 1.2),
        ("norton_hoff_kozlowski", None, 1.05, 1.2),
    ],
)
def test_straightening_over_bending_by_what_hardening_remembers(
    shipped: Caster, name: str, forgets: float | None, least: float, most: float
) -> None:
    law = study.Memory("", name, forgets).made()
    bending, straightening = study.fibres(law, *shipped, steps=160)
    assert least < straightening / bending < most


def test_signed_strain_lacks_the_back_stress_of_the_bend(shipped: Caster) -> None:
    """Kozlowski's f1 e^f2, of the viscoplastic strain after either bend."""
    law = study.SIGNED.made()
    bending, straightening = study.fibres(law, *shipped, steps=320)
    arc, kelvin = study.HALF * shipped[0].curvature(10.0, "centreline"), study.AT
    young = float(law.elasticity.young(np.array([kelvin]))[0])
    first, second = 130.5e6 - 5.128e3 * kelvin, -0.6289 + 1.114e-3 * kelvin
    bent, undone = arc - bending / young, straightening / young
    back = first * (bent**second + undone**second)
    assert bending - straightening == pytest.approx(back, rel=0.03)


def test_a_harder_end_keeps_the_radii_that_are_told(shipped: Caster, tmp_path: Path) -> None:
    machine, places = study.caster(study.CASTERS[1], tmp_path)
    radii = [1.0 / max(machine.curvature(float(places[roll - 1])), 1e-9) for roll in range(1, 88)]
    own = [1.0 / max(shipped[0].curvature(float(places[roll - 1])), 1e-9) for roll in range(1, 88)]
    changed = [roll for roll in range(1, 88) if not np.isclose(radii[roll - 1], own[roll - 1])]
    assert changed == [51, 52, 53, 54, 55, 56]
    bender, straightener = study.rates(*shipped)
    assert straightener == pytest.approx(bender, rel=0.03)
    assert study.rates(machine, places) == (bender, pytest.approx(1.43 * straightener, rel=0.01))


def test_a_case_has_the_law_that_forgets(tmp_path: Path) -> None:
    key = study.Memory("", "kozlowski_zhu", 50.0).key(tmp_path)
    case = load_case(study.CASES / "slab.toml", (key,))
    assert case.mechanics is not None
    text = Path(str(case.mechanics.law)).read_text(encoding="utf-8")
    assert 'recovery_time = "50 s"' in text.partition("[data]")[0]
