"""A run killed in the middle of a call that changes a file: what is there, and how it goes on."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

RUNS = Path(__file__).with_name("killed_runs.py")
EVERY = 31  # how many of the calls are tried: one in so many; a run makes about 260
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
        [sys.executable, str(RUNS), str(tmp_path), str(EVERY)],
        env={**os.environ, "LD_PRELOAD": str(library)},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("calls") == 2
