"""Runs that failed, and what is left of a benchmark that was killed or whose files were damaged since.

Of a run that failed something is said in a line and at length, with the command that repeats it. Every other
run's file holds its curve and its row, with a checksum. A row of results.csv counts where the run's file says
the same; where the table is damaged, its rows are taken from these files. What cannot be told for sure is
named and run again; nothing is guessed.
"""

from __future__ import annotations

import shlex
import traceback
from collections.abc import Callable, Collection, Sequence
from pathlib import Path

import cv2

from layoutexplore.agents import AGENTS
from layoutexplore.benchmark.rows import Row, RunKey, format_row, parse_row
from layoutexplore.benchmark.store import KEPT, ResultsFolder
from layoutexplore.drawing.beliefs import SUFFIX
from layoutexplore.errors import (
    LayoutExploreError,
    OwnCodeError,
    ResultsError,
    cause,
    checks_arguments,
    shortened,
)
from layoutexplore.files import parse_csv, read_bytes, write_atomically
from layoutexplore.files.reading import is_there
from layoutexplore.grids.grid import Pose
from layoutexplore.plugins.tracebacks import own_frames, told
from layoutexplore.simulation.config import SimulationConfig

_CV2_NO_MEMORY = -4
"""OpenCV's number of this error (`cv::Error::StsNoMem`)."""

_NO_MEMORY = ("can't start new thread", "failed to map segment", "Cannot allocate memory")
"""What threads, shared libraries and the system say then."""


def described(error: BaseException) -> str:
    """One line: the type, the message and, where the error is not one of ours, the place in the user's code.

    Without such a place, that in ours.
    """
    lines = str(error).splitlines()
    if isinstance(error, OwnCodeError) and len(lines) > 2:
        lines = [lines[0], lines[-1]]
    message = " ".join(" ".join(lines).split())
    if isinstance(error, LayoutExploreError):
        return f"{type(error).__name__}: {message}"
    frame = (own_frames(error) or traceback.extract_tb(error.__traceback__))[-1]
    return f"{type(error).__name__}: {message} ({Path(frame.filename).name}, line {frame.lineno})"


def lacks_memory(error: BaseException) -> bool:
    """Whether there was not enough memory: for Python, NumPy, a kernel, OpenCV, a thread or a library.

    Example:
        >>> lacks_memory(MemoryError()), lacks_memory(ValueError("no room"))
        (True, False)
    """
    if isinstance(error, MemoryError) or (isinstance(error, cv2.error) and error.code == _CV2_NO_MEMORY):
        return True
    if any(text in str(error) for text in _NO_MEMORY):
        return True
    before = error.__cause__ or error.__context__
    return before is not None and lacks_memory(before)


def at_length(error: BaseException, repeat: str) -> str:
    """The traceback, from the user's own code on where it has any, and how to repeat the run."""
    text = told(error)
    if not own_frames(error) and not isinstance(error, LayoutExploreError):
        text = "".join(traceback.format_exception(error)).rstrip("\n")
    return f"{text}\nRepeat it: {repeat}\n"


def repeating_command(
    plan: str, agent: str, sensor: str, settings: SimulationConfig, seed: int, start: Pose, results: Path
) -> str:
    """The command that repeats one run, its start in full digits; a line of Python where a name needs it.

    Args:
        plan: What the floor plan is loaded from.
        agent: The agent.
        sensor: The sensor's name in the benchmark.
        settings: How it is simulated.
        seed: Of the run.
        start: Of the run.
        results: The folder that knows the settings, named where they are not the usual ones.
    """
    pose = ",".join(repr(float(number)) for number in start)
    if any(entry.name == agent.partition(":")[0] for entry in AGENTS.own()):
        made = f"prepare({plan!r}, {settings!r}, {agent!r})"
        return f"play(*{made}, seed={seed}, start=Pose({pose}))  # in Python, with {agent!r} registered"
    words = ["layoutexplore", "explore", plan, "--agent", agent, "--sensor", sensor, "--seed", str(seed)]
    words.append(f"--start={pose}")
    if not isinstance(settings.sensor, str) or settings != SimulationConfig(sensor=settings.sensor):
        words += ["--config", str(results / "run.toml")]
    return shlex.join(words)


def finished_rows(
    folder: ResultsFolder, say: Callable[[str], None], anew: Collection[RunKey] = frozenset()
) -> list[Row]:
    """Rows of earlier runs that ended well and whose file is undamaged, and of others that failed.

    The table is cut back to these.

    Args:
        folder: The results, held by this process.
        say: Told what is damaged, and whether it is run again.
        anew: Keys of the runs that are made again where they failed.

    Raises:
        ResultsError: The table is none of this version, and no run's file holds its row.
    """
    rows, damage = _rows_of_table(folder)
    good: dict[RunKey, Row] = {}
    for row in rows:
        path = folder.curve_path(row)
        if row.error and row.key not in anew:
            good[row.key] = row
        if row.error or not is_there(path):
            continue
        try:
            saved = saved_row(folder, path, row)
        except ResultsError as error:
            say(str(error))
            continue
        if format_row(saved) != format_row(row):
            damage = damage or ResultsError(f"{folder.table}: the row of {shortened(saved.key)} is damaged")
        good[saved.key] = saved
    _tell_lost(folder, say, [row for row in rows if not row.error and row.key not in good], anew)
    before = len(good)
    if damage or not rows:
        good |= {row.key: row for row in _rows_of_runs(folder, say) if row.key not in good}
    if damage:
        if not good:
            raise damage
        write_atomically(folder.path / KEPT, folder.table.read_bytes())
        say(f"{damage}; {len(good) - before} rows were taken from runs/, the damaged table is kept as {KEPT}")
    folder.rewrite(good.values())
    return list(good.values())


def _tell_lost(
    folder: ResultsFolder, say: Callable[[str], None], lost: Sequence[Row], anew: Collection[RunKey]
) -> None:
    """Name runs that ended well and whose file is gone or damaged; the table is kept where rows leave it."""
    left = f"left out of {folder.table.name}, of which {KEPT} is a copy"
    for what, again in (("made anew", True), (left, False)):
        if runs := [row for row in lost if (row.key in anew) == again]:
            names = "; ".join(f"{r.plan}, start {r.start}, {r.sensor}, {r.agent}" for r in runs[:5])
            more = f"; and {len(runs) - 5} more" if len(runs) > 5 else ""
            say(f"{what}, since the file in runs/ is gone or damaged: {names}{more}")
    if not {row.key for row in lost} <= set(anew):
        write_atomically(folder.path / KEPT, folder.table.read_bytes())


def _rows_of_table(folder: ResultsFolder) -> tuple[list[Row], ResultsError | None]:
    """The rows, and what is wrong with the table; a last line that was cut off is dropped."""
    if not folder.table.exists() or not folder.table.stat().st_size:
        return [], None
    written = read_bytes(folder.table, ResultsError, "table")
    if not written.endswith(b"\n"):
        write_atomically(folder.table, written[: written.rfind(b"\n") + 1])
    try:
        return folder.rows(), None
    except ResultsError as error:
        return [], error


def _rows_of_runs(folder: ResultsFolder, say: Callable[[str], None]) -> list[Row]:
    """The rows that the files of runs hold; of files that are damaged, or of an earlier version, none."""
    rows = []
    for path in sorted((folder.path / "runs").glob("*/*.npz")):
        if path.name.endswith(SUFFIX):
            continue
        try:
            row = saved_row(folder, path)
        except ResultsError as error:
            say(str(error))
            continue
        if folder.curve_path(row) == path and not row.error:
            rows.append(row)
    return rows


@checks_arguments
def saved_row(folder: ResultsFolder, path: Path, table: Row | None = None) -> Row:
    """The row that the file of a run holds.

    Args:
        folder: The results.
        path: The file.
        table: What the table says, for a file that an earlier version wrote without its row.

    Raises:
        ResultsError: The file is damaged, or holds no row, or that of another run.
    """
    text = str(folder.run_arrays(path).get("row", ""))
    if not text:
        if table is None:
            raise ResultsError(f"{path} holds no row: it is run again")
        return table
    try:
        (line,) = parse_csv(text, str(path))
        row = parse_row(line)
    except ValueError as error:
        raise ResultsError(f"{path} is damaged: its row: {cause(error)}; it is run again") from error
    if folder.curve_path(row) != path:
        raise ResultsError(f"{path} holds the row of another run: it is run again")
    return row
