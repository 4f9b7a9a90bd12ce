"""Degrees of freedom of generalized plane strain: curvature, neutral axis, symmetry, loads.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import numpy as np
import pytest

from castfem.base.errors import InputError
from castfem.base.tables import Constant
from castfem.physics.constitutive.elasticity import Elasticity
from castfem.physics.constitutive.flow_laws import PerfectlyPlastic
from castfem.physics.mechanics.generalized_plane_strain import (
    PlainPlanes,
    allowed_strains,
    check_strains,
)
from castfem.physics.mechanics.machine_bending import BentPlanes, ImposedAxis
from castfem.physics.mechanics.supports import PrescribedDisplacement
from mechanics.setups import SliceSetup, box, elastic, expansion, mapped

FREE = ("left", "bottom", "right", "top")
E = 200e9


def thickness(generalized_strains: np.ndarray, y: float) -> float:
    return float(1.0 + generalized_strains[0] + generalized_strains[2] * y)


@pytest.mark.parametrize("radius", [4.0, 10.0, 1e9])
def test_planes_intersect_at_the_centre_of_curvature(radius: float) -> None:
    """(40)-(41): for any a0 the thickness vanishes at y = R - h/2."""
    planes = BentPlanes(lambda t: 1 / radius, 0.1, test_direction="axial")
    offset, directions, test = planes.at(0.0)
    assert test[:, 0] == pytest.approx([1.0, 0.0, 0.0, 0.0], abs=0.0)
    for strain in (0.0, 0.02, -0.01):
        generalized_strains = offset + directions @ [strain]
        assert generalized_strains[0] == pytest.approx(strain, abs=1e-15)
        assert generalized_strains[2] == pytest.approx(-(1 + strain) / (radius - 0.1), rel=1e-12)
        assert abs(thickness(generalized_strains, radius - 0.1)) < 1e-12


@pytest.mark.parametrize("axis", [-0.05, 0.0, 0.08])
def test_imposed_neutral_axis_keeps_its_thickness(axis: float) -> None:
    """(42)-(44): the thickness is 1 at y1, and both motions are imposed."""
    radius, half = 10.0, 0.11
    planes = BentPlanes(lambda t: 1 / radius, half, neutral_axis=axis)
    assert planes.free == ()
    generalized_strains = planes.at(0.0)[0]
    assert thickness(generalized_strains, axis) == pytest.approx(1.0, abs=1e-14)
    assert 1 + generalized_strains[0] == pytest.approx(
        (radius - half) / (radius - half - axis), rel=1e-14
    )
    assert generalized_strains[2] == pytest.approx(-1 / (radius - half - axis), rel=1e-14)


def test_straight_strand_has_no_imposed_curvature() -> None:
    offset, directions, _ = BentPlanes(lambda t: 0.0, 0.1).at(0.0)
    assert not offset.any()
    assert directions[:, 0] == pytest.approx([1.0, 0.0, 0.0, 0.0], abs=0.0)


def test_impossible_curvatures_are_rejected() -> None:
    with pytest.raises(InputError, match="radius of curvature"):
        BentPlanes(lambda t: 20.0, 0.1).at(0.0)


def test_elastic_strand_bends_about_its_neutral_axis() -> None:
    """Without axial force the neutral axis is at mid-thickness, and M = E I / R."""
    half, radius = 0.05, 10.0
    mesh = mapped(1, 4, box(0.1, 2 * half, 0.0, -half), groups=("symmetry_x", *FREE[1:]))
    planes = BentPlanes(lambda t: min(t, 1.0) / radius, half, test_direction="axial")
    setup = SliceSetup(mesh, elastic(E), settings={"planes": planes})
    for time in (0.25, 0.5, 1.0):
        result = setup.step(time)
    a0, a2 = setup.state.generalized_strains[[0, 2]]
    assert a0 == pytest.approx(0.0, abs=1e-12)
    assert a2 == pytest.approx(-1 / (radius - half), rel=1e-11)
    inertia = 0.1 * (2 * half) ** 3 / 12
    assert result.balance.axial == pytest.approx(
        [0.0, 0.5 * 0.1 * 0.0, E * inertia * a2], rel=1e-10, abs=1e-3
    )
    # An axial force F shifts the axis by F / (E A) / a2 from mid-thickness.
    planes = BentPlanes(lambda t: t / radius, half, force=lambda t: 1e6 * t, test_direction="axial")
    pulled = SliceSetup(mesh, elastic(E), settings={"planes": planes})
    balance = pulled.step(1.0).balance
    assert balance.axial[0] == pytest.approx(1e6, rel=1e-9)
    assert pulled.state.generalized_strains[0] == pytest.approx(
        1e6 / (E * 0.1 * 2 * half), rel=1e-9
    )


def test_strain_across_moves_the_points() -> None:
    """The points move equally if the strain is imposed by nodes or as generalized strain."""
    found = []
    for imposed, ends in (({"across": lambda t: 1e-3 * t}, 0.0), ({}, 1e-3)):
        side = PrescribedDisplacement(("top",), 1, lambda p, t, ends=ends: ends * t * p[:, 1])
        setup = SliceSetup(
            mapped(2, 2, box(0.1, 0.1)),
            elastic(E),
            settings={"planes": PlainPlanes(("a0",), imposed), "held": (side,)},
        )
        setup.step(1.0)
        found.append(
            setup.problem.points.moved(setup.state.displacement, setup.state.generalized_strains)
        )
    assert np.ptp(found[0][:, 1]) == pytest.approx(1e-4)
    assert np.allclose(*found, rtol=1e-9, atol=1e-14)


def test_symmetry_determines_the_free_strains() -> None:
    quarter = ("wide_face", "narrow_face", "symmetry_x", "symmetry_y")
    assert allowed_strains(quarter) == ("a0",)
    assert allowed_strains(("wide_face", "symmetry_x")) == ("a0", "a2")
    assert allowed_strains(("wide_face",)) == ("a0", "a1", "a2")
    check_strains(("a0", "across"), quarter)
    with pytest.raises(InputError, match="a2: the symmetry"):
        check_strains(("a0", "a2"), quarter)


def test_setup_has_only_the_requested_planes() -> None:
    mesh = mapped(2, 2, box(0.1, 0.1))
    fixed = SliceSetup(mesh, settings={"planes": PlainPlanes(())})
    assert fixed.problem.bordered.scalars == 0
    assert not [f for f in fixed.section.compiled if "column" in f or "corner" in f]
    assert fixed.problem.solver.x.getSize() == fixed.problem.owned
    free = SliceSetup(mesh)
    assert free.problem.solver.x.getSize() == free.problem.owned + 1
    with pytest.raises(InputError, match="symmetry of this section"):
        SliceSetup(mesh, settings={"planes": PlainPlanes(("a0", "a1"))})


def test_names_of_generalized_strains_are_checked() -> None:
    with pytest.raises(InputError, match="a3: not a generalized strain"):
        PlainPlanes(("a3",))
    with pytest.raises(InputError, match="either free or imposed"):
        PlainPlanes(("a0",), {"a0": lambda t: 0.0})


HALF, MIDDLE = 0.11, 1.0 / (8.006 - 0.11)  # m, 1/m


def extrados(middle: float) -> float:
    return middle / (1.0 + middle * HALF)


def curvature(time: float) -> float:
    """Return the curvature: bent from 1 to 2 s, constant to 5 s, straight again at 7 s."""
    return extrados(MIDDLE * float(np.interp(time, [1.0, 2.0, 5.0, 7.0], [0.0, 1.0, 1.0, 0.0])))


def planes(bending: float, straightening: float) -> BentPlanes:
    plain = BentPlanes(curvature, HALF)
    axis = ImposedAxis.alternating(plain.middle, (0.0, 1.0, 2.0, 5.0, 7.0), bending, straightening)
    return BentPlanes(curvature, HALF, neutral_axis=axis)


def thickness_of(strand: BentPlanes, time: float, y: float) -> float:
    return thickness(strand.at(time)[0], y)


def test_slab_of_the_thesis_is_stretched_by_three_per_cent() -> None:
    """The stretch is (1 + kH)/(1 - kH): of one face on the arc, of all when straight again."""
    strand = planes(HALF, -HALF)
    for time in (0.0, 1.0, 1.5, 2.0, 3.0, 5.0):
        assert thickness_of(strand, time, HALF) == pytest.approx(1.0, abs=1e-15)
    stretched = (1.0 + MIDDLE * HALF) / (1.0 - MIDDLE * HALF)
    for time in (2.0, 5.0, 6.0, 7.0, 9.0):
        assert thickness_of(strand, time, -HALF) == pytest.approx(stretched, rel=1e-12)
    for y in (-HALF, 0.0, HALF):
        assert thickness_of(strand, 8.0, y) == pytest.approx(stretched, rel=1e-12)
    assert stretched == pytest.approx(1.028, abs=5e-4)


def test_thickness_is_continuous_in_time() -> None:
    strand = planes(HALF, -HALF)
    times = np.linspace(0.0, 8.0, 8001)
    for y in (-HALF, 0.05, HALF):
        history = np.array([thickness_of(strand, float(t), y) for t in times])
        assert np.abs(np.diff(history)).max() < 2.0 * 1e-3 * MIDDLE * 2.0 * HALF


def test_equal_axes_are_a_constant_axis() -> None:
    alternating, constant = planes(0.02, 0.02), BentPlanes(curvature, HALF, neutral_axis=0.02)
    for time in (0.0, 1.3, 3.0, 6.1, 9.0):
        assert alternating.at(time)[0] == pytest.approx(constant.at(time)[0], abs=1e-15)
    assert alternating.free == ()


# A strand that is bent and straightened: the conserved force, and the work of the drives.
#
# [Pascon2003] (38), (41); the closed forms follow from (N - k M)' = -M k'.


YOUNG, YIELD = 200e9, 200e6
WIDTH, BENT_HALF = 0.1, 0.05
AREA, INERTIA = 2 * BENT_HALF * WIDTH, WIDTH * (2 * BENT_HALF) ** 3 / 12
BENT_MIDDLE = 0.2  # 1/m: largest curvature of the middle


def bent_extrados(middle: float) -> float:
    """Return the curvature of the extrados, 1/m, for that of the middle."""
    return middle / (1.0 + middle * BENT_HALF)


def arc(time: float) -> float:
    """Return the curvature of the extrados: bent in 1 s, constant to 2 s, straight again at 3 s."""
    return bent_extrados(BENT_MIDDLE * max(0.0, min(time, 1.0, 3.0 - time)))


def strand(law: object, cells: int = 4, **settings: object) -> SliceSetup:
    """Set up half a strand with free faces."""
    mesh = mapped(
        1, cells, box(WIDTH, 2 * BENT_HALF, 0.0, -BENT_HALF), groups=("symmetry_x", "b", "r", "t")
    )
    planes = BentPlanes(arc, BENT_HALF, **settings.pop("planes", {}))  # type: ignore[arg-type]
    return SliceSetup(mesh, law, settings={"planes": planes}, **settings)  # type: ignore[arg-type]


def run(setup: SliceSetup, steps: int, end: float = 3.0) -> None:
    for i in range(1, round(end * steps) + 1):
        setup.step(i / steps)


def forces(setup: SliceSetup) -> tuple[float, float]:
    """Return N and M of the last step."""
    balance = setup.results[-1].balance
    return float(balance.axial[0]), float(balance.axial[2])


def test_bending_shortens_an_elastic_strand() -> None:
    """EA da0 + EI d(k^2 (1 + a0)) = EI k (1 + a0) dk, so 1 + a0 = 1 / sqrt(1 + k^2 I / A)."""
    exact = (1.0 + BENT_MIDDLE**2 * INERTIA / AREA) ** -0.5 - 1.0
    errors = []
    for steps in (4, 8):
        setup = strand(elastic(YOUNG))
        run(setup, steps, end=1.0)
        errors.append(setup.state.generalized_strains[0] / exact - 1.0)
        force, moment = forces(setup)
        # N - k M has grown by the work of bending, to second order E I k^2 / 2.
        bending = setup.state.bending
        assert force - BENT_MIDDLE * moment == pytest.approx(-bending.work, rel=1e-9)
        assert -bending.work == pytest.approx(0.5 * YOUNG * INERTIA * BENT_MIDDLE**2, rel=1e-4)
    assert abs(errors[1]) < 1e-5
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


def test_elastic_strand_straightens_without_residue() -> None:
    """Force, moment, strain and work return to 0 for any steps."""
    setup = strand(elastic(YOUNG))
    run(setup, 4)
    force, moment = forces(setup)
    stress = YOUNG * BENT_MIDDLE * BENT_HALF
    assert abs(force) < 1e-9 * stress * AREA
    assert abs(moment) < 1e-9 * stress * AREA * BENT_HALF
    assert abs(setup.state.generalized_strains[[0, 2]]).max() < 1e-12
    assert abs(setup.state.bending.work) < 1e-9 * YOUNG * INERTIA * BENT_MIDDLE**2


@pytest.mark.parametrize("pull", [0.0, 3e5])
def test_rolls_conserve_force_at_constant_curvature(pull: float) -> None:
    """On the arc N - k M is constant while cooling changes M; an applied pull adds to it."""
    setup = strand(elastic(YOUNG), thermal=expansion(1e-5), planes={"force": lambda t: pull})
    run(setup, 4, end=1.0)
    force, moment = forces(setup)
    before = force - BENT_MIDDLE * moment
    setup.step(1.5, lambda x, y: -100.0 * (y / BENT_HALF))
    after, turned = forces(setup)
    assert abs(turned - moment) > 0.05 * abs(moment)
    assert after - BENT_MIDDLE * turned == pytest.approx(before, rel=1e-8)
    assert before - pull == pytest.approx(-setup.state.bending.work, rel=1e-8)


def test_axial_test_direction_is_that_of_the_thesis() -> None:
    """(38) only: N = F, also in bending."""
    setup = strand(elastic(YOUNG), planes={"test_direction": "axial", "force": lambda t: 3e5})
    run(setup, 4, end=1.0)
    assert forces(setup)[0] == pytest.approx(3e5, rel=1e-9)


def test_work_contained_in_the_force_is_not_added() -> None:
    """A measured pull equals N - k M including the work of bending."""
    settings = {"force": lambda t: 3e5, "contains_work": True}
    setup = strand(elastic(YOUNG), planes=settings)
    run(setup, 4, end=1.0)
    force, moment = forces(setup)
    assert force - BENT_MIDDLE * moment == pytest.approx(3e5, rel=1e-9)


def plastic() -> PerfectlyPlastic:
    return PerfectlyPlastic(Elasticity.constant(YOUNG, 0.3), Constant(YIELD))


def energies(setup: SliceSetup) -> tuple[float, float]:
    """Return the work of the drives and the energy absorbed, J per m of undeformed strand."""
    volume = setup.problem.points.deviator.volume
    flowed = sum(float(volume @ result.dissipation) for result in setup.results)
    stress = setup.stress
    stored = (1.3 * (stress**2).sum(axis=1) - 0.3 * stress[:, :3].sum(axis=1) ** 2) / (2 * YOUNG)
    force, moment = forces(setup)
    k = setup.state.bending.curvature
    drawn = (force - k * moment) * (1.0 + setup.state.generalized_strains[0])
    return drawn, flowed + float(volume @ stored)


def test_plastic_strand_absorbs_the_work_of_the_drives() -> None:
    """The growth of N - k M, per metre of strand, is dissipated or stored.

    The difference is the error of the time steps, of second order.
    """
    errors = []
    for steps in (20, 40):
        setup = strand(plastic(), cells=8)
        run(setup, steps)
        drawn, absorbed = energies(setup)
        assert drawn > 0.0
        errors.append(absorbed / drawn - 1.0)
    assert abs(errors[1]) < 1e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.15)
    # With N = F the drives do no work.
    axial = strand(plastic(), cells=8, planes={"test_direction": "axial"})
    run(axial, 20)
    drawn, absorbed = energies(axial)
    assert abs(drawn) < 1e-6 * absorbed


def test_neutral_axis_is_where_the_thickness_is_constant() -> None:
    """The pull shifts the axis towards the intrados in bending, to the other side afterwards."""
    setup = strand(plastic(), cells=8, planes={"force": lambda t: 0.1 * YIELD * AREA})
    run(setup, 20, end=1.0)
    bent = setup.state.bending.axis
    assert bent is not None
    assert 0.0 < bent < BENT_HALF
    setup.step(1.5)
    assert setup.state.bending.axis is None
    for i in range(1, 21):
        old = setup.state.generalized_strains
        setup.step(2.0 + i / 20)
    axis = setup.state.bending.axis
    assert axis is not None
    assert -BENT_HALF < axis < 0.0
    change = setup.state.generalized_strains - old
    assert change[0] + change[2] * axis == pytest.approx(0.0, abs=1e-15)
    assert np.isclose(setup.state.bending.curvature, 0.0, atol=1e-15)
