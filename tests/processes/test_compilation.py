"""Compiling is told when it takes long, and only then."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from layoutexplore.processes import compilation
from layoutexplore.processes.compilation import MESSAGE, CompilationListener

KERNEL = """
from numba import njit
import layoutexplore.grids, layoutexplore.processes.compilation as compilation

compilation.PATIENCE = 0.0

@njit(cache=True)
def first(x): return x + 1

@njit(cache=True)
def second(x): return first(x) * 2

first(1), second(1.0), second(2)
"""


def test_what_takes_no_time_is_not_told(capsys: pytest.CaptureFixture[str]) -> None:
    listener = CompilationListener()
    for _ in range(3):
        listener.on_start(None)
        listener.on_end(None)
    assert capsys.readouterr().err == ""


def test_it_is_told_once(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compilation, "PATIENCE", -1.0)
    listener = CompilationListener()
    for _ in range(3):
        listener.on_start(None)
        listener.on_end(None)
    assert capsys.readouterr().err == MESSAGE + "\n"


def test_what_lies_in_the_cache_is_not_told(tmp_path: Path) -> None:
    (tmp_path / "kernel.py").write_text(KERNEL)
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    for expected in (MESSAGE + "\n", ""):
        words = [sys.executable, str(tmp_path / "kernel.py")]
        done = subprocess.run(words, env=environment, capture_output=True, text=True, check=True)
        assert done.stderr == expected
