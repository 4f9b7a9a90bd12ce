"""All interactions with the surface of a slice."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.fem.section import Section
from castfem.physics.contact.interaction import (
    DifferentiableInteraction,
    Interaction,
    InteractionState,
    Motion,
    Solid,
)
from castfem.physics.contact.settings import SurfaceInteraction
from castfem.physics.contact.wall_contact import WallContact
from castfem.physics.mechanics.state import MechanicalState

Found = tuple[object, ...]


class Interactions:
    """The interactions of one slice, in the order of their definition.

    Args:
        each: The interactions.

    Attributes:
        symmetric: Whether they leave a symmetric tangent symmetric, at small strain.
    """

    def __init__(self, each: Sequence[Interaction]) -> None:
        self._each = tuple(each)
        self.symmetric = all(one.symmetric for one in self._each)

    @classmethod
    def build(
        cls, section: Section, given: Sequence[SurfaceInteraction], solid: Solid, motion: Motion
    ) -> Interactions:
        """Build interactions from their settings (collective).

        Args:
            section: The distributed section.
            given: Settings of each.
            solid: Material of the slice.
            motion: Displacement and generalized strains of the mechanical problem.

        Raises:
            InputError: A group does not exist.
        """
        return cls([one.build(section, solid, motion) for one in given])

    def __iter__(self) -> Iterator[Interaction]:
        return iter(self._each)

    def __len__(self) -> int:
        return len(self._each)

    @property
    def wall(self) -> WallContact | None:
        """Contact with the mould, across whose gap heat flows; None without a mould."""
        return next((one for one in self._each if isinstance(one, WallContact)), None)

    def with_states(
        self, states: Sequence[InteractionState]
    ) -> Iterator[tuple[Interaction, InteractionState]]:
        """Yield each interaction with its state."""
        return zip(self._each, states, strict=True)

    def of_slice(self, given: Sequence[SurfaceInteraction], solid: Solid) -> Interactions:
        """Make those of another slice, see `DifferentiableInteraction.of_slice`.

        Raises:
            InputError: One of them has no derivatives; for cases this is checked before, by key.
        """
        others = list[Interaction]()
        for one, its in zip(self._each, given, strict=True):
            if not isinstance(one, DifferentiableInteraction):
                raise InputError(
                    f"interactions: {one.name} is not differentiated; leave it out, or compare "
                    "runs (castfem sweep)"
                )
            others.append(one.of_slice(its, solid))
        return Interactions(others)

    def always_held(self) -> tuple[Array, Array] | None:
        """Places (n, 2), m, and directions (n, 2) in which they are restrained in every step."""
        found = [one.always_held() for one in self._each]
        if not found:
            return None
        places, directions = (np.concatenate(parts) for parts in zip(*found, strict=True))
        return places, directions

    def initial(self) -> tuple[InteractionState, ...]:
        """Initial states, before anything has acted."""
        return tuple(one.initial() for one in self._each)

    def begin(self, old: MechanicalState, time: float, temperature: Array) -> None:
        """Prepare a step from `old` to `time` (s) and `temperature` (owned,), K (collective)."""
        for one, state in self.with_states(old.interactions):
            one.begin(state, old.time, time, old.temperature, temperature)

    def axial_strain(self, places: Array) -> Array | None:
        """Axial strain (n,) that they add in this step at places (n, 2), m; None for none."""
        found = [part for one in self._each if (part := one.axial_strain(places)) is not None]
        return sum(found[1:], found[0]) if found else None

    def front_strain(
        self, old: MechanicalState, new: MechanicalState, places: Array
    ) -> Array | None:
        """Axial strain (n,) added at the solidification front from a state to a later one.

        See `Interaction.front_strain`; None for none.
        """
        span, states = (old.time, new.time), zip(old.interactions, new.interactions, strict=True)
        parts = [
            part
            for one, (before, after) in zip(self._each, states, strict=True)
            if (part := one.front_strain(before, after, span, places)) is not None
        ]
        return sum(parts[1:], parts[0]) if parts else None

    def refusal(self) -> str:
        """Reason why the current step cannot be taken; "" if it can (collective)."""
        return next((reason for one in self._each if (reason := one.refusal())), "")

    def evaluate(self) -> float:
        """Evaluate all interactions; return the stress caused by rounding, Pa (collective)."""
        return sum((one.evaluate() for one in self._each), start=0.0)

    def work_on(self, directions: Array) -> Array:
        """Work on directions (4, k) of the generalized strains, N/m each (collective)."""
        return sum((one.work_on(directions) for one in self._each), np.zeros(directions.shape[1]))

    def hold(self, on: bool) -> bool:
        """Keep contacts closed that were so, or let go; return if there are any (collective)."""
        return any([one.hold(on) for one in self._each])  # must call all of them

    def evaluated(self) -> Found:
        """Results of the last evaluation, for `kink`."""
        return tuple(one.evaluated() for one in self._each)

    def kink(self, base: Found) -> float:
        """Work of tractions since `base`, minus that predicted by their tangents (collective)."""
        parts = zip(self._each, base, strict=True)
        return sum((one.kink(before) for one, before in parts), start=0.0)

    def states(self) -> tuple[InteractionState, ...]:
        """The states of the last evaluation (collective)."""
        return tuple(one.state() for one in self._each)

    def arrays(self, states: Sequence[InteractionState]) -> dict[str, Array | None]:
        """States for a checkpoint, complete on rank 0, None elsewhere (collective)."""
        found: dict[str, Array | None] = {}
        for prefix, (one, state) in zip(self._prefixes(), self.with_states(states), strict=True):
            found |= {prefix + name: values for name, values in one.arrays(state).items()}
        return found

    def restored(self, arrays: dict[str, Array]) -> tuple[InteractionState, ...]:
        """Inverse of `arrays`, which are on every rank (collective)."""
        found = []
        for prefix, one in zip(self._prefixes(), self._each, strict=True):
            mine = {n.removeprefix(prefix): v for n, v in arrays.items() if n.startswith(prefix)}
            found.append(one.restored(mine))
        return tuple(found)

    def _prefixes(self) -> Iterator[str]:
        """Prefixes that distinguish the arrays of several interactions of one kind."""
        names: list[str] = []
        for one in self._each:
            yield f"{names.count(one.name) + 1}_" if one.name in names else ""
            names.append(one.name)
