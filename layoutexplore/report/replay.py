"""Replays of runs for a page: the recordings of chosen runs, packed, with the script that plays them."""

from __future__ import annotations

import base64
import json
import shlex
import zlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from layoutexplore.benchmark.recording import ROOMS_AT, Recording
from layoutexplore.benchmark.rows import Row, RunKey
from layoutexplore.benchmark.store import ResultsFolder
from layoutexplore.errors import ResultsError, checks_arguments, counted
from layoutexplore.files import write_atomically
from layoutexplore.report.templates import TEMPLATES, map_colours, render

MOST_BYTES = 3_000_000
"""Replays in a report, packed: more are left to `layoutexplore replay`."""

MOST_BYTES_OF_PAGE = 60_000_000
"""Replays in a page of their own: browsers open larger ones slowly."""


@dataclass(frozen=True)
class ReplayView:
    """What the templates show.

    Attributes:
        json: The runs and floor plans, safe inside a script element.
        script: The player.
        note: What is there and what is not.
        numbers: Place of each run in the page, by its key.
    """

    json: str
    script: str
    note: str
    numbers: Mapping[RunKey, int]

    def link(self, row: Row, metres: float) -> str:
        """The address in the page of a run at a distance; empty where the run is not in the page."""
        number = self.numbers.get(row.key)
        return "" if number is None else f"#replay={number}@{metres:.2f}"


@checks_arguments
def write_replay(folder: ResultsFolder, rows: Sequence[Row], path: Path) -> int:
    """Write a page with the replays of some runs.

    Args:
        folder: What `layoutexplore benchmark` left.
        rows: The runs; those that failed are left out.
        path: Of the page.

    Returns:
        Number of replays in it.

    Raises:
        ResultsError: There is no recording of any of the runs, all of them failed, or a file is damaged.
    """
    good = [row for row in rows if not row.error]
    if not good:
        raise ResultsError(_why_none(folder, rows))
    view = replay_view(folder, good, most_bytes=MOST_BYTES_OF_PAGE)
    if view is None:
        raise ResultsError(
            f"{folder.path} holds no recording of these runs: they were made by an earlier version; "
            "run the benchmark again into another folder"
        )
    title = f"Replay of {counted(len(view.numbers), 'run')}"
    command = folder.manifest()["command"]
    page = render("replay_page.html", replay=view, title=title, command=command)
    write_atomically(path, page)
    return len(view.numbers)


def _why_none(folder: ResultsFolder, rows: Sequence[Row]) -> str:
    """Why there is nothing to replay."""
    if not rows:
        return f"{folder.path} holds no recording of such runs: none was made"
    which = "the run" if len(rows) == 1 else f"all {len(rows)} runs"
    first = "" if len(rows) == 1 else ", the first"
    return (
        f"{which} to be replayed from {folder.path} failed{first} with {rows[0].error}: what went wrong is "
        f"in {folder.path / 'runs'} (*.error.txt); the same benchmark command tries failed runs again"
    )


def runs_to_replay(rows: Sequence[Row], first: Iterable[Row] = ()) -> list[Row]:
    """The order in which runs get into a report: some first, then one of each floor plan and agent."""
    good = [row for row in rows if not row.error]
    chosen = {row.key: row for row in first}
    met: set[tuple[str, str]] = set()
    for row in sorted(good, key=lambda row: (row.start, row.sensor)):
        if (row.plan, row.agent) not in met:
            met.add((row.plan, row.agent))
            chosen.setdefault(row.key, row)
    return list(chosen.values())


def replay_view(
    folder: ResultsFolder, rows: Sequence[Row], *, most_bytes: int = MOST_BYTES
) -> ReplayView | None:
    """The replays of runs, as many of the first ones as there is room for; None where there is no recording.

    Args:
        folder: The results.
        rows: Runs that ended well, the most important first.
        most_bytes: Room for all that is packed.
    """
    runs: list[dict[str, Any]] = []
    floors: dict[str, dict[str, Any]] = {}
    keys: list[RunKey] = []
    size = 0
    for row in rows:
        recording = folder.recording(row)
        if recording is None:
            continue
        if row.plan not in floors:
            floors[row.plan] = _floor(folder, row.plan)
            size += len(floors[row.plan]["data"])
        text = _packed(_arrays_of_run(recording, folder.episode(row)[0]))
        if runs and size + len(text) > most_bytes:
            break
        size += len(text)
        keys.append(row.key)
        cell = f"{row.plan}, start {row.start}, {row.sensor}"
        runs.append({"cell": cell, "agent": row.agent, "floor": row.plan, "data": text})
    if not runs:
        return None
    used = {run["floor"] for run in runs}
    data = {
        "runs": runs,
        "floors": {name: floor for name, floor in floors.items() if name in used},
        "colours": map_colours(as_numbers=True),
    }
    percents = ", ".join(f"{100 * share:.0f}" for share in ROOMS_AT)
    rest = "" if len(runs) == len(rows) else f" {len(runs)} of {len(rows)} runs had room here."
    note = (
        "The map as the robot knew it, over the metres travelled. Rooms are those that the agent's predictor "
        f"believed when {percents} % had been seen.{rest} Any run of the folder becomes a page by "
        f"layoutexplore replay {shlex.quote(folder.path.resolve().name)} --plan NAME --agent NAME."
    )
    script = (TEMPLATES / "replay.js").read_text(encoding="utf-8")
    text = json.dumps(data).replace("<", "\\u003c")  # no script element can be ended by it
    return ReplayView(_markup(text), _markup(script), note, {key: k for k, key in enumerate(keys)})


def _arrays_of_run(recording: Recording, curve: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
    """What the player reads of a run."""
    arrays: dict[str, NDArray[Any]] = {name: getattr(recording, name) for name in recording.__dict__}
    arrays["occupied"] = np.packbits(recording.occupied)
    arrays["curve"] = curve.astype(np.float32)
    return arrays


def _floor(folder: ResultsFolder, plan: str) -> dict[str, Any]:
    occupied, frame = folder.raster(plan)
    packed = _packed({"occupied": np.packbits(occupied)})
    return {"shape": list(occupied.shape), "frame": frame.tolist(), "data": packed}


def _packed(arrays: Mapping[str, NDArray[Any]]) -> str:
    """Arrays as text: base64 of deflate of the header's length, a JSON header, and the arrays.

    The header holds (name, type, number of entries, place of the first byte behind the header) of each.
    """
    rows, at = [], 0
    for name, array in arrays.items():
        rows.append([name, array.dtype.name, array.size, at])
        at += array.nbytes
    header = json.dumps(rows).encode()
    parts = [len(header).to_bytes(4, "little"), header, *(array.tobytes() for array in arrays.values())]
    return base64.b64encode(zlib.compress(b"".join(parts), 6)).decode()


def _markup(text: str) -> str:
    from markupsafe import Markup

    return Markup(text)
