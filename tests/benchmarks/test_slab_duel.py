"""The slab of castfem and that of the plain script are one problem."""

from __future__ import annotations

from mpi4py import MPI

import numpy as np
import pytest

from benchmarks import slab_duel
from castfem.model import from_document
from castfem.model.build.simulation import build, build_mesh

pytest.importorskip("skfem", reason="scikit-fem is an extra: pip install 'castfem[benchmark]'")

from benchmarks import plain_heat, slab_opponent

END = 1.07  # m: past two rolls, a spray on each face, run-off water


def test_the_same_triangles_and_steps_give_the_same_surface() -> None:
    """Lumped storage on triangles is the vertex rule: what is left is Newton's tolerance."""
    keys = (*slab_duel.lengths(10.0, 60.0, 120.0), "mesh.cell=triangle")
    document = slab_duel.slab(*keys, end=END).document()
    document["thermal"]["time"] = {"scheme": "backward_euler", "step": "1 s"}
    case = from_document(document, "slab")
    ours = slab_duel.follow(case)
    simulation = build(case, MPI.COMM_SELF)
    steel = slab_duel.steel_of(simulation, 0.02)
    simulation.destroy()
    caster, mesh = slab_opponent.Caster(slab_duel.FOLDER, steel), build_mesh(case)
    script = slab_opponent.Slab(plain_heat.mesh_from(mesh.points, mesh.cells), caster, END)
    for change in script.changes:  # where something else begins, both have a step's end
        assert np.abs(ours.position - change).min() < 1e-6
    theirs = slab_opponent.advance(
        script, (ours.position / caster.speed).tolist(), "backward_euler"
    )
    assert ours.mid_face[-1] < 1200.0
    for name in ("mid_face", "corner"):
        np.testing.assert_allclose(
            getattr(ours, name), getattr(theirs, name), rtol=0, atol=5e-3, err_msg=name
        )
    np.testing.assert_allclose(ours.heat, theirs.heat, rtol=1e-6)


def test_steps_of_the_script_go_from_change_to_change() -> None:
    steel = slab_opponent.Steel(*(np.array([0.0, 1500.0]) * k for k in (1, 5e6, 30, 0)), 1500.0)
    caster = slab_opponent.Caster(slab_duel.FOLDER, steel)
    mesh = slab_opponent.tensor_mesh(caster, 0.02, 0.02, 0.1, 0.05)
    slab = slab_opponent.Slab(mesh, caster, 1.0, "cg")
    changes = np.array(slab.changes) / caster.speed
    for first in (None, 0.05):
        instants = np.array(slab.instants(0.5, first))
        assert np.diff(instants, prepend=0.0).max() < 0.5 + 1e-9
        assert np.abs(instants[:, None] - changes).min(axis=0).max() < 1e-9
        after = instants[np.searchsorted(instants, changes[0] + 1e-9)] - changes[0]
        assert after < 0.05 + 1e-9 if first else after > 0.1


def test_table_has_the_cheapest_run_of_each_code_within_a_level() -> None:
    def row(code: str, steps: str, error: float, seconds: float) -> dict[str, object]:
        return {
            "code": code, "how": code, "scheme": "s", "steps": steps, "surface_size_mm": error,
            "mid_face_K": error, "corner_K": 0.1, "heat_percent": 0.01, "seconds": seconds,
        }  # fmt: skip

    rows = [
        row("castfem", "1 K", 1.5, 2.0), row("castfem", "1 K", 0.5, 8.0),
        row("scikit-fem", "0.1 s", 1.6, 3.0), row("scikit-fem", "0.1 to 1 s", 1.4, 1.0),
        row("castfem", "1 K", 1.5, 9.0),
    ]  # fmt: skip
    lines = slab_duel.verdict(slab_duel.best_of(rows))
    assert [line["code"] for line in lines] == list(slab_duel.KINDS) * len(slab_duel.LEVELS)
    ours, even, growing = lines[3:6]
    assert ours["seconds"] == 2.0 and (even["ratio"], growing["ratio"]) == (1.5, 0.5)
    assert lines[6]["seconds"] == 8.0
    assert lines[7]["how"] == "not reached" and "ratio" not in lines[7]
