"""The page of a leaderboard, with the same tables as Markdown and CSV."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import layoutexplore
from layoutexplore.benchmark.analysis import METRICS
from layoutexplore.benchmark.leaderboard import Leaderboard, Standing
from layoutexplore.errors import checks_arguments
from layoutexplore.files import write_atomically, write_csv
from layoutexplore.report.plots import forest
from layoutexplore.report.templates import render


@checks_arguments
def write_leaderboard(board: Leaderboard, out: Path) -> list[Path]:
    """Write leaderboard.html, leaderboard.md and leaderboard.csv.

    Args:
        board: The ranking.
        out: The folder.

    Returns:
        The files written, the page first.
    """
    comparisons = [c for standing in board.standings for c in standing.ratios.values()]
    sensors = sorted({name for standing in board.standings for name in standing.by_sensor})
    view: dict[str, Any] = {
        "board": board,
        "baseline": board.baseline,
        "repeated": any(standing.entrant.repeated for standing in board.standings),
        "forest": forest(comparisons),
        "sensors": sensors if len(sensors) > 1 else [],
        "metrics": METRICS,
        "version": layoutexplore.__version__,
    }
    written = []
    for name in ("leaderboard.html", "leaderboard.md"):
        write_atomically(out / name, render(name, **view))
        written.append(out / name)
    write_csv(out / "leaderboard.csv", [_flat(standing) for standing in board.standings])
    return [*written, out / "leaderboard.csv"]


def _flat(standing: Standing) -> dict[str, Any]:
    """A line of the CSV file."""
    entrant = standing.entrant
    row: dict[str, Any] = {
        "rank": standing.rank or "",
        "agent": entrant.agent,
        "tied_with_best": standing.tied,
    }
    for metric in METRICS:
        ratio = standing.ratios[metric].ratio if metric in standing.ratios else None
        for end in ("estimate", "low", "high"):
            row[f"{metric}_{end}"] = float("nan") if ratio is None else getattr(ratio, end)
    for sensor, c in sorted(standing.by_sensor.items()):
        row[f"d95_{sensor}"] = c.ratio.estimate
    reached = standing.ratios.get("d99")
    row |= {"reached99": reached.reached if reached else float("nan"), "runs": len(entrant.rows)}
    return row | {"repeated": len(entrant.repeated), "folder": str(entrant.folder)}
