"""Damaged files of every kind are read, or refused with an error of ours: a short run, and a long one."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from tests.files.command_targets import READERS
from tests.files.crafted import craft
from tests.files.fuzzing import fuzz

QUICK = [name for name in READERS if name not in ("network policy", "resume", "report")]
"""Readers that need neither torch nor a report."""


@pytest.mark.parametrize("name", QUICK)
def test_damaged_files_are_taken_or_refused(name: str) -> None:
    found = fuzz(name, round(40 * READERS[name].share), seed=1)
    assert found.failed == 0, found.faults
    assert found.refused + found.accepted == found.tried > 0


@pytest.mark.parametrize("name", [name for name in READERS if name not in QUICK])
def test_a_few_damaged_files_of_slow_readers(name: str) -> None:
    pytest.importorskip("torch")
    found = fuzz(name, 6, seed=1)
    assert found.failed == 0, found.faults
    assert found.tried == 6


@pytest.mark.skipif(sys.platform != "linux", reason="needs pipes and Linux's devices")
@pytest.mark.parametrize("name", QUICK)
def test_crafted_files_are_taken_or_refused(name: str) -> None:
    found = fuzz(name, round(30 * READERS[name].share), seed=2, how=craft)
    assert found.failed == 0, found.faults
    assert found.refused + found.accepted == found.tried > 0


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="memory is limited as Linux does")
def test_many_damaged_files_are_taken_or_refused() -> None:
    """`LAYOUTEXPLORE_FUZZ=N` sets how many, `LAYOUTEXPLORE_FUZZ_SEED` which."""
    inputs, seed = (
        os.environ.get("LAYOUTEXPLORE_FUZZ", "60000"),
        os.environ.get("LAYOUTEXPLORE_FUZZ_SEED", "1"),
    )
    command = [sys.executable, "-m", "tests.files.fuzzing", "--inputs", inputs, "--seed", seed]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    print(run.stdout)
    assert run.returncode == 0, run.stdout + run.stderr[-3000:]
