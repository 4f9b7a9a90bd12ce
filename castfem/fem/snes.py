"""Small nonlinear problems on PETSc SNES, with checked options and convergence per field.

The problem owns its vectors; SNES works on its own copies (the line search needs that).
"""

from __future__ import annotations

import ctypes
import gc
import math
import re
import weakref
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar

from petsc4py import PETSc

from castfem.base.errors import InputError
from castfem.base.log import logger
from castfem.base.stopwatch import Stopwatch

Options = Mapping[str, Any]
Returned = TypeVar("Returned")

LINEAR_SHARE = 0.05
"""Share of a field's tolerance that an iterative linear solver may leave of the residual."""
LEAST_REDUCTION = 0.1
"""Least reduction of the residual by an iterative linear solver, even close to the tolerances."""
FAMILIES = ("snes_", "ksp_", "pc_", "mat_", "sub_", "redundant_", "fieldsplit_", "mg_")


def weakly(method: Callable[..., Returned]) -> Callable[..., Returned]:
    """Return a bound method as a callback that does not keep its object alive.

    Python's garbage collector does not see the references of PETSc's objects: a solver whose SNES
    holds its plain bound methods is never freed, nor are its matrices and MPI communicators.
    """
    reference = weakref.WeakMethod(method)

    def call(*arguments: Any) -> Returned:
        found = reference()
        assert found is not None  # it is solving, so it exists
        return found(*arguments)

    return call


@contextmanager
def _no_garbage_search() -> Iterator[None]:
    """Hold off the garbage collector, for as long as an exception may pass through PETSc.

    Python 3.13 drops an exception that is on its way when it searches for garbage, and petsc4py
    3.22, which extends its traceback, crashes without one.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


class NonlinearProblem(Protocol):
    """Interface of a problem for `SnesSolver`."""

    def residual(self, x: PETSc.Vec, out: PETSc.Vec) -> None:
        """Compute F(x) in `out`."""
        ...

    def jacobian(self, x: PETSc.Vec, out: PETSc.Mat) -> None:
        """Compute dF/dx at `x` in `out`; called right after `residual` at the same x."""
        ...

    def norms(self, x: PETSc.Vec, f: PETSc.Vec) -> dict[str, float]:
        """Residual of each field relative to its tolerance; converged if all are <= 1."""
        ...


@dataclass(slots=True)
class SolveResult:
    """Result of one solve."""

    converged: bool  #: whether every field met its tolerance
    iterations: int  #: Newton iterations
    reason: str  #: why it stopped, in the words of SNES or castfem
    #: residual of each field over its tolerance, for each iteration
    norms: list[dict[str, float]] = field(default_factory=list)

    def describe(self) -> str:
        """One line for the log."""
        last = ", ".join(f"{k} {v:.3g} x tolerance" for k, v in (self.norms or [{}])[-1].items())
        return f"{self.reason} after {self.iterations} iterations ({last})"


def _reason_names() -> dict[int, str]:
    reasons = PETSc.SNES.ConvergedReason
    return {getattr(reasons, k): k for k in dir(reasons) if k.isupper()}


class SolverOptions:
    """PETSc options of one solver, in PETSc's database only while that solver works.

    Some are read when the solver is created, others at the first factorisation.  Left in the
    database they would apply to every later solver with the same prefix.

    Args:
        prefix: Prefix of the options in the database.
        options: Without prefix, without a leading dash.
        asked: Names of the options to report if PETSc never reads them; all if None.

    Raises:
        InputError: An option belongs to no family that PETSc knows.
    """

    def __init__(self, prefix: str, options: Options, asked: Collection[str] | None = None) -> None:
        strangers = [k for k in options if not k.startswith(FAMILIES)]
        if strangers:
            raise InputError(
                [
                    f"solver option '{k}': PETSc has no such family of options; write it without a "
                    f"dash, beginning with one of {', '.join(FAMILIES)}"
                    for k in strangers
                ]
            )
        self._prefix, self._options = prefix, options
        self._unread = [k for k in options if asked is None or k in asked]

    @contextmanager
    def given(self) -> Iterator[None]:
        """Put the options into PETSc's database for a while."""
        database = PETSc.Options()
        # Options from the command line (PETSC_OPTIONS) take precedence.
        mine = [k for k in self._options if not database.hasName(self._prefix + k)]
        for key in mine:
            database.setValue(self._prefix + key, self._options[key])
        try:
            yield
        finally:
            self._unread = [k for k in self._unread if k in mine and not _read(self._prefix + k)]
            for key in mine:
                database.delValue(self._prefix + key)

    def apply(self, *objects: PETSc.Object) -> None:
        """Apply the options to PETSc objects (SNES, KSP, PC).

        Raises:
            InputError: PETSc rejects a value.
        """
        with self.given():
            try:
                for thing in objects:
                    thing.setFromOptions()
            except PETSc.Error as error:
                raise InputError(_refused(self._prefix, self._options, str(error))) from error

    def tell_unread(self) -> None:
        """Warn once about options that PETSc has not read; call it after the first solve."""
        for key in self._unread:
            logger.warning(
                '%s solver: PETSc has not read %s = "%s": its name is wrong, or it is unused',
                self._prefix.rstrip("_"), key, self._options[key],
            )  # fmt: skip
        self._unread = []


def _read(name: str) -> bool:
    """Whether PETSc has read an option in its database; petsc4py does not provide this."""
    found = ctypes.c_int(0)
    library = ctypes.CDLL(PETSc.__file__)
    library.PetscOptionsUsed(None, name.encode(), ctypes.byref(found))
    return bool(found.value)


def _refused(prefix: str, options: Options, message: str) -> str:
    """PETSc's message about a value, after the options that have it (all, if it does not say)."""
    reason = re.sub(r"^\[\d+\] ", "", message.splitlines()[-1]).rstrip(".")
    meant = {
        k: v
        for k, v in options.items()
        if re.search(rf"(?<!\w){re.escape(str(v))}\b", reason, re.IGNORECASE)
    }
    named = ", ".join(f'{k} = "{v}"' for k, v in (meant or options).items())
    what = prefix.rstrip("_")
    return f"{what} solver, {named}: PETSc refuses: {reason}; its manual has names and values"


def try_options(prefix: str, options: Options) -> None:
    """Apply options to a small temporary solver, so that a wrong one is reported at once.

    PETSc looks up a factorisation package (pc_factor_mat_solver_type) only at the first
    factorisation, in the middle of a run: here a unit matrix is factored. Not collective.

    Args:
        prefix: Prefix of the actual solver, for the message.
        options: Default and user options, without prefix.

    Raises:
        InputError: An option belongs to no family that PETSc knows, or PETSc rejects its value.
    """
    given = SolverOptions(prefix, options, asked=())
    matrix = PETSc.Mat().createAIJ((2, 2), nnz=1, comm=PETSc.COMM_SELF)
    things = [kind().create(PETSc.COMM_SELF) for kind in (PETSc.SNES, PETSc.KSP, PETSc.PC)]
    try:
        for row in range(2):
            matrix.setValue(row, row, 1.0)
        matrix.assemble()
        matrix.setOption(PETSc.Mat.Option.SPD, True)
        things[-1].setOperators(matrix, matrix)
        for thing in things:
            thing.setOptionsPrefix(prefix)
        given.apply(*things)
        if "pc_factor_mat_solver_type" in options:
            with given.given():
                try:
                    things[-1].setUp()
                except PETSc.Error as error:
                    named = {k: v for k, v in options.items() if k.startswith("pc_")}
                    raise InputError(_refused(prefix, named, str(error))) from error
    finally:
        for thing in (*things, matrix):
            thing.destroy()


class SnesSolver:
    """SNES around a `NonlinearProblem`.

    Args:
        problem: Residual, Jacobian and norms.
        vector: A vector of the unknowns' layout. matrix: Storage of the Jacobian.
        prefix: Unique option prefix that ends in an underscore.
        options: PETSc options without prefix, without a leading dash.
        watch: Charged with "petsc" for the time in SNES itself; the problem charges its own part.
        shorten: Called with the unknowns and Newton's correction before each step (SNES subtracts
            the correction); may scale the correction and returns whether it did, or None to give up
            at the present unknowns.
        asked: Names of the user's options, to report those that PETSc never reads; all if None.
        reduction: Largest reduction of the residual requested of an iterative linear solver, which
            need not exceed the fields' tolerances, unless the user sets ksp_rtol. None leaves it to
            the options.

    Raises:
        InputError: An option belongs to no family that PETSc knows, or PETSc rejects its value.
    """

    def __init__(
        self,
        problem: NonlinearProblem,
        vector: PETSc.Vec,
        matrix: PETSc.Mat,
        prefix: str,
        options: Options,
        watch: Stopwatch | None = None,
        shorten: Callable[[PETSc.Vec, PETSc.Vec], bool | None] | None = None,
        asked: Collection[str] | None = None,
        reduction: float | None = None,
    ) -> None:
        self.problem = problem
        self.watch = watch if watch is not None else Stopwatch()
        self.x, self._f, self._matrix = vector.duplicate(), vector.duplicate(), matrix
        self.snes = PETSc.SNES().create(vector.comm)
        self.snes.setOptionsPrefix(prefix)
        self.snes.setFunction(weakly(self._residual), self._f)
        self.snes.setJacobian(weakly(self._jacobian), matrix)
        self.snes.setConvergenceTest(weakly(self._converged))
        self._shorten = shorten
        if shorten is not None:
            self.snes.setLineSearchPreCheck(weakly(self._precheck))
        ksp = self.snes.getKSP()
        self._options = SolverOptions(prefix, options, asked)
        self._options.apply(self.snes, ksp, ksp.getPC())
        named = options if asked is None else asked
        self._prefix, self._asked = prefix, {k: v for k, v in options.items() if k in named}
        asked_for = "ksp_rtol" in named or PETSc.Options().hasName(prefix + "ksp_rtol")
        self._reduction = None if asked_for else reduction
        self._names = _reason_names()
        self._history: list[dict[str, float]] = []
        self._raised: BaseException | None = None
        self._given_up = False
        self._has_factored = False  # after which PETSc reads none of castfem's own options again

    def _called_back(self, method: Callable[..., Returned], *given: Any) -> Returned:
        """Charge a call from SNES to "python"; keep its exception, which PETSc may replace."""
        self.watch.start("python")
        try:
            return method(*given)
        except BaseException as error:
            self._raised = error
            raise
        finally:
            self.watch.stop()

    def _residual(self, snes: PETSc.SNES, x: PETSc.Vec, f: PETSc.Vec) -> None:
        self._called_back(self.problem.residual, x, f)

    def _jacobian(self, snes: PETSc.SNES, x: PETSc.Vec, a: PETSc.Mat, p: PETSc.Mat) -> None:
        self._called_back(self.problem.jacobian, x, p)

    def _precheck(self, x: PETSc.Vec, correction: PETSc.Vec) -> bool:
        assert self._shorten is not None
        shortened = self._called_back(self._shorten, x, correction)
        if shortened is None:
            self._given_up = True
            correction.set(0.0)  # SNES takes this for convergence: see `solve`
        return shortened is not False

    def _converged(
        self, snes: PETSc.SNES, its: int, norms: tuple[float, float, float]
    ) -> int | None:
        reasons = PETSc.SNES.ConvergedReason
        found = snes.getSolution(), snes.getFunction()[0]
        sizes = self._called_back(self.problem.norms, *found)
        self._history.append(sizes)
        if self._given_up:
            return int(reasons.DIVERGED_LINE_SEARCH)
        worst = max(sizes.values())
        if not all(math.isfinite(size) for size in sizes.values()):
            return int(reasons.DIVERGED_FNORM_NAN)
        if worst <= 1.0:
            return int(reasons.CONVERGED_FNORM_ABS)
        if its >= snes.getTolerances()[3]:
            return int(reasons.DIVERGED_MAX_IT)
        if self._reduction is not None:
            # The remainder of Newton's method is of second order; reductions below a tolerance are
            # wasted.
            enough = min(max(self._reduction, LINEAR_SHARE / worst), LEAST_REDUCTION)
            snes.getKSP().setTolerances(rtol=enough)
        return int(reasons.ITERATING)

    def solve(self) -> SolveResult:
        """Solve from the values in `x`, in place; never raises if it does not converge.

        Raises:
            InputError: PETSc cannot do what an option asks for.
        """
        self._history = []
        self._raised, self._given_up = None, False
        known = self._has_factored and not self._asked
        given = nullcontext() if known else self._options.given()
        with self.watch.section("petsc"), given, _no_garbage_search():
            try:
                self.snes.solve(None, self.x)
            except PETSc.Error as error:
                if self._raised is None:
                    if not self._asked:
                        raise
                    # PETSc reports impossible options only here: ILU on several ranks, for example.
                    raise InputError(_refused(self._prefix, self._asked, str(error))) from error
                raise self._raised from None  # for example Ctrl-C in the middle of a solve
        reason = self.snes.getConvergedReason()
        if self._given_up:
            reason = int(PETSc.SNES.ConvergedReason.DIVERGED_LINE_SEARCH)
        name = self._names.get(reason, str(reason))
        if not self._has_factored and self.snes.getIterationNumber() > 0:
            self._options.tell_unread()
            self._has_factored = True
        return SolveResult(reason > 0, self.snes.getIterationNumber(), name, self._history)

    def destroy(self) -> None:
        """Free the PETSc objects; safe to call twice."""
        for thing in (self.snes, self.x, self._f, self._matrix):
            thing.destroy()
