"""Lines that say how far a long command is."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from layoutexplore.cli import progress
from layoutexplore.cli.progress import ProgressLine, plain_console


def test_the_end_is_told_once_however_often_it_is_reached() -> None:
    console = Console(file=io.StringIO(), width=200)
    with ProgressLine(console, "steps") as line:
        for done in (1, 10, 10, 10):  # as of training, whose last rollout goes past its end
            line.advance(done, 10, done / 10)
    assert isinstance(console.file, io.StringIO)
    assert console.file.getvalue().count("10/10 steps") == 1


def test_names_that_look_like_markup_are_written_as_they_are() -> None:
    odd = "[red]a[/b] :smile:"
    for is_terminal in (False, True):
        console = plain_console(file=io.StringIO(), width=200, force_terminal=is_terminal)
        with ProgressLine(console, "steps") as line:
            line.advance(1, 2, 0.5, odd)
            line.say(odd)
            line.advance(2, 2, 1.0, odd)
        assert isinstance(console.file, io.StringIO)
        assert odd in console.file.getvalue()


def test_the_time_left_goes_by_the_speed_of_late(monkeypatch: pytest.MonkeyPatch) -> None:
    console, times = Console(file=io.StringIO(), width=200), iter((0.0, 300.0, 320.0, 340.0))
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(times))
    with ProgressLine(console, "% seen") as line:
        for done in (2, 42, 82):  # kernels were compiled for the first five minutes
            line.advance(done, 100, done / 100)
    assert isinstance(console.file, io.StringIO)
    assert console.file.getvalue().splitlines() == [
        "2 % seen, 5:00 elapsed",
        "42 % seen, 5:20 elapsed, about 0:29 left",
        "82 % seen, 5:40 elapsed, about 0:09 left",
    ]


def test_nothing_done_yet_and_begun_again() -> None:
    console = Console(file=io.StringIO(), width=200)
    with ProgressLine(console, "runs") as line:
        for done in (0, 0, 1, 0, 2):
            line.advance(done, 2, done / 2)
    assert isinstance(console.file, io.StringIO)
    assert console.file.getvalue().startswith("2/2 runs")
