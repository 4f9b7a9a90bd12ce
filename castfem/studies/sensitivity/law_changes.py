"""The law at the points of a slice, differentiated by all parameters at once.

The coefficients of the law depend on temperature and parameter. They are differentiated by
temperature once for all parameters, and by a parameter at constant temperature if it changes the
law.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from castfem.base.types import Array
from castfem.physics.constitutive.base import (
    Law,
    MaterialStep,
    ResponseChange,
    StepChange,
)
from castfem.physics.constitutive.flow_laws import ThermoElastic
from castfem.physics.mechanics.material_points import FedPoints
from castfem.physics.mechanics.problem import MechanicalProblem
from castfem.studies.sensitivity.perturbed_slices import (
    DIFFERENCES,
    SliceSides,
    slope,
    slope_by_temperature,
)
from castfem.studies.sensitivity.step_inputs import Beginning


class LawChanges:
    """The law at the points with stress, in a step of the run.

    It takes the arguments of `linearised_step.LinearisedStep`, and the strain increments there (m,
    4).
    """

    def __init__(
        self,
        run: MechanicalProblem,
        sides: Sequence[SliceSides],
        begun: Sequence[Beginning],
        strain: Array,
    ) -> None:
        self._run, self._sides, self._begun = run, sides, begun
        here = self._here = begun[0].stressed
        self._strain = strain
        self._tangent = run.response.tangent[here.kept]
        self._directions = _directions(run.slice.law, here.now)
        self._ways = len(self._directions)
        self._longer = self._rows(np.array(its.late[1] - its.late[0]) for its in begun)
        self._starts = [
            self._rows(its.start[name][here.rows] for its in begun)
            for name in ("stress", "internal")
        ]
        stiff = run.points.stiffness_temperature
        self._stiff = [stiff(one)[here.rows] for one in begun[0].points]
        ends = range(2)
        self._warming = [self._rows(its.warming[end][here.rows] for its in begun) for end in ends]
        self._stiff_warming = self._warming
        if not run.points.whole:
            self._stiff_warming = [
                self._rows(stiff(its.warming[end])[here.rows] for its in begun) for end in ends
            ]
        self._thermal, self._thermal_changes = self._thermal_strain()
        first = slice(0, here.deviators)
        self._parts = [self._part(first, False), self._part(slice(first.stop, None), True)]
        self._strain_held: Array = np.zeros(0)
        self._held = self._rise = ResponseChange.empty(0, 0, 0)

    def _rows(self, changes: Iterable[Array]) -> Array:
        """Changes by the parameters (k, ...), and zero along the additional directions."""
        given = list(changes)
        return np.array([*given, *(np.zeros_like(given[0]) for _ in range(self._ways))])

    def _thermal_strain(self) -> tuple[Array, Array]:
        """Thermal strain of the step (m,), and its derivatives (k, m)."""
        here, strain = self._here, self._run.slice.thermal_strain
        ends = here.before, here.after
        now = [np.asarray(strain(one)) for one in ends]
        rise = [slope_by_temperature(strain, one, its) for one, its in zip(ends, now, strict=True)]
        changes = rise[1] * self._warming[1] - rise[0] * self._warming[0]
        for number, one in enumerate(self._sides):
            if all(side.thermal_strain == strain for side in one.slices):
                continue
            above, below = (
                np.asarray(side.thermal_strain(here.after)) - side.thermal_strain(here.before)
                for side in one.slices
            )
            changes[number] += slope(above, now[1] - now[0], below, one.by)
        return now[1] - now[0], changes

    def _part(self, rows: slice, elastic: bool) -> tuple[slice, Law, Array, Array]:
        """The points of one rule; where only the mean stress counts, the law is its elasticity.

        Returns:
            These points, their law, its coefficients (n, columns), and their derivatives by all
            input (k, n, columns).
        """
        law, fed = _of_part(self._run.slice.law, elastic), self._here.fed
        before, after = (one[rows] for one in self._stiff)
        # At the present temperatures, warmer and colder at the start, warmer and colder at the end:
        # in one call, since there are few points.
        starts = [before, before + DIFFERENCES.warmer, before - DIFFERENCES.warmer, before, before]
        ends = [after, after, after, after + DIFFERENCES.warmer, after - DIFFERENCES.warmer]
        every = law.coefficients(np.concatenate(starts), np.concatenate(ends))
        tables = every.reshape(5, len(before), every.shape[1])
        now = tables[0]
        solid = now.copy()
        for table in tables:
            _softened(table, fed, rows)
        rise = [slope(tables[i], now, tables[i + 1], DIFFERENCES.warmer) for i in (1, 3)]
        warm = [one[:, rows, None] for one in self._stiff_warming]
        changes = rise[0] * warm[0] + rise[1] * warm[1]
        for number, (one, its) in enumerate(zip(self._sides, self._begun, strict=True)):
            wet = one.fed(fed, its)
            if one.same_law and wet[0] is fed:
                continue
            ends = [solid.copy(), solid.copy()]
            if not one.same_law:
                laws = (_of_part(side.law, elastic) for side in one.slices)
                ends = [its_law.coefficients(before, after) for its_law in laws]
            above, below = (_softened(t, w, rows) for t, w in zip(ends, wet, strict=True))
            changes[number] += slope(above, now, below, one.by)
        return rows, law, now, changes

    def held(self, strain: Array) -> ResponseChange:
        """Derivatives of the response by all parameters at constant unknowns.

        Args:
            strain: Derivatives of the strain increments (k, m, 4).
        """
        count, here, thermal = len(strain), self._here, self._thermal_changes
        found = ResponseChange.empty(count + self._ways, len(here.rows), here.internal.shape[1])
        strains, (stress, state) = np.concatenate([strain, self._directions]), self._starts
        for rows, law, coefficients, changes in self._parts:
            remembered = slice(0, len(law.state_names))
            found.state[:, rows, remembered.stop :] = 0.0
            law.differentiate(
                MaterialStep(
                    self._strain[rows], self._thermal[rows], here.before[rows], here.after[rows],
                    self._run.dt,
                ),
                here.stress[rows], here.internal[rows, remembered],
                StepChange(
                    changes, strains[:, rows], thermal[:, rows], stress[:, rows],
                    state[:, rows, remembered], self._longer,
                ),
                coefficients=coefficients,
                out=ResponseChange(
                    found.stress[:, rows], found.state[:, rows, remembered],
                    found.dissipation[:, rows],
                ),
            )  # fmt: skip
        self._strain_held = strain
        self._held, self._rise = found.some(slice(0, count)), found.some(slice(count, None))
        return self._held

    def moved(self, strain: Array, some: list[int] | slice) -> ResponseChange:
        """The same by some of the parameters with moving unknowns, once `held` is known.

        Args:
            strain: Derivatives of the strain increments (k, m, 4).
            some: Indices of these k parameters.
        """
        held, rise = self._held.some(some), self._rise
        more = strain - self._strain_held[some]
        share = np.einsum("knc,dnc->dkn", more, self._directions)
        return ResponseChange(
            held.stress + (self._tangent @ more[..., None])[..., 0],
            held.state + np.einsum("dkn,dns->kns", share, rise.state),
            held.dissipation + np.einsum("dkn,dn->kn", share, rise.dissipation),
        )


def _directions(law: Law, stress: Array) -> Array:
    """Strains (d, n, 4) in which a law is also differentiated, to follow a motion.

    The stress follows from its tangent. For an isotropic law the rest depends only on the length of
    the trial deviator, which grows with the strain along the stress deviator; a law with a back
    stress also turns its flow with the strain.
    """
    if not law.symmetric:
        return np.repeat(np.eye(4)[:, None], len(stress), axis=1)
    deviator = stress.copy()
    deviator[:, :3] -= stress[:, :3].mean(axis=1)[:, None]
    length = np.linalg.norm(deviator, axis=1)[:, None]
    return np.divide(deviator, length, out=np.zeros_like(deviator), where=length > 0.0)[None]


def _softened(table: Array, fed: FedPoints | None, rows: slice) -> Array:
    """Coefficients at some of the points, with the stiffness used for fed liquid."""
    if fed is not None:
        fed.soften(rows, table)
    return table


def _of_part(law: Law, elastic: bool) -> Law:
    """A law, or only its elasticity."""
    return ThermoElastic(law.elasticity) if elastic else law
