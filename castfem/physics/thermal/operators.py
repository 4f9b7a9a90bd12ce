"""Matrices of the heat balance, shared by several steels, and solver options."""

from __future__ import annotations

from dataclasses import dataclass

from petsc4py import PETSc

import numpy as np
import ufl
from dolfinx import fem

from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.fem.compat import assemble_matrix, assemble_owned, without_zeros
from castfem.fem.section import Section
from castfem.fem.snes import Options, try_options
from castfem.forms.heat import conduction, conduction_moved, slice_measure, storage, storage_measure
from castfem.physics.thermal.deformed_section import Shape

ITERATED, FACTORED = "thermal_", "thermal_direct_"  # prefixes of the solvers
# Methods that never multiply the correction of the enthalpy by the matrix, which is not that of H.
BY_RESIDUAL = {"snes_type": ("newtonls",), "snes_linesearch_type": ("basic", "l2", "cp")}
# Newton's full step on the enthalpy needs no line search.
NEWTON = {"snes_linesearch_type": "basic", "snes_max_it": 100}
# The matrix is symmetric, positive where the stage has one solution, and as well conditioned as a
# time step makes it: a few iterations on an incomplete factorisation of each rank's own part
# solve it to the accuracy that Newton's method can use, at any size (docs/benchmarks.md).
REDUCTION = 1e-9
ITERATIVE = {"ksp_type": "cg", "ksp_rtol": REDUCTION, "ksp_max_it": 300}
# If they do not, as in a step that is a thousand times too long, the matrix is factored.
DIRECT = {"ksp_type": "preonly", "pc_type": "lu"}
SERIAL_LU = {"pc_factor_mat_solver_type": "petsc", "pc_factor_mat_ordering_type": "nd"}
PARALLEL_LU = {"pc_factor_mat_solver_type": "mumps"}


def iterative_options(ranks: int, asked: Options) -> dict[str, object]:
    """Options of the iterative solver on a number of ranks.

    Args:
        ranks: Number of ranks.
        asked: The user's options, which take precedence over the defaults.

    Raises:
        InputError: An option belongs to no family that PETSc knows, PETSc rejects its value, or a
            method multiplies the correction of the enthalpy by the matrix.
    """
    incomplete = {"pc_type": "icc"} if ranks == 1 else {"pc_type": "bjacobi", "sub_pc_type": "icc"}
    options: dict[str, object] = {**NEWTON, **ITERATIVE, **incomplete, **asked}
    if asked:
        try_options(ITERATED, options)
    database = PETSc.Options()  # the command line (PETSC_OPTIONS) takes precedence
    for name, sound in BY_RESIDUAL.items():
        value = database.getString(ITERATED + name, str(options.get(name, sound[0])))
        if value not in sound:
            raise InputError(
                f'thermal solver, {name} = "{value}": needs the matrix of the enthalpy, but '
                f"castfem's is that of the conduction integral; give {' or '.join(sound)}"
            )
    return options


def direct_options(ranks: int) -> dict[str, object]:
    """Options of the fallback solver, used where the iterative one fails."""
    return {**NEWTON, **DIRECT, **(SERIAL_LU if ranks == 1 else PARALLEL_LU)}


@dataclass(frozen=True, slots=True)
class Operators:
    """Data that all heat balances on a section share, for any steel."""

    laplacian: PETSc.Mat  #: Laplacian of the section, L
    area: Array  #: area of each owned vertex (owned,), m2
    conduction: fem.Form | None  #: form of L, for a moving slice; None if it does not move
    theta: PETSc.Vec  #: work vector
    work: PETSc.Vec  #: work vector

    @classmethod
    def on(cls, section: Section, shape: Shape | None) -> Operators:
        """Make the operators of the slice, undeformed or deformed (collective)."""
        space, mesh = section.vertex_space, section.mesh
        u, v, dx = ufl.TrialFunction(space), ufl.TestFunction(space), slice_measure(mesh)
        if shape is None:
            form = section.compile("heat.conduction", conduction(u, v, dx))
            laplacian, conducts = without_zeros(assemble_matrix(form)), None
            one = fem.Constant(mesh, np.float64(1.0))
            form = storage(one, v, storage_measure(mesh, section.order == 2))
            area = assemble_owned(section.compile("heat.storage", form), section.owned)
        else:
            moved = conduction_moved(u, v, dx, shape.gradient, shape.thickness)
            conducts = section.compile("heat.conduction.moved", moved)
            laplacian, area = assemble_matrix(conducts), shape.area
        theta, work = laplacian.createVecs()
        return cls(laplacian, area, conducts, theta, work)
