"""A cast from the empty machine to its tail: mass and heat that enter, leave and remain."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_case import strip
from small_caster import caster

import castfem
from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.model import Case
from castfem.model.caster_slices import followed, slice_of, starts_of
from castfem.post.plots.caster_figures import strand_figure
from castfem.post.report.caster import answers
from castfem.runs.caster.files import read_table
from castfem.runs.caster.run import run_caster
from castfem.runs.caster.strand import Strand

COOL = {"law": "convection", "coefficient": "1500 W/(m^2 K)", "ambient": "25 degC"}
PLANT = {"time": ["0 s", "2 s", "12 s", "60 s"],
         "speed": ["0 m/min", "0 m/min", "1 m/min", "1 m/min"]}  # fmt: skip
BEGAN, ENDED, LENGTH, SPACING = 1.0, 25.0, 0.5, 0.04
"""s, s, m, m"""


def full_cast(**changes: Any) -> Case:
    """Return a thin strip, cooled uniformly, from rest to the tail."""
    table = {
        "plant": PLANT, "spacing": f"{SPACING} m", "every": "1 s", "cast_from": f"{BEGAN} s",
        "cast_until": f"{ENDED} s", **changes,
    }  # fmt: skip
    zone = {"name": "all along", "surface": [COOL]}
    return strip({"casting.length": f"{LENGTH} m", "cooling": [zone], "caster": table})


def cast(until: Array | float) -> Any:
    """Return the cast length, m, by hand."""
    ramp = np.clip(np.asarray(until) - 2.0, 0.0, 10.0)
    return (0.05 * ramp**2 + np.maximum(np.asarray(until) - 12.0, 0.0)) / 60.0


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Case, Path]:
    """Return the case and the folder of its caster."""
    case, folder = full_cast(), tmp_path_factory.mktemp("cast")
    run_caster(case, folder)
    return case, folder


def test_strand_reaches_from_its_tail_to_its_head(made: tuple[Case, Path]) -> None:
    case, folder = made
    strand, _, _ = read_table(folder / "strand.csv")
    numbers, _, _ = read_table(folder / "caster.csv")
    time = numbers["time"]
    assert time[0] == BEGAN and time[-1] == 60.0
    starts = starts_of(case)
    assert starts[0] == BEGAN and starts[-1] == ENDED
    for now, count in zip(time, numbers["slices"], strict=True):
        places = strand["position"][strand["clock"] == now]
        assert len(places) == count
        if cast(now) < LENGTH:  # the head is still in the machine
            assert places.max() == pytest.approx(cast(now), abs=1e-8)
        if now >= ENDED and count:
            assert places.min() == pytest.approx(cast(now) - cast(ENDED), abs=1e-6)
    assert numbers["slices"][0] == 1
    out = time > ENDED + LENGTH * 60.0 - 0.5
    assert out.any() and not numbers["slices"][out].any() and numbers["slices"][~out].all()


def test_pool_follows_the_head_and_ends_before_the_tail(made: tuple[Case, Path]) -> None:
    case, folder = made
    numbers, _, _ = read_table(folder / "caster.csv")
    time, pool = numbers["time"], numbers["metallurgical_length"]
    slices, _, _ = read_table(folder / "slices.csv")
    starts = np.array(starts_of(case))
    ages = [
        np.interp(cast(start) + place, cast(fine), fine) - start
        for start, place in zip(starts, slices["metallurgical_length"], strict=True)
        if start > 3.0  # the place says little about the head, which is at rest
        for fine in [np.linspace(0.0, 60.0, 60001)]
    ]
    solid_after = float(np.mean(ages))
    assert np.ptp(ages) < 1.5e-2 * solid_after and 5.0 < solid_after < 25.0
    head = time < BEGAN + 0.98 * solid_after
    assert pool[head] == pytest.approx(cast(time[head]), abs=1e-8)
    steady = (time > BEGAN + 1.05 * solid_after) & (time < ENDED + 0.9 * solid_after)
    expected = cast(time) - cast(time - solid_after)
    assert steady.sum() > 10 and pool[steady] == pytest.approx(expected[steady], abs=5e-3)
    assert np.isnan(pool[time > ENDED + 1.02 * solid_after]).all()
    text = "\n".join(answers(folder, case))
    assert "no slice has liquid at" in text and "leaves the machine" not in text


def test_mass_and_heat_are_balanced(made: tuple[Case, Path]) -> None:
    case, folder = made
    numbers, _, _ = read_table(folder / "caster.csv")
    rows, _, _ = read_table(folder / "strand.csv")
    slices, _, _ = read_table(folder / "slices.csv")
    strand = Strand(case)
    length = np.array([strand.length_of(i + 1) for i in range(len(strand.starts))])
    strand.destroy()
    assert length.sum() == pytest.approx(cast(ENDED), rel=1e-6)
    heat, every = 0.0, 1.0  # J of the whole strand, s
    for i, now in enumerate(numbers["time"]):
        inside = rows["slice"][rows["clock"] == now].astype(int) - 1
        gone = slices["slice"][slices["left"] <= now + 1e-9].astype(int) - 1
        entered = cast(min(now, ENDED))
        left = max(0.0, min(cast(now) - LENGTH, cast(ENDED)))
        # Each slice represents the length after it, the youngest also the length just cast.
        assert -1e-6 <= length[inside].sum() + length[gone].sum() - entered <= SPACING + 1e-6
        assert -1e-6 <= length[gone].sum() - left <= SPACING + 1e-6
        removed = float(length[inside] @ rows["heat_removed"][rows["clock"] == now])
        removed += float(length[gone] @ slices["heat_removed"][: len(gone)])
        if i:
            given = 1e3 * numbers["cooling_power"][i] * every
            assert removed - heat == pytest.approx(given, rel=1e-6, abs=1e-3)
        heat = removed
    assert np.abs(numbers["energy_error"]).max() < 1e-12 and heat > 0.0


def test_picture_has_no_strand_beyond_its_ends(made: tuple[Case, Path]) -> None:
    _, folder = made
    axes = strand_figure(folder, "a cast", LENGTH).axes
    shell = next(a.collections[0] for a in axes if a.collections).get_array()
    assert shell is not None
    seen = ~np.ma.getmaskarray(shell)
    time = read_table(folder / "caster.csv")[0]["time"]
    top = np.maximum(cast(time) - cast(np.minimum(time, ENDED)), 0.0)
    share = np.maximum(np.minimum(cast(time), LENGTH) - top, 0.0) / LENGTH
    drawn = seen.mean(axis=0)  # above the tail by the distance of slices
    assert (drawn > share - 0.01).all() and (drawn < share + SPACING / LENGTH + 0.01).all()
    head = cast(time) < LENGTH
    assert head.sum() > 20 and drawn[head & (time < ENDED)] == pytest.approx(
        share[head & (time < ENDED)], abs=0.01
    )


def test_slice_of_the_start_is_the_run_of_its_case(made: tuple[Case, Path]) -> None:
    case, folder = made
    slices, _, _ = read_table(folder / "slices.csv")
    strand = Strand(case)
    for number in (1, 4):
        result = castfem.run(slice_of(strand.base, strand.starts[number - 1]))
        last = result.history.iloc[-1]
        for name in ("time", "heat_removed", "surface_temperature_chill"):
            if name in slices:
                assert last[name] == slices[name][number - 1], name
    strand.destroy()


def test_steady_cast_until_the_tail() -> None:
    case = caster({"caster.cast_until": "3.2 s"})
    starts = starts_of(case)
    assert starts[-1] == 3.2 and starts[0] < -1.0
    assert len(followed(case)) == len(starts) and min(followed(case)) > 0.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"cast_from": None}, "begins with the strand at rest; .* or empty with cast_from"),
        ({"cast_from": "70 s"}, r"cast_from: \(70 s\): the plant's history goes from 0 s to 60 s"),
        ({"start": "0.5 s"}, r"start: \(0.5 s\): the cast begins at 1 s"),
        ({"cast_until": "0.5 s"}, r"cast_until: \(0.5 s\): .*, the cast begins at 1 s"),
        ({"cast_until": "61 s"}, r"cast_until: \(61 s\): the plant's history goes"),
    ],
)
def test_impossible_ends_are_refused(changes: dict[str, Any], message: str) -> None:
    if changes.get("cast_from", "") is None:
        table = {"plant": PLANT, "spacing": "40 mm", "every": "1 s"}
        with pytest.raises(InputError, match=message):
            strip({"casting.length": "0.5 m", "caster": table})
        return
    with pytest.raises(InputError, match=message):
        full_cast(**changes)
