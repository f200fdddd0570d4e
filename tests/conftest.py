"""Shared fixtures."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder of real floor plans and maps; tests that need it skip where it is absent."""
    folder = Path(
        os.environ.get("LAYOUTEXPLORE_DATA", Path(__file__).resolve().parents[2] / "shared" / "data")
    )
    if not folder.is_dir():
        pytest.skip(
            f"no data folder at {folder}: set LAYOUTEXPLORE_DATA to run the tests on real floor plans"
        )
    return folder
