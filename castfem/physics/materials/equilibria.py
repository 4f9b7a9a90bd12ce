"""Equilibria of a steel from a thermodynamic database (CALPHAD), with pycalphad.

pycalphad is imported only when something is computed. Compositions are passed as mole fractions,
and heat capacities are those of the phases: pycalphad 0.11 gives NaN for some mass fractions of
carbon, and wrong slopes of the enthalpy for interstitial carbon.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.types import Array

PRESSURE = 101325.0  # Pa
CARBIDES = ("CEMENTITE", "M7C3", "M23C6", "M6C", "M3C2")
USUAL = re.compile(rf"(LIQUID|BCC_A2|FCC_A1|{'|'.join(CARBIDES)}|MNS(_Q)?)(_D\d+)?")
CARBIDE_CARBON = 0.2  # mole fraction above which a face-centred phase is a carbide, such as NbC

Moles = dict[str, float]  # amounts by element


@dataclass(frozen=True, slots=True)
class Settings:
    """Accuracy of the table of equilibria."""

    longest: float = 5.0  # largest interval between rows, K
    narrowest: float = 0.01  # accuracy of the temperature at which a phase appears, K
    fraction: float = 5e-4  # error of a fraction by linear interpolation between two rows
    enthalpy: float = 100.0  # error of the enthalpy by linear interpolation, J/kg
    jump: float = 0.02  # change of a fraction within `narrowest` that counts as a jump
    #: jump between pieces of a phase's enthalpy that is ignored, J/kg; that of liquid iron falls by
    #: 6 at 1811 K in [PovodenKaradeniz2016]
    misfit: float = 20.0
    freezing: float = 0.02  # fraction that may freeze in a Scheil step before carbon moves
    passes: int = 30  # largest number of passes of freezing and moving of carbon in a step
    step: float = 1.0  # largest step of a Scheil path, K
    potential: float = 1e-4  # allowed difference of the potentials of carbon over RT
    settled: float = 1e-4  # further freezing of a kilogram, kg, below which passes end
    #: points by which pycalphad samples a phase: at some temperatures it finds a state that is not
    #: the most stable one, so the best of several is taken; more points if these are inconsistent
    samples: tuple[tuple[int, ...], ...] = ((60, 20), (60, 20, 200), (60, 20, 200, 1000))


SETTINGS = Settings()


@dataclass(frozen=True, slots=True)
class State:
    """A kilogram of steel, or part of one, at one temperature."""

    temperature: float  #: K
    #: kg of liquid, ferrite, austenite, carbides, others (5,)
    mass: Array
    carbon: Array  #: carbon in each (5,), wt%; NaN where absent
    gibbs: float  #: J
    enthalpy: float  #: J
    capacity: float  #: J/K, for constant phases
    names: frozenset[str]  #: names of the phases in the database
    liquid: Moles  #: amounts in the liquid
    potential: float  #: chemical potential of carbon, J/mol; NaN without carbon

    def plus(self, other: State) -> State:
        """Return the sum of two states."""
        mass = self.mass + other.mass
        kg = np.nan_to_num(self.carbon) * self.mass + np.nan_to_num(other.carbon) * other.mass
        return State(
            self.temperature, mass, content(kg, mass), self.gibbs + other.gibbs,
            self.enthalpy + other.enthalpy, self.capacity + other.capacity,
            self.names | other.names, other.liquid or self.liquid, math.nan,
        )  # fmt: skip


class Equilibria:
    """Equilibria of a steel from a database.

    Raises:
        ValueError: The database cannot be used for the steel; the message is one line.
    """

    def __init__(self, path: Path, elements: Sequence[str], phases: Sequence[str]) -> None:
        """Read the database."""
        from pycalphad import Database

        try:
            with warnings.catch_warnings():  # pycalphad warns about what it ignores
                warnings.simplefilter("ignore")
                self.data = Database(str(path))
        except Exception as error:  # reason: its parsers raise many kinds of errors
            first = (str(error).strip() or type(error).__name__).splitlines()[0]
            raise ValueError(f"cannot be read as a thermodynamic database ({first})") from error
        self._check(elements, phases)
        named = phases or sorted(name for name in self.data.phases if USUAL.fullmatch(name))
        self.elements = [e.upper() for e in elements]
        self.molar = {e: 1e-3 * self.data.refstates[e]["mass"] for e in self.elements}
        self.phases = self._possible(named)
        self.solids = [name for name in self.phases if name != "LIQUID"]
        self.samples = SETTINGS.samples[0]
        self._shared: dict[str, Any] = {}

    def _check(self, elements: Sequence[str], phases: Sequence[str]) -> None:
        known = sorted(e.capitalize() for e in self.data.elements if e.isalpha() and e != "VA")
        if not known:
            raise ValueError("has no elements; it is no thermodynamic database")
        if lacking := [e for e in elements if e not in known]:
            raise ValueError(f"has no data for {', '.join(lacking)}; it has {', '.join(known)}")
        if unknown := [name for name in phases if name not in self.data.phases]:
            raise ValueError(f"has no phase {', '.join(unknown)}")

    def _possible(self, names: Sequence[str]) -> list[str]:
        """Return those phases that the elements can form."""
        from pycalphad.core.utils import filter_phases, unpack_species

        made_of = unpack_species(self.data, [*self.elements, "VA"])
        found: list[str] = sorted(filter_phases(self.data, made_of, list(names)))
        for needed in ("LIQUID", "BCC_A2", "FCC_A1"):
            if needed not in found:
                raise ValueError(f"has no phase {needed}, or it is not among those requested")
        return found

    def moles(self, composition: Mapping[str, float]) -> Moles:
        """Return the moles of a kilogram of steel with a composition in wt%, the rest iron."""
        kg = {e.upper(): w / 100.0 for e, w in composition.items()}
        kg["FE"] = 1.0 - sum(kg.values())
        if kg["FE"] <= 0.0:
            raise ValueError("is for steels, and this one has no iron; correct steel.composition")
        return {e: m / self.molar[e] for e, m in kg.items()}

    def state(self, temperature: float, moles: Moles, phases: Sequence[str] = ()) -> State:
        """Return the equilibrium of given moles of the elements among some phases, by default all.

        Raises:
            ValueError: pycalphad finds none at the temperature or very near it.
        """
        for shift in (0.0, 2e-3, -2e-3, 0.02, -0.02):
            among = list(phases or self.phases)
            samples = self.samples if len(among) > 1 else self.samples[:1]
            solved = [self._solve(temperature + shift, moles, among, n) for n in samples]
            if found := [state for state in solved if state is not None]:
                return replace(min(found, key=lambda state: state.gibbs), temperature=temperature)
        amounts = ", ".join(
            f"{e.capitalize()} {100.0 * n * self.molar[e]:.4g}" for e, n in moles.items()
        )
        raise ValueError(
            f"gives no equilibrium at {temperature - ZERO_CELSIUS:.2f} degC ({amounts} g) with "
            "pycalphad; leave out an element, or name the phases with steel.phases"
        )

    def _solve(
        self, temperature: float, moles: Moles, phases: list[str], samples: int
    ) -> State | None:
        from pycalphad import Workspace
        from pycalphad import variables as v

        total = sum(moles.values())
        there = [e for e in self.elements if moles[e] > 0.0]
        key = " ".join([*there, *phases])
        given = {v.N: 1.0, v.P: PRESSURE, v.T: temperature}
        given |= {v.X(e): moles[e] / total for e in there if e != "FE"}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            space = Workspace(
                self.data, [*there, "VA"], phases, given, calc_opts={"pdens": samples},
                **self._shared.get(key, {}),
            )  # fmt: skip
            sets = space.get_composition_sets()
            gibbs, enthalpy, capacity = (
                total * float(np.squeeze(space.get(name))) for name in ("GM", "HM", "CPM")
            )
            potential = float(np.squeeze(space.get(v.MU("C")))) if "C" in there else math.nan
        self._shared.setdefault(
            key, {"models": space.models, "phase_record_factory": space.phase_record_factory}
        )
        if not (sets and math.isfinite(enthalpy) and math.isfinite(capacity)):
            return None
        mass, carbon, names, liquid = np.zeros(5), np.zeros(5), set(), dict[str, float]()
        for one in sets:
            amount = float(one.NP) * total
            if amount <= 1e-10 * total:
                continue
            record = one.phase_record
            shares = dict(zip(record.nonvacant_elements, map(float, one.X), strict=True))
            kg = {e: amount * x * self.molar[e] for e, x in shares.items()}
            place = role(record.phase_name, shares.get("C", 0.0))
            mass[place] += sum(kg.values())
            carbon[place] += kg.get("C", 0.0)
            names.add(f"{record.phase_name}{place}")
            if place == 0:
                liquid = {e: amount * x + liquid.get(e, 0.0) for e, x in shares.items()}
        return State(
            temperature, mass, content(100.0 * carbon, mass), gibbs, enthalpy, capacity,
            frozenset(names), liquid, potential,
        )  # fmt: skip


def role(phase: str, carbon: float) -> int:
    """Index of a phase in `State.mass`, from its name and its mole fraction of carbon."""
    if phase == "LIQUID":
        return 0
    if phase == "BCC_A2":
        return 1
    if phase == "FCC_A1":
        return 2 if carbon < CARBIDE_CARBON else 3
    return 3 if phase.startswith(CARBIDES) else 4


def content(carbon: Array, mass: Array) -> Array:
    """Carbon over mass; NaN without mass."""
    return np.where(mass > 0.0, carbon / np.where(mass > 0.0, mass, 1.0), np.nan)
