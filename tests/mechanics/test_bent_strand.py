"""A strand that is bent and straightened: what rolls conserve, and who pays for the work.

[Pascon2003] (38), (41); the closed forms follow from (N - k M)' = -M k'.
"""

from __future__ import annotations

import numpy as np
import pytest

from castfem.base.tables import Constant
from castfem.physics.constitutive.elasticity import Elasticity
from castfem.physics.constitutive.flow_laws import PerfectlyPlastic
from castfem.physics.mechanics.bent_planes import BentPlanes
from mechanics.setups import SliceSetup, box, elastic, expansion, mapped

E, YIELD = 200e9, 200e6
WIDTH, HALF = 0.1, 0.05
AREA, INERTIA = 2 * HALF * WIDTH, WIDTH * (2 * HALF) ** 3 / 12
MIDDLE = 0.2  # 1/m: largest curvature of the middle


def extrados(middle: float) -> float:
    """Curvature of the extrados, 1/m, of that of the middle."""
    return middle / (1.0 + middle * HALF)


def arc(time: float) -> float:
    """Curvature of the extrados: bent from 0 to 1 s, held to 2 s, straight again at 3 s."""
    return extrados(MIDDLE * max(0.0, min(time, 1.0, 3.0 - time)))


def strand(law: object, cells: int = 4, **given: object) -> SliceSetup:
    """Half a strand whose faces are free."""
    mesh = mapped(1, cells, box(WIDTH, 2 * HALF, 0.0, -HALF), groups=("symmetry_x", "b", "r", "t"))
    planes = BentPlanes(arc, HALF, **given.pop("planes", {}))  # type: ignore[arg-type]
    return SliceSetup(mesh, law, given={"planes": planes}, **given)  # type: ignore[arg-type]


def run(setup: SliceSetup, steps: int, end: float = 3.0) -> None:
    for i in range(1, round(end * steps) + 1):
        setup.step(i / steps)


def forces(setup: SliceSetup) -> tuple[float, float]:
    """N and M of the last step."""
    balance = setup.results[-1].balance
    assert balance is not None
    return float(balance.axial[0]), float(balance.axial[2])


def test_an_elastic_strand_is_shortened_by_bending() -> None:
    """EA da0 + EI d(k^2 (1 + a0)) = EI k (1 + a0) dk, so 1 + a0 = 1 / sqrt(1 + k^2 I / A)."""
    exact = (1.0 + MIDDLE**2 * INERTIA / AREA) ** -0.5 - 1.0
    errors = []
    for steps in (4, 8):
        setup = strand(elastic(E))
        run(setup, steps, end=1.0)
        errors.append(setup.state.generalized_strains[0] / exact - 1.0)
        force, moment = forces(setup)
        # The work of bending, to second order E I k^2 / 2, is what N - k M has grown by.
        bending = setup.state.bending
        assert force - MIDDLE * moment == pytest.approx(-bending.work, rel=1e-9)
        assert -bending.work == pytest.approx(0.5 * E * INERTIA * MIDDLE**2, rel=1e-4)
    assert abs(errors[1]) < 1e-5
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


def test_an_elastic_strand_comes_back_straight() -> None:
    """As it was: no force, no moment, no work, whatever the steps."""
    setup = strand(elastic(E))
    run(setup, 4)
    force, moment = forces(setup)
    stress = E * MIDDLE * HALF
    assert abs(force) < 1e-9 * stress * AREA
    assert abs(moment) < 1e-9 * stress * AREA * HALF
    assert abs(setup.state.generalized_strains[[0, 2]]).max() < 1e-12
    assert abs(setup.state.bending.work) < 1e-9 * E * INERTIA * MIDDLE**2


@pytest.mark.parametrize("pull", [0.0, 3e5])
def test_rolls_conserve_what_they_do_not_bend(pull: float) -> None:
    """On the arc N - k M stays while cooling changes M; what is pulled besides adds to it."""
    setup = strand(elastic(E), thermal=expansion(1e-5), planes={"force": lambda t: pull})
    run(setup, 4, end=1.0)
    force, moment = forces(setup)
    before = force - MIDDLE * moment
    setup.step(1.5, lambda x, y: -100.0 * (y / HALF))
    after, turned = forces(setup)
    assert abs(turned - moment) > 0.05 * abs(moment)
    assert after - MIDDLE * turned == pytest.approx(before, rel=1e-8)
    assert before - pull == pytest.approx(-setup.state.bending.work, rel=1e-8)


def test_the_axial_test_direction_is_that_of_the_thesis() -> None:
    """(38) alone: N = F, whatever is bent."""
    setup = strand(elastic(E), planes={"test_direction": "axial", "force": lambda t: 3e5})
    run(setup, 4, end=1.0)
    assert forces(setup)[0] == pytest.approx(3e5, rel=1e-9)


def test_work_in_the_force_is_not_taken_twice() -> None:
    """A measured effort is that of N - k M as it stands."""
    given = {"force": lambda t: 3e5, "contains_work": True}
    setup = strand(elastic(E), planes=given)
    run(setup, 4, end=1.0)
    force, moment = forces(setup)
    assert force - MIDDLE * moment == pytest.approx(3e5, rel=1e-9)


def plastic() -> PerfectlyPlastic:
    return PerfectlyPlastic(Elasticity.constant(E, 0.3), Constant(YIELD))


def energies(setup: SliceSetup) -> tuple[float, float]:
    """Work of the drives and energy that the strand has taken, J per m of undeformed strand."""
    volume = setup.problem.points.deviator.volume
    flowed = sum(float(volume @ result.dissipation) for result in setup.results)
    stress = setup.stress
    stored = (1.3 * (stress**2).sum(axis=1) - 0.3 * stress[:, :3].sum(axis=1) ** 2) / (2 * E)
    force, moment = forces(setup)
    k = setup.state.bending.curvature
    drawn = (force - k * moment) * (1.0 + setup.state.generalized_strains[0])
    return drawn, flowed + float(volume @ stored)


def test_a_plastic_strand_takes_its_work_from_the_drives() -> None:
    """What N - k M has grown by, per metre of strand, is dissipated or stored.

    The rest is that of the steps, of second order.
    """
    errors = []
    for steps in (20, 40):
        setup = strand(plastic(), cells=8)
        run(setup, steps)
        drawn, taken = energies(setup)
        assert drawn > 0.0
        errors.append(taken / drawn - 1.0)
    assert abs(errors[1]) < 1e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.15)
    # Nothing of it is seen by N = F.
    axial = strand(plastic(), cells=8, planes={"test_direction": "axial"})
    run(axial, 20)
    drawn, taken = energies(axial)
    assert abs(drawn) < 1e-6 * taken


def test_the_neutral_axis_is_where_the_thickness_stays() -> None:
    """The drives pull: from the middle towards the intrados in bending, back in straightening."""
    setup = strand(plastic(), cells=8, planes={"force": lambda t: 0.1 * YIELD * AREA})
    run(setup, 20, end=1.0)
    bent = setup.state.bending.axis
    assert bent is not None
    assert 0.0 < bent < HALF
    setup.step(1.5)
    assert setup.state.bending.axis is None
    for i in range(1, 21):
        old = setup.state.generalized_strains
        setup.step(2.0 + i / 20)
    axis = setup.state.bending.axis
    assert axis is not None
    assert -HALF < axis < 0.0
    change = setup.state.generalized_strains - old
    assert change[0] + change[2] * axis == pytest.approx(0.0, abs=1e-15)
    assert np.isclose(setup.state.bending.curvature, 0.0, atol=1e-15)
