"""A leaderboard: which results are of the same cells, whole and repeatable, and how their agents rank.

What counts is decided by the files alone: the cells by their hash, the version, the weights and code of the
agents by their fingerprints. A sample of the runs is then made again and must be the same bit for bit.
"""

from __future__ import annotations

import dataclasses
import hashlib
import math
import os
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import layoutexplore
from layoutexplore.benchmark.analysis import HEADLINE, METRICS, POOLED, Comparison, compare, over_all_sensors
from layoutexplore.benchmark.plans import Task
from layoutexplore.benchmark.rows import (
    TIMING_COLUMNS,
    CellKey,
    Row,
    fingerprints,
    format_row,
    knows_the_plan,
)
from layoutexplore.benchmark.runner import run_task
from layoutexplore.benchmark.store import ResultsFolder
from layoutexplore.benchmark.suite import Suite, cells_of
from layoutexplore.errors import LayoutExploreError, ResultsError, checks_arguments
from layoutexplore.files.reading import shown_path

REPEATED = 3
"""Runs of each agent that are made again."""

_NOT_COMPARED = (*TIMING_COLUMNS, "building")
"""Columns in which a repeated run may differ: results of earlier versions name no building."""


@dataclass(frozen=True, kw_only=True)
class Entrant:
    """An agent whose results count.

    Attributes:
        agent: Its name.
        folder: Where its results lie.
        repeated: The runs that were made again, bit for bit the same.
        rows: All its runs.
    """

    agent: str
    folder: Path
    repeated: tuple[CellKey, ...]
    rows: tuple[Row, ...]


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """Results that do not count, and why.

    Attributes:
        agent: Its name; empty where a whole folder does not count.
        folder: Where they lie.
        reason: One sentence.
    """

    agent: str
    folder: Path
    reason: str

    def __str__(self) -> str:
        return f"{f'{self.folder} {self.agent}'.rstrip()}: {self.reason}"


@dataclass(frozen=True, kw_only=True)
class Standing:
    """A line of the ranking.

    Attributes:
        rank: From 1; 0 for an agent that knows the floor plan, which is a bound and no competitor.
        entrant: The agent.
        ratios: Its metres against the baseline's by level (d90, d95, d99), all sensors, intervals over
            buildings.
        by_sensor: The same to 95 % by sensor.
        tied: Whether the best agent's lead over it may be chance: the interval of their ratio holds 1.
    """

    rank: int
    entrant: Entrant
    ratios: Mapping[str, Comparison]
    by_sensor: Mapping[str, Comparison]
    tied: bool


@dataclass(frozen=True, kw_only=True)
class Leaderboard:
    """The ranking of a suite.

    Attributes:
        suite: Its name.
        hash: The hash of its cells.
        baseline: The agent that the others are compared with.
        cells: Number of runs of each agent.
        buildings: Number of buildings.
        standings: Bounds first, then the best agent.
        left_out: What does not count.
    """

    suite: str
    hash: str
    baseline: str
    cells: int
    buildings: int
    standings: tuple[Standing, ...]
    left_out: tuple[LeftOut, ...]


@checks_arguments
def make_leaderboard(
    folders: Sequence[str | os.PathLike[str]],
    suite: Suite,
    *,
    repeat: int = REPEATED,
    say: Callable[[str], None] = lambda text: None,
) -> Leaderboard:
    """Check results, repeat a sample of their runs, and rank the agents.

    Args:
        folders: Results of `layoutexplore benchmark --suite NAME`.
        suite: The cells that count.
        repeat: Runs of each agent that are made again; 0 believes the files.
        say: Told what happens.

    Raises:
        ResultsError: No agent's results count, or none of the baseline.
        ConfigError: The floor plans or defaults that are installed are not those of the suite.
    """
    entrants: dict[str, Entrant] = {}
    left_out: list[LeftOut] = []
    for folder in folders:
        for found in _of_folder(ResultsFolder(folder), suite, repeat, say):
            if isinstance(found, LeftOut):
                left_out.append(found)
            elif found.agent in entrants:
                left_out += _second(found, entrants[found.agent])
            else:
                entrants[found.agent] = found
    baseline = suite.config().baseline
    if baseline not in entrants:
        reasons = "".join(f"\n  {out}" for out in left_out)
        raise ResultsError(
            f"there are no results of {baseline} to compare with in these folders, of suite {suite.name} "
            f"(--suite names another){reasons}"
        )
    buildings = {name: plan.building for name, plan in suite.plans.items()}
    return Leaderboard(
        suite=suite.name,
        hash=suite.hash,
        baseline=baseline,
        cells=len(_cells(suite.cells)),
        buildings=len(set(buildings.values())),
        standings=tuple(_ranked(entrants, baseline, buildings)),
        left_out=tuple(left_out),
    )


def _second(found: Entrant, first: Entrant) -> list[LeftOut]:
    """What is said of a second folder with results of the same agent."""
    same = [format_row(_timeless(r)) for r in found.rows] == [format_row(_timeless(r)) for r in first.rows]
    if same:
        return []
    reason = f"{first.folder} holds other results of the same agent, and those count"
    return [LeftOut(agent=found.agent, folder=found.folder, reason=reason)]


def _of_folder(
    folder: ResultsFolder, suite: Suite, repeat: int, say: Callable[[str], None]
) -> list[Entrant | LeftOut]:
    """Every agent of a folder, as it counts or does not."""
    try:
        manifest, rows = folder.manifest(), folder.rows()
    except ResultsError as error:
        reason = str(error).removeprefix(f"{shown_path(folder.path)} ")
        return [LeftOut(agent="", folder=folder.path, reason=reason)]
    if reason := _of_other_cells(manifest, suite.cells):
        return [LeftOut(agent="", folder=folder.path, reason=reason)]
    wanted = _cells(suite.cells)
    found: list[Entrant | LeftOut] = []
    for agent in sorted({row.agent for row in rows} | set(manifest["agents"])):
        mine = sorted((row for row in rows if row.agent == agent), key=lambda row: row.key)
        reason = _incomplete(mine, wanted) or _of_other_weights(agent, manifest)
        chosen = [] if reason else _sample(mine, repeat)
        for row in chosen:
            say(f"repeating {agent} on {row.plan}, start {row.start}, {row.sensor}")
            reason = reason or _differs(row, folder, suite)
        if reason:
            found.append(LeftOut(agent=agent, folder=folder.path, reason=reason))
        else:
            repeated = tuple(row.cell for row in chosen)
            found.append(Entrant(agent=agent, folder=folder.path, repeated=repeated, rows=tuple(mine)))
    return found


def _of_other_cells(manifest: Mapping[str, Any], cells: Mapping[str, Any]) -> str:
    """Why the results of a folder are not of the suite; empty where they are."""
    version = manifest["settings"]["version"]
    if version != layoutexplore.__version__:
        return f"made by version {version}; this is {layoutexplore.__version__}, which may run otherwise"
    theirs = cells_of(manifest)
    key = "rooms of doors"
    theirs[key] = cells[key] | theirs[key]  # earlier results do not note them
    different = ", ".join(name for name in cells if theirs[name] != cells[name])
    return f"other cells than the suite's: different {different}" if different else ""


def _cells(cells: Mapping[str, Any]) -> set[CellKey]:
    """Every cell of a suite."""
    return {(p, k, s) for p in cells["plans"] for k in range(cells["starts"]) for s in cells["lidars"]}


def _incomplete(rows: Sequence[Row], wanted: set[CellKey]) -> str:
    """What is missing of an agent's runs; empty where nothing is."""
    there = {row.cell for row in rows if not row.error}
    failed = sum(bool(row.error) for row in rows)
    if missing := len(wanted - there):
        return f"incomplete: {missing} of {len(wanted)} runs are missing" + (
            f", {failed} of them failed" if failed else ""
        )
    if len(rows) != len(wanted):
        return f"{len(rows)} rows for {len(wanted)} cells"
    return ""


def _of_other_weights(agent: str, manifest: Mapping[str, Any]) -> str:
    """Why an agent here is not the one that ran; empty where it is."""
    try:
        now = fingerprints([agent]).get(agent, "")
    except LayoutExploreError as error:
        return f"cannot be repeated here: {error}"
    noted = manifest["settings"].get("models", {}).get(agent, "")
    return (
        "" if now == noted else f"it ran with other weights or code ({noted or 'none'}; here {now or 'none'})"
    )


def _sample(rows: Sequence[Row], count: int) -> list[Row]:
    """Some runs; which ones follows from the results, so that nobody can choose them."""
    text = "".join(format_row(_timeless(row)) for row in rows)
    seed = int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "little")
    picked = np.random.default_rng(seed).choice(len(rows), min(count, len(rows)), replace=False)
    return [rows[k] for k in sorted(picked.tolist())]


def _differs(row: Row, folder: ResultsFolder, suite: Suite) -> str:
    """How a run comes out otherwise when it is made again; empty where it does not."""
    asked = math.isfinite(row.layout_changed) and row.prediction_seconds != 0
    config = suite.config((row.agent,), explain=asked)
    task = Task(suite.plans[row.plan], row.start, row.sensor, row.agent)
    cell = f"{row.plan}, start {row.start}, {row.sensor}"
    with tempfile.TemporaryDirectory() as place:
        again = ResultsFolder(Path(place))
        made = run_task(task, config, again)
        for name in (f.name for f in dataclasses.fields(Row) if f.name not in _NOT_COMPARED):
            was, now = getattr(row, name), getattr(made, name)
            if was != now and not (was != was and now != now):
                return f"{cell} comes out otherwise when repeated: {name} was {was}, is {now}"
        try:
            theirs = folder.episode(row)
        except ResultsError as error:
            return str(error)
        pairs = zip(("curve", "way"), theirs, again.episode(row), strict=True)
        for name, was_there, is_there in pairs:
            if not np.array_equal(was_there, is_there):
                return f"{cell} comes out otherwise when repeated: its {name} differs"
    return ""


def _timeless(row: Row) -> Row:
    times: dict[str, Any] = dict.fromkeys(TIMING_COLUMNS, 0.0)
    return dataclasses.replace(row, building="", **times)


def _ranked(
    entrants: Mapping[str, Entrant], baseline: str, buildings: Mapping[str, str]
) -> Iterable[Standing]:
    """Bounds first, then the agents with the fewest metres to 95 %."""
    # results of earlier versions name no building, and the suite knows them all
    rows = [
        dataclasses.replace(row, building=buildings[row.plan])
        for entrant in entrants.values()
        for row in entrant.rows
    ]
    comparisons = compare(rows, baseline)
    ratios = over_all_sensors(comparisons)
    bounds = {agent for agent in entrants if knows_the_plan(agent)}
    order = sorted(
        entrants, key=lambda agent: (agent not in bounds, _at_95(ratios, agent).ratio.estimate, agent)
    )
    best = next((agent for agent in order if agent not in bounds), baseline)
    against_best = over_all_sensors(compare(rows, best))
    for k, agent in enumerate(order):
        mine = [c for c in comparisons if c.agent == agent and c.metric == HEADLINE]
        lead = _at_95(against_best, agent).ratio
        yield Standing(
            rank=0 if agent in bounds else k + 1 - len(bounds),
            entrant=entrants[agent],
            ratios={metric: ratios[agent, metric] for metric in METRICS if (agent, metric) in ratios},
            by_sensor={c.sensor: c for c in mine if c.sensor != POOLED},
            tied=agent not in bounds and agent != best and not (lead.low > 1),
        )


def _at_95(comparisons: Mapping[tuple[str, str], Comparison], agent: str) -> Comparison:
    """An agent's metres to 95 %, over all sensors."""
    if (agent, HEADLINE) not in comparisons:
        raise ResultsError(f"no run of {agent} can be compared at 95 %: results.csv is damaged; run it again")
    return comparisons[agent, HEADLINE]
