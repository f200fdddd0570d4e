"""Tracebacks show the user's own code."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer

from layoutexplore.agents import make_agent
from layoutexplore.errors import OwnCodeError
from layoutexplore.options import read_value
from layoutexplore.plugins.tracebacks import own_frames, told
from layoutexplore.simulation.episode import play
from layoutexplore.simulation.simulation import Simulation
from tests.plugins.cases import AGENT, write


def test_frames_of_this_package_are_left_out(tmp_path: Path) -> None:
    path = write(tmp_path, AGENT.replace("return min(", "return decision.path_lengths_from(99, [0]) or min("))
    with pytest.raises(IndexError) as caught:
        play(Simulation("apartment-03"), make_agent(f"{path}:Mine"))
    text = told(caught.value)
    assert text.count("File ") == len(own_frames(caught.value))
    assert f'File "{path}", line 15, in act' in text and "simulation" not in text
    (note,) = caught.value.__notes__
    assert note == f"(agent '{path}:Mine', decision 0 on 'apartment-03')"
    assert text.endswith(f"{caught.value}\n{note}")


def test_an_error_without_own_code_says_its_message() -> None:
    def inner(value: Any) -> None:
        read_value("size", 1, value)

    with pytest.raises(ValueError, match="size") as caught:
        inner("x")
    assert [frame.name for frame in own_frames(caught.value)][-1] == "inner"
    assert told(ValueError("plain")) == "ValueError: plain"
    with pytest.raises(ValueError, match="shape") as caught:
        np.zeros(3).reshape(2, 2)
    assert "reshape" in told(caught.value)


def test_what_is_told_has_a_length_that_can_be_read() -> None:
    with pytest.raises(SyntaxError) as caught:
        compile("x = (" + "y z " * 5000, "mine.py", "exec")
    assert len(told(caught.value)) < 2000 and "SyntaxError" in told(caught.value)
    text = told(ValueError("first\n" + "more\n" * 5000 + "last"))
    assert len(text) < 3000 and text.startswith("ValueError: first") and text.endswith("last")
    assert str(OwnCodeError(f"mine.py cannot be loaded:\n{text}")).count("...") == 1, "shortened once"


def test_commands_end_quietly_wherever_packages_lie(tmp_path: Path) -> None:
    """As with `pip install --target`: commands end by an exit of typer's, whose code is not the user's."""
    shutil.copytree(Path(typer.__file__).parent, tmp_path / "typer")
    code = "import typer; print(typer.__file__); from layoutexplore.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", code, "--version"],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert str(tmp_path) in done.stdout and (done.returncode, done.stderr) == (0, "")
