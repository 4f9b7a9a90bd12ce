"""Steps of the mechanics within a window: as many as asked for, and the same as windows."""

from __future__ import annotations

import numpy as np
import pytest
from billet_runs import Kept, billet, run_in_memory

ALONE = ("casting.length=60 mm", "coupling.dissipation=0", "coupling.follow_shape=false")
STEPS = ("thermal.time.step=0.05 s",)


def shape(kept: Kept) -> list[np.ndarray]:
    state = kept.states[-1].mechanical
    assert state is not None
    return [state.displacement, state.stress, state.internal, kept.states[-1].thermal.enthalpy]


def test_steps_within_a_window_are_those_of_shorter_windows() -> None:
    """Where the mechanics tell the heat nothing, it is all one how long they keep silent."""
    kept = [
        run_in_memory(billet("idealised", *ALONE, *STEPS, f"coupling.interval={window}", *step))
        for window, step in (
            ("0.1 s", ()),
            ("0.5 s", ("coupling.mechanical_step=0.1 s",)),
            ("0.5 s", ()),
        )
    ]
    assert [len(k.states) - 1 for k in kept] == [10, 2, 2]
    for one, other in zip(shape(kept[0]), shape(kept[1]), strict=True):
        assert np.abs(one - other).max() <= 1e-7 * np.abs(one).max()
    longer = np.abs(shape(kept[0])[1] - shape(kept[2])[1]).max()
    assert longer > 1e-3 * np.abs(shape(kept[0])[1]).max()


def test_work_and_iterations_are_those_of_all_steps() -> None:
    changes = ("casting.length=90 mm", "thermal.time.step=62.5 ms")
    step = "coupling.mechanical_step=62.5 ms"
    short, several = (
        run_in_memory(billet("taper_3", *changes, *more))
        for more in (("coupling.interval=62.5 ms",), ("coupling.interval=0.25 s", step))
    )
    heating = [sum(s.heating.sum() for s in kept.states) for kept in (short, several)]
    assert heating[1] == pytest.approx(heating[0], rel=0.05)
    newton = [
        sum(r.mechanics.newton for r in kept.samples if r.mechanics) for kept in (short, several)
    ]
    assert newton[1] == pytest.approx(newton[0], rel=0.2)
    assert several.value("heat_removed") == pytest.approx(short.value("heat_removed"), rel=5e-3)
