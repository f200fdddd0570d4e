"""`layoutexplore layout`: rooms, walls and lines of grid maps, as label images, GeoJSON and pictures."""

from __future__ import annotations

import json
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from layoutexplore.cli.map_import import (
    Blueprint,
    ImageAnywhere,
    KeepOutside,
    Resolution,
    ScaleBy,
    UnknownGreyOption,
)
from layoutexplore.processes import end_with_parent

if TYPE_CHECKING:
    from layoutexplore.importing.pictures import PictureConfig


def register(app: typer.Typer) -> None:
    """Add `layout` to the command line."""
    examples = (
        "layoutexplore layout floor.yaml --out layouts",
        "layoutexplore layout evacuation.png --blueprint",
    )
    app.command("layout", epilog="Examples: " + "; ".join(examples))(layout)


def layout(
    maps: Annotated[list[Path], typer.Argument(help="ROS map YAML files or images.")],
    method: Annotated[
        str,
        typer.Option(
            "--method", "-m", help="As `layoutexplore methods` lists them, or FILE.py:FUNCTION of your own."
        ),
    ] = "default",
    resolution: Resolution = None,
    scale_by: ScaleBy = None,
    blueprint: Blueprint = False,
    unknown_grey: UnknownGreyOption = "auto",
    image_anywhere: ImageAnywhere = False,
    keep_outside: KeepOutside = False,
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path(),
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object a map instead of a line.")
    ] = False,
    jobs: Annotated[int, typer.Option(min=1, help="Maps done at the same time.")] = 1,
) -> None:
    """Reconstruct the layout of grid maps.

    Writes NAME_labels.png (16-bit room ids in the image's own orientation, 0 for none), NAME_layout.geojson
    and NAME_overview.png for each map. A map that cannot be read does not keep the others from being
    done. The time of the first map includes loading compiled code.
    """
    from layoutexplore.errors import ConfigError
    from layoutexplore.files import check_places
    from layoutexplore.importing.pictures import picture_config
    from layoutexplore.layout.pipeline import layout_method
    from layoutexplore.options import JOBS

    layout_method(method)
    config = picture_config(
        resolution=resolution,
        scale_by=scale_by,
        blueprint=blueprint,
        unknown_grey=unknown_grey,
        image_anywhere=image_anywhere,
        keep_outside=keep_outside,
    )
    names = [path.stem for path in maps]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ConfigError(
            f"several maps are called {', '.join(twice)}: their results would overwrite each other"
        )
    check_places(out)
    work = [(path, method, config, out) for path in maps]
    jobs = min(JOBS.convert("--jobs", jobs), len(work))
    if jobs == 1:
        failed = [_say(_attempt(item), as_json) for item in work]
    else:
        with ProcessPoolExecutor(jobs, get_context("spawn"), end_with_parent) as pool:
            failed = [_say(summary, as_json) for summary in pool.map(_attempt, work)]
    if any(failed):
        raise typer.Exit(2)


def _say(summary: dict[str, Any] | str, as_json: bool) -> bool:
    """Print what became of a map; whether it failed."""
    from layoutexplore.errors import counted

    if isinstance(summary, str):
        typer.echo(f"layoutexplore: {summary}", err=True)
        return True
    if as_json:
        typer.echo(json.dumps(summary))
        return False
    note = f"  warning: {'; '.join(summary['warnings'])}" if summary["warnings"] else ""
    score = "" if summary["structure_score"] is None else f", W {summary['structure_score']:.2f}"
    typer.echo(
        f"{summary['map']}: {counted(summary['rooms'], 'room')}, {summary['room_area']:.0f} m2{score}, "
        f"{summary['ms']:.0f} ms"
        f" -> {summary['labels']}{note}"
    )
    return False


def _attempt(item: tuple[Path, str, PictureConfig, Path]) -> dict[str, Any] | str:
    """What `_reconstruct` sums up, or what is wrong with the map."""
    from layoutexplore.errors import MapError

    try:
        return _reconstruct(item)
    except MapError as error:
        return str(error)


def _reconstruct(item: tuple[Path, str, PictureConfig, Path]) -> dict[str, Any]:
    """Reconstruct one map, write its files, and sum up."""
    import numpy as np

    from layoutexplore.drawing.layouts import draw_layout
    from layoutexplore.files import write_atomically
    from layoutexplore.grids.ros_map import encode_png
    from layoutexplore.importing.layout_files import layout_with_doors
    from layoutexplore.importing.pictures import read_picture
    from layoutexplore.layout.pipeline import reconstruct

    path, method, config, out = item
    grid = read_picture(path, config)
    found = reconstruct(grid, method)
    labels = out / f"{path.stem}_labels.png"
    overview = out / f"{path.stem}_overview.png"
    geojson = out / f"{path.stem}_layout.geojson"
    write_atomically(labels, encode_png(found.room_labels().astype(np.uint16)[::-1]))
    write_atomically(overview, encode_png(draw_layout(found, grid)))
    write_atomically(geojson, (json.dumps(layout_with_doors(found)) + "\n").encode())
    return {
        "map": str(path),
        "method": method,
        "rooms": len(found.rooms),
        "room_area": round(sum(room.area for room in found.rooms), 3),
        "structure_score": None if np.isnan(found.structure_score) else round(found.structure_score, 4),
        "ms": round(1000 * found.seconds, 2),
        "timings": {stage: round(1000 * seconds, 3) for stage, seconds in found.timings.items()},
        "warnings": list(found.warnings),
        "labels": str(labels),
        "overview": str(overview),
        "geojson": str(geojson),
    }
