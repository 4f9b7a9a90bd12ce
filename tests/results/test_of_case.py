"""What is told from the case alone of results that no run of it has, against what runs have."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

from mpi4py import MPI

import pytest
from small_case import small

from castfem.base.result_registry import result_names
from castfem.model.build.simulation import Simulation, build
from castfem.model.shipped_cases import load
from castfem.physics.mechanics.planes import PlainPlanes
from castfem.runs.results.needs import fault_of, faults_of
from castfem.runs.results.registry import columns_of, results_of


@pytest.fixture(scope="module")
def thermal() -> Iterator[Simulation]:
    simulation = build(small({"output.shell_at": [0.7]}), MPI.COMM_SELF)
    yield simulation
    simulation.destroy()


def names_of(simulation: Any) -> set[str]:
    having = (*columns_of(simulation), *results_of(simulation))
    return {definition.named(probe) for definition, probe in having}


def test_results_of_a_thermal_run(thermal: Simulation) -> None:
    case, having = thermal.case, sorted(names_of(thermal))
    assert len(having) > 20 and "fs70_corner" in having
    assert faults_of(case, having) == [""] * len(having)
    others = [name for name in result_names() if name not in having]
    refused = {name for name, fault in zip(others, faults_of(case, others), strict=True) if fault}
    assert {"von_mises_max", "way_von_mises_max", "gap_corner", "mould_gap_max"} <= refused
    assert {"surface_temperature_tip", "size_mid_face", "negative_strip_time"} <= refused


def test_results_of_a_slice_in_its_mould(thermal: Simulation) -> None:
    case = load("billet125/taper_1")
    law = SimpleNamespace(data=object())
    strained = SimpleNamespace(
        slice=SimpleNamespace(
            law=law, interactions=[SimpleNamespace(has_friction=True)], planes=PlainPlanes()
        )
    )
    like = SimpleNamespace(
        case=case, strained=strained, probes=thermal.probes,
        centred_probes=thermal.centred_probes, zones=thermal.zones,
    )  # fmt: skip
    having = sorted(names_of(like))
    assert "contact_sticking" in having and "gap_corner" in having
    assert faults_of(case, having) == [""] * len(having)
    assert fault_of(case, "negative_strip_time").startswith(
        "is none of this case, for it has no [mould.oscillation]; "
    )


def test_what_is_missing_is_named() -> None:
    case = small()
    assert fault_of(case, "gap_max") == (
        "is none of this case, for it has no [mechanics] and [mould]; "
        "add it, or name another result"
    )
    assert fault_of(case, "shell_tip") == (
        'has no place "tip" on this section; allowed: mid_face, narrow_face, corner'
    )
    assert fault_of(case, "fs70_corner") == "is not followed; give output.shell_at = [0.7]"
