"""A long hollow cylinder, heated inside and cooled outside, compared with its closed form.

[Boley1960] 9.10, plane strain: T(r) = T_i - (T_i - T_o) ln(r/a) / ln(b/a), and with
I(r) = int_a^r (T - T_cold) r dr, alpha constant,

    u       = (1 + nu)/(1 - nu) alpha/r (I(r) + ((1 - 2 nu) r^2 + a^2)/(b^2 - a^2) I(b))
    sigma_r = alpha E/(1 - nu) 1/r^2 ((r^2 - a^2)/(b^2 - a^2) I(b) - I(r))
    sigma_t = alpha E/(1 - nu) 1/r^2 ((r^2 + a^2)/(b^2 - a^2) I(b) + I(r) - (T - T_cold) r^2)
    sigma_z = nu (sigma_r + sigma_t) - alpha E (T - T_cold)
"""

from __future__ import annotations

from itertools import pairwise

from petsc4py import PETSc

import basix
import numpy as np
import pytest

from castfem.base.errors import RunFailure
from castfem.base.tables import Constant, Table
from castfem.base.types import Array
from castfem.meshes.tube import brick_nodes, graded, tube
from castfem.physics.mould.cavity import (
    FreeCavity,
    RectangleCavity,
    RoundCavity,
    Sides,
    Tapers,
    same,
)
from castfem.physics.mould.contour import Contour
from castfem.physics.mould.hot.conduction import Conduction, FaceLoad
from castfem.physics.mould.hot.copper import CONDUCTIVITY, EXPANSION, Copper
from castfem.physics.mould.hot.distortion import Distortion
from castfem.physics.mould.hot.solvers import LinearSolver
from castfem.physics.mould.perimeter import Places, lengths, sides_of
from castfem.physics.mould.segments import Straight
from castfem.physics.mould.taper import Taper

from .tubes import COLD, ROUND, SQUARE, plain_copper, round_tube, square_tube, tube_mesh

A, B = 0.06, 0.08
FLUX, H, K = 2e6, 3e4, 380.0
NU, ALPHA, E = 0.34, 17e-6, 117e9
OUTER = COLD + FLUX * A / (H * B)


def temperature(r: Array) -> Array:
    return np.asarray(OUTER + FLUX * A * np.log(B / r) / K)


def heat(r: Array) -> Array:
    """Return I(r), integrated by parts."""
    c = FLUX * A / K
    rest = 0.5 * (OUTER - COLD) * (r**2 - A**2)
    return np.asarray(
        rest + c * (0.5 * r**2 * np.log(B / r) - 0.5 * A**2 * np.log(B / A) + 0.25 * (r**2 - A**2))
    )


def displacement(r: Array) -> Array:
    fraction = ((1.0 - 2.0 * NU) * r**2 + A**2) / (B**2 - A**2)
    return np.asarray((1.0 + NU) / (1.0 - NU) * ALPHA / r * (heat(r) + fraction * heat(B)))


def stresses(r: Array) -> Array:
    """Return the radial, hoop and axial stress (..., 3)."""
    scale, ring, rise = ALPHA * E / (1.0 - NU) / r**2, B**2 - A**2, temperature(r) - COLD
    radial = scale * ((r**2 - A**2) / ring * heat(B) - heat(r))
    hoop = scale * ((r**2 + A**2) / ring * heat(B) + heat(r) - rise * r**2)
    return np.stack([radial, hoop, NU * (radial + hoop) - ALPHA * E * rise], axis=-1)


def von_mises(r: float) -> float:
    """Return the von Mises stress of the closed form."""
    radial, hoop, axial = stresses(np.array(r))
    squares = (radial - hoop) ** 2 + (hoop - axial) ** 2 + (axial - radial) ** 2
    return float(np.sqrt(0.5 * squares))


def errors(cells: int) -> tuple[float, float, float]:
    """Return the largest errors of temperature (K), displacement and stress (relative)."""
    tube = round_tube(cells)
    heated = Conduction(tube, plain_copper()).solve(FaceLoad(FLUX, H, COLD))
    r = np.hypot(*tube.scalars.tabulate_dof_coordinates()[:, :2].T)
    off = np.abs(heated.temperature.x.array - temperature(r)).max()
    assert heated.supplied == pytest.approx(heated.removed, rel=1e-9)
    distortion = Distortion(tube, plain_copper(), "between")
    found = distortion.solve(heated.temperature)
    moved = found.displacement.x.array.reshape(-1, 3)
    radial = (moved[:, :2] * tube.scalars.tabulate_dof_coordinates()[:, :2]).sum(axis=1) / r
    exact = displacement(r)
    barlow = 0.5 + 0.5 / np.sqrt(3.0) * np.array([[1, 1, 1], [-1, 1, 1], [1, -1, -1]])
    sigma, places = distortion.stress_at(found.displacement, heated.temperature, barlow)
    across = np.hypot(places[..., 0], places[..., 1])
    unit = places[..., :2] / across[..., None]
    hoop = np.stack([-unit[..., 1], unit[..., 0]], axis=-1)
    cylinder = [
        np.einsum("...i,...ij,...j->...", way, sigma[..., :2, :2], way) for way in (unit, hoop)
    ]
    stress = np.stack([*cylinder, sigma[..., 2, 2]], axis=-1)
    expected = stresses(across)
    return (
        float(off),
        float(np.abs(radial - exact).max() / np.abs(exact).max()),
        float(np.abs(stress - expected).max() / np.abs(expected).max()),
    )


def test_temperature_displacement_and_stress_converge() -> None:
    coarse, fine = np.array(errors(2)), np.array(errors(4))
    order = np.log2(coarse / fine)
    assert fine[0] < 2e-4 and fine[1] < 1e-5 and fine[2] < 2e-3
    assert order[0] > 3.0 and order[1] > 3.0 and order[2] > 1.9


@pytest.mark.parametrize(("cells", "part"), [(1, 0.03), (2, 0.009)])
def test_largest_stress_is_at_the_hot_face(cells: int, part: float) -> None:
    tube = round_tube(cells)
    warm = tube.function()
    r = np.hypot(*tube.scalars.tabulate_dof_coordinates()[:, :2].T)
    warm.x.array[:] = temperature(r)
    found = Distortion(tube, plain_copper(), "between").solve(warm)
    assert found.largest_stress == pytest.approx(von_mises(A), rel=part)
    assert np.hypot(*found.largest_at[:2]) == pytest.approx(A)
    expected = np.array([von_mises(float(one)) for one in r])
    assert found.von_mises.x.array == pytest.approx(expected, abs=2.0 * part * von_mises(A))


def test_closed_form_is_in_equilibrium() -> None:
    """The formulas above satisfy d(r sigma_r)/dr = sigma_t with traction-free walls."""
    r, step = np.linspace(0.062, 0.078, 9), 1e-6
    slope = ((r + step) * stresses(r + step)[:, 0] - (r - step) * stresses(r - step)[:, 0]) / (
        2.0 * step
    )
    assert slope == pytest.approx(stresses(r)[:, 1], rel=1e-5)
    assert stresses(np.array([A, B]))[:, 0] == pytest.approx([0.0, 0.0], abs=1e-3)


def test_cylinder_with_k_of_temperature_has_its_closed_form() -> None:
    """With k(T) the conduction integral is logarithmic in r."""
    table = Table("temperature", (300.0, 400.0, 600.0), (400.0, 380.0, 330.0))
    copper = Copper(table, Constant(ALPHA), Constant(E), Constant(NU), COLD)
    tube = round_tube(3)
    heated = Conduction(tube, copper).solve(FaceLoad(2.0 * FLUX, H, COLD))
    r = np.hypot(*tube.scalars.tabulate_dof_coordinates()[:, :2].T)
    outer = COLD + 2.0 * FLUX * A / (H * B)
    theta = copper.conduction_integral(np.full_like(r, outer)) + 2.0 * FLUX * A * np.log(B / r)
    assert heated.temperature.x.array == pytest.approx(copper.temperature(theta), abs=2e-3)
    assert heated.newton <= 5
    assert heated.supplied == pytest.approx(heated.removed, rel=1e-9)


def test_faces_of_prescribed_temperature_have_the_closed_form() -> None:
    tube = round_tube(3)
    heated = Conduction(tube, plain_copper()).solve(FaceLoad(hot=460.0, outer=360.0))
    r = np.hypot(*tube.scalars.tabulate_dof_coordinates()[:, :2].T)
    exact = 360.0 + 100.0 * np.log(B / r) / np.log(B / A)
    assert heated.temperature.x.array == pytest.approx(exact, abs=1e-3)


# The mesh of a tube, and the points round its wall.


BULGED = Sides((0.0625, 0.05), (0.0622, 0.0496), 0.006)


@pytest.mark.parametrize("order", [1, 2])
def test_nodes_are_in_the_order_of_the_element(order: int) -> None:
    element = basix.create_element(
        basix.ElementFamily.P, basix.CellType.hexahedron, order, basix.LagrangeVariant.gll_warped
    )
    assert brick_nodes(order) == pytest.approx(order * element.points)


@pytest.mark.parametrize("sides", [SQUARE, ROUND, BULGED])
def test_points_are_on_the_contour(sides: Sides) -> None:
    places = Places.spread(sides, 4, 3)
    points, normals = places.on(sides)
    assert np.hypot(*normals.T) == pytest.approx(1.0)
    if sides is ROUND:
        contour = RoundCavity(0.12).contour(same(Taper.single(0.0, 1.0)), 0.0, 1.0)
    else:
        (a, b), (p, q), r = sides.middle, sides.ends, sides.radius
        cavity = RectangleCavity(2 * a, 2 * b, r)
        assert isinstance(cavity, RectangleCavity)
        from castfem.physics.mould.cavity import rectangle

        contour = rectangle(Sides((a, b), (p, q), r))
    assert isinstance(contour, Contour)
    found = contour.gap_function(0.99 * points, normals)
    inner = 0.01 * (points * normals).sum(axis=1)
    # A bulged face has a kink at the corner, where the normals are those of the arc.
    assert np.abs(contour.gap_function(points - 1e-3 * normals, normals).gap - 1e-3).max() < 1e-9
    assert found.gap == pytest.approx(inner, rel=0.05)


@pytest.mark.parametrize("sides", [SQUARE, ROUND, BULGED])
def test_points_are_recovered_from_their_arc_length(sides: Sides) -> None:
    places = Places.spread(sides, 4, 3)
    again = Places.at_ways(sides, places.ways(sides))
    assert again.on(sides)[0] == pytest.approx(places.on(sides)[0], abs=1e-12)
    assert np.all(np.diff(places.ways(sides)) > 0.0)
    assert places.ways(sides)[-1] == pytest.approx(sum(lengths(sides)))


def test_sides_have_the_sizes_of_the_cavity() -> None:
    taper = same(Taper.single(0.01, 0.6))
    assert sides_of(RoundCavity(0.2), taper, 0.0) == Sides((0.1, 0.1), (0.1, 0.1), 0.1)
    assert sides_of(RectangleCavity(0.2, 0.1, 0.01), taper, 0.0).middle == (0.1, 0.05)
    free = FreeCavity((Straight((0.1, 0.0), (0.0, 0.1)),), 0.2, 0.2)
    with pytest.raises(ValueError, match="not a beam blank"):
        sides_of(free, Tapers(taper.width, taper.height), 0.0)


def test_volume_and_faces_of_a_tube_are_exact() -> None:
    from mpi4py import MPI

    import dolfinx.fem as fem

    tube = round_tube(2)
    areas = {
        name: fem.assemble_scalar(fem.form(1.0 * tube.surface(name)))
        for name in ("inner", "outer", "top", "bottom", "symmetry_x", "symmetry_y")
    }
    ring = 0.25 * np.pi * (0.08**2 - 0.06**2)
    expected = {
        "inner": 0.5 * np.pi * 0.06 * 0.03,
        "outer": 0.5 * np.pi * 0.08 * 0.03,
        "top": ring,
        "bottom": ring,
        "symmetry_x": 0.02 * 0.03,
        "symmetry_y": 0.02 * 0.03,
    }
    assert areas == pytest.approx(expected, rel=1e-4)
    assert tube.comm == MPI.COMM_SELF
    sums = fem.assemble_scalar(fem.form(tube.function(1.0) * tube.dx))
    assert sums == pytest.approx(ring * 0.03, rel=1e-4)


def test_nodal_values_are_set_and_gathered() -> None:
    tube = round_tube(1)
    mesh = tube_mesh(ROUND, (1, 3, 1))
    field = tube.function(mesh.points[:, 0])
    assert field.x.array == pytest.approx(tube.scalars.tabulate_dof_coordinates()[:, 0], abs=1e-15)
    gathered = tube.gather(field.x.array[: tube.owned])
    assert gathered is not None and gathered == pytest.approx(mesh.points[:, 0])
    assert mesh.points[mesh.inner()[0, 0]] == pytest.approx([0.06, 0.0, 0.0])
    assert mesh.points[mesh.outer()[-1, -1]] == pytest.approx([0.0, 0.08, 0.03], abs=1e-15)


def test_layers_are_fine_at_the_meniscus() -> None:
    z = graded(-0.1, 0.6, 0.004, 0.02, order=1)
    assert z[0] == pytest.approx(-0.1) and z[-1] == pytest.approx(0.6)
    assert 0.0 in z
    steps = np.diff(z)
    assert steps.max() <= 0.0201 and 0.0025 < steps[np.searchsorted(z, 0.0)] <= 0.0041
    assert all(max(a, b) <= 1.35 * min(a, b) for a, b in pairwise(steps))
    assert len(graded(0.0, 0.6, 0.004, 0.02)) % 2 == 1


def test_mesh_with_partial_cells_is_rejected() -> None:
    points, normals = Places.spread(ROUND, 1, 2).on(ROUND)
    with pytest.raises(ValueError, match="nodes round and along"):
        tube(np.repeat(points[None], 2, 0), np.repeat(normals[None], 2, 0), np.zeros(2), 0.01, 1)


# Tubes with exact distortions: free ones, and bars between supports.


GROWTH, YOUNG = 17e-6, 117e9
MIDDLE = np.full((1, 3), 0.5)


def test_uniform_temperature_gives_no_stress() -> None:
    tube = square_tube()
    distortion = Distortion(tube, plain_copper(), "free")
    warm = tube.function(COLD + 120.0)
    found = distortion.solve(warm)
    moved = found.displacement.x.array.reshape(-1, 3)
    x = tube.scalars.tabulate_dof_coordinates()
    assert moved == pytest.approx(120.0 * GROWTH * x, abs=1e-14)
    assert found.largest_stress < 1e-8 * YOUNG * GROWTH * 120.0


def test_linear_temperature_gives_no_stress() -> None:
    """The patch test: u = alpha g (x z, y z, (z^2 - x^2 - y^2)/2) for T - T_cold = g z.

    Elements of second order represent it exactly on cells with straight edges, also tapered ones.
    """
    tube, g = square_tube((2, 3, 3)), 500.0
    x = tube.scalars.tabulate_dof_coordinates()
    warm = tube.function()
    warm.x.array[:] = COLD + g * x[:, 2]
    distortion = Distortion(tube, plain_copper(), "free")
    found = distortion.solve(warm)
    moved = found.displacement.x.array.reshape(-1, 3)
    first, second, z = x.T
    exact = GROWTH * g * np.stack([first * z, second * z, 0.5 * (z**2 - first**2 - second**2)], 1)
    shift = (moved - exact)[:, 2]
    assert np.ptp(shift) < 1e-13
    assert moved[:, :2] == pytest.approx(exact[:, :2], abs=1e-13)
    assert found.largest_stress < 1e-7 * YOUNG * GROWTH * g * 0.2


def test_bar_between_supports_has_its_closed_form() -> None:
    """At constant length sigma_z = -E alpha dT, and it widens by (1 + nu) alpha dT."""
    tube, rise = square_tube(taper=0.0), 80.0
    distortion = Distortion(tube, plain_copper(), "between")
    warm = tube.function(COLD + rise)
    found = distortion.solve(warm)
    sigma, _ = distortion.stress_at(found.displacement, warm, MIDDLE)
    expected = np.diag([0.0, 0.0, -YOUNG * GROWTH * rise])
    assert sigma == pytest.approx(
        np.broadcast_to(expected, sigma.shape), abs=1e-6 * YOUNG * GROWTH * rise
    )
    moved = found.displacement.x.array.reshape(-1, 3)
    x = tube.scalars.tabulate_dof_coordinates()
    assert moved[:, :2] == pytest.approx((1.0 + 0.34) * GROWTH * rise * x[:, :2], abs=1e-13)


@pytest.mark.parametrize("support", ["hung", "clamped"])
def test_supports_fix_the_top(support: str) -> None:
    tube = square_tube()
    found = Distortion(tube, plain_copper(), support).solve(tube.function(COLD + 100.0))  # type: ignore[arg-type]
    moved = found.displacement.x.array.reshape(-1, 3)
    x = tube.scalars.tabulate_dof_coordinates()
    top = np.isclose(x[:, 2], 0.0)
    fixed = moved[top] if support == "clamped" else moved[top, 2:]
    assert np.abs(fixed).max() == 0.0
    assert moved[~top, 2].max() > 1e-4
    if support == "hung":  # the expansion is free
        assert moved == pytest.approx(100.0 * GROWTH * x, abs=1e-13)


def _heated(method: str, cells: tuple[int, int, int]) -> tuple[Array, Array, tuple[int, int]]:
    tube = square_tube(cells)
    copper = Copper()
    load = FaceLoad(flux=2.5e6, coefficient=3e4, water=313.0)
    heated = Conduction(tube, copper, method).solve(load)  # type: ignore[arg-type]
    found = Distortion(tube, copper, "hung", method).solve(heated.temperature)  # type: ignore[arg-type]
    counts = heated.solved.iterations, found.solved.iterations
    return heated.temperature.x.array, found.displacement.x.array, counts


@pytest.mark.parametrize("cells", [(2, 2, 12), (3, 3, 8)])
def test_multigrid_matches_the_direct_solver(cells: tuple[int, int, int]) -> None:
    """With three cells through the wall some cells have only inner nodes."""
    direct, exact, none = _heated("direct", cells)
    kelvin, moved, counts = _heated("multigrid", cells)
    assert none == (0, 0)
    assert kelvin == pytest.approx(direct, abs=1e-6)
    assert moved == pytest.approx(exact, abs=1e-7 * float(np.abs(exact).max()))
    # Without hypre PETSc uses aggregation, which is less suited to conduction in flat cells.
    most = 30 if PETSc.Sys.hasExternalPackage("hypre") else 60
    assert 0 < counts[0] < most and 0 < counts[1] < 100


def test_unconverged_solver_is_reported() -> None:
    matrix = PETSc.Mat().createAIJ((4, 4), nnz=1)
    for i in range(4):
        matrix.setValue(i, i, 10.0**i)
    matrix.assemble()
    options = {"ksp_type": "cg", "pc_type": "none", "ksp_max_it": 1, "ksp_rtol": 1e-12}
    solver = LinearSolver(matrix, "mould_test_", options)
    with pytest.raises(RunFailure, match="hot mould: the mould_test solver does not converge"):
        solver.solve(np.array([1.0, 1.0, 1.0, 1.0]))
    solver.destroy()
    matrix.destroy()


def test_copper_properties_follow_the_temperature() -> None:
    copper = Copper()
    kelvin = np.linspace(200.0, 900.0, 141)
    theta = copper.conduction_integral(kelvin)
    assert copper.temperature(theta) == pytest.approx(kelvin, abs=1e-9)
    middle = 0.5 * (kelvin[1:] + kelvin[:-1])
    assert np.diff(theta) / np.diff(kelvin) == pytest.approx(CONDUCTIVITY(middle), abs=0.1)
    assert copper.thermal_strain(copper.cold) == 0.0
    # From 20 degC to 200 degC: the mean coefficient of the table.
    strain = copper.thermal_strain(473.15) - copper.thermal_strain(293.15)
    assert strain == pytest.approx(float(EXPANSION(473.15)) * 180.0, rel=1e-12)
    constant = Copper(expansion=Constant(17e-6))
    assert constant.thermal_strain(398.15) == pytest.approx(17e-6 * 100.0, rel=1e-12)
