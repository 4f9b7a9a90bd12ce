"""Sparse factorisations: choice of solver, recovery from failures, checked solutions."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np

from castfem.base import log
from castfem.fem import reductions
from castfem.fem.snes import Options, SolverOptions

# PETSc's own factorisation has neither pivoting nor a parallel form. With minimum degree ordering,
# which PETSc has from SuiteSparse, it takes half the time of MUMPS for a shell of some hundred
# cells; with nested dissection, which is always available, the same time.
OWN = {"pc_factor_mat_solver_type": "petsc", "pc_factor_mat_ordering_type": "amd"}
DISSECTED = {"pc_factor_mat_solver_type": "petsc", "pc_factor_mat_ordering_type": "nd"}
# The default scaling of MUMPS iterates over the matrix before each factorisation, which takes a
# quarter of its time (more on several ranks) without benefit for equations of one unit: use the
# diagonal.
MUMPS = {"pc_factor_mat_solver_type": "mumps", "mat_mumps_icntl_8": 1}
# On several ranks its ordering, done on one rank, takes longer than minimum degree, and fronts of
# this size are too small for ScaLAPACK.
SEVERAL_RANKS = {"mat_mumps_icntl_7": 0, "mat_mumps_icntl_13": 1}


@dataclass(frozen=True, slots=True)
class OwnLimits:
    """Limits up to which PETSc's own factorisation is used."""

    residual: float = 1e-8  #: residual of its solution, relative to the right-hand side
    rows: int = 10_000  #: rows of the matrix
    #: entries of the factor per row: for a fuller one MUMPS, which works on blocks, is faster
    entries: float = 75.0


LIMITS = OwnLimits()

# per cent beyond the memory MUMPS expects to need, ICNTL(14); its default is 20
ROOM = (100, 400, 1600)
NO_ROOM = (-8, -9, -11, -14, -15, -17, -19, -20)  # INFOG(1): a workspace was too small
SINGULAR = (-10,)
OF_ROOM = "mat_mumps_icntl_14"


def factorise(ksp: PETSc.KSP, matrix: PETSc.Mat) -> str:
    """Factor `matrix` with the preconditioner of `ksp` (collective).

    PETSc factors again only when the preconditioner itself is set up, and a failed factorisation
    stays failed until it is created again.

    Returns:
        Why it failed, empty if it did not; the next call then starts from scratch.
    """
    why = _tried(ksp)
    for room in ROOM:
        if why not in map(_code, NO_ROOM):
            break
        log.logger.debug("factorisation: %s; again with %d %% more room", why, room)
        _begin_anew(ksp, matrix)
        with _given(f"{ksp.getOptionsPrefix() or ''}{OF_ROOM}", room):
            why = _tried(ksp)
    if why:
        _begin_anew(ksp, matrix)
    return "the equations are singular" if why in map(_code, SINGULAR) else why


def _code(info: int) -> str:
    return f"MUMPS reports INFOG(1) = {info}"


def _tried(ksp: PETSc.KSP) -> str:
    """Set the preconditioner up; return why it failed, the same on every rank."""
    pc, error = ksp.getPC(), ""
    try:
        pc.setUp()
        failed = pc.getFailedReason() != PETSc.PC.FailedReason.NOERROR
    except PETSc.Error as raised:
        failed, error = True, str(raised).splitlines()[-1]
    comm: MPI.Comm = ksp.comm.tompi4py()
    if not reductions.any_of(comm, failed):
        return ""
    return next(reason for reason in comm.allgather(_reason(pc, error) if failed else "") if reason)


def _reason(pc: PETSc.PC, error: str) -> str:
    """The message of MUMPS or PETSc about a failed factorisation."""
    if pc.getType() in ("lu", "cholesky") and pc.getFactorSolverType() == "mumps":
        info = int(pc.getFactorMatrix().getMumpsInfog(1))
        if info < 0:
            return _code(info)
    return error or f"PETSc's preconditioner fails ({pc.getFailedReason()})"


def _begin_anew(ksp: PETSc.KSP, matrix: PETSc.Mat) -> None:
    """Discard the factorisation: its analysis, its memory and its failure."""
    ksp.getPC().reset()
    ksp.setOperators(matrix)


@contextmanager
def _given(name: str, value: int) -> Iterator[None]:
    """Set an option in PETSc's database for a while, overriding the present value."""
    database = PETSc.Options()
    before = database.getString(name) if database.hasName(name) else None
    database.setValue(name, value)
    try:
        yield
    finally:
        if before is None:
            database.delValue(name)
        else:
            database.setValue(name, before)


@lru_cache(maxsize=1)
def has_minimum_degree() -> bool:
    """Whether this PETSc orders by approximate minimum degree (SuiteSparse)."""
    matrix = PETSc.Mat().createAIJ((1, 1), nnz=1, comm=PETSc.COMM_SELF)
    matrix.setValue(0, 0, 1.0)
    matrix.assemble()
    try:
        for one in matrix.getOrdering("amd"):
            one.destroy()
    except PETSc.Error:
        return False
    finally:
        matrix.destroy()
    return True


def default_options(symmetric: bool, ranks: int = 1) -> dict[str, Any]:
    """Options of the factorisation of a matrix, without the user's options.

    Args:
        symmetric: Whether the matrix is symmetric.
        ranks: Number of ranks that share it.
    """
    if ranks == 1 and has_minimum_degree():
        return {"pc_type": "lu", **OWN}
    return pivoting_options(symmetric, ranks)


def pivoting_options(symmetric: bool, ranks: int = 1) -> dict[str, Any]:
    """Options of MUMPS; without MUMPS those of PETSc's own factorisation."""
    kind = {"pc_type": "cholesky" if symmetric else "lu"}
    if not PETSc.Sys.hasExternalPackage("mumps"):
        return kind | DISSECTED
    return kind | MUMPS | (SEVERAL_RANKS if ranks > 1 else {})


class DirectSolver:
    """Solves with a matrix for several right-hand sides at once.

    PETSc's own factorisation has no pivoting: if it fails, or its solution leaves a residual, MUMPS
    solves this time.  If its factor is full, MUMPS solves until the pattern of the matrix changes.
    Both depend on the matrix alone, so that a resumed run does the same.

    Args:
        matrix: Assembled by its owner before each `solve`.
        prefix: Option prefix.
        options: PETSc options (ksp_, pc_, mat_), without prefix.
        symmetric: Whether the matrix is symmetric.

    Attributes:
        ksp: PETSc's solver.
    """

    def __init__(self, matrix: PETSc.Mat, prefix: str, options: Options, symmetric: bool) -> None:
        self._matrix, self._prefix, self._symmetric = matrix, prefix, symmetric
        self.ksp, self._options = self._made(options)
        self._checked = OWN.items() <= options.items() and PETSc.Sys.hasExternalPackage("mumps")
        self._fallback: tuple[PETSc.KSP, SolverOptions] | None = None
        self._full = self._is_large()

    def _made(self, options: Options) -> tuple[PETSc.KSP, SolverOptions]:
        ksp = PETSc.KSP().create(self._matrix.comm)
        ksp.setOptionsPrefix(self._prefix)
        ksp.setOperators(self._matrix)
        given = SolverOptions(self._prefix, options)
        given.apply(ksp, ksp.getPC())
        return ksp, given

    def _is_large(self) -> bool:
        return bool(self._matrix.getSize()[0] > LIMITS.rows)

    def use(self, matrix: PETSc.Mat) -> None:
        """Solve with another matrix from now on."""
        self._matrix, self._full = matrix, self._is_large()
        self.ksp.getPC().reset()
        self.ksp.setOperators(matrix)
        self._drop_fallback()

    def solve(self, given: PETSc.Mat, found: PETSc.Mat) -> str:
        """Factor the matrix if it has changed, and solve (collective).

        Args:
            given: Right-hand sides, dense.
            found: Output: the solutions.

        Returns:
            Why it failed; empty if it did not.
        """
        own = self.ksp, self._options
        if not self._checked:
            return self._solved(own, given, found)
        if not self._full:
            why = self._solved(own, given, found) or self._unfit(given, found)
            if not why:
                return ""
            log.logger.debug("factorisation without pivoting: %s; MUMPS instead", why)
        if self._fallback is None:
            options = pivoting_options(self._symmetric)
            self._fallback = self._made({"ksp_type": "preonly", **options})
        return self._solved(self._fallback, given, found)

    def _solved(
        self, by: tuple[PETSc.KSP, SolverOptions], given: PETSc.Mat, found: PETSc.Mat
    ) -> str:
        ksp, options = by
        with options.given():
            if why := factorise(ksp, self._matrix):
                return why
            ksp.matSolve(given, found)
        reason = ksp.getConvergedReason()
        return f"the linear solver fails (KSP reason {reason})" if reason < 0 else ""

    def _unfit(self, given: PETSc.Mat, found: PETSc.Mat) -> str:
        """Reason against a factorisation without pivoting; empty if there is none."""
        pc, rows = self.ksp.getPC(), self._matrix.getSize()[0]
        entries = pc.getFactorMatrix().getInfo()["nz_used"] / rows
        self._full = entries > LIMITS.entries
        if self._full:
            pc.reset()
            return f"{entries:.0f} entries a row"
        product = self._matrix.matMult(found)
        right = given.getDenseArray(readonly=True)
        left = np.linalg.norm(product.getDenseArray(readonly=True) - right, axis=0)
        product.destroy()
        good = left <= LIMITS.residual * np.linalg.norm(right, axis=0)
        return "" if good.all() else f"residuals of {left}"

    def tell_unread(self) -> None:
        """See `SolverOptions.tell_unread`."""
        self._options.tell_unread()

    def _drop_fallback(self) -> None:
        if self._fallback is not None:
            self._fallback[0].destroy()
        self._fallback = None

    def destroy(self) -> None:
        """Free the PETSc objects (the owner frees the matrix)."""
        self._drop_fallback()
        self.ksp.destroy()
