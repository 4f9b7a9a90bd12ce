"""`castfem check` and `castfem run` on the mechanical tables of a case: messages in one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from castfem.physics.constitutive import available_laws

ALL_LAWS = "one of " + ", ".join(available_laws())


@pytest.mark.parametrize(
    ("assignment", "said"),
    [
        ("mechanics.law=norton_hof", 'mechanics.law: "norton_hof" not found; ' + ALL_LAWS),
        ("mechanics.law=elastic_steel", 'mechanics.law: "elastic_steel" holds none; ' + ALL_LAWS),
        ("mechanics.law=./soft.toml", 'mechanics.law: "soft.toml" not found; did you mean'),
        ("mechanics.law=./sift.toml", "sift.toml: law: is missing; one of thermo_elastic"),
        ("mechanics.elasticity=elastic", 'mechanics.elasticity: "elastic" not found; one of'),
        ("mechanics.elasticity=./sift.toml", "sift.toml: young: is missing; the Young's modulus"),
    ],
)
def test_law_of_the_slice_is_tried(castfem, assignment: str, said: str) -> None:
    Path("sift.toml").write_text("poisson = 0.3\n", encoding="utf-8")
    for command in ("check", "run"):
        outcome = castfem(command, "billet125/idealised", "--set", assignment)
        assert outcome.status == 1
        assert said in outcome.err
        assert outcome.err.count("\n") == 1
        assert outcome.err.startswith("castfem: --set: mechanics.")
    assert not Path("results").exists()


def test_what_the_steel_must_have_is_looked_for(castfem) -> None:
    radiation = 'cooling=[{name = "air", surface = [{law = "radiation", ambient = "25 degC"}]}]'
    missing = {
        "steel.name: copper has no thermal_expansion, which [mechanics] needs": (),
        'cooling.0.surface.0.emissivity (zone "air"): steel copper has no': ("--set", radiation),
    }
    for command in ("check", "run"):
        words = ("--set", "steel.name=copper", *(one for more in missing.values() for one in more))
        outcome = castfem(command, "billet125/taper_1", *words)
        assert outcome.status == 1
        for line in missing:
            assert f"--set: {line}" in outcome.err
    assert not Path("results").exists()
    given = ("--set", 'steel.overrides.thermal_expansion="1.7e-5 1/K"')
    assert castfem("check", "billet125/taper_1", "--set", "steel.name=copper", *given).status == 0


def test_sprays_from_roll_to_roll_radiate_by_the_steel_too(castfem) -> None:
    outcome = castfem("check", "slab1200/sprays", "--set", "steel.name=copper")
    assert outcome.status == 1
    assert "secondary.emissivity: " in outcome.err


def test_both_sets_are_told_at_once(castfem) -> None:
    words = ("--set", "mechanics.law=none", "--set", "mechanics.elasticity=none")
    outcome = castfem("check", "billet125/idealised", *words)
    assert 'mechanics.law: "none"' in outcome.err
    assert 'mechanics.elasticity: "none"' in outcome.err


def test_check_tells_the_mechanics(castfem) -> None:
    assert (
        "mechanics: norton_hoff_kozlowski (numbers of a steel of 0.1 %C), free"
        in castfem("check", "billet125/idealised").out
    )
    assert ", in a rigid mould" in castfem("check", "billet125/taper_1").out
    assert "mechanics" not in castfem("check", "billet125/thermal").out
