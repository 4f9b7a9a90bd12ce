"""Moulds outside practice: a run ends correctly, or fails with a reason and its last good state."""

from __future__ import annotations

import json
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from runs.billet_runs import Kept, billet, run, run_in_memory, shipped

from castfem.base.errors import InputError, RunFailure
from castfem.runs.output.history import read_history

pytestmark = pytest.mark.slow

SHORT = 'casting.length="240 mm"'


def wall(*rows: tuple[float, float]) -> str:
    """Return a taper as a table: position below the meniscus and closing of the wall, mm."""
    where, closing = ([r[i] for r in rows] for i in (0, 1))
    return f'mould.taper={{position={where},position_unit="mm",value={closing},unit="mm"}}'


def sound(kept: Kept) -> Kept:
    """Check what must hold in any mould, in every window; return `kept`."""
    for sample in kept.samples[1:]:
        mechanics = sample.mechanics
        assert abs(sample.balance) < 1e-9
        assert mechanics.balance.forces_error < 1e-6 and mechanics.balance.axial_error < 1e-6
        assert mechanics.contact.penetration < 1e-6
        assert np.isfinite([mechanics.peak, mechanics.contact.pressure, mechanics.strain]).all()
        low, high = sample.temperature_range
        assert 293.0 < low <= high < 1543.0 + 273.0
    return kept


def contact(kept: Kept, name: str) -> np.ndarray:
    """Return a number of the contact summary over the windows."""
    found = [r.mechanics.contact for r in kept.samples[1:] if r.mechanics is not None]
    return np.array([getattr(c, name) for c in found])


def test_ten_percent_into_the_shell() -> None:
    """A shell of 6 s is squeezed by 10 %/m: it follows the wall and lengthens the strand."""
    squeezed = wall((0, 0), (300, 0), (301, 0.0625), (420, 0.81))
    kept = sound(run_in_memory(billet("taper_1", squeezed, 'casting.length="420 mm"')))
    assert contact(kept, "share")[-1] > 0.9
    assert kept.value("size_mid_face") == pytest.approx(0.125 - 2 * 0.81e-3, abs=2e-6)
    assert kept.value("contact_pressure_max") > 2e6
    assert kept.value("axial_strain") > 0.0


def test_liquid_surface_does_not_sink_into_the_wall() -> None:
    """80 um of overlap with a wall as soft as the liquid are pushed out as the surface freezes."""
    slow = "cooling.mould.surface.0.coefficient=250 W/(m^2 K)"
    liquid = "mechanics.liquid_stiffness=1e-5"
    kept = sound(run_in_memory(shipped("taper_1", slow, liquid, "casting.length=90 mm")))
    assert kept.samples[-1].shell["mid_face"] == 0.0
    assert contact(kept, "penetration").max() < 1e-9
    head = 7000.0 * 9.81 * 0.09
    assert kept.value("contact_pressure_max") == pytest.approx(head, rel=0.1)


def test_ten_percent_from_the_meniscus() -> None:
    kept = sound(run_in_memory(shipped("taper_1", "mould.taper=10 %/m", SHORT)))
    # As the first points freeze, at 1.75 s, a sixth of the surface is off by 2 um; later less.
    share = contact(kept, "share")
    assert np.delete(share, share.argmin()).min() > 0.85
    assert contact(kept, "gap").max() < 3e-6
    assert kept.value("von_mises_max") > 7e6


def test_ten_percent_away() -> None:
    """The wall leaves at once: the gap is its opening less the bulge of the strand."""
    kept = sound(run_in_memory(billet("taper_1", "mould.taper=-10 %/m", SHORT)))
    assert kept.value("contact_share") == 0.0
    opened = 0.5 * 0.125 * (1.0 - 1.0 / (1.0 - 0.1 * 0.6)) * 0.24 / 0.6
    points = kept.states[-1].mechanical.contact
    face = points.normal[:, 0] > 0.999
    assert np.ptp(points.gap[face]) > 2e-5
    # The gap differs along the face, point by point.
    assert points.place[face, 0] + points.gap[face] == pytest.approx(0.0625 - opened, abs=1e-12)
    # At mid-face, the end of a facet, it is that of the line through the two nearest points ...
    near, far = points.gap[face][np.argsort(points.place[face, 1])[:2]]
    gap, bulge = kept.value("gap_mid_face"), kept.value("displacement_mid_face")
    assert gap == pytest.approx(near + 0.5 * (np.sqrt(3.0) - 1.0) * (near - far), rel=1e-7)
    # ... from which the facet itself, of second order, bows away by 15 nm.
    assert gap + bulge == pytest.approx(-opened, rel=2e-5)


@pytest.mark.parametrize(("speed", "length"), [("18 m/min", "600 mm"), ("0.36 m/min", "60 mm")])
def test_casting_speed(speed: str, length: str) -> None:
    """Five times as fast, ten times as slow."""
    changes = (f"casting.speed={speed}", f'casting.length="{length}"')
    kept = sound(run_in_memory(shipped("taper_1", *changes)))
    assert (kept.value("shell_corner") > 5e-3) == (speed == "0.36 m/min")


SIX_SECONDS = 'casting.length="360 mm"'


@lru_cache
def in_tenths(name: str) -> Kept:
    """Run six seconds in the shipped windows of 0.1 s, once for all tests."""
    return run_in_memory(shipped(name, SIX_SECONDS, "coupling.interval=0.1 s"))


@pytest.mark.parametrize(
    ("name", "intervals"), [("taper_1", ("2 s",)), ("taper_0", ("2 s", "100 s"))]
)
def test_windows_twenty_times_longer(name: str, intervals: tuple[str, ...]) -> None:
    """Two seconds, and endless: heat within 1 %, stress within 10 % of windows of 0.1 s.

    Where the gap controls the heat, at 0 %/m, windows of 2 s would be 4.3 and 14 % off.
    """
    fine = in_tenths(name)
    for interval in intervals:
        long = sound(run_in_memory(shipped(name, SIX_SECONDS, f"coupling.interval={interval}")))
        assert long.value("heat_removed") == pytest.approx(fine.value("heat_removed"), rel=0.01)
        assert len(long.states) > 4  # cut where the surface freezes, however long they may be
        peak = fine.value("von_mises_max")
        assert long.value("von_mises_max") == pytest.approx(peak, rel=0.1)


def test_windows_are_cut_only_where_the_gap_opens() -> None:
    """At 0 %/m the gap opens as the surface freezes, after 1.5 s, and then ever more slowly."""
    changes = (SIX_SECONDS, "coupling.interval=1 s")
    kept = sound(run_in_memory(shipped("taper_0", *changes)))
    ends = np.array([s.time for s in kept.states])
    window = np.diff(ends)
    opening = (ends[:-1] > 1.2) & (ends[:-1] < 2.0)
    assert window[opening].max() < 0.4 and window[ends[:-1] > 3.0].max() > 0.6
    free = run_in_memory(shipped("taper_0", *changes, "coupling.window_error=1000 K"))
    assert np.allclose(np.diff([s.time for s in free.states]), 1.0)
    gap = [k.value("gap_max") for k in (kept, free)]
    of_tenths = in_tenths("taper_0").value("gap_max")
    assert gap[0] == pytest.approx(of_tenths, rel=0.1)
    assert gap[1] > 1.2 * of_tenths


def test_friction_up_to_the_pressure() -> None:
    """The wall pulls on the strand and lengthens it; coefficient 0 is as no friction."""
    found = {
        mu: sound(
            run_in_memory(shipped("taper_1", 'casting.length="105 mm"', f"mould.friction={law}"))
        )
        for mu, law in (
            (None, "none"),
            (0.0, '{law="coulomb", coefficient=0.0}'),
            (0.3, '{law="coulomb", coefficient=0.3}'),
            (1.0, '{law="coulomb", coefficient=1.0}'),
        )
    }
    for name in ("von_mises_max", "axial_strain", "heat_removed"):
        assert found[0.0].value(name) == pytest.approx(found[None].value(name), rel=1e-6)
    strains = [found[mu].value("axial_strain") for mu in (0.0, 0.3, 1.0)]
    assert strains[0] < strains[1] < strains[2]
    assert (contact(found[1.0], "axial")[-1]) != 0.0


@pytest.mark.parametrize("name", ["taper_1", "taper_0"])
def test_nearly_sharp_corner(name: str) -> None:
    changes = "section.corner_radius=0.5 mm", "mechanics.tolerance=1e-8", SHORT
    kept = sound(run_in_memory(shipped(name, *changes)))
    gap = kept.value("gap_corner")
    assert (gap > 5e-5) == (name == "taper_0")


def test_strong_cooling_converges() -> None:
    """At 20 kW/m2K the gap controls all heat: one iteration oscillates, several converge.

    A gap that opens in one window keeps the face hot in the next, which closes it.
    """
    strong = ("cooling.mould.surface.0.coefficient=20000 W/(m^2 K)", 'casting.length="75 mm"')
    face, not_converged = {}, {}
    for name, changes in (("plain", ("coupling.passes=1",)), ("repeated", ())):
        kept = sound(run_in_memory(billet("taper_1", *strong, *changes)))
        surface = [r.profiles["mid_face"].temperature[0] for r in kept.samples[-5:]]
        face[name] = np.abs(np.diff(surface, 2)).max()
        not_converged[name] = kept.summary.steps["coupling windows not converged"]
    assert face["repeated"] < 60.0 < 200.0 < face["plain"]
    assert not_converged["repeated"] == 0.0 < not_converged["plain"] == 5.0  # all windows


def test_windows_that_do_not_converge_are_cut_back() -> None:
    """Two iterations are not enough for full windows: shorter ones replace them."""
    strong = ("cooling.mould.surface.0.coefficient=20000 W/(m^2 K)", 'casting.length="45 mm"')
    kept = sound(run_in_memory(billet("taper_1", *strong, "coupling.passes=2")))
    assert kept.summary.steps["coupling windows"] > kept.samples[-1].time / 0.25 + 2
    assert kept.summary.steps["coupling windows cut back"] > 1


def test_gap_that_hardly_conducts() -> None:
    """A third of the shipped conductivity where the wall leaves at -3 %/m: a thin hot shell.

    Farther down, at 317 mm, its corner melts open: a breakout.
    """
    little = "cooling.mould.surface.0.gap_conductivity=0.05 W/(m K)"
    changes = ('casting.length="120 mm"', "coupling.interval=0.1 s")
    kept = sound(run_in_memory(shipped("taper_minus_3", little, *changes)))
    assert kept.value("gap_corner") > 50e-6
    assert kept.value("heat_removed") < run_in_memory(shipped("taper_minus_3", *changes)).value(
        "heat_removed"
    )


def test_liquid_rotates_with_flat_cells() -> None:
    """Its pressure is most of their load: windows had been cut to 1e-7 s, 33 mm down."""
    flat = ("surface_size=1.2 mm", "corner_size=1.2 mm", "face_size=8 mm", "core_size=12 mm")
    changes = ('casting.length="60 mm"', "coupling.interval=0.1 s", *(f"mesh.{f}" for f in flat))
    kept = sound(run_in_memory(shipped("taper_minus_3", *changes)))
    steps = kept.summary.steps
    assert steps["coupling windows cut back"] == 0
    assert steps["Newton iterations, mechanics"] < 8 * steps["coupling windows"]


def test_cold_mould() -> None:
    cold = sound(run_in_memory(shipped("taper_1", SHORT, "cooling.mould.surface.0.wall=20 degC")))
    warm = run_in_memory(shipped("taper_1", SHORT))
    assert cold.value("heat_removed") > 1.05 * warm.value("heat_removed")


def test_step_in_the_wall() -> None:
    """Half a millimetre within 1 mm of mould, in and out, against a shell of 2.5 s."""
    inward = sound(run_in_memory(billet("taper_1", SHORT, wall((0, 0), (150, 0), (151, 0.5)))))
    assert inward.value("size_mid_face") == pytest.approx(0.124, abs=2e-6)
    outward = sound(run_in_memory(billet("taper_1", SHORT, wall((0, 0), (150, 0), (151, -0.5)))))
    assert outward.value("contact_share") == 0.0
    assert outward.value("gap_mid_face") > 0.3e-3
    assert outward.value("heat_removed") < 0.9 * inward.value("heat_removed")


def test_strand_that_touches_nowhere() -> None:
    kept = sound(
        run_in_memory(billet("taper_1", SHORT, "mould.width=140 mm", "mould.height=140 mm"))
    )
    assert not contact(kept, "length").any() and not contact(kept, "pressure").any()
    assert kept.value("gap_max") > 7e-3 and kept.value("shell_mid_face") == 0.0
    assert abs(contact(kept, "axial")).max() == 0.0


def test_contact_lost_and_regained() -> None:
    """Waves of 0.1 mm in the wall, less than three windows long: contact comes and goes."""
    waves = [(20.0 * i, 0.1 * (i % 2)) for i in range(13)]
    kept = sound(run_in_memory(billet("taper_1", 'casting.length="130 mm"', wall(*waves))))
    change = np.diff(contact(kept, "share"))
    assert (change > 0.1).sum() >= 3 and (change < -0.1).sum() >= 3
    assert kept.summary is not None and kept.summary.steps["coupling windows cut back"] < 5


def test_impossible_moulds_are_refused() -> None:
    with pytest.raises(InputError, match="does not fit the strand"):
        billet("taper_1", "mould.width=124 mm")
    with pytest.raises(InputError, match="allowed: at most 50 %/m"):
        billet("taper_1", "mould.taper=-200 %/m")


def test_failure_is_reported_with_the_last_good_state(tmp_path: Path) -> None:
    """Five Newton iterations are too few for shells that freeze at once, at any step.

    The run reports it, and keeps the state before.
    """
    strong = ("cooling.mould.surface.0.coefficient=10000 W/(m^2 K)", "coupling.interval=1 s")
    few = ("coupling.order=mechanics_first", "mechanics.solver.snes_max_it=5")
    case = billet("taper_1", SHORT, *strong, *few)
    with pytest.raises(RunFailure) as caught:
        run(case, tmp_path)
    for part in ("mechanics", "smallest step", "DIVERGED_MAX_IT"):
        assert part in str(caught.value)
    record = json.loads((tmp_path / "run.json").read_text())
    assert record["status"] == "failed" and record["reason"] == str(caught.value)
    last = read_history(tmp_path / "history.csv").iloc[-1]
    assert record["reached"]["time"] == pytest.approx(last["time"], rel=1e-11)
    assert last["time"] > 0.2
    assert last["penetration"] < 1.0 and abs(last["force_error"]) < 1e-6
    assert (tmp_path / "checkpoint.h5").is_file()
