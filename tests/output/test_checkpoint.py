"""checkpoint.h5: is restored bit by bit, survives a kill, and reports its faults."""

from __future__ import annotations

import json
import math
import os
import random
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from synthetic_run import printed

import castfem
from castfem.base.errors import InputError, RunFailure
from castfem.runs.output import checkpoint
from castfem.runs.output.checkpoint import load_checkpoint, save_checkpoint
from castfem.runs.output.run_record import RunRecord

pytestmark = pytest.mark.slow


META = {"time": 1 / 3, "steps": 41, "zone": "mould", "nested": {"rates": [0.1, -1e-300]}}


def arrays() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(3)
    return {
        "temperature": rng.random(1000),
        "thermal/old": rng.random((10, 3)),
        "flags": rng.random(7) > 0.5,
        "index": np.arange(5, dtype=np.int32),
        "empty": np.zeros((0, 3)),
        "scalar": np.array(math.pi),
        "odd": np.array([np.nan, np.inf, -0.0, 5e-324]),
        "strided": np.arange(12.0).reshape(3, 4).T,
    }


def test_meta_and_arrays_are_restored_bit_by_bit(tmp_path):
    save_checkpoint(tmp_path / "c.h5", META, arrays(), physics="abc")
    meta, found = load_checkpoint(tmp_path / "c.h5", physics="abc")
    assert meta == META
    assert set(found) == set(arrays())
    for name, values in arrays().items():
        assert found[name].dtype == values.dtype
        assert found[name].shape == values.shape
        assert found[name].tobytes() == values.tobytes()
    assert [p.name for p in tmp_path.iterdir()] == ["c.h5"]


@given(
    hnp.arrays(
        st.sampled_from([np.float64, np.float32, np.int64, np.bool_]),
        hnp.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4),
    )
)
def test_any_array_is_restored(tmp_path_factory, values):
    path = tmp_path_factory.mktemp("c") / "c.h5"
    save_checkpoint(path, {}, {"a": values})
    found = load_checkpoint(path)[1]["a"]
    assert (found.dtype, found.shape) == (values.dtype, values.shape)
    assert found.tobytes() == values.tobytes()


def test_numpy_numbers_become_plain_and_nan_survives(tmp_path):
    save_checkpoint(tmp_path / "c.h5", {"a": np.float64(0.1), "b": np.arange(2), "c": np.nan}, {})
    meta, _ = load_checkpoint(tmp_path / "c.h5")
    assert meta["a"] == 0.1
    assert meta["b"] == [0, 1]
    assert math.isnan(meta["c"])
    with pytest.raises(TypeError, match="Path cannot be kept"):
        save_checkpoint(tmp_path / "c.h5", {"p": tmp_path}, {})


def test_another_case_is_refused_with_the_fix(tmp_path):
    save_checkpoint(tmp_path / "c.h5", {}, {}, physics="0123456789abcdef")
    load_checkpoint(tmp_path / "c.h5")
    with pytest.raises(InputError) as error:
        load_checkpoint(tmp_path / "c.h5", physics="fedcba9876543210")
    (line,) = error.value.problems
    assert str(tmp_path / "c.h5") in line
    assert "another case (physics 0123456789ab there, fedcba987654 here)" in line
    assert "undo the change of the case, or run again without --resume" in line


def test_another_case_is_refused_with_its_differences(tmp_path):
    path = tmp_path / "c.h5"
    stored = {"casting": {"speed": "3.6 m/min"}, "cooling": [{"to": "1 m"}], "mesh": {"order": 2}}
    present = {
        "casting": {"speed": "3 m/min"},
        "cooling": [{"to": "1 m"}],
        "mould": {"taper": "x" * 50},
    }
    save_checkpoint(path, {}, {}, physics="0123", case=json.dumps(stored))
    load_checkpoint(path, physics="0123", case=json.dumps(stored))
    with pytest.raises(InputError) as error:
        load_checkpoint(path, physics="4567", case=json.dumps(present))
    assert (
        "belongs to another case (casting.speed: 3.6 m/min there, 3 m/min here; "
        f"mesh.order: 2 there, nothing here; mould.taper: nothing there, {'x' * 36} ... here); "
        "undo the change of the case"
    ) in error.value.problems[0]
    many = {"steel": {f"k{i}": i for i in range(7)}}
    with pytest.raises(InputError, match=r"k0: .*steel\.k1: .*; and 4 more\)"):
        more = many | {"mesh": {"order": 1}, "cooling": []}
        load_checkpoint(path, physics="4567", case=json.dumps(stored | more))


def test_another_version_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(checkpoint, "VERSION", 99)
    save_checkpoint(tmp_path / "c.h5", {}, {})
    monkeypatch.undo()
    with pytest.raises(
        InputError, match=f"format version 99, this castfem reads {checkpoint.VERSION}"
    ):
        load_checkpoint(tmp_path / "c.h5")


def test_missing_and_foreign_files_are_refused(tmp_path):
    with pytest.raises(InputError, match="no such file, nothing to resume from"):
        load_checkpoint(tmp_path / "c.h5")
    (tmp_path / "c.h5").write_text("time = 3\n")
    with pytest.raises(InputError, match="is not a castfem checkpoint, or is truncated"):
        load_checkpoint(tmp_path / "c.h5")
    h5py.File(tmp_path / "d.h5", "w").close()
    with pytest.raises(InputError, match="is not a castfem checkpoint"):
        load_checkpoint(tmp_path / "d.h5")


def test_every_damaged_byte_is_noticed(tmp_path):
    path, hurt = tmp_path / "c.h5", tmp_path / "hurt.h5"
    save_checkpoint(path, META, {"temperature": np.linspace(1000.0, 1800.0, 50)})
    image = path.read_bytes()
    for place in [*random.Random(5).sample(range(len(image)), 200), *range(-8, 0)]:
        changed = bytearray(image)
        changed[place] ^= 0x10
        hurt.write_bytes(changed)
        with pytest.raises(InputError, match=r"hurt\.h5: is (damaged|not a castfem checkpoint)"):
            load_checkpoint(hurt)


def test_truncated_file_is_refused(tmp_path):
    save_checkpoint(tmp_path / "c.h5", META, arrays())
    image = (tmp_path / "c.h5").read_bytes()
    for size in (10, len(image) // 2, len(image) - 1):
        (tmp_path / "cut.h5").write_bytes(image[:size])
        with pytest.raises(
            InputError, match=r"cut\.h5: is not a castfem checkpoint, or is truncated"
        ):
            load_checkpoint(tmp_path / "cut.h5")


def test_full_disk_keeps_the_old_checkpoint(tmp_path):
    path = tmp_path / "c.h5"
    save_checkpoint(path, {"k": 1}, arrays())
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, before[1]))
    try:
        with pytest.raises(RunFailure, match=r"c\.h5: cannot be written \(.*free some space"):
            save_checkpoint(path, {"k": 2}, {"a": np.zeros(100_000)})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert load_checkpoint(path)[0] == {"k": 1}
    assert [p.name for p in Path(tmp_path).iterdir()] == ["c.h5"]


# Runs of an earlier castfem, interrupted after five steps, are read and resumed.
#
# `*.expected.csv` are the complete histories of the same cases by that version. Changes in later
# versions may move them by no more than `MOVED`.


HERE = Path(__file__).parent / "earlier_runs"
# The volume of liquid in curved cells of 5 mm is now integrated by another rule.
KEPT = ("time", "position", "surface", "shell", "liquidus", "heat", "temperature")
MOVED = {"thermal": 1e-9, "taper_1": 1e-3}


@pytest.fixture(params=sorted(MOVED))
def run(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    return Path(shutil.copytree(HERE / request.param, tmp_path / request.param))


def test_earlier_run_is_read(run: Path) -> None:
    text = printed(run, 120)
    assert "stopped by the user" in text and "shell" in text
    assert "time loop" in RunRecord.load(run).wall_time
    result = castfem.Result(run)
    if run.name == "taper_1":
        assert result.summary.steps["coupling windows"] == 5
        assert result.summary.steps["coupling iterations"] == 5
    assert len(result.history) == (6 if run.name == "taper_1" else 3)


def test_earlier_run_resumes(run: Path) -> None:
    """From its checkpoint to the end of its case, with the history of a complete run."""
    before = pd.read_csv(run / "history.csv")
    with castfem.run(castfem.load(run / "case.toml"), run, resume=True):
        found = pd.read_csv(run / "history.csv")
    expected = pd.read_csv(HERE / f"{run.name}.expected.csv")
    assert list(found.columns) == list(expected.columns)
    pd.testing.assert_frame_equal(
        found.iloc[: len(before) - 1], before.iloc[:-1], check_dtype=False
    )
    names = [n for n in found.columns if n.startswith(KEPT)]
    for name in names:
        scale = expected[name].abs().max()
        assert found[name].to_numpy() == pytest.approx(
            expected[name].to_numpy(), rel=MOVED[run.name], abs=MOVED[run.name] * scale, nan_ok=True
        ), name


# A run killed in the middle of a call that changes a file: its files, and its resumption.


RUNS = Path(__file__).with_name("killed_runs.py")
EVERY = 31  # every n-th call is tried; a run makes about 260
COMPILER = shutil.which(os.environ.get("CC", "cc")) or shutil.which("gcc")

# Loaded before the C library, it ends the process in the middle of the n-th call that changes a
# file, also calls of HDF5. Nothing waits for the disk: unlike a power cut, a kill loses nothing
# that was passed to the operating system.
SHIM = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <sys/types.h>
#include <unistd.h>

static long left = 0, seen = 0;
void kill_at(long call) { left = call; seen = 0; }
long calls(void) { return seen; }
static int due(void) { seen++; return left > 0 && --left == 0; }
static void die(void) { kill(getpid(), SIGKILL); pause(); }
int fsync(int file) { (void)file; return 0; }

#define REAL(type, name, types) \
    static type (*real) types; \
    if (!real) real = (type (*) types) dlsym(RTLD_NEXT, #name)
#define WRITE(name, types, ...) \
    ssize_t name types { \
        REAL(ssize_t, name, types); \
        if (file > 2 && due()) { count /= 2; real(__VA_ARGS__); die(); } \
        return real(__VA_ARGS__); }
#define CHANGE(name, types, ...) \
    int name types { REAL(int, name, types); if (due()) die(); return real(__VA_ARGS__); }
#define OPEN(name) \
    int name(const char *path, int flags, ...) { \
        REAL(int, name, (const char *, int, ...)); \
        va_list more; va_start(more, flags); \
        int mode = flags & O_CREAT ? va_arg(more, int) : 0; \
        va_end(more); \
        if (flags & (O_CREAT | O_TRUNC) && due()) die(); \
        return real(path, flags, mode); }

WRITE(write, (int file, const void *data, size_t count), file, data, count)
WRITE(pwrite, (int file, const void *data, size_t count, off_t at), file, data, count, at)
WRITE(pwrite64, (int file, const void *data, size_t count, off64_t at), file, data, count, at)
OPEN(open)
OPEN(open64)
CHANGE(rename, (const char *from, const char *to), from, to)
CHANGE(link, (const char *from, const char *to), from, to)
CHANGE(unlink, (const char *path), path)
CHANGE(rmdir, (const char *path), path)
CHANGE(mkdir, (const char *path, mode_t mode), path, mode)
CHANGE(ftruncate, (int file, off_t size), file, size)
CHANGE(ftruncate64, (int file, off64_t size), file, size)
"""


@pytest.mark.skipif(
    COMPILER is None or not sys.platform.startswith("linux"), reason="needs Linux and a C compiler"
)
def test_kill_in_the_middle_of_a_call_loses_nothing(tmp_path: Path) -> None:
    (tmp_path / "shim.c").write_text(SHIM)
    library = tmp_path / "shim.so"
    words = "-shared", "-fPIC", "-o", str(library), str(tmp_path / "shim.c"), "-ldl"
    subprocess.run([str(COMPILER), *words], check=True)
    done = subprocess.run(
        [sys.executable, str(RUNS), str(tmp_path), str(EVERY)],
        env={**os.environ, "LD_PRELOAD": str(library)},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("calls") == 2
