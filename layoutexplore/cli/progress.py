"""How far a long command is: a bar with the time left on a terminal, plain lines where there is none."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import Any

from rich.cells import cell_len
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn
from rich.table import Table

PLAIN_EVERY = 10.0
"""Seconds between plain lines."""

_EARLY = 0.05
"""Share of the work up to which nobody knows how long the rest takes."""


def plain_console(**options: Any) -> Console:
    """A console that writes texts as they are: names of floor plans and files may look like markup."""
    return Console(highlight=False, markup=False, emoji=False, **options)


def print_table(headings: Sequence[str], rows: Sequence[Sequence[str]], *, keys: int = 1) -> None:
    """Print a table of texts so that none of its numbers is cut.

    Where there is no terminal it is as wide as it has to be. A terminal that is too narrow shows the columns
    in parts, one below the other.

    Args:
        headings: One a column.
        rows: The texts of each row, as many as there are headings.
        keys: So many first columns tell the rows apart, and are shown in every part; the others stand at the
            right of their columns.
    """
    columns = list(zip(headings, *rows, strict=True))
    wide = [2 + max(map(cell_len, column)) for column in columns]
    console = plain_console()
    if not console.is_terminal:
        console = plain_console(width=sum(wide))
    parts: list[list[int]] = []
    left = 0
    for k in range(keys, len(columns)):
        if not parts or wide[k] > left:
            parts.append(list(range(keys)))
            left = console.width - sum(wide[:keys])
        parts[-1].append(k)
        left -= wide[k]
    for part in parts:
        table = Table(box=None, pad_edge=False)
        for k in part:
            table.add_column(headings[k], overflow="fold", justify="left" if k < keys else "right")
        for row in rows:
            table.add_row(*(row[k] for k in part))
        console.print(table)


class ProgressLine:
    """A progress display, used as a context manager.

    Args:
        console: Where to write.
        unit: What is counted, in the plural; percents are not told as parts of a hundred.
    """

    def __init__(self, console: Console, unit: str) -> None:
        self.console = console
        self.unit = unit
        self._bar: Progress | None = None
        self.restart()

    def __enter__(self) -> ProgressLine:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.end()

    def end(self) -> None:
        """Take the bar away; another one may follow."""
        if self._bar:
            self._bar.stop()
        self._bar = None

    def say(self, text: str) -> None:
        """A line of its own; the time left is estimated from the last one on."""
        self.console.print(text, soft_wrap=True, markup=False)
        self.restart()

    def restart(self) -> None:
        """The work begins now, or other work: so do its clock and the estimate of the time left."""
        self._ended = False
        self._began = self._printed = time.monotonic()
        self._marks = deque([(self._began, 0.0)])

    def advance(self, done: int, total: int, share: float, note: str = "") -> None:
        """Show how far it is.

        Args:
            done: Number of units done.
            total: Number of all.
            share: Share of the work done since the last `say`, 0..1: what the time left is estimated from.
            note: What is worth saying about the last unit.
        """
        now = time.monotonic()
        elapsed = now - self._began
        left = self._left(now, share)
        count = f"{done} {self.unit}" if self.unit.startswith("%") else f"{done}/{total} {self.unit}"
        if not self.console.is_terminal:
            ended, self._ended = self._ended, done == total  # what overshoots says so once
            if not ended and (now - self._printed >= PLAIN_EVERY or done == total):
                self._printed = now
                self.say_plain(f"{count}, {clock(elapsed)} elapsed{', ' + left if left else ''}")
            return
        if self._bar is None:
            columns = (
                TextColumn("{task.fields[count]}"),
                BarColumn(),
                TextColumn("{task.fields[left]}  [dim]{task.fields[note]}"),
            )
            self._bar = Progress(*columns, console=self.console, transient=True)
            self._bar.start()
            self._bar.add_task("", total=1.0, count="", left="", note="")
        left = f"{clock(elapsed)}  {left}"
        # On a narrow terminal the note is cut, then the bar, and never how far it is.
        note = escape(note[: max(0, self.console.width - len(count + left) - 16)])
        self._bar.update(self._bar.task_ids[0], completed=share, count=count, left=left, note=note)

    def _left(self, now: float, share: float) -> str:
        """The time left at the speed of the later half of what is done: kernels are compiled in the first."""
        self._marks.append((now, share))
        while len(self._marks) > 1 and self._marks[1][1] <= share / 2:
            self._marks.popleft()
        began, before = self._marks[0]
        if not _EARLY <= share < 1 or share <= before:
            return ""
        return f"about {clock((now - began) * (1 - share) / (share - before))} left"

    def say_plain(self, text: str) -> None:
        """A line that does not disturb the estimate."""
        self.console.print(text, soft_wrap=True, markup=False)


def clock(seconds: float) -> str:
    """Minutes and seconds, with hours where there are any.

    Example:
        >>> clock(75), clock(7325)
        ('1:15', '2:02:05')
    """
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"


def progress_lines() -> Callable[[str, int, int], None]:
    """Shows on the error stream what takes long before and between the scores."""
    console = plain_console(stderr=True)
    lines: dict[str, ProgressLine] = {}  # one for each thing that is done

    def show(what: str, done: int, total: int) -> None:
        line = lines.setdefault(what, ProgressLine(console, what))
        line.advance(done, total, done / total)
        if done == total:
            line.end()

    return show
