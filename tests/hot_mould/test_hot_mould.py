"""The hot mould: heat flux on its wall, shape and temperature of the wall, several ranks."""

from __future__ import annotations

from pathlib import Path

from mpi4py import MPI

import meshio
import numpy as np
import pytest
from dolfinx import fem

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.errors import RunFailure
from castfem.base.tables import Constant, Table
from castfem.base.types import Array
from castfem.physics.mould import Mould, RectangleCavity, RoundCavity, Taper, same
from castfem.physics.mould.hot.conduction import Conduction, FaceLoad
from castfem.physics.mould.hot.copper import Copper
from castfem.physics.mould.hot.distortion import Distortion
from castfem.physics.mould.hot.flux import FluxMap, of_strand, profile
from castfem.physics.mould.hot.model import HotMould, HotWall, TubeSettings
from castfem.physics.mould.hot.tube import Tube
from castfem.physics.mould.hot.vtk_file import write_tube
from castfem.physics.mould.perimeter import Places, corner_of, lengths, sides_of

from .tubes import ROUND, SQUARE, tube_mesh

ALPHA = 17e-6
PLAIN = Copper(Constant(380.0), Constant(ALPHA), Constant(117e9), Constant(0.34), 298.15)
WATER = Constant(313.15)


def mould(taper: float = 0.0) -> Mould:
    return Mould(RectangleCavity(0.125, 0.125, 0.005), 0.6, same(Taper.single(taper, 0.6)))


def settings(**changes: object) -> TubeSettings:
    options = {"size": 0.04, "across": 1, **changes}
    return TubeSettings(0.01, 0.1, Constant(3e4), WATER, **options)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def heated() -> tuple[HotMould, HotWall, FluxMap]:
    flux = profile(Table("position", (0.0, 0.6), (2.2e6, 1.4e6)), SQUARE, 0.6)
    tube = HotMould(MPI.COMM_SELF, mould(), PLAIN, settings())
    return tube, tube.solve(flux), flux


def test_profile_decreases_to_the_corner() -> None:
    found = profile(Constant(2e6), SQUARE, 0.6, corner=0.5, reach=0.02)
    right, arc, _ = lengths(SQUARE)
    ways = np.array([0.0, right - 0.02, right - 0.01, right, right + 0.5 * arc, right + arc + 0.02])
    assert found.on(np.array([-0.1, 0.3]), ways) == pytest.approx(
        np.array([[0.0] * 6, [2e6, 2e6, 1.5e6, 1e6, 1e6, 2e6]])
    )
    plain = profile(Constant(2e6), SQUARE, 0.6)
    assert plain.heat(np.array([-0.1, 0.0, 0.6])) == pytest.approx(2e6 * 0.6 * (2 * right + arc))
    assert profile(Constant(1e6), ROUND, 0.6, corner=0.5).flux == pytest.approx(1e6)


def test_melting_copper_is_reported() -> None:
    """With too little cooling no valid wall results."""
    flux = profile(Constant(2e6), SQUARE, 0.6)
    dry = TubeSettings(0.01, 0.1, Constant(100.0), WATER, size=0.04, across=1)
    with pytest.raises(RunFailure, match=r"would reach \d{4,} degC and melts at 1085 degC: check"):
        HotMould(MPI.COMM_SELF, mould(), PLAIN, dry).solve(flux)


@pytest.mark.parametrize("times", [1.0, 0.99])
def test_flux_of_a_strand_is_mapped_to_the_wall(times: float) -> None:
    """Of a quarter and of a full section, also of a strand slightly smaller than its mould."""
    places = Places.spread(SQUARE, 6, 5)
    quarter, _ = places.on(SQUARE)
    flux = np.array([[1e6], [2e6]]) * np.exp(-((places.ways(SQUARE) / 0.05) ** 2))
    found = of_strand(np.array([0.0, 0.5]), times * quarter, flux, SQUARE)
    assert found.on(np.array([0.5]), places.ways(SQUARE))[0] == pytest.approx(flux[1], rel=2e-2)
    assert found.on(np.array([0.25]), places.ways(SQUARE))[0, 0] == pytest.approx(1.5e6)
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    full = np.concatenate([times * quarter * sign for sign in signs])
    again = of_strand(np.array([0.0, 0.5]), full, np.tile(flux, 4), SQUARE)
    assert again.flux == pytest.approx(found.flux)


def test_heat_of_the_strand_is_removed_by_the_water(
    heated: tuple[HotMould, HotWall, FluxMap],
) -> None:
    tube, wall, flux = heated
    assert wall.heated.supplied == pytest.approx(flux.heat(tube.positions), rel=2e-4)
    assert wall.heated.removed == pytest.approx(wall.heated.supplied, rel=1e-8)
    assert wall.displacement.positions[0] == 0.0
    assert wall.displacement.positions[-1] == pytest.approx(0.6)


def test_temperature_at_mid_length_is_that_of_a_plane_wall(
    heated: tuple[HotMould, HotWall, FluxMap],
) -> None:
    """Far from ends and corner the conduction is one-dimensional."""
    _, wall, _ = heated
    middle = int(np.argmin(np.abs(wall.displacement.positions - 0.3)))
    q = 2.2e6 - 0.8e6 * wall.displacement.positions[middle] / 0.6
    outer = 313.15 + q / 3e4
    assert wall.outer[middle, 0] == pytest.approx(outer, abs=0.5)
    assert wall.hot[middle, 0] == pytest.approx(outer + q * 0.01 / 380.0, abs=0.8)
    # The maximum is slightly below the meniscus, by conduction up the tube (V.2.4).
    hottest = wall.displacement.positions[wall.hot[:, 0].argmax()]
    assert 0.02 < hottest < 0.12


def test_corner_of_a_bloom_is_located() -> None:
    """For unequal sides it is not at half the quarter; a round section has no corner."""
    bloom = sides_of(RectangleCavity(0.2, 0.11, 0.008), (tapers := mould(0.0).tapers), 0.0)
    places = Places.spread(bloom, 8, 6)
    at = corner_of(bloom, places.ways(bloom))
    assert at is not None
    middle = np.array([0.1, 0.055]) - 0.008 * (1.0 - 0.5**0.5)
    assert places.on(bloom)[0][at] == pytest.approx(middle)
    round_ = sides_of(RoundCavity(0.18), tapers, 0.0)
    assert corner_of(round_, Places.spread(round_, 8, 6).ways(round_)) is None


def test_width_is_near_that_of_free_expansion(heated: tuple[HotMould, HotWall, FluxMap]) -> None:
    """The face between two corners bends; its mean is that of the mean temperature."""
    _, wall, _ = heated
    middle = int(np.argmin(np.abs(wall.displacement.positions - 0.3)))
    mean = 0.5 * (wall.hot[middle] + wall.outer[middle])
    ways = wall.displacement.ways
    rise = np.trapezoid(mean, ways) / ways[-1] - 298.15
    free = ALPHA * rise * 0.0625
    moved = wall.displacement.moved[middle]
    corner = moved[np.argmin(np.abs(ways - 0.5 * ways[-1]))]
    assert moved[0, 0] == pytest.approx(free, rel=0.35)
    assert corner[0] == pytest.approx(free, rel=0.35)
    assert moved[0, 1] == moved[-1, 0] == 0.0
    assert moved == pytest.approx(moved[::-1, ::-1], abs=1e-9)  # mirrored at the diagonal
    assert wall.longer == pytest.approx(ALPHA * 0.7 * rise, rel=0.3)


def test_uniform_temperature_expands_the_wall_uniformly() -> None:
    warm = Constant(398.15)
    tube = HotMould(MPI.COMM_SELF, mould(0.02), PLAIN, settings(hot_face=warm, water_side=warm))
    wall = tube.solve(None)
    for row, z in enumerate(wall.displacement.positions[::4]):
        points, _ = tube.places.on(sides_of(tube.mould.cavity, tube.mould.tapers, float(z)))
        found = wall.displacement.moved[4 * row]
        assert found == pytest.approx(ALPHA * 100.0 * points, abs=5e-9)
    assert wall.profile()[1] == pytest.approx(398.15)


def test_round_tube_is_the_hollow_cylinder_at_mid_length() -> None:
    """With free ends u(a) = 2 alpha / (a (b^2/a^2 - 1)) int (T - T_cold) r dr / a."""
    cavity = RoundCavity(0.12)
    shape = Mould(cavity, 0.8, same(Taper.single(0.0, 0.8)))
    chosen = TubeSettings(0.02, 0.0, Constant(3e4), WATER, size=0.03, across=2)
    tube = HotMould(MPI.COMM_SELF, shape, PLAIN, chosen)
    flux = profile(Constant(2e6), sides_of(cavity, shape.tapers, 0.0), 0.8)
    wall = tube.solve(flux)
    a, b, k = 0.06, 0.08, 380.0
    outer = 313.15 + 2e6 * a / (3e4 * b) - 298.15
    moment = 0.5 * outer * (b**2 - a**2) + 2e6 * a / k * (
        0.25 * (b**2 - a**2) - 0.5 * a**2 * np.log(b / a)
    )
    exact = 2.0 * ALPHA * a / (b**2 - a**2) * moment
    middle = int(np.argmin(np.abs(wall.displacement.positions - 0.4)))
    found = np.hypot(*wall.displacement.moved[middle].T)
    assert found == pytest.approx(exact, rel=2e-4)


def test_expansion_counts_from_the_cold_temperature() -> None:
    warm = Constant(50.0 + ZERO_CELSIUS)
    tube = HotMould(MPI.COMM_SELF, mould(), PLAIN, settings(hot_face=warm, water_side=warm))
    assert tube.solve(None).displacement.moved[5, 0, 0] == pytest.approx(25.0 * ALPHA * 0.0625)


def test_file_for_paraview_contains_the_tube(
    heated: tuple[HotMould, HotWall, FluxMap], tmp_path: Path
) -> None:
    """The cells have the volume of the tube, their corners the values of the nodes."""
    model, wall, _ = heated
    write_tube(tmp_path / "tube.vtu", wall)
    found = meshio.read(tmp_path / "tube.vtu")
    across, around, along = model.tube.shape
    corners = found.points[found.cells[0].data]
    assert len(corners) == (across - 1) * (around - 1) * (along - 1)
    ends = (
        ([1, 2, 5, 6], [0, 3, 4, 7]),
        ([2, 3, 6, 7], [0, 1, 4, 5]),
        ([4, 5, 6, 7], [0, 1, 2, 3]),
    )
    edges = [corners[:, far].mean(axis=1) - corners[:, near].mean(axis=1) for far, near in ends]
    volumes = np.linalg.det(np.stack(edges, axis=1))
    assert volumes.min() > 0.0
    dx = fem.form(fem.Constant(model.tube.mesh, 1.0) * model.tube.dx)
    assert volumes.sum() == pytest.approx(fem.assemble_scalar(dx), rel=2e-3)
    block = found.point_data["temperature"].reshape(along, around, across)
    assert block[-len(wall.hot) :, :, 0] == pytest.approx(wall.hot, abs=1e-3)
    assert np.ptp(found.points[:, 2]) == pytest.approx(0.7)
    assert found.points[:, 2].max() == pytest.approx(0.1)  # upwards from the meniscus
    lower = found.point_data["displacement"].reshape(along, around, across, 3)[-1]
    assert lower[..., 2].mean() == pytest.approx(
        -wall.longer, rel=1e-3
    )  # it is hung and expands downwards


def test_stress_in_the_file_is_that_of_a_constrained_bar(tmp_path: Path) -> None:
    warm = Constant(50.0 + ZERO_CELSIUS)
    fixed = settings(hot_face=warm, water_side=warm, support="between")
    wall = HotMould(MPI.COMM_SELF, mould(), PLAIN, fixed).solve(None)
    write_tube(tmp_path / "tube.vtu", wall)
    stress = meshio.read(tmp_path / "tube.vtu").point_data["von_mises"]
    assert stress == pytest.approx(117e9 * ALPHA * 25.0, rel=1e-6)
    with pytest.raises(RunFailure, match=r"none/tube.vtu: cannot be written"):
        write_tube(tmp_path / "none" / "tube.vtu", wall)


def solved(comm: MPI.Comm, method: str, support: str) -> list[Array] | None:
    """Solve a tube; return heat, stress, temperature and displacement on the first rank."""
    mesh = tube_mesh(SQUARE, (1, 2, 6), 0.01, 0.3) if comm.rank == 0 else None
    tube = Tube(comm, mesh)
    nodes = comm.bcast(None if mesh is None else mesh.points)
    flux = 2e6 * np.exp(-5.0 * nodes[:, 2])
    heated = Conduction(tube, Copper(), method).solve(FaceLoad(flux, 3e4, 313.0))
    found = Distortion(tube, Copper(), support, method).solve(heated.temperature)
    kelvin = tube.gather(heated.temperature.x.array[: tube.owned])
    moved = tube.gather(found.displacement.x.array[: 3 * tube.owned].reshape(-1, 3))
    if comm.rank > 0:
        return None
    heat = np.array([heated.supplied, heated.removed, heated.hottest])
    stress = np.array([found.largest_stress, *found.largest_at])
    return [heat, stress, kelvin, *moved.T]


@pytest.mark.mpi
@pytest.mark.parametrize(("method", "support"), [("direct", "hung"), ("multigrid", "free")])
def test_results_are_independent_of_ranks(method: str, support: str) -> None:
    one, many = (solved(comm, method, support) for comm in (MPI.COMM_SELF, MPI.COMM_WORLD))
    assert one is not None and (many is None) == (MPI.COMM_WORLD.rank > 0)
    for first, second in zip(one, many or one, strict=True):
        assert np.isfinite(first).all()
        assert np.abs(first - second).max() <= 1e-7 * np.abs(first).max()
