"""Uniform contact pressure is exact to solver tolerance with both methods on all cells."""

from __future__ import annotations

from dataclasses import fields
from itertools import pairwise
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest
from mechanics.casting import billet_mesh
from mechanics.setups import SliceSetup, elastic, mapped, skewed

from castfem.fem.section import Section
from castfem.physics.contact.facets import LENGTH, Facets, SurfaceMean
from castfem.physics.contact.settings import Contact
from castfem.physics.contact.state import OPEN
from castfem.physics.contact.summary import summary
from castfem.physics.mechanics.generalized_plane_strain import PlainPlanes
from castfem.physics.mechanics.supports import PrescribedDisplacement, SurfacePressure
from castfem.physics.mould import Straight
from contact.setups import ContourWall, LineWall, tapered_block

METHODS = ("penalty", "nitsche")
CELLS = ("quadrilateral", "triangle")
YOUNG, POISSON, WIDTH, HEIGHT = 200e9, 0.3, 0.03, 0.02
CONFINED = YOUNG * (1 - POISSON) / ((1 + POISSON) * (1 - 2 * POISSON))
MODULI = {"free": YOUNG, "plane strain": YOUNG / (1 - POISSON**2), "confined": CONFINED}


def pressed(method: str, cell: str, kind: str, large: bool = False, **settings: Any) -> SliceSetup:
    """Set up a block of distorted cells on rollers under a wall that descends at 1 um/s."""
    right = ("right",) if kind == "confined" else ()
    groups = ("symmetry_x", "symmetry_y", "right", "top")
    wall = LineWall(lambda z: np.array([0.0, HEIGHT - z]))
    contact = Contact(wall, ("top",), lambda t: 1e-6 * t, method=method, **settings)  # type: ignore
    return SliceSetup(
        mapped(3, 3, skewed(WIDTH, HEIGHT), cell, groups=groups),
        elastic(YOUNG, POISSON),
        settings={
            "planes": PlainPlanes(("a0",) if kind == "free" else ()),
            "held": tuple(PrescribedDisplacement((name,), 0) for name in right),
            "interactions": (contact,),
            "large_strain": large,
        },
        tolerance=1e-11,
    )


@pytest.mark.parametrize(
    ("method", "cell", "kind"),  # every kind with each method and on each cell
    [(m, CELLS[(i + j) % 2], k) for i, m in enumerate(METHODS) for j, k in enumerate(MODULI)],
)
def test_pressure_under_a_moving_wall_is_exact(method: str, cell: str, kind: str) -> None:
    """Sigma = -E' d / H; with the penalty method the springs E'/H and K_p are in series."""
    setup = pressed(method, cell, kind)
    setup.step(2.0)
    setup.step(3.0)
    state, stiffness = setup.state.contact, setup.problem.contact.stiffness
    modulus, depth = MODULI[kind], 3e-6
    spring = stiffness.mean() if method == "penalty" else np.inf
    pressure = depth / (HEIGHT / modulus + 1.0 / spring)
    assert state.pressure == pytest.approx(pressure, rel=1e-8)
    assert np.abs(state.gap + pressure / spring).max() < 1e-8 * depth
    assert setup.stress[:, 1] == pytest.approx(-pressure, rel=1e-8)
    support = setup.results[-1].balance.support  # type: ignore[union-attr]
    force = summary(setup.problem.contact, state, setup.state.generalized_strains).force
    assert force == pytest.approx([0.0, -pressure * WIDTH], rel=1e-8)
    assert force[1] == pytest.approx(-support[1], rel=1e-8)


# The line y = 0 in segments that do not match the mesh.
ENDS = (-0.01, 0.0031, 0.0047, 0.0131, 0.0202, 0.0299, 0.05)
PIECES = [Straight((a, 0.0), (b, 0.0)) for a, b in pairwise(ENDS)]


# One method for each cell shape.
@pytest.mark.parametrize(
    ("method", "cell", "large", "pieces"),
    [(m, c, large, p) for m, c in zip(METHODS, CELLS, strict=True) for large in (False, True)
     for p in (False, True)],
)  # fmt: skip
def test_applied_pressure_is_the_contact_pressure(
    method: str, cell: str, large: bool, pieces: bool
) -> None:
    """A block is pressed against a wall below by a uniform pressure from above."""
    groups = ("left", "foot", "right", "top")
    wall = ContourWall(*PIECES) if pieces else LineWall(lambda z: np.zeros(2), lambda z: np.pi)
    setup = SliceSetup(
        mapped(3, 2, skewed(WIDTH, HEIGHT, 0.0), cell, groups=groups),
        elastic(YOUNG, POISSON),
        settings={
            "planes": PlainPlanes(("a0",)),
            "loads": (SurfacePressure(("top",), lambda t: 1e6 * t),),
            "held": (PrescribedDisplacement(("left",), 0),),
            "pin": False,
            "interactions": (Contact(wall, ("foot",), method=method),),  # type: ignore[arg-type]
            "large_strain": large,
        },
        tolerance=1e-11,
    )
    setup.step(1.0)
    state = setup.state.contact
    # At large strain foot and top widen equally.
    assert state.pressure == pytest.approx(1e6, rel=1e-8)
    assert setup.stress[:, 1] == pytest.approx(-1e6, rel=1e-8)
    assert np.abs(setup.stress[:, [0, 2, 3]]).max() < 1.0


@pytest.mark.parametrize("method", METHODS)
def test_block_on_an_oblique_wall_is_in_balance(method: str) -> None:
    """Only a wall and a line of symmetry support the block; the forces are in balance."""
    groups = ("symmetry_x", "foot", "right", "top")
    angle = 0.1
    wall = LineWall(lambda z: np.zeros(2), lambda z: np.pi - angle)
    setup = SliceSetup(
        mapped(3, 2, skewed(WIDTH, HEIGHT, 0.0), groups=groups),
        elastic(YOUNG, POISSON),
        settings={
            "planes": PlainPlanes(("a0",)),
            "loads": (SurfacePressure(("top",), lambda t: 1e5 * t),),
            "pin": False,
            "interactions": (Contact(wall, ("foot",), method=method),),  # type: ignore[arg-type]
        },
    )
    setup.step(1.0)
    found = summary(setup.problem.contact, setup.state.contact, setup.state.generalized_strains)  # type: ignore[arg-type]
    normal = np.array([-np.sin(angle), np.cos(angle)])
    assert found.force == pytest.approx(normal * 1e5 * WIDTH / np.cos(angle), rel=1e-7)
    state = setup.state.contact
    touching = state.weight[state.status != OPEN].sum()
    assert 0.1 * WIDTH < touching < 0.9 * WIDTH
    assert found.share == pytest.approx(touching / WIDTH, rel=1e-12)


# Contact pressure as a mean over a length: independent of cells and ranks.


HALF = 0.0625
END = np.array([HALF - 5e-3, HALF])  # end of the arc, where the face begins


def surface(size: float, comm: MPI.Comm = MPI.COMM_SELF) -> Facets:
    """Return the surface of a quarter billet with cells of `size` (m) near the corner."""
    mesh = billet_mesh(
        corner_radius=5e-3, surface_size=size, core_size=2e-2, face_size=8e-3, order=2
    )
    section = Section(comm, mesh)
    return Facets(section, section.matching(("wide", "narrow", "corner")), 2)


def test_mean_of_uniform_pressure_is_exact() -> None:
    facets = surface(1e-3)
    most, _ = SurfaceMean(facets).highest(np.full(facets.count, 3e6), facets.position)
    assert most == pytest.approx(3e6, rel=1e-12)


def test_mean_of_a_singular_peak_converges() -> None:
    """For 1 / sqrt(distance), as at the edge of a punch, the mean is 2 sqrt(2 / L)."""
    points, means = [], []
    for size in (1.6e-3, 0.8e-3, 0.4e-3, 0.2e-3):
        facets = surface(size)
        distance = np.hypot(*(facets.position - END).T)
        pressure = 1.0 / np.sqrt(distance)
        points.append(pressure.max())
        mean, place = SurfaceMean(facets).highest(pressure, facets.position)
        means.append(mean)
        assert np.hypot(*(place - END)) < 2 * size
    exact = 2.0 * np.sqrt(2.0 / LENGTH)
    assert points[-1] > 2.0 * points[0]
    assert means[-1] == pytest.approx(exact, rel=0.06)
    errors = np.abs(np.array(means) / exact - 1.0)
    assert (np.diff(errors) < 0.0).all() and errors[1] < 0.15


def test_mean_includes_three_long_cells() -> None:
    """At mid-face a single facet without contact does not give a mean of 0."""
    facets = surface(1e-3)
    x = facets.position[:, 0]
    top = facets.position[:, 1] > HALF - 1e-9
    pressure = np.where(top & (x > np.unique(x[top])[1]), 1e5, 0.0)  # except the first facet
    around = SurfaceMean(facets).around(np.array([[0.0, HALF]]))
    assert 0.2e5 < (around @ pressure)[0] < 0.8e5


@pytest.mark.mpi
def test_ranks_agree() -> None:
    found = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        facets = surface(1e-3, comm)
        mean = SurfaceMean(facets)
        pressure = 1e6 * np.sin(300.0 * facets.position[:, 0]) ** 2
        start = mean.around(np.array([[0.0, HALF]])) @ mean.gathered(pressure)
        most, place = mean.highest(pressure, facets.position)
        found.append([most, *place, *start])
    assert found[1] == pytest.approx(found[0], rel=1e-9)


# An elastic block and a tapered wall that is pushed into it: resultant, iterations, units.


# With the penalty method the wall is a spring; for 0.05 % it must be 500 times stiffer than a cell.
FACTORS = {"penalty": 1000.0, "nitsche": None}
BLOCK_METHODS = tuple(FACTORS)
FORCE = 40e9 / (1 - 0.3**2) * 0.03e-3  # E/(1 - nu^2) times the mean closure, per length of wall
STEPS = np.linspace(0.1, 1.0, 10)


@pytest.mark.parametrize(("method", "cell"), zip(BLOCK_METHODS, CELLS, strict=True))
def test_resultant_of_a_tapered_wall_is_exact(method: str, cell: str) -> None:
    setup = tapered_block(method, cell=cell, factor=FACTORS[method])
    for time in STEPS:
        result = setup.step(time)
        assert result.newton <= 5
    found = summary(setup.problem.contact, setup.state.contact, setup.state.generalized_strains)
    assert -found.force[1] == pytest.approx(FORCE, rel=5e-4)
    assert found.share == 1.0
    assert found.penetration < 2e-8
    assert found.points[0] == 0


UNITS = ((1e-3, 1.0), (1.0, 1e6), (1e-3, 1e6), (1e3, 1e-6))  # m, Pa


@pytest.mark.parametrize(("method", "cell"), zip(BLOCK_METHODS, CELLS, strict=True))
def test_iterations_and_results_are_independent_of_units(method: str, cell: str) -> None:
    """Units of length and stress are changed separately and together."""
    setups = [tapered_block(method, *unit, cell=cell) for unit in ((1.0, 1.0), *UNITS)]
    for time in STEPS:
        reference, *results = (setup.step(time) for setup in setups)
        first = reference.state.contact
        top = first.pressure.max()
        for result, (_, stress) in zip(results, UNITS, strict=True):
            second = result.state.contact
            assert result.newton == reference.newton
            assert np.array_equal(second.status, first.status)
            assert second.pressure * stress == pytest.approx(first.pressure, abs=1e-6 * top)


@pytest.mark.parametrize("method", BLOCK_METHODS)
@pytest.mark.parametrize("factor", [300.0, 3e5])
def test_resultant_is_independent_of_the_contact_stiffness(method: str, factor: float) -> None:
    setup = tapered_block(method, factor=factor / 100 if method == "nitsche" else factor)
    for time in STEPS:
        assert setup.step(time).newton <= 5
    found = summary(setup.problem.contact, setup.state.contact, setup.state.generalized_strains)
    assert -found.force[1] == pytest.approx(FORCE, rel=5e-4)


@pytest.mark.parametrize("method", BLOCK_METHODS)
def test_failed_step_has_no_after_effect(method: str) -> None:
    """The old state is unchanged to the bit, and the next step gives the same result."""
    setup = tapered_block(method, options={"snes_max_it": 6})
    setup.step(0.1)
    old = setup.state
    assert old.contact is not None
    kept = {f.name: np.copy(getattr(old.contact, f.name)) for f in fields(old.contact)}
    moved = old.displacement.copy()
    good = setup.stepper.step(old, 0.2, old.temperature)
    bad = tapered_block(method, options={"snes_max_it": 1})
    failed = bad.stepper.step(bad.state, 0.5, bad.state.temperature)
    assert not failed.converged and failed.state is bad.state
    setup.problem.solver.snes.setTolerances(max_it=1)
    failed = setup.stepper.step(old, 0.5, old.temperature)
    assert not failed.converged and failed.state is old
    for name, value in kept.items():
        assert np.array_equal(getattr(old.contact, name), value), name
    assert np.array_equal(old.displacement, moved)
    setup.problem.solver.snes.setTolerances(max_it=6)
    again = setup.stepper.step(old, 0.2, old.temperature)
    assert np.array_equal(again.state.displacement, good.state.displacement)
    assert np.array_equal(again.state.contact.pressure, good.state.contact.pressure)
    assert again.newton == good.newton


def test_forms_of_contact_are_compiled_only_with_contact() -> None:
    from mechanics.setups import SliceSetup, box, mapped

    setup = SliceSetup(mapped(2, 2, box(1.0, 1.0)))
    assert setup.problem.contact is None and setup.state.contact is None
    assert not [name for name in setup.section.compiled if "contact" in name]
