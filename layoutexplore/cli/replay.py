"""`layoutexplore replay`: runs of a benchmark as a page that plays them again."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from layoutexplore.benchmark.rows import Row

HELP = """Write a page that plays runs of a benchmark again: map, frontiers, rooms believed, coverage.

Without options, every run of the folder, as far as a page can hold them.

[bold]Examples[/bold]

  layoutexplore replay benchmark-results --plan office-01 --agent tour

  layoutexplore replay benchmark-results --plan office-01 --start 1 --out office-01.html
"""


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("replay", help=HELP)(replay)


def replay(
    folder: Annotated[Path, typer.Argument(help="Results folder of `layoutexplore benchmark`.")] = Path(
        "benchmark-results"
    ),
    plan: Annotated[list[str] | None, typer.Option(help="Floor plan. Repeatable.")] = None,
    agent: Annotated[list[str] | None, typer.Option(help="Agent. Repeatable.")] = None,
    start: Annotated[list[int] | None, typer.Option(help="Number of the start, from 0. Repeatable.")] = None,
    sensor: Annotated[list[str] | None, typer.Option(help="Sensor. Repeatable.")] = None,
    out: Annotated[Path, typer.Option(help="The page.")] = Path("replay.html"),
) -> None:
    """Write the page."""
    from layoutexplore.benchmark.store import ResultsFolder
    from layoutexplore.errors import counted, require
    from layoutexplore.report.replay import write_replay

    require("jinja2", "bench")
    results = ResultsFolder(folder)
    results.manifest()
    rows = sorted(results.rows(), key=lambda row: row.key)
    for name, wanted in (("plan", plan), ("agent", agent), ("start", start), ("sensor", sensor)):
        rows = _only(rows, name, wanted, folder)
    count = write_replay(results, rows, out)
    typer.echo(f"wrote {out}: {count} of {counted(sum(not row.error for row in rows), 'run')}")


def _only(rows: Sequence[Row], name: str, wanted: Sequence[object] | None, folder: Path) -> list[Row]:
    """Those of some runs that have one of the wanted values; one that none has is told."""
    from layoutexplore.errors import unknown_name

    known = sorted({str(getattr(row, name)) for row in rows})
    for value in wanted or ():
        if str(value) not in known:
            raise unknown_name(f"{name} of the runs in {folder}", str(value), known)
    return [row for row in rows if not wanted or getattr(row, name) in wanted]
