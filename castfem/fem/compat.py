"""Every call that differs between DOLFINx 0.9, 0.10 and 0.11; no other module checks versions."""

from __future__ import annotations

import gc
from collections.abc import Callable
from functools import lru_cache
from itertools import count
from typing import Any, TypeAlias, TypeVar

from mpi4py import MPI

import basix.ufl
import dolfinx
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import cpp, fem, la
from dolfinx import mesh as dmesh

from castfem.base.libraries import cache_folder
from castfem.fem import form_cache

T = TypeVar("T")
_Rules: TypeAlias = dict[Any, tuple[Any, ...]]  # quadrature rule -> integrands
_Domains: TypeAlias = list[tuple[int, npt.NDArray[np.int32]]]  # number -> facets

CELLS = 1  # identifier of the cells in the measures of a `CellForm`
_MESHES = count()  # numbers of the meshes of this process


@lru_cache(maxsize=1)
def jit_options() -> dict[str, Any]:
    """Compiler options with the cache folder: a separate one for each variant of the elements.

    From 0.10 a compiled form contains the exact bits of its elements, and those of an element with
    a bubble depend on the BLAS that computed them. DOLFINx looks forms up by name alone and rejects
    a cached form of another BLAS.
    """
    quadratic = basix.ufl.element("Lagrange", "triangle", 2)
    bubble = basix.ufl.element("Bubble", "triangle", 3)
    bits = basix.ufl.enriched_element([quadratic, bubble]).basix_hash()
    return {
        "cache_dir": cache_folder() / "forms" / f"{version()}-{bits:x}",
        "timeout": form_cache.WAIT,
    }


def _compiled(comm: MPI.Comm, folder: str, make: Callable[[dict[str, Any]], T]) -> T:
    """Make a DOLFINx object with these compiler options (collective).

    Args:
        comm: Communicator of the ranks that need it.
        folder: Subfolder of the cache: each look-up lists a whole folder.
        make: Calls DOLFINx.
    """
    options = jit_options()
    cache = options["cache_dir"] / folder
    return form_cache.compiled(comm, cache, lambda place: make(options | {"cache_dir": place}))


def compile_form(form: ufl.Form) -> fem.Form:
    """Compile a form, or find it compiled.

    Raises:
        ValueError: A quadrature rule would be mixed up, see `_check_rules`.
    """
    form = _renumbered(form)[0]
    comm = form.ufl_domain().ufl_cargo().comm
    folder = form.signature()[0]
    return _compiled(comm, folder, lambda options: fem.form(form, jit_options=options))


def _tags_of(integral: ufl.Integral) -> tuple[Any, ...]:
    asked = integral.subdomain_id()
    return asked if isinstance(asked, tuple) else (asked,)


def _integrands(form: ufl.Form) -> dict[tuple[str, Any], _Rules]:
    """Kind of integral and tag -> what is integrated there by each quadrature rule."""
    parts: dict[tuple[str, Any], _Rules] = {}
    for one in form.integrals():
        rule = tuple(sorted(one.metadata().items()))
        for tag in _tags_of(one):
            rules = parts.setdefault((one.integral_type(), tag), {})
            rules[rule] = (*rules.get(rule, ()), one.integrand())
    return parts


def _check_rules(parts: dict[tuple[str, Any], _Rules]) -> None:
    """Reject two quadrature rules on one tag whose sets of tags differ.

    Each rule's integrands with the same tags become one kernel. DOLFINx 0.9 finds kernels by tag:
    of two that share a tag it uses one for both and silently computes a wrong value. Rules with the
    same tags share a kernel and are correct.
    """
    if all(len(rules) == 1 for rules in parts.values()):
        return
    kernels: dict[Any, set[Any]] = {}
    for (kind, tag), rules in parts.items():
        for rule, integrands in rules.items():
            kernels.setdefault((kind, rule, integrands), set()).add(tag)
    for (kind, tag), rules in parts.items():
        where = [kernels[kind, rule, integrands] for rule, integrands in rules.items()]
        if any(tags != where[0] for tags in where):
            raise ValueError(f"two quadrature rules share the tag {tag} ({kind}), not all tags")


def _renumbered(form: ufl.Form) -> tuple[ufl.Form, _Domains]:
    """The form with surface tags renumbered 1, 2, ..., and the facets of each number.

    A compiled form contains its tags, so the same form on other or more sides would be compiled
    again. Consecutive tags that share all integrands get one number, so that facets are still
    visited in the order of their tags: sums stay the same to the bit.

    Raises:
        ValueError: A quadrature rule would be mixed up, see `_check_rules`.
    """
    parts = _integrands(form)
    _check_rules(parts)
    surface = [one for one in form.integrals() if one.integral_type() == "exterior_facet"]
    if not surface or any(tag == "everywhere" for one in surface for tag in _tags_of(one)):
        return form, []
    tagged = surface[0].subdomain_data()
    if tagged is None or any(one.subdomain_data() is not tagged for one in surface):
        return form, []  # DOLFINx rejects it
    alike: list[list[int]] = []  # tags of each number
    for tag in sorted({tag for one in surface for tag in _tags_of(one)}):
        rules = parts["exterior_facet", tag]
        if alike and rules == parts["exterior_facet", alike[-1][0]]:
            alike[-1].append(tag)
        else:
            alike.append([tag])
    domains = [
        (number, np.concatenate([_facets(tagged, tag) for tag in tags]))
        for number, tags in enumerate(alike, 1)
    ]
    numbers = {tags[0]: number for number, tags in enumerate(alike, 1)}
    others = [one for one in form.integrals() if one.integral_type() != "exterior_facet"]
    moved = [
        one.reconstruct(subdomain_id=numbers[tag], subdomain_data=domains)
        for one in surface
        for tag in _tags_of(one)
        if tag in numbers
    ]
    return ufl.Form(others + moved), domains


def _facets(tags: dmesh.MeshTags, tag: int) -> npt.NDArray[np.int32]:
    """Cells and local facet numbers of the owned surface facets that have a tag."""
    topology, dim = tags.topology, tags.dim
    topology.create_connectivity(dim, dim + 1)
    topology.create_connectivity(dim + 1, dim)
    kind, facets = fem.IntegralType.exterior_facet, tags.find(tag)
    if version().startswith("0.9"):
        found = cpp.fem.compute_integration_domains(kind, topology, facets, dim)
    else:  # it neither needs the dimension nor checks itself which facets are on the surface
        facets = np.intersect1d(facets, cpp.mesh.exterior_facet_indices(topology))
        found = cpp.fem.compute_integration_domains(kind, topology, facets)
    return np.array(found).ravel()


class CellForm:
    """A form that is compiled once and integrated over varying subsets of a mesh's cells.

    Args:
        mesh: The mesh.
        form: Its cell measures have the identifier `CELLS`, its surface measures facet tags.

    Raises:
        ValueError: A quadrature rule would be mixed up, see `_check_rules`.
    """

    def __init__(self, mesh: dmesh.Mesh, form: ufl.Form) -> None:
        form, self._facets = _renumbered(form)
        scalar = {"scalar_type": dolfinx.default_scalar_type}
        self._mesh, self._form = mesh, form
        folder = form.signature()[0]
        self._compiled = _compiled(
            mesh.comm, folder, lambda options: fem.compile_form(mesh.comm, form, scalar, options)
        )
        self._constants = {c: c for c in ufl.algorithms.analysis.extract_constants(form)}
        self._coefficients = self._named()
        self._spaces = [argument.ufl_function_space() for argument in form.arguments()]

    def _named(self) -> dict[Any, Any]:
        """The coefficients by the names under which DOLFINx looks them up."""
        found = ufl.algorithms.extract_coefficients(self._form)
        if not version().startswith("0.9"):
            return {one: one for one in found}
        # It names them by their index among all coefficients of the form, and looks them up by that
        # among those the compiler has kept.
        compiled = self._compiled.ufcx_form
        places = compiled.original_coefficient_positions
        return {found[i]: found[places[i]] for i in range(compiled.num_coefficients)}

    def on(self, cells: npt.NDArray[np.int32], surface: bool = True) -> fem.Form:
        """The form on local cells and, if requested, on all of its surface."""
        kind = fem.IntegralType
        parts: dict[Any, list[tuple[int, npt.NDArray[np.int32]]]] = {kind.cell: [(CELLS, cells)]}
        if surface and self._facets:
            parts[kind.exterior_facet] = self._facets
        return fem.create_form(
            self._compiled, self._spaces, self._mesh, parts, self._coefficients, self._constants
        )


def create_mesh(
    comm: MPI.Comm,
    cells: npt.NDArray[np.int64],
    points: npt.NDArray[np.float64],
    cell: str,
    order: int,
    parts: npt.NDArray[np.int32] | None = None,
) -> dmesh.Mesh:
    """Distribute `points` (n, dimension) and `cells` (m, k), given on rank 0 alone (collective).

    A problem and its solver refer to each other, and so keep their mesh until Python collects
    garbage. The collector counts objects, not communicators: MPICH has about 2000, a mesh takes
    five or more, and without one DOLFINx aborts. Therefore garbage of earlier problems is collected
    here; before the first mesh of a process there is none.

    `parts` are the ranks of the cells (m,), also given on rank 0 alone; without it a graph
    partitioner is used.
    """
    if next(_MESHES):
        gc.collect()
    element = basix.ufl.element("Lagrange", cell, order, shape=(points.shape[1],))

    def given(*_: Any) -> Any:
        assert parts is not None
        # The call DOLFINx itself makes; since 0.10 dolfinx.graph wraps it in a Python class.
        return cpp.graph.AdjacencyList_int32(parts, np.arange(len(parts) + 1, dtype=np.int32))

    # 0.10 swapped the order of x and e: with keywords the call is the same.
    partitioner = None if parts is None or comm.size == 1 else given
    return dmesh.create_mesh(
        comm, cells=cells, x=points, e=ufl.Mesh(element), partitioner=partitioner
    )


def geometry_dofmap(mesh: dmesh.Mesh) -> npt.NDArray[np.int32]:
    """Geometry nodes of each local cell, (cells, nodes); renamed in 0.11."""
    geometry = mesh.geometry
    maps = getattr(geometry, "dofmaps", None)
    if maps is not None and not callable(maps):
        return np.asarray(maps[0])
    return np.asarray(geometry.dofmap)


def coordinate_map(mesh: dmesh.Mesh) -> Any:
    """Coordinate element of the only cell type; 0.11 keeps a list of them."""
    maps = getattr(mesh.geometry, "cmaps", None)
    return maps[0] if isinstance(maps, (list, tuple)) else mesh.geometry.cmap


def assemble_matrix(form: fem.Form) -> Any:
    """Assembled PETSc matrix of a bilinear form without boundary conditions."""
    from dolfinx.fem import petsc

    matrix = petsc.assemble_matrix(form)
    matrix.assemble()
    return matrix


def without_zeros(matrix: Any) -> Any:
    """Copy of an AIJ matrix without entries below 1e-12 of its largest; frees `matrix`.

    On rectangles the vertex rule leaves half of the pattern of a bilinear element empty, and the
    cost of a factorisation depends on the pattern.
    """
    from petsc4py import PETSc

    starts, columns, values = matrix.getValuesCSR()
    comm = matrix.comm.tompi4py()
    largest = comm.allreduce(float(np.abs(values).max(initial=0.0)), op=MPI.MAX)
    keep = np.abs(values) > 1e-12 * largest
    rows = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    counts = np.bincount(rows[keep], minlength=len(starts) - 1)
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(starts.dtype)
    sizes = matrix.getSizes()
    slim = PETSc.Mat().createAIJ(sizes, csr=(starts, columns[keep], values[keep]), comm=matrix.comm)
    slim.assemble()
    matrix.destroy()
    return slim


def assemble_owned(form: fem.Form, owned: int) -> npt.NDArray[np.float64]:
    """Linear form summed over the ranks, entries of this rank's own degrees of freedom (owned,)."""
    vector = fem.assemble_vector(form)
    vector.scatter_reverse(la.InsertMode.add)
    return np.array(vector.array[:owned])


def create_matrix(form: fem.Form) -> Any:
    """Empty PETSc matrix with the pattern of a bilinear form."""
    from dolfinx.fem import petsc

    return petsc.create_matrix(form)


def assemble_into(matrix: Any, form: fem.Form, conditions: list[fem.DirichletBC]) -> None:
    """Assemble a bilinear form again; rows and columns of the conditions become the identity."""
    from dolfinx.fem import petsc

    matrix.zeroEntries()
    petsc.assemble_matrix(matrix, form, conditions)  # type: ignore[arg-type]
    matrix.assemble()


def interpolation_matrix(coarse: fem.FunctionSpace, fine: fem.FunctionSpace) -> Any:
    """Assembled PETSc matrix that maps the unknowns of one space to those of another."""
    from dolfinx.fem import petsc

    matrix = petsc.interpolation_matrix(coarse, fine)
    matrix.assemble()
    return matrix


class Tabulation:
    """A UFL expression at points of the reference cell, on all or some cells of this rank.

    Args:
        mesh: Mesh.
        expression: Expression of any shape; with an argument (rank 1), its derivative by that.
        points: Reference points (n, 2).
        cells: Local cells; all that this rank owns if None.
    """

    def __init__(
        self,
        mesh: dmesh.Mesh,
        expression: Any,
        points: npt.NDArray[np.float64],
        cells: npt.NDArray[np.int32] | None = None,
    ) -> None:
        self._mesh, self._points = mesh, len(points)
        folder = f"at_{len(points)}"
        self._expression = _compiled(
            mesh.comm, folder,
            lambda options: fem.Expression(expression, points, jit_options=options),
        )  # fmt: skip
        owned = mesh.topology.index_map(mesh.topology.dim).size_local
        self._cells = np.arange(owned, dtype=np.int32) if cells is None else cells

    def values(self) -> npt.NDArray[np.float64]:
        """Values (cells, points, components x degrees of freedom); 0.9 returns them flat."""
        found = np.asarray(self._expression.eval(self._mesh, self._cells))
        rows = len(self._cells) * self._points
        width = found.size // rows if rows else 0
        return found.reshape(len(self._cells), self._points, width)


def version() -> str:
    """DOLFINx version."""
    return str(dolfinx.__version__)
