"""`layoutexplore agents`, `predictors` and `methods`: what there is to choose from, with its parameters."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from layoutexplore.plugins.registry import Description

AsJson = Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")]


def register(app: typer.Typer) -> None:
    """Add the commands to the application."""
    app.command("agents", epilog="Example: layoutexplore agents --json")(agents)
    app.command("predictors", epilog="Example: layoutexplore predictors")(predictors)
    app.command("methods", epilog="Example: layoutexplore methods")(methods)


def agents(as_json: AsJson = False) -> None:
    """List the agents, with their parameters, their defaults and what they mean."""
    from layoutexplore.agents import AGENTS

    _show(AGENTS.describe(), "FILE.py:CLASS", as_json)


def predictors(as_json: AsJson = False) -> None:
    """List the predictors of rooms, with their parameters, their defaults and what they mean."""
    from layoutexplore.predictors import PREDICTORS

    _show(PREDICTORS.describe(), "FILE.py:CLASS", as_json)


def methods(as_json: AsJson = False) -> None:
    """List the layout methods, with their options and their defaults."""
    from layoutexplore.layout.pipeline import LAYOUTS

    _show(LAYOUTS.describe(), "FILE.py:FUNCTION", as_json)


def _show(rows: Sequence[Description], own: str, as_json: bool) -> None:
    if as_json:
        found = [
            {
                "name": row.name,
                "summary": row.summary,
                "parameters": [
                    {"name": name, "default": default, "meaning": meaning}
                    for name, default, meaning in row.parameters
                ],
            }
            for row in rows
        ]
        typer.echo(json.dumps(found, indent=1))
        return
    from rich.table import Table
    from rich.text import Text

    from layoutexplore.cli.progress import plain_console

    table = Table(box=None, header_style="bold", pad_edge=False)
    for heading in ("name", "parameter", "default", "what it does"):
        table.add_column(heading, overflow="fold", no_wrap=heading == "name")
    for row in rows:
        table.add_row(Text(row.name, "bold"), "", "", row.summary)
        for name, default, meaning in row.parameters:
            table.add_row("", name, default, Text(meaning, "dim"))
    console = plain_console()
    console.print(table)
    console.print(
        f"\nParameters are written NAME:key=value,key=value. One of your own: {own}:key=value", soft_wrap=True
    )
