"""Options that several commands of `layoutexplore evaluate` share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from layoutexplore.files import write_json

FloorPlans = Annotated[list[str], typer.Argument(help="Floor plans: names, splits, files or folders.")]
Sensors = Annotated[
    list[str] | None, typer.Option("--sensor", "-s", help="Sensor; stage and indoor when none is named.")
]
Starts = Annotated[int, typer.Option(min=1, max=10_000, help="Starts on each floor plan.")]
Workers = Annotated[int | None, typer.Option(min=1, help="Worker processes. Default: one per core.")]
PageFolder = Annotated[
    Path, typer.Option(help="Folder for the page and the runs; the same command goes on in it.")
]
JsonFile = Annotated[Path | None, typer.Option("--json", help="Write every number into this file.")]
PlanFolders = Annotated[
    list[str] | None,
    typer.Option(help="Floor plans, or folders of them, to simulate from besides generated ones."),
]


def write_numbers(path: Path | None, numbers: dict[str, Any], indent: int | None = 1) -> None:
    """Write what `--json` asks for, if it was given, and say so."""
    if path is not None:
        write_json(path, numbers, indent=indent)
        typer.echo(f"written: {path}")
