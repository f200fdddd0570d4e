"""Programs of a user, as tests run them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

wherever_it_comes_from = pytest.mark.parametrize("from_stdin", [True, False], ids=["stdin", "file"])


def said_by(program: str, folder: Path, *, from_stdin: bool) -> str:
    """What a program prints that comes from stdin or a file in a folder; it must complain of nothing."""
    script = folder / "script.py"
    script.write_text(program, encoding="utf-8")
    words = [sys.executable, "-" if from_stdin else str(script)]
    given = program if from_stdin else ""
    told = subprocess.run(words, input=given, capture_output=True, text=True, check=True, timeout=300)
    assert not told.stderr, told.stderr
    return told.stdout
