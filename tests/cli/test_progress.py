"""Lines that say how far a long command is."""

from __future__ import annotations

import io

from rich.console import Console

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
