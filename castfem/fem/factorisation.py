"""The factorisation of the sparse block: set up, again with more room where that ran out."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from mpi4py import MPI
from petsc4py import PETSc

from castfem.base import log
from castfem.fem import reductions

ROOM = (100, 400, 1600)  # per cent beyond what MUMPS expects to need, ICNTL(14); its own is 20
NO_ROOM = (-8, -9, -11, -14, -15, -17, -19, -20)  # INFOG(1): a workspace was too small
SINGULAR = (-10,)
OF_ROOM = "mat_mumps_icntl_14"


def set_up(ksp: PETSc.KSP, matrix: PETSc.Mat) -> str:
    """Factor `matrix` with the preconditioner of `ksp` (collective).

    PETSc factors anew only when the preconditioner itself is set up, and a factorisation that has
    failed stays failed until it is made from the beginning.

    Returns:
        Why it failed, empty if it did not; the next call begins from the beginning then.
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
    """Set the preconditioner up; why it failed, the same on every rank."""
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
    """What MUMPS or PETSc has to say of a factorisation that failed."""
    if pc.getType() in ("lu", "cholesky") and pc.getFactorSolverType() == "mumps":
        info = int(pc.getFactorMatrix().getMumpsInfog(1))
        if info < 0:
            return _code(info)
    return error or f"PETSc's preconditioner fails ({pc.getFailedReason()})"


def _begin_anew(ksp: PETSc.KSP, matrix: PETSc.Mat) -> None:
    """Forget the factorisation: its analysis, its room and its failure."""
    ksp.getPC().reset()
    ksp.setOperators(matrix)


@contextmanager
def _given(name: str, value: int) -> Iterator[None]:
    """Have an option in PETSc's database for a while, instead of what is there."""
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
