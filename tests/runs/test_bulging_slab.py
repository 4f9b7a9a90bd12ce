"""A slab whose wide faces bulge between their rolls: strip and slice together."""

from __future__ import annotations

from copy import deepcopy
from itertools import pairwise
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from interrupted import history_of
from runs.billet_runs import Kept, run_in_memory, simulated
from runs.bulging_slab import ROLLS, SLAB, below, rolls_of, slab

from castfem.base.errors import InputError, RunFailure
from castfem.model import Case
from castfem.model.build.shell_prediction import ShellPrediction
from castfem.model.build.simulation import build
from castfem.physics.constitutive.flow_laws import RadialReturn
from castfem.physics.machine.bulging import CreepingStrip, ElasticStrip, Shell, Span, stiffness
from castfem.runs.results.mechanical import MechanicalSampler
from castfem.runs.results.sample import Sample


def offset(position: float) -> float:
    """Return the offset of the rolls from the first one, m."""
    return float(np.interp(position, ROLLS, [0.0, -0.1e-3, -0.15e-3]))


@pytest.fixture(scope="module")
def creeping() -> Kept:
    return run_in_memory(slab())


def test_mid_face_moves_as_the_strip(creeping: Kept) -> None:
    between = [s for s in creeping.samples if ROLLS[0] < s.position < ROLLS[-1]]
    assert max(rolls_of(s).memory["largest"].max() for s in between) > 10e-6
    for sample in between:
        bed = rolls_of(sample).beds["wide_face_intrados"]
        assert bed.offset == pytest.approx(offset(sample.position), abs=1e-9)
        assert bed.within == 1.0  # its core is liquid
        moved = sample.strained.moved["mid_face"]
        # The edges also hold the face, more so the narrower it is.
        assert moved == pytest.approx(bed.bulge + bed.offset, abs=8e-6)
    assert sum(s.position in ROLLS for s in creeping.samples) == len(ROLLS)


def entered(kept: Kept, roll: int) -> Sample:
    """Return the first sample beyond a roll."""
    return below(kept, ROLLS[roll])


def half_way(roll: int) -> float:
    """Return the time at which the slice is in the middle of a pitch, s."""
    return 0.5 * (ROLLS[roll] + ROLLS[roll + 1]) / 0.02


def shell_of(sample: Sample, time: float) -> tuple[Shell, RadialReturn]:
    """Return the shell at mid-face, predicted for a later time (s), and the law of the case."""
    with simulated(slab()) as simulation:
        law, solidus = simulation.mechanics.problem.slice.law, simulation.steel.solidus
        profile = simulation.probes.sample(sample.state.thermal.point.temperature)["mid_face"]
        profile = ShellPrediction(simulation.steel).later(profile, time - sample.time)
    depth, heat = profile.depth, profile.temperature
    shell = Shell(profile.isotherm_depth(solidus), lambda d: np.interp(d, depth, heat))
    return shell, law  # type: ignore[return-value]


def test_bulge_is_that_of_the_strip(creeping: Kept) -> None:
    above, sample = entered(creeping, 0), entered(creeping, 1)
    state, (shell, law) = rolls_of(sample), shell_of(sample, half_way(1))
    assert state.memory["thickness"][0] == pytest.approx(shell.thickness, rel=1e-9)
    pressure = float(state.memory["load"][0]) / (ROLLS[2] - ROLLS[1])
    assert pressure == pytest.approx(1.2 * 9.81 * 7400.0, rel=0.01)
    strip = CreepingStrip(law).bulge(Span(ROLLS[2] - ROLLS[1], pressure, 0.02), shell)
    assert state.memory["largest"][0] == pytest.approx(strip.largest, rel=1e-6)
    bulge = state.beds["wide_face_intrados"].bulge
    assert bulge == pytest.approx(float(strip.at(sample.position - ROLLS[1])), rel=1e-6)
    # A roll takes half of the load of the pitch above and half of that below it.
    loads = [rolls_of(s).memory["load"][0] for s in (above, sample)]
    assert state.memory["force"][0] == pytest.approx(0.5 * sum(loads), rel=1e-12)


def test_elastic_and_thesis_are_the_closed_forms() -> None:
    elastic, thesis, sheared = (
        entered(run_in_memory(slab(mechanics__bulging=model, casting__length="0.95 m")), 0)
        for model in ("elastic", "thesis", {"model": "elastic", "shear": True})
    )
    length, memory = ROLLS[1] - ROLLS[0], rolls_of(elastic).memory
    shell, law = shell_of(elastic, half_way(0))
    span = Span(length, float(memory["load"][0]) / length, 0.02)
    exact = ElasticStrip(law.elasticity).bulge(span, shell).largest
    assert memory["largest"][0] == pytest.approx(exact, rel=1e-6)
    more = span.pressure * length**2 / 8.0 * stiffness(law.elasticity, shell.points()).shear
    assert rolls_of(sheared).memory["largest"][0] == pytest.approx(exact + more, rel=1e-6)
    ratio = (0.4 / length) ** 2
    plate = 384.0 * 4.0 * ratio**2 / (12.0 * np.pi**4 * (ratio**2 + 2.0 / 3.0 * ratio + 1.0))
    assert rolls_of(thesis).memory["largest"][0] / exact == pytest.approx(plate, rel=1e-6)


def test_stop_just_below_a_roll_counts_by_mean_speed() -> None:
    """The strand stops for 10 s at 5 mm below the first roll, where its speed is 0."""
    stop = {"time": [44.75, 45.75, 55.75, 56.75], "time_unit": "s", "value": [1.2, 0, 0, 1.2],
            "unit": "m/min"}  # fmt: skip
    kept = run_in_memory(slab(casting__speed=stop, casting__length="0.92 m"))
    stopped = entered(kept, 0)
    assert stopped.position == pytest.approx(0.905) and stopped.time == pytest.approx(45.75)
    begun, ended = 45.75 - np.sqrt(0.5), 66.0
    shell, law = shell_of(stopped, 0.5 * (begun + ended))
    memory, length = rolls_of(stopped).memory, ROLLS[1] - ROLLS[0]
    # It reaches 0.9 m while it brakes, and 1.1 m at 56.75 s + (1.1 - 0.915) m / 0.02 m/s.
    span = Span(length, float(memory["load"][0]) / length, length / (ended - begun))
    bulge = CreepingStrip(law).bulge(span, shell)
    assert memory["largest"][0] == pytest.approx(bulge.largest, rel=1e-3)


def test_plate_is_scaled_to_a_reference_over_position() -> None:
    largest = {"position": [0, 2], "position_unit": "m", "value": [1, 3], "unit": "mm"}
    given = {"model": "thesis", "largest": largest}
    kept = run_in_memory(slab(mechanics__bulging=given, casting__length="0.95 m"))
    assert rolls_of(kept.samples[-1]).memory["largest"] == pytest.approx(np.full(2, 2e-3), rel=1e-6)


def test_full_strand_does_not_drift_sideways() -> None:
    """Below the mould nothing supports the narrow faces: only a weak spring holds it sideways."""
    whole = run_in_memory(
        slab(section__symmetry="whole", mechanics__bulging="elastic", casting__length="1 m")
    )
    below = [s.strained.moved for s in whole.samples if s.position > ROLLS[0] + 1e-6]
    assert len(below) > 1 and all(moved["narrow_face"] > 1e-6 for moved in below)
    for moved in below:
        assert moved["narrow_face_left"] == pytest.approx(moved["narrow_face"], abs=1e-9)


def test_half_bulges_as_the_full_section(creeping: Kept) -> None:
    whole = run_in_memory(slab(section__symmetry="whole", casting__length="1.15 m")).samples
    assert rolls_of(whole[-1]).memory["deflection"].any()
    for ours, theirs in zip(creeping.samples[: len(whole)], whole, strict=True):
        one, other = (rolls_of(s).memory["deflection"] for s in (ours, theirs))
        assert one == pytest.approx(other, abs=1e-8)
        left, right = (s.strained.moved["mid_face"] for s in (ours, theirs))
        assert left == pytest.approx(right, abs=1e-7)


def test_axial_strain_of_the_strip_is_added_to_the_shell(creeping: Kept) -> None:
    """At mid-width that of the strip at its depth; none in the core and at the narrow face."""
    with_strain = slab(mechanics__bulging={"model": "creep", "axial_strain": True})
    with simulated(with_strain) as simulation:
        (rolls,) = simulation.mechanics.problem.slice.interactions
        foundation, memory = rolls.foundation, rolls_of(entered(creeping, 0)).memory
        begun, end = (simulation.machine.time_at(ROLLS[0] + way) for way in (0.05, 0.1))
        thickness = float(memory["thickness"][0])
        depth = np.array([0.0, 0.5 * thickness, 0.049])
        places = np.array([[x, side * (0.05 - d)] for side in (1, -1) for x in (0.0, 0.2)
                           for d in depth])  # fmt: skip
        found = foundation.axial_strain(memory, memory, begun, end, places).reshape(2, 2, 3)
    ends = [np.interp([0.05, 0.1], memory["z"][0], memory[name][0]) for name in
            ("axial_strain", "curvature")]  # fmt: skip
    stretched, bent = (float(b - a) for a, b in ends)
    middle = stretched + bent * (memory["neutral"][0] - depth)
    assert found[:, 0, :2] == pytest.approx(np.tile(middle[:2], (2, 1)), rel=1e-6)
    assert abs(middle[0]) > 1e-6 and middle[0] * middle[1] != 0.0
    assert not found[:, 0, 2].any() and not found[:, 1].any()


def test_bulge_strains_the_front() -> None:
    """Each point of the front takes the strain of the strip at its depth, from roll to slice.

    This continues beyond the inner side of the shell, where the slice has the front: checked by
    hand from the bulge. The damage of a slab rises by it.
    """
    bulging = {"model": "creep", "axial_strain": True}
    kept = run_in_memory(slab(mechanics__bulging=bulging))
    states = [s.mechanical for s in kept.states if s.mechanical is not None]
    memory = rolls_of(entered(kept, 1)).memory
    thickness, neutral = float(memory["thickness"][0]), float(memory["neutral"][0])
    with simulated(slab(mechanics__bulging=bulging)) as simulation:
        interactions = simulation.mechanics.problem.interactions
        depth = np.array([0.002, thickness + 0.003])
        places = np.column_stack([np.zeros(2), 0.05 - depth])
        found, at = np.zeros(2), []
        for before, after in pairwise(states):
            position = simulation.machine.position(after.time)
            if ROLLS[1] < position <= ROLLS[1] + 0.1 + 1e-9:
                part = interactions.front_strain(before, after, places)
                assert part is not None
                found, at = found + part, [*at, position]
    assert at[-1] == pytest.approx(ROLLS[1] + 0.1) and len(at) == 2
    stretched, bent = (
        float(np.diff(np.interp([0.0, 0.1], memory["z"][0], memory[name][0]))[0])
        for name in ("axial_strain", "curvature")
    )
    assert found == pytest.approx(stretched + bent * (neutral - depth), rel=1e-6)
    assert found[1] * found[0] < 0.0 and abs(found).min() > 1e-6


def test_strain_of_the_front_contains_the_bulge(monkeypatch: pytest.MonkeyPatch) -> None:
    """By up to its strain in the middle of the faces, and by nothing near the narrow ones."""
    case = slab(
        mechanics__bulging={"model": "creep", "axial_strain": True},
        quality={"hot_tearing": ["won"]},
    )
    taken = []
    for followed in (True, False):
        if not followed:
            monkeypatch.setattr(MechanicalSampler, "front_strain", lambda *given: 0.0)
        tearing = run_in_memory(case).samples[-1].judged.tearing
        taken.append(tearing.history.axial)
    simulation = build(case, MPI.COMM_SELF)
    x = simulation.section.vertex_space.tabulate_dof_coordinates()[:, 0]
    simulation.destroy()
    more = taken[0] - taken[1]
    assert more.max() > 1e-6 and np.abs(more).max() < 1e-3
    assert not more[np.abs(x) > 0.199].any()


def test_axial_strain_of_the_strip_stresses_the_face(creeping: Kept) -> None:
    kept = run_in_memory(slab(mechanics__bulging={"model": "creep", "axial_strain": True}))
    at = [s.position for s in creeping.samples]
    assert at == pytest.approx([s.position for s in kept.samples])
    with simulated(slab()) as simulation:
        points = simulation.mechanics.problem.points
        x, y = points.position[: points.deviator_points].T
    near = np.flatnonzero((x < 0.04) & (y > 0.047))
    stresses = []
    for run in (creeping, kept):
        states = [state.mechanical for state in run.states]
        stresses.append([s.stress[near, 2].mean() for s in states if s is not None])
    plain, bent = np.array(stresses)
    balances = [s.strained.balance for s in kept.samples[1:]]
    assert max(abs(b.axial_error) for b in balances if b is not None) < 1e-6
    # The surface is stretched up to the middle of a pitch, and compressed beyond it.
    middle = [k for k, z in enumerate(at) if any(abs(z - r - 0.1) < 1e-6 for r in ROLLS[:2])]
    assert len(middle) == 2
    assert np.all((bent - plain)[middle] > 2e6)
    assert plain[:2] == pytest.approx(bent[:2])


@pytest.mark.mpi
def test_ranks_agree() -> None:
    creep = {"model": "creep", "axial_strain": True}
    given = slab(mechanics__bulging=creep, casting__length="1.15 m")
    one, several = (run_in_memory(given, comm) for comm in (MPI.COMM_SELF, MPI.COMM_WORLD))
    for ours, theirs in zip(one.samples, several.samples, strict=True):
        both = [rolls_of(s).memory["deflection"] for s in (ours, theirs)]
        assert both[0] == pytest.approx(both[1], rel=1e-6, abs=1e-10)
        moved = [s.strained.moved["mid_face"] for s in (ours, theirs)]
        assert moved[0] == pytest.approx(moved[1], rel=1e-5, abs=1e-9)


def strained_along() -> Case:
    """Return a case whose checkpoint has the axial strain of the strip and of the front."""
    return slab(
        mechanics__bulging={"model": "creep", "axial_strain": True},
        quality={"hot_tearing": ["won"]},
    )


@pytest.fixture(scope="module")
def never_stopped(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Return the history of the uninterrupted run."""
    return history_of(strained_along(), tmp_path_factory.mktemp("whole"))


@pytest.mark.parametrize("steps", [2, 4])
def test_run_resumes_byte_for_byte(tmp_path: Path, never_stopped: bytes, steps: int) -> None:
    """Stopped within a pitch: its bulge is not computed again from another temperature."""
    ours = history_of(strained_along(), tmp_path, steps)
    assert ours == never_stopped
    header = ours.splitlines()[0].decode()
    for column in ("bulge_intrados [mm]", "bulge_extrados [mm]", "bulge_pitch [mm]",
                   "roll_force [kN/m]"):  # fmt: skip
        assert column in header


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"machine": None}, r"mechanics\.bulging: needs rolls, the table \[machine\]"),
        ({"mechanics__ferrostatic": "off"}, r"mechanics\.bulging: needs the pressure"),
        (
            {"mechanics__held": [{"on": ["wide_face_intrados"], "component": "y"}]},
            r"mechanics\.held\.0: moves the wide faces, which the rolls bear",
        ),
        (
            {"mechanics__bulging": {"model": "thesis", "shear": True}},
            r'bulging\.shear: is for a strip, not for model = "thesis"',
        ),
    ],
)
def test_cases_that_cannot_bulge_are_refused(changes: dict[str, object], text: str) -> None:
    with pytest.raises(InputError, match=text):
        slab(**changes)


def solid(*apertures: str) -> Kept:
    """Run a slab that is solid throughout, on rolls."""
    profile = {"depth": [0, 50], "depth_unit": "mm", "value": [950, 1250], "unit": "degC"}
    start = {**SLAB["casting"], "start": {"at": "mould_exit", "profile": profile}}
    return run_in_memory(slab(casting=start, machine__rolls__aperture=list(apertures)))


def test_solid_core_neither_bulges_nor_is_pulled() -> None:
    """It shrinks away from its rolls; a foundation that pulls would follow it with 10 kN/m."""
    kept = solid("100 mm", "100 mm", "100 mm")
    for sample in kept.samples[1:]:
        state = rolls_of(sample)
        assert not state.memory["largest"].any() and not state.memory["force"].any()
        assert state.beds["wide_face_intrados"].pressure == 0.0
    last = rolls_of(kept.samples[-1])
    bed = last.beds["wide_face_extrados"]
    assert bed.stiffness > 1e9 and bed.within < 2e-3
    assert np.all(last.moved[:2] < -20e-6) and bed.rest == 0.0
    pull = bed.stiffness * 20e-6 * 0.2  # of half of the face
    assert pull > 5e3 and np.abs(last.force[:2]).max() < 2e-3 * pull


@pytest.mark.parametrize("mush", ["full", "proportional"])
def test_pull_on_a_face_fades_as_the_core_freezes(mush: str) -> None:
    """A thin slab freezes through between its rolls, and shrinks away from them."""
    places = [0.9, 1.1, 1.3, 1.5, 1.7]
    kept = run_in_memory(
        slab(
            section__height="44 mm",
            casting__length="1.6 m",
            mesh={"surface_size": "4 mm", "face_size": "40 mm", "core_size": "6 mm"},
            machine__rolls__position=[f"{place} m" for place in places],
            machine__rolls__diameter=["120 mm"] * 5,
            machine__rolls__aperture=["44 mm"] * 5,
            mechanics__ferrostatic=mush,
        )
    )
    states = [rolls_of(s) for s in kept.samples if s.position > places[0] + 1e-6]
    beds = [state.beds["wide_face_intrados"] for state in states]
    shares = [bed.within for bed in beds]
    assert shares == sorted(shares, reverse=True) and shares[-1] == 1e-3
    assert len({round(c, 3) for c in shares}) > (2 if mush == "proportional" else 1)
    for state, bed in zip(states, beds, strict=True):
        gap = state.moved[0] - bed.rest
        # Half of the face, by the remaining share, and the pressure of its edges in addition.
        assert state.force[0] > 0.2 * bed.within * bed.stiffness * min(gap, 0.0) * 1.5
        assert bed.pressure <= bed.within * 1.7 * 7400.0 * 9.81
    assert states[-1].moved[0] < beds[-1].rest - 5e-6


def test_closing_rolls_press_a_solid_strand() -> None:
    kept = solid("100 mm", "99 mm", "98 mm")
    last = rolls_of(kept.samples[-1])
    bed = last.beds["wide_face_extrados"]
    assert bed.rest == pytest.approx(-1e-3)
    assert last.force[:2] == pytest.approx(0.2 * bed.stiffness * (last.moved[:2] + 1e-3), rel=1e-2)
    assert last.force[0] > 300e3


def test_pitch_too_wide_for_the_shell_ends_the_run() -> None:
    places = {"position": ["0.9 m", "2.4 m", "2.6 m"]}
    rolls = deepcopy(SLAB["machine"]["rolls"]) | places
    message = r"between the rolls at 0\.9 and 2\.4 m a shell of \d.* \(at most 75 mm\)"
    for model, creeps in (("creep", True), ("elastic", False)):
        with pytest.raises(RunFailure, match=message) as caught:
            run_in_memory(slab(machine={"rolls": rolls}, mechanics__bulging=model))
        assert ("a strip, held by its rolls alone" in str(caught.value)) == creeps


def test_strand_without_a_shell_ends_the_run() -> None:
    hot = deepcopy(SLAB["cooling"])
    hot[0]["surface"][0]["coefficient"] = "1 W/(m^2 K)"
    with pytest.raises(RunFailure, match=r"there is no shell between the rolls at 0\.9 and 1\.1 m"):
        run_in_memory(slab(cooling=hot))
