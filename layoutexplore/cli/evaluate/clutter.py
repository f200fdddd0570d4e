"""`layoutexplore evaluate clutter`: how ROSE keeps walls and drops clutter, and its effect on wall lines."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from layoutexplore.cli.evaluate.options import JsonFile, end_study, holding, write_numbers
from layoutexplore.files import check_places

if TYPE_CHECKING:
    from layoutexplore.grids.grid import OccupancyGrid

_FIGURES = {
    "correlation": "correlation of W and precision",
    "correlation_by_count": "the same by number of objects",
    "clean_scores": "W of the clean map",
    "error": "wall-line error with ROSE [rad m]",
    "raw_error": "wall-line error without [rad m]",
}


def clutter(
    maps: Annotated[
        list[Path], typer.Argument(help="Clean grid maps, images or ROS YAML; or folders of images.")
    ],
    resolution: Annotated[float, typer.Option(min=0.001, help="Metres a pixel.")] = 0.05,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder that keeps the trials of each map; the same command goes on in it."),
    ] = None,
    json_file: JsonFile = None,
) -> None:
    """ROSE on clean maps with clutter added.

    Precision, recall, W against precision, and the wall-line error with and without it.
    """
    from layoutexplore.cli.progress import progress_lines
    from layoutexplore.errors import MapError
    from layoutexplore.evaluation.clutter import check_for_clutter, run_study
    from layoutexplore.grids.ros_map import load_grid, usable_maps

    def load(path: Path) -> tuple[str, OccupancyGrid]:
        grid = load_grid(path, resolution=resolution)
        check_for_clutter(str(path), grid)
        return str(path), grid

    check_places(out, json_file)
    files = [f for path in maps for f in (sorted(path.glob("*.png")) if path.is_dir() else [path])]
    if not (chosen := [f for f in files if not f.stem.endswith("_gt")]):
        raise MapError(f"{', '.join(map(str, maps))}: no map NAME.png inside")
    grids, failed = usable_maps(load, chosen)
    with holding(out):
        summary, trials = run_study(dict(grids), progress=progress_lines(), store=out)
    for key, value in asdict(summary).items():
        values = {"": value} if not isinstance(value, dict) else {f", {k}": v for k, v in value.items()}
        for which, number in values.items():
            name = _FIGURES.get(key, key.replace("_", " "))
            typer.echo(f"{name}{which}: {number if isinstance(number, int) else format(number, '.3g')}")
    write_numbers(json_file, {"summary": asdict(summary), "trials": [asdict(t) for t in trials]})
    end_study(failed)
