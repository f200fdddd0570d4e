"""A kernel that several processes need at the same time is compiled by one of them."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="files are locked in other ways there")

KERNELS = """
from numba import njit

@njit(cache=True)
def lowest(x):
    return x + 1

@njit(cache=True)
def first(x):
    return 2 * lowest(x)

@njit(cache=True)
def second(x):
    return 3 * lowest(x)

@njit(cache=True)
def both(x):
    return first(x) + second(x)

@njit(cache=True)
def last(x):
    return x - 1
"""

PROGRAM = """
import importlib.util, sys, time
from pathlib import Path
from numba.core import event
import layoutexplore.grids

spec = importlib.util.spec_from_file_location("layoutexplore.kernels_of_a_test", "kernels.py")
kernels = importlib.util.module_from_spec(spec)
sys.modules[spec.name] = kernels
spec.loader.exec_module(kernels)

class Names(event.Listener):
    def on_start(self, event):
        function = event.data["dispatcher"].py_func
        if function.__module__ == kernels.__name__:
            print(function.__name__, flush=True)
        if sys.argv[1] == "stays":
            time.sleep(1000)
    def on_end(self, event): pass

event.register("numba:compile", Names())
Path("ready", sys.argv[1]).touch()
while not Path("go").exists():
    time.sleep(0.001)
print(kernels.both(1), kernels.last(1))
"""


def _begin(folder: Path, name: str) -> subprocess.Popen[str]:
    """A program that compiles two kernels, and those that they call, as soon as `go` is there."""
    (folder / "kernels.py").write_text(KERNELS)
    (folder / "ready").mkdir(exist_ok=True)
    (folder / "cache").mkdir(exist_ok=True)
    program = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, name],
        cwd=folder,
        env={**os.environ, "NUMBA_CACHE_DIR": str(folder / "cache")},
        stdout=subprocess.PIPE,
        text=True,
    )
    while not (folder / "ready" / name).exists():
        assert program.poll() is None
        time.sleep(0.01)
    return program


def test_two_processes_share_the_work(tmp_path: Path) -> None:
    programs = [_begin(tmp_path, name) for name in ("first", "second")]
    (tmp_path / "go").touch()
    said = [program.communicate(timeout=300)[0].split() for program in programs]
    compiled = [words[:-2] for words in said]
    assert all(words[-2:] == ["10", "0"] for words in said)
    assert {*compiled[0], *compiled[1]} == {"lowest", "first", "second", "both", "last"}
    assert not {*compiled[0]} & {*compiled[1]}


def test_nobody_waits_for_one_that_was_killed(tmp_path: Path) -> None:
    (tmp_path / "go").touch()
    killed = _begin(tmp_path, "stays")
    assert killed.stdout and killed.stdout.readline() == "both\n"
    waits = _begin(tmp_path, "waits")
    with pytest.raises(subprocess.TimeoutExpired):
        waits.wait(timeout=2)
    killed.kill()
    killed.communicate()
    assert waits.communicate(timeout=300)[0].split()[0] == "both"


def test_without_a_place_for_locks_everyone_compiles(tmp_path: Path) -> None:
    (tmp_path / "go").touch()
    alone = _begin(tmp_path, "alone")
    assert alone.communicate(timeout=300)[0].split()[0] == "both"
    for lock in tmp_path.rglob("*.lock"):
        for kernel in lock.parent.glob("*.nb?"):
            kernel.unlink()
        lock.unlink()
        lock.mkdir()
    without = _begin(tmp_path, "without")
    assert without.communicate(timeout=300)[0].split()[0] == "both"
