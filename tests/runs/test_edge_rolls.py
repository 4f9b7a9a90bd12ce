"""A slab from the meniscus through its mould to rolls at its wide and its narrow faces."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest
from interrupted import history_of
from runs.billet_runs import Kept, run_in_memory
from runs.bulging_slab import below
from test_slab_below_mould import END, ROLLS, TAPER, slab

from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.model import Case, load_case
from castfem.model.build.simulation import Simulation, build
from castfem.physics.contact.roll_support import RollSupportState
from castfem.physics.mechanics.state import MechanicalState
from castfem.physics.mechanics.stepper import MechanicalStepper
from castfem.runs.loop import TimeLoop
from castfem.runs.results.sample import Sample

EDGES = (0.4, 0.47)
HALF = (0.2, 0.05)  # m: half of width and thickness
SHIPPED = Path(__file__).parents[2] / "cases" / "slab1200" / "from_meniscus.toml"


def edged(edges: tuple[float, ...] = EDGES, **changes: object) -> Case:
    """Return the slab of test_slab_below_mould with rolls at its narrow faces."""
    rolls = {
        "position": [f"{place} m" for place in (*ROLLS, *edges)],
        "diameter": ["60 mm"] * (3 + len(edges)),
        "aperture": ["100 mm", "99.8 mm", "99.7 mm"] + [""] * len(edges),
        "side": ["wide"] * 3 + ["narrow"] * len(edges),
    }
    taper = {"wide_face": f"{100 * TAPER} %/m", "narrow_face": "1.5 %/m"}
    mould = {"length": f"{END} m", "taper": taper}
    return slab(**{"machine__rolls": rolls, "mould": mould} | changes)


class RunWithSimulation:
    """Keeps a run in memory together with its simulation."""

    def __init__(self, case: Case) -> None:
        self.simulation, self.kept = build(case, MPI.COMM_SELF), Kept()
        TimeLoop(self.simulation, self.kept).run()  # type: ignore[arg-type]

    def below(self, position: float) -> Sample:
        return below(self.kept, position)


@pytest.fixture(scope="module")
def own() -> Any:
    run = RunWithSimulation(edged())
    yield run
    run.simulation.destroy()


def state_of(sample: Sample) -> MechanicalState:
    assert sample.state.mechanical is not None
    return sample.state.mechanical


def beds_of(sample: Sample) -> list[RollSupportState]:
    """Return the roll supports of the wide faces and, last, of the narrow ones."""
    return [s for s in state_of(sample).interactions if isinstance(s, RollSupportState)]


def within(simulation: Simulation, state: MechanicalState) -> Array:
    """Return Int sigma_xx da and Int sigma_yy da (2,), N, of steel and liquid."""
    assert isinstance(simulation.mechanics, MechanicalStepper)
    points = simulation.mechanics.problem.points
    n, volume = points.deviator_points, points.volume
    mean = state.stress[:, :3].mean(axis=1)
    deviator = volume[:n] @ (state.stress[:n, :2] - mean[:n, None])
    return np.asarray(deviator + volume[n:] @ (mean[n:] - state.pressure))


def from_outside(simulation: Simulation, state: MechanicalState) -> Array:
    """Return the work of mould and rolls on the motions (x, 0) and (0, y) (2,), N."""
    assert isinstance(simulation.mechanics, MechanicalStepper)
    wall, contact = simulation.mechanics.problem.contact, state.contact
    force = -(contact.weight * contact.pressure)[:, None] * contact.normal
    work = (force * wall.facets.position).sum(axis=0)
    wide, narrow = (s for s in state.interactions if isinstance(s, RollSupportState))
    return np.asarray(work - [HALF[0] * narrow.force.sum(), HALF[1] * wide.force.sum()])


def test_mould_and_rolls_support_shell_and_liquid(own: RunWithSimulation) -> None:
    """In the mould, at its end, between its end and each roll, and below the last edge roll."""
    met = set()
    for sample in own.kept.samples[1:]:
        state = state_of(sample)
        inside, outside = within(own.simulation, state), from_outside(own.simulation, state)
        # The part of the liquid's pressure.
        size = float(state.pressure.max()) * 4.0 * HALF[0] * HALF[1]
        assert size > 0.0
        assert inside == pytest.approx(outside, abs=1e-5 * size)
        assert (np.abs(outside) > 0.01 * size).any()
        met |= {(state.contact.pressure > 0.0).any() if state.contact is not None else None,
                bool(beds_of(sample)[1].force.any())}  # fmt: skip
    assert met == {True, False}


def test_edge_rolls_begin_at_the_end_of_the_mould(own: RunWithSimulation) -> None:
    left = HALF[0] / (1.0 + 0.015 * END) - HALF[0]
    for sample in own.kept.samples:
        (bed,) = beds_of(sample)[1].beds.values()
        on = END + 1e-6 < sample.position < EDGES[-1] + 1e-6
        assert (bed.stiffness > 0.0) == on
        if on:
            assert bed.offset == pytest.approx(left, abs=1e-9)
            assert -1e-12 < bed.bulge < 1e-3
    spans = [beds_of(own.below(place))[1].memory["z"][0, -1] for place in (END, EDGES[0])]
    assert spans == pytest.approx([EDGES[0] - END, EDGES[1] - EDGES[0]])
    positions = [s.position for s in own.kept.samples]
    assert all(min(abs(p - place) for p in positions) < 1e-9 for place in EDGES)


def test_edge_rolls_hold_the_face(own: RunWithSimulation) -> None:
    """They never pull it: their force is that in the history."""
    free = run_in_memory(slab(mould=own.simulation.case.document()["mould"]))
    held, pushed = (
        max(s.strained.moved["narrow_face"] for s in one.samples if s.position > END)
        for one in (own.kept, free)
    )
    left = HALF[0] / (1.0 + 0.015 * END) - HALF[0]
    assert held < left + 60e-6 < pushed
    forces = [float(beds_of(s)[1].force[0]) for s in own.kept.samples]
    assert max(forces) > 100.0
    # A face that has left its rolls has a thousandth of their stiffness.
    assert min(forces) > -0.02 * max(forces)


def test_idealised_mould_and_rolls_never_act_together() -> None:
    """Without [mould] the faces are held up to the first roll of the wide ones, here at 0.38 m."""
    start = {"start": {"at": "mould_exit"}, "superheat": "20 K", "speed": "0.6 m/min"}
    whole = run_in_memory(edged(mould=None, casting=start | {"length": "0.42 m"}))
    met = set()
    for sample in whole.samples[1:]:
        (narrow,) = beds_of(sample)[1].beds.values()
        held = next(bed for name, bed in beds_of(sample)[0].beds.items() if "narrow" in name)
        assert (held.stiffness > 0.0) != (narrow.stiffness > 0.0)
        met.add(narrow.stiffness > 0.0)
    assert met == {True, False}


def test_run_resumes_byte_for_byte_through_mould_exit(tmp_path: Path) -> None:
    case = edged(casting__length="0.46 m")
    for stop in (4, 6):
        assert history_of(case, tmp_path / "a") == history_of(case, tmp_path / f"{stop}", stop)


def test_full_slab_has_rolls_at_both_narrow_faces(own: RunWithSimulation) -> None:
    whole = run_in_memory(edged(section__symmetry="whole", casting__length=f"{EDGES[0]} m"))
    assert whole.samples[-1].position == pytest.approx(EDGES[0])
    for ours, theirs in zip(own.kept.samples, whole.samples, strict=False):
        assert theirs.position == pytest.approx(ours.position)
        half, (one, other) = beds_of(ours)[1].force[0], beds_of(theirs)[1].force
        assert [one, other] == pytest.approx([half, half], rel=1e-4, abs=0.5)


@pytest.mark.mpi
def test_ranks_agree(own: RunWithSimulation) -> None:
    several = run_in_memory(edged(), MPI.COMM_WORLD)
    for ours, theirs in zip(own.kept.samples, several.samples, strict=True):
        one, other = beds_of(ours)[1], beds_of(theirs)[1]
        assert other.force == pytest.approx(one.force, rel=1e-5, abs=1.0)
        moved = (s.strained.moved["narrow_face"] for s in (ours, theirs))
        assert next(moved) == pytest.approx(next(moved), abs=1e-7)


def test_mould_without_gap_and_friction_keeps_the_heat() -> None:
    """With a straight mould whose gap conducts perfectly, the slab is as in an idealised mould."""
    ways = {"start": {"at": "mould_exit"}, "superheat": "20 K", "speed": "0.6 m/min"}
    begun = slab(mould=None, casting=ways | {"length": "0.32 m"})
    through = slab(**{"mould.taper": "0 %/m", "casting__length": "0.32 m",
                      "cooling.0.surface.0.gap_conductivity": "1000 W/(m K)",
                      "coupling.follow_shape": False})  # fmt: skip
    ours, theirs = (run_in_memory(case).samples[-1] for case in (begun, through))
    for name, profile in ours.profiles.items():
        assert profile.temperature == pytest.approx(theirs.profiles[name].temperature, abs=2.0)
    assert ours.removed == pytest.approx(theirs.removed, rel=2e-3)


@pytest.mark.parametrize(
    ("edges", "text"),
    [
        ((0.29, 0.47), r"edge roll 1: position \(0\.29 m\) lies within the mould, .* at 0\.3 m"),
        ((0.4, 0.45), r"edge roll 2: diameter \(60 mm\) overlaps the previous roll by 10 mm at the "
                      r"narrow face, 50 mm below it"),
        ((0.47, 0.4), r"edge roll 2: position \(0\.4 m\) does not lie below the previous roll"),
    ],
)  # fmt: skip
def test_misplaced_edge_rolls_are_refused(edges: tuple[float, ...], text: str) -> None:
    with pytest.raises(InputError, match=text) as caught:
        edged(edges)
    assert len(str(caught.value).splitlines()) == 1


def test_shipped_slab_passes_mould_and_all_rolls() -> None:
    case = load_case(SHIPPED, ("casting.length=1 m", "output.fields=[]", "output.figures=false",
                               "coupling.interval=100 mm", "mesh.face_size=150 mm",
                               "mesh.corner_size=10 mm"))  # fmt: skip
    whole = run_in_memory(case)
    last = whole.samples[-1]
    assert last.position == pytest.approx(1.0)
    wide, narrow = beds_of(last)
    assert wide.force.min() > 1e4 and narrow.force.min() > 1e3
    # At the mould's exit the corner is as warm as the faces, neither 689 nor 1392 degC.
    exit_ = below(whole, 0.79).profiles
    corner, face = (exit_[n].temperature[0] for n in ("corner_intrados", "narrow_face"))
    assert abs(corner - face) < 150.0
