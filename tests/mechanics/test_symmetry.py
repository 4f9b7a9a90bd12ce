"""Equal results of full, half and quarter sections, of rotated sections, on several ranks."""

from __future__ import annotations

from collections.abc import Callable

from mpi4py import MPI

import numpy as np
import pytest

from castfem.base.types import Array
from castfem.fem.section import Cellwise
from castfem.physics.constitutive.base import rotation
from castfem.physics.constitutive.elasticity import Elasticity
from castfem.physics.constitutive.flow_laws import NortonCreep
from castfem.physics.mechanics.generalized_plane_strain import PlainPlanes
from castfem.physics.mechanics.supports import PrescribedDisplacement
from mechanics.casting import CastSetup, billet_mesh, in_its_mould
from mechanics.setups import SliceSetup, box, elastic, mapped, pressed_tube, skewed

SIZES = {"width": 0.1, "height": 0.08, "surface_size": 2e-3, "core_size": 1e-2}


def values(setup: CastSetup) -> dict[tuple[float, float], np.ndarray]:
    """Return displacement and stress by vertex in the first quadrant."""
    moved, stress = setup.moved, setup.stress
    found = {}
    for (x, y), u, s in zip(setup.vertices, moved, stress, strict=True):
        if x > -1e-9 and y > -1e-9:
            if min(x, y) < 1e-9:
                s[3] = 0.0  # odd across the axes: its average there is one-sided in a quarter
            found[round(x * 1e6) + 0.0, round(y * 1e6) + 0.0] = np.concatenate([u / 1e-4, s / 1e6])
    return found


@pytest.mark.parametrize(("radius", "cell"), [(5e-3, "quadrilateral"), (0.0, "triangle")])
def test_whole_half_and_quarter_agree(radius: float, cell: str) -> None:
    """Stress and displacement agree; the pins of the full section carry no force."""
    if radius and cell == "triangle":
        pytest.skip("unstructured triangles of a whole section are no mirror images")
    setups = {
        name: CastSetup(billet_mesh(name, cell=cell, corner_radius=radius, **SIZES)).advance(
            1.0, 0.25
        )
        for name in ("quarter", "half", "whole")
    }
    free = {"quarter": ("a0",), "half": ("a0", "a2"), "whole": ("a0", "a1", "a2")}
    quarter = values(setups["quarter"])
    for name, setup in setups.items():
        assert setup.problem.slice.planes.free == free[name]
        assert setup.state.generalized_strains[0] == pytest.approx(
            setups["quarter"].state.generalized_strains[0], rel=1e-7
        )
        assert np.abs(setup.state.generalized_strains[1:]).max() < 1e-7
        found = values(setup)
        assert len(found) == len(quarter)
        tolerance = 1e-6 if cell == "quadrilateral" else 2e-2
        worst = max(float(np.abs(found[k] - quarter[k]).max()) for k in quarter)
        assert worst < tolerance
        balance = setup.results[-1].balance
        if name == "whole":
            pressure = setup.state.pressure.max() * 0.1
            assert np.abs(balance.support).max() < 1e-6 * pressure


def test_section_rotated_by_90_degrees_has_rotated_results() -> None:
    upright = CastSetup(billet_mesh(**SIZES)).advance(1.0, 0.25)
    rotated = CastSetup(billet_mesh(**(SIZES | {"width": 0.08, "height": 0.1}))).advance(1.0, 0.25)
    one, other = values(upright), values(rotated)
    swap = [1, 0, 3, 2, 4, 5]
    assert len(one) == len(other)
    for (x, y), found in one.items():
        assert np.abs(other[y, x][swap] - found).max() < 1e-6
    assert rotated.state.generalized_strains[0] == pytest.approx(
        upright.state.generalized_strains[0], rel=1e-8
    )


def test_net_forces_of_a_quarter_are_zero() -> None:
    """The force of stress and pressure on each line of symmetry adds up to 0."""
    setup = CastSetup(billet_mesh()).advance(1.0, 0.25)
    balance = setup.results[-1].balance
    pressure = setup.state.pressure.max()
    assert np.abs(balance.support).max() < 1e-6 * pressure * 0.0625
    assert abs(balance.axial[0]) < 1e-6 * pressure * 0.0625**2
    assert balance.forces_error < 1e-8
    assert balance.axial_error < 1e-8


# Symmetry, cells, large strain, and contact with a mould (with springs).
SETUPS = [
    ("whole", "triangle", False, False),
    ("quarter", "quadrilateral", True, False),
    ("half", "quadrilateral", False, True),
]


def cooled(
    comm: MPI.Comm, symmetry: str, cell: str, large: bool, mould: bool, until: float = 2.0
) -> CastSetup:
    mesh = billet_mesh(symmetry, cell=cell, surface_size=4e-3, core_size=1.5e-2)
    settings = in_its_mould(mesh) if mould else {}
    return CastSetup(mesh, comm, large_strain=large, **settings).advance(until, 0.5)


def gathered(setup: CastSetup) -> list[np.ndarray] | None:
    """Return displacement and stress of all vertices on rank 0."""
    section = setup.thermal.section
    columns = np.column_stack([setup.moved, setup.stress]).T
    found = [section.gather(np.ascontiguousarray(c)) for c in columns]
    return None if found[0] is None else found  # type: ignore[return-value]


def differ(one: list[np.ndarray], many: list[np.ndarray]) -> float:
    """Return the largest relative difference of displacements and of stresses."""
    pairs = [(np.array(one[:2]), np.array(many[:2])), (np.array(one[2:]), np.array(many[2:]))]
    return max(float(np.abs(a - b).max() / np.abs(a).max()) for a, b in pairs)


@pytest.mark.mpi
@pytest.mark.parametrize(("symmetry", "cell", "large", "mould"), SETUPS)
def test_results_are_independent_of_ranks(
    symmetry: str, cell: str, large: bool, mould: bool
) -> None:
    serial = cooled(MPI.COMM_SELF, symmetry, cell, large, mould)
    parallel = cooled(MPI.COMM_WORLD, symmetry, cell, large, mould)
    one, many = gathered(serial), gathered(parallel)
    if MPI.COMM_WORLD.rank == 0:
        assert one is not None and many is not None
        assert differ(one, many) < 1e-8
    assert parallel.state.generalized_strains == pytest.approx(
        serial.state.generalized_strains, rel=1e-8, abs=1e-12
    )
    assert [r.newton for r in parallel.results] == [r.newton for r in serial.results]
    first, second = serial.results[-1].balance, parallel.results[-1].balance
    scale = serial.problem.residual_state.scale.total if serial.problem.residual_state else 1.0
    assert np.abs(first.axial - second.axial).max() < 1e-8 * scale
    assert parallel.results[-1].flowing == pytest.approx(serial.results[-1].flowing, rel=1e-6)
    heat = [
        s.problem.points.to_vertices(s.results[-1].dissipation).sum() for s in (serial, parallel)
    ]
    assert MPI.COMM_WORLD.allreduce(heat[1]) == pytest.approx(heat[0], rel=1e-7)


@pytest.mark.mpi
def test_ranks_without_cells_are_allowed() -> None:
    setup = SliceSetup(
        mapped(1, 1, box(0.01, 0.01)), comm=MPI.COMM_WORLD, thermal=lambda T: 1e-5 * T
    )
    setup.step(1.0, 100.0)
    assert setup.state.generalized_strains[0] == pytest.approx(1e-3, rel=1e-10)


@pytest.mark.mpi
def test_cellwise_values_are_independent_of_ranks() -> None:
    """Gathered stress is in the order of the input cells; scattering restores the local order."""
    fields = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        setup = SliceSetup(mapped(5, 4, box(0.1, 0.1)), comm=comm, thermal=lambda T: 1e-5 * T)
        setup.step(1.0, lambda x, y: 1e4 * x**2 + 500 * y)
        cellwise = Cellwise(setup.section)
        cells = len(cellwise.cells)
        local = setup.stress.reshape(cells, -1)
        gathered_stress = cellwise.gather(local)
        assert np.array_equal(cellwise.scatter(gathered_stress), local)
        fields.append(gathered_stress)
    if MPI.COMM_WORLD.rank == 0:
        assert np.abs(fields[0] - fields[1]).max() < 1e-9 * np.abs(fields[0]).max()


@pytest.mark.mpi
def test_motion_of_the_planes_strains_all_ranks() -> None:
    """One rank owns the unknowns of the planes; the unknowns of others may not change."""
    setup = SliceSetup(mapped(5, 4, box(0.1, 0.1)), comm=MPI.COMM_WORLD)
    problem = setup.problem
    cold = np.zeros(setup.section.owned)
    problem.begin(setup.state, 1.0, cold)
    x, out = problem.bordered.vector(), problem.bordered.vector()
    still = np.zeros(problem.owned)
    for strain in (0.0, 1e-4):
        scalars = np.array([strain]) / problem.planes.scaled.scaling
        x.setArray(problem.bordered.join(still, scalars))
        problem.residual(x, out)
        stiff = 200e9 * 0.7 / (1.3 * 0.4)
        assert problem.response.stress[:, 2] == pytest.approx(stiff * strain)
    x.destroy()
    out.destroy()


# Large strain: objectivity, simple shear, tension to 60 %, follower pressure, curved strand.


FREE = ("left", "bottom", "right", "top")
E, NU = 200e9, 0.3
SHEAR = 0.5 * E / (1 + NU)


def driven(
    gradient: Callable[[float], Array],
    stretch: Callable[[float], float] = lambda t: 0.0,
    cell: str = "quadrilateral",
) -> SliceSetup:
    """Set up a block whose complete boundary follows a deformation gradient over time."""
    held = tuple(
        PrescribedDisplacement(FREE, i, lambda p, t, i=i: p @ (gradient(t) - np.eye(2))[i])  # type: ignore[misc]
        for i in range(2)
    )
    planes = PlainPlanes((), {"a0": stretch})
    mesh = mapped(2, 2, skewed(0.1, 0.07), cell, groups=FREE)
    settings = {"held": held, "planes": planes, "pin": False, "large_strain": True}
    return SliceSetup(mesh, elastic(E, NU), settings=settings, extrapolate=False, tolerance=1e-10)


def turn(angle: float) -> Array:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


@pytest.mark.parametrize("degrees", [90.0, 210.0])
@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_rigid_rotation_rotates_the_stress(cell: str, degrees: float) -> None:
    """The stress of a block that is rotated in three steps rotates with it, to rounding."""
    stretch = np.array([[1.02, 0.01], [0.0, 0.97]])
    final = np.radians(degrees)
    setup = driven(
        lambda t: (
            turn(final * max(t - 1, 0.0) / 3) @ (np.eye(2) + min(t, 1.0) * (stretch - np.eye(2)))
        ),
        lambda t: 0.01 * min(t, 1.0),
        cell,
    )
    setup.step(1.0)
    before = setup.stress.copy()
    assert np.abs(before).max() > 1e9
    for time in (2.0, 3.0, 4.0):
        setup.step(time)
    expected = before @ rotation(final).T
    assert np.abs(setup.stress - expected).max() < 1e-9 * np.abs(before).max()


def test_simple_shear_has_the_jaumann_stress() -> None:
    """S12 = G sin(gamma), s11 = G (1 - cos(gamma)), to second order in the step."""
    amount = 2.0

    def error(steps: int) -> float:
        setup = driven(lambda t: np.array([[1.0, amount * t], [0.0, 1.0]]))
        for i in range(steps):
            setup.step((i + 1) / steps)
        exact = SHEAR * np.array(
            [1 - np.cos(amount), np.cos(amount) - 1, 0.0, np.sqrt(2) * np.sin(amount)]
        )
        return float(np.abs(setup.stress - exact).max() / SHEAR)

    errors = np.array([error(n) for n in (10, 20, 40)])
    assert errors[-1] < 2e-3
    assert np.log2(errors[:-1] / errors[1:]).min() > 1.9


@pytest.mark.parametrize("axial", [True, False])
def test_tension_at_constant_rate_has_the_true_stress(axial: bool) -> None:
    """A true strain of 60 % along the strand or across it; the force acts on the deformed area."""
    rate, end = 1e-3, 0.6
    law = NortonCreep.constant(Elasticity.constant(20e9, NU), 1e-9, 1e6, 5.0)
    flow = 1e6 * (rate / 1e-9) ** 0.2
    mesh = mapped(2, 2, box(0.01, 0.02))

    def stretch(t: float) -> float:
        return float(np.exp(rate * t) - 1)

    settings: dict[str, object] = {"large_strain": True}
    if axial:
        settings["planes"] = PlainPlanes((), {"a0": stretch})
    else:
        settings["held"] = (
            PrescribedDisplacement(("right",), 0, lambda p, t: p[:, 0] * stretch(t)),
        )
    setup = SliceSetup(mesh, law, settings=settings)
    for time in np.linspace(0.0, end / rate, 121)[1:]:
        result = setup.step(float(time))
    along = 2 if axial else 0
    others = [i for i in range(4) if i != along]
    assert setup.stress[:, along] == pytest.approx(flow, rel=1e-5)
    assert np.abs(setup.stress[:, others]).max() < 1e-6 * flow
    elastic_part = flow / 20e9
    volume = np.exp(elastic_part * (1 - 2 * NU))
    thin = np.sqrt(volume / np.exp(end))
    if axial:
        area = 0.01 * 0.02 * thin**2
        assert result.balance.axial[0] == pytest.approx(flow * area, rel=1e-4)
        tip = setup.displacement(lambda x, y: np.isclose(x, 0.01) & np.isclose(y, 0.02))[0]
        assert tip == pytest.approx([0.01 * (thin - 1), 0.02 * (thin - 1)], rel=1e-4)
    else:
        assert 1 + setup.state.generalized_strains[0] == pytest.approx(thin, rel=1e-4)


def test_elastic_tension_gives_hookes_law_of_true_strain() -> None:
    """Sigma = E ln(stretch), to second order in the step."""
    errors = []
    for steps in (4, 8):
        setup = SliceSetup(
            mapped(1, 1, box(0.01, 0.01)),
            elastic(E, NU),
            settings={"large_strain": True, "planes": PlainPlanes((), {"a0": lambda t: 0.5 * t})},
        )
        for i in range(steps):
            setup.step((i + 1) / steps)
        errors.append(abs(setup.stress[0, 2] / (E * np.log(1.5)) - 1))
    assert errors[-1] < 1e-3
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)


def test_large_strain_tends_to_small_strain() -> None:
    """Both formulations agree to first order in the strain."""

    def tube(large: bool, pressure: float) -> Array:
        settings = {"planes": PlainPlanes(), "large_strain": large}
        rise = lambda t: pressure * t  # noqa: E731
        setup = pressed_tube((3, 3), (0.02, 0.03), elastic(E, NU), rise, **settings)
        setup.step(1.0)
        return setup.state.displacement / pressure

    differences = [
        np.abs(tube(True, p) - tube(False, p)).max() / np.abs(tube(False, p)).max()
        for p in (1e8, 1e7)
    ]
    assert differences[0] < 0.01
    assert differences[1] == pytest.approx(0.1 * differences[0], rel=0.05)


def test_growing_tube_has_the_current_hoop_stress() -> None:
    """A thin tube creeps to 1.5 times its radius: the hoop stress is p r / t when deformed."""
    pressure, law = 2e5, NortonCreep.constant(Elasticity.constant(20e9, NU), 1e-9, 1e6, 3.0)
    rise = lambda t: min(t, 1.0) * pressure  # noqa: E731
    setup = pressed_tube((1, 6), (0.0495, 0.0505), law, rise, large_strain=True)
    time, radius, speed = 0.0, 0.0495, 0.0
    while radius < 0.075:
        dt = 1.0 if time == 0.0 else 0.02 * radius / speed
        time += dt
        setup.step(time)
        at = setup.displacement(lambda x, y: np.isclose(y, 0.0) & np.isclose(x, 0.0495))[0]
        speed = max((0.0495 + at[0] - radius) / dt, 1e-9)
        radius = 0.0495 + at[0]
    outer = 0.0505 + setup.displacement(lambda x, y: np.isclose(y, 0) & np.isclose(x, 0.0505))[0][0]
    assert outer**2 - radius**2 == pytest.approx(0.0505**2 - 0.0495**2, rel=1e-3)
    normal = setup.places / np.hypot(*setup.places.T)[:, None]
    c, s = normal.T
    stress = setup.stress
    hoop = stress[:, 0] * s * s + stress[:, 1] * c * c - np.sqrt(2) * stress[:, 3] * c * s
    assert hoop.mean() == pytest.approx(pressure * radius / (outer - radius), rel=2e-3)
