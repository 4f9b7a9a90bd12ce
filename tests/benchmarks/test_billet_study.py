"""Benchmarks of the billets in their moulds: what is read on the way, and what the tables make."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from benchmarks.billet_run import Listener, every, mesh, run

SMALL = (*mesh(3.0), every(0.25), "casting.length=150 mm")


def listener(**tracks: list[float]) -> Listener:
    return Listener(np.inf, tracks={name.replace("_", " ", 1): t for name, t in tracks.items()})


def test_places_are_found_between_two_windows() -> None:
    heard = listener(
        position=[0.0, 0.1, 0.2], surface_corner=[1800.0, 1700.0, 1600.0],
        gap_mid_face=[0.0, 0.0, 0.0], gap_corner=[0.0, 0.0, 0.004],
    )  # fmt: skip
    assert heard.cools_to("corner", 1725.0) == pytest.approx(75.0)
    assert np.isnan(heard.cools_to("corner", 1500.0))
    assert heard.lost() == pytest.approx(125.0)  # a quarter of 4 um is where contact is lost
    assert np.isnan(listener(position=[0.0, 0.1], gap_corner=[0.0, 0.0]).lost())


@pytest.fixture(scope="module")
def untapered() -> Iterator[dict[str, float]]:
    found = run("taper_0", SMALL)
    assert not found.failure
    yield dict(found.values)


def test_untapered_mould_loses_its_corner_after_it_has_frozen(untapered: dict[str, float]) -> None:
    assert untapered["first_mush"] < untapered["first_solid"] < untapered["closed_solid"] < 150.0
    assert 30.0 < untapered["lost"] < 130.0
    assert untapered["gap_max"] > 1e-3
    assert untapered["pressure_mean"] == pytest.approx(untapered["force"] / 62.5)
