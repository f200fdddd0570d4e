"""Kernels have a place in which they are kept."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from layoutexplore.processes.kernel_cache import keep_kernels_somewhere

NOWHERE = Path("/proc/nowhere")
"""Nobody can write there, not even root."""


@pytest.fixture
def homeless(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A user whose home does not exist; the folder of temporary files."""
    if not NOWHERE.parent.is_dir():
        pytest.skip("no folder that nobody can write to")
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")  # so that what is set in the test is undone
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.setenv("HOME", str(NOWHERE))
    monkeypatch.setenv("XDG_CACHE_HOME", str(NOWHERE / "cache"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def test_kernels_of_a_user_without_a_home_are_kept_among_temporary_files(homeless: Path) -> None:
    keep_kernels_somewhere(NOWHERE)
    first = os.environ.pop("NUMBA_CACHE_DIR")
    keep_kernels_somewhere(NOWHERE)
    assert Path(first).parent == homeless and os.environ["NUMBA_CACHE_DIR"] == first


def test_a_user_whom_nobody_knows_has_no_home(homeless: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def expanduser(path: Path) -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "expanduser", expanduser)
    keep_kernels_somewhere(NOWHERE)
    assert Path(os.environ["NUMBA_CACHE_DIR"]).parent == homeless


def test_a_folder_that_others_can_write_to_is_not_trusted(homeless: Path) -> None:
    keep_kernels_somewhere(NOWHERE)
    first = os.environ.pop("NUMBA_CACHE_DIR")
    Path(first).chmod(0o777)
    keep_kernels_somewhere(NOWHERE)
    assert os.environ["NUMBA_CACHE_DIR"] != first


def test_nothing_is_named_where_numba_finds_a_place(homeless: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    keep_kernels_somewhere(homeless)
    assert "NUMBA_CACHE_DIR" not in os.environ
    monkeypatch.setenv("XDG_CACHE_HOME", str(homeless))
    keep_kernels_somewhere(NOWHERE)
    assert "NUMBA_CACHE_DIR" not in os.environ
    monkeypatch.setenv("NUMBA_CACHE_DIR", "mine")
    keep_kernels_somewhere(NOWHERE)
    assert os.environ["NUMBA_CACHE_DIR"] == "mine"


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="users as on Unix")
def test_importing_the_package_names_no_folder_where_it_can_be_written() -> None:
    code = "import os, layoutexplore; print(os.environ.get('NUMBA_CACHE_DIR'))"
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    words = [sys.executable, "-c", code]
    done = subprocess.run(words, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "None"
