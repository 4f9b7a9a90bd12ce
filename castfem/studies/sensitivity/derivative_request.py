"""Derivatives that a run with files carries along: they are written beside its results."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path

from castfem.base import log
from castfem.base.atomic_files import plain, write_json
from castfem.base.errors import InputError
from castfem.fem.root import on_root
from castfem.model.build.simulation import Simulation
from castfem.runs.output.folder import DERIVATIVES_NAME
from castfem.runs.results.run_state import RunState
from castfem.runs.results.sample import Sample
from castfem.studies.sensitivity.differentiated_steps import followed
from castfem.studies.sensitivity.readings import Readings, asked_quantities
from castfem.studies.sensitivity.recorder import Recorder
from castfem.studies.sensitivity.run import follow, refuse, result_of
from castfem.studies.sensitivity.slopes import REFUSED


class Carried:
    """Carries derivatives along with a run (`castfem.runs.loop.Companion`).

    Args:
        simulation: The run, before it has begun.
        of: Names of results.
        to: Parameters, `castfem.studies.sensitivity.parameters.read_parameters`.
        path: Of the file that is written at the end.

    Raises:
        InputError: Case, results or parameters cannot be used; the simulation is as it was.
    """

    def __init__(
        self, simulation: Simulation, of: Sequence[str], to: Sequence[str], path: Path
    ) -> None:
        refuse(simulation.case)
        asked = asked_quantities(simulation, of)
        self._path, self._derivatives = path, follow(simulation, to)
        self._readings = Readings(simulation, self._derivatives, asked, errors=False)
        self._recorder = Recorder(simulation, self._derivatives, self._readings, None)

    def step(self, run: RunState, sample: Sample) -> None:
        """Take in one committed step (collective)."""
        self._recorder.step(run, sample)

    def finish(self, run: RunState) -> None:
        """Write the derivatives (collective).

        Raises:
            RunFailure: They cannot be written.
        """
        content = plain(result_of(run, self._derivatives, self._readings).to_json())
        comm = run.simulation.section.comm
        on_root(comm, lambda: write_json(self._path, content))

    def destroy(self) -> None:
        """Free the PETSc objects."""
        simulation = self._recorder.simulation
        with ExitStack() as freed:
            freed.callback(self._derivatives.destroy)
            if simulation.coupling is not None:
                freed.callback(followed(simulation.coupling).destroy)


def carrying(
    of: Sequence[str], to: Sequence[str], folder: Path
) -> Callable[[Simulation], Carried | None]:
    """Return what lets a run carry derivatives along, where it can have them.

    Where it cannot, its log says why, and so does the file of the derivatives.

    Args:
        of: Names of results.
        to: Parameters.
        folder: Of the run.
    """
    path = folder / DERIVATIVES_NAME

    def begin(simulation: Simulation) -> Carried | None:
        try:
            return Carried(simulation, of, to, path)
        except InputError as error:
            problems = error.problems
        comm = simulation.section.comm
        if comm.rank == 0:
            log.logger.warning("the run has no derivatives: %s", "; ".join(problems))
        on_root(comm, lambda: write_json(path, {REFUSED: problems}))
        return None

    return begin
