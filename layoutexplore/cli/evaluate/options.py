"""Options that several commands of `layoutexplore evaluate` share."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from layoutexplore.files import write_json

if TYPE_CHECKING:
    from layoutexplore.predictors.protocol import RoomPredictor

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


def asked_predictors(specs: Iterable[str]) -> dict[str, RoomPredictor]:
    """Predictors by names that make them again: one that two texts mean is there once."""
    from layoutexplore.options import format_spec
    from layoutexplore.predictors import PREDICTORS

    found: dict[str, RoomPredictor] = {}
    for spec in specs:
        entry, options = PREDICTORS.find(spec)
        made = PREDICTORS.build(entry, options)
        # what a user's own code calls itself makes nothing, and is the same whatever its options
        name = made.name if entry.thing is None else format_spec(entry.name, options, entry.options)
        found.setdefault(name, made)
    return found


def asked_sensors(names: Iterable[str] | None) -> tuple[str, ...]:
    """The names of sensors, each once; those of all studies where none is named."""
    from layoutexplore.sensing.lidar import sensor
    from layoutexplore.training.explorations import SENSORS

    return tuple(dict.fromkeys(sensor(name).name for name in names or SENSORS))


def holding(out: Path | None) -> AbstractContextManager[None]:
    """Hold the folder of a study, where it has one, to its end: another one there ends before it works."""
    from layoutexplore.files.locking import held

    return held(out, "study") if out else nullcontext()


def end_study(failed: Sequence[str]) -> None:
    """Name what failed, and end with status 1 if anything did."""
    for text in failed:
        typer.echo(f"failed: {text}")
    if failed:
        raise typer.Exit(1)


def write_numbers(path: Path | None, numbers: dict[str, Any], indent: int | None = 1) -> None:
    """Write what `--json` asks for, if it was given, and say so."""
    if path is not None:
        write_json(path, numbers, indent=indent)
        typer.echo(f"written: {path}")
