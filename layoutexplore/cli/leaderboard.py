"""`layoutexplore leaderboard`: results of a suite, checked, repeated in part, and ranked."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

HELP = """Rank the agents of results of a suite: checked against its hash, and repeated in part.

Results of other cells, another version, other weights, or with runs missing are named and left out.

[bold]Example[/bold]

  layoutexplore benchmark --suite v1 --agents tour --out tour-v1

  layoutexplore leaderboard tour-v1 others-v1 --out leaderboard
"""


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("leaderboard", help=HELP)(leaderboard)


def leaderboard(
    folders: Annotated[list[Path], typer.Argument(help="Results of `layoutexplore benchmark --suite`.")],
    suite: Annotated[str, typer.Option(help="The suite: its name, or its TOML file.")] = "v1",
    repeat: Annotated[
        int, typer.Option(min=0, help="Runs of each agent that are made again; 0 believes the files.")
    ] = 3,
    out: Annotated[Path, typer.Option(help="Folder of the page and the tables.")] = Path("leaderboard"),
) -> None:
    """Check, repeat and rank."""
    from layoutexplore.benchmark.leaderboard import make_leaderboard
    from layoutexplore.benchmark.suite import load_suite
    from layoutexplore.errors import require
    from layoutexplore.files import check_places
    from layoutexplore.report.leaderboard import write_leaderboard

    require("jinja2", "bench")
    check_places(out)
    board = make_leaderboard(folders, load_suite(suite), repeat=repeat, say=typer.echo)
    for left_out in board.left_out:
        typer.echo(f"left out: {left_out}")
    for path in write_leaderboard(board, out):
        typer.echo(f"wrote {path}")
