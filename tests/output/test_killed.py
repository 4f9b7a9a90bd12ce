"""A run killed in the middle of a call that changes a file: what is there, and how it goes on."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

EVERY = 4  # how many of the calls are tried: one in so many; a step takes about 25
COMPILER = shutil.which(os.environ.get("CC", "cc")) or shutil.which("gcc")

# Loaded before the C library, it ends the process in the middle of the n-th call that changes a
# file, those of HDF5 too. Nothing waits for the disk: a kill, other than a power cut, loses nothing
# that was handed to the operating system.
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

RUN = r"""
import ctypes, mmap, os, shutil, signal, struct, sys
from pathlib import Path
import meshio, numpy as np
from castfem.output.checkpoint import load_checkpoint, save_checkpoint
from castfem.output.fields import Fields
from castfem.output.folder import OutputFolder, RunRecord
from castfem.output.history import History, read_history
from castfem.output.xdmf import FieldWriter

LAST, COLUMNS, CELLS = 4, [("time", "s"), ("square", "-")], [[0, 1, 2], [1, 2, 3]]
points = np.random.default_rng(1).random((40, 2))
shim, done = ctypes.CDLL(None), mmap.mmap(-1, 16)


def fields(k):
    return {"t": points[:, 0] + k, "v": k * points}


def run(path, resume):
    # As run.time_loop and run.recorder go about it; a checkpoint at every other step.
    with OutputFolder(path) as folder:
        folder.begin("title = 'x'\n", resume=resume)
        k = 0
        if resume:
            meta, _ = load_checkpoint(path / "checkpoint.h5")
            history = History.resume(path / "history.csv", meta["k"], COLUMNS)
            writer = FieldWriter.resume(path, meta["k"])
            k = meta["k"] + 1
        else:
            history = History(path / "history.csv", COLUMNS)
            writer = FieldWriter(path, points, CELLS, "triangle", 1)
        for k in range(k, LAST + 1):
            history.append({"time": k, "square": k * k})
            writer.write(float(k), 0.1 * k, fields(k))
            done[:8] = struct.pack("q", k + 1)
            if k in (1, 3):
                save_checkpoint(path / "checkpoint.h5", {"k": k}, {"a": points + k})
                folder.update(reached={"time": k})
        history.close()
        writer.close()
        save_checkpoint(path / "checkpoint.h5", {"k": LAST}, {"a": points + LAST})
        folder.finish()


def look(path, least):
    # All that is there can be read; no time and no row that was written is missing.
    if (path / "run.json").exists():
        RunRecord.load(path)
    if (path / "checkpoint.h5").exists():
        meta, arrays = load_checkpoint(path / "checkpoint.h5")
        assert np.array_equal(arrays["a"], points + meta["k"])
    found = 0
    if (path / "fields.xdmf").exists():
        with meshio.xdmf.TimeSeriesReader(path / "fields.xdmf") as reader:
            reader.read_points_cells()
            found = reader.num_steps
            for k in range(found):
                time, at_points, _ = reader.read_data(k)
                assert time == k and np.array_equal(at_points["t"], np.float32(fields(k)["t"]))
        with Fields(path) as stored:
            assert stored.times.tolist() == list(range(len(stored.times)))
            assert len(stored.times) >= found
            for k in range(len(stored.times)):
                assert np.array_equal(stored.values("t", k), np.float32(fields(k)["t"]))
    assert found >= least, f"{least} times were written, {found} are there"
    if (path / "history.csv").exists():
        rows = read_history(path / "history.csv")
        assert rows["square"].tolist() == [k * k for k in range(len(rows))] and len(rows) >= least


def whole(path):
    # What must not depend on how often the run was killed.
    names = sorted(str(p.relative_to(path)) for p in path.rglob("*"))
    return names, *((path / n).read_bytes() for n in ("history.csv", "fields.xdmf"))


def forked(path, resume, call):
    # A run killed at a call: the calls it made, or None if it was killed.
    process = os.fork()
    if process == 0:
        shim.kill_at(call)
        try:
            run(path, resume)
            done[8:] = struct.pack("q", shim.calls())
        finally:
            os._exit(0)
    status = os.waitpid(process, 0)[1]
    if os.WIFSIGNALED(status):
        assert os.WTERMSIG(status) == signal.SIGKILL
        return None
    return struct.unpack("q", done[8:])[0]


base = Path(sys.argv[1])
run(base / "unbroken", False)
expected = whole(base / "unbroken")
half = base / "half"  # as the first run stands at its third row
call = 1
while len(read_history(half / "history.csv") if (half / "history.csv").exists() else []) < 3:
    shutil.rmtree(half, ignore_errors=True)
    assert forked(half, False, call) is None
    call += 1
for resume in (False, True):
    done[8:] = bytes(8)
    if resume:
        shutil.copytree(half, base / "count")
    number = forked(base / "count", resume, 0)
    shutil.rmtree(base / "count")
    assert number > 100, number
    for call in range(1, number + 1, int(sys.argv[2])):
        path = base / f"{resume}{call}"
        if resume:
            shutil.copytree(half, path)
        done[:8] = struct.pack("q", 2 if resume else 0)
        assert forked(path, resume, call) is None
        try:
            look(path, struct.unpack("q", done[:8])[0])
            run(path, (path / "checkpoint.h5").exists())
            look(path, LAST + 1)
            assert whole(path) == expected
        except BaseException:
            print("killed at call", call, "of a run", "resumed" if resume else "begun", flush=True)
            raise
        shutil.rmtree(path)
    print(number, "calls")
"""


@pytest.mark.skipif(
    COMPILER is None or not sys.platform.startswith("linux"), reason="needs Linux and a C compiler"
)
def test_a_kill_in_the_middle_of_a_call_costs_nothing(tmp_path: Path) -> None:
    (tmp_path / "shim.c").write_text(SHIM)
    library = tmp_path / "shim.so"
    build = [
        str(COMPILER),
        "-shared",
        "-fPIC",
        "-o",
        str(library),
        str(tmp_path / "shim.c"),
        "-ldl",
    ]
    subprocess.run(build, check=True)
    done = subprocess.run(
        [sys.executable, "-c", RUN, str(tmp_path), str(EVERY)],
        env={**os.environ, "LD_PRELOAD": str(library)},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("calls") == 2
