"""A slice whose law has a strain tensor for its state: factored by LU, through reversals."""

from __future__ import annotations

import numpy as np
import pytest

from castfem.base.tables import Constant
from castfem.base.types import Array
from castfem.fem import factorisation
from castfem.physics.constitutive.elasticity import Elasticity
from castfem.physics.constitutive.hardening_laws import NortonHoff, UnifiedSteel
from mechanics.setups import SliceSetup, box, expansion, mapped

HOT = 1350.0
STIFF = Elasticity.constant(15e9, 0.3)
CURVE = (Constant(40e6), Constant(0.0), Constant(0.14), Constant(0.16))


def law(name: str, hardening: str) -> UnifiedSteel | NortonHoff:
    if name == "steel":
        return UnifiedSteel(STIFF, 0.1, np.zeros_like, hardening=hardening)  # type: ignore[arg-type]
    return NortonHoff(STIFF, *CURVE, hardening=hardening)  # type: ignore[arg-type]


def swung(name: str, hardening: str) -> SliceSetup:
    """Two swings of an uneven temperature whose pattern turns, so that flow does, too."""
    setup = SliceSetup(
        mapped(4, 4, box(0.1, 0.1)), law(name, hardening), expansion(2e-5), start=HOT
    )
    for step in range(1, 25):
        turn = 2.0 * np.pi * step / 12.0

        def uneven(x: Array, y: Array, turn: float = turn) -> Array:
            along, aside = np.sin(turn), np.sin(1.5 * turn)
            return np.asarray(HOT - 80.0 * along * (x / 0.1) ** 2 - 80.0 * aside * (y / 0.1) ** 2)

        setup.step(float(step), uneven)
    return setup


@pytest.mark.parametrize("name", ["steel", "hoff"])
def test_newton_needs_no_more_through_reversals(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """By MUMPS, which factors a symmetric matrix as one."""
    monkeypatch.setattr(factorisation, "LIMITS", factorisation.OwnLimits(rows=0))
    plain, signed = swung(name, "accumulated"), swung(name, "signed")
    for setup, kind in ((plain, "cholesky"), (signed, "lu")):
        solver = setup.problem.bordered.solver
        assert (solver._fallback[0] if solver._fallback else solver.ksp).getPC().getType() == kind
    counts = [np.array([r.newton for r in setup.results]) for setup in (plain, signed)]
    assert counts[1].max() <= 8
    assert counts[1].sum() <= 1.3 * counts[0].sum()
    flowed = [s.problem.slice.law.strain(s.state.internal[: s.problem.points.deviator_points])
              for s in (plain, signed)]  # fmt: skip
    assert flowed[1].max() > 1e-4
    assert flowed[0].max() > 2.0 * flowed[1].max()  # what is accumulated only grows
