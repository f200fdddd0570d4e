"""`layoutexplore layout`: rooms, walls and lines of grid maps, as label images, GeoJSON and pictures."""

from __future__ import annotations

import json
from collections import Counter
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
    and NAME_overview.png for each map (FOLDER_NAME_... where several maps have one name). A map that cannot
    be read does not keep the others from being done. The time of the first map includes loading compiled
    code.
    """
    from layoutexplore.cli.warm_up import compile_missing
    from layoutexplore.files import check_kept, check_places
    from layoutexplore.importing.pictures import picture_config
    from layoutexplore.layout.pipeline import layout_method
    from layoutexplore.maps.library import source_files
    from layoutexplore.options import JOBS
    from layoutexplore.plugins.transport import worker_map

    layout_method(method)
    config = picture_config(
        resolution=resolution,
        scale_by=scale_by,
        blueprint=blueprint,
        unknown_grey=unknown_grey,
        image_anywhere=image_anywhere,
        keep_outside=keep_outside,
    )
    check_places(out)
    bases = [out / name for name in _names(maps)]
    made = [place for base in bases for place in _places(base)]
    read = [(path, file) for path in maps for file in source_files(path)]
    check_kept(made, [file for path, file in read if file == path or not _is_made(file)])
    work = [(path, method, config, base) for path, base in zip(maps, bases, strict=True)]
    jobs = min(JOBS.convert("--jobs", jobs), len(work))
    compile_missing(("a floor plan", f"layout method {method.partition(':')[0]}"))
    with worker_map(jobs) as spread:
        failed = [_say(summary, as_json) for summary in spread(_attempt, work)]
    if any(failed):
        raise typer.Exit(2)


def _names(maps: list[Path]) -> list[str]:
    """What the results of each map are called: NAME, or FOLDER_NAME where several maps are called alike.

    Raises:
        ConfigError: Results would overwrite each other all the same.
    """
    from layoutexplore.errors import ConfigError

    stems = Counter(path.stem for path in maps)
    names = [p.stem if stems[p.stem] == 1 else f"{p.absolute().parent.name}_{p.stem}" for p in maps]
    names = [name or "map" for name in names]  # of `.` and `/`, which are no maps and are told so
    counts = Counter(names)
    if twice := sorted({path.stem for path, name in zip(maps, names, strict=True) if counts[name] > 1}):
        raise ConfigError(
            f"several maps are called {', '.join(twice)}: their results would overwrite each other; rename "
            "one, or do them one after the other with another --out"
        )
    return names


def _places(base: Path) -> tuple[Path, Path, Path]:
    """The files of a map's results: labels, overview, GeoJSON."""
    endings = ("_labels.png", "_overview.png", "_layout.geojson")
    labels, overview, geojson = (base.with_name(f"{base.name}{ending}") for ending in endings)
    return labels, overview, geojson


def _is_made(labels: Path) -> bool:
    """Whether room numbers are results of this command, by what lies beside them; they are made anew."""
    name = labels.stem.removesuffix("_labels")
    return name != labels.stem and labels.with_name(f"{name}_layout.geojson").is_file()


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
    scale = f", {summary['scale']}" if summary["scale"] else ""
    score = "" if summary["structure_score"] is None else f", W {summary['structure_score']:.2f}"
    typer.echo(
        f"{summary['map']}: {counted(summary['rooms'], 'room')}, {summary['free_area']:.0f} m2 of floor"
        f"{score}, {summary['ms']:.0f} ms{scale} -> {summary['labels']}{note}"
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
    from layoutexplore.grids.ros_map import YAML_SUFFIXES, encode_png
    from layoutexplore.importing.layout_files import layout_with_doors
    from layoutexplore.importing.pictures import read_picture
    from layoutexplore.layout.pipeline import reconstruct
    from layoutexplore.maps.image import said_scale

    path, method, config, base = item
    grid = read_picture(path, config)
    found = reconstruct(grid, method)
    labels, overview, geojson = _places(base)
    write_atomically(labels, encode_png(found.room_labels().astype(np.uint16)[::-1]))
    write_atomically(overview, encode_png(draw_layout(found, grid)))
    write_atomically(geojson, (json.dumps(layout_with_doors(found)) + "\n").encode())
    return {
        "map": str(path),
        "method": method,
        "rooms": len(found.rooms),
        "room_area": round(sum(room.area for room in found.rooms), 3),
        "free_area": round(sum(found.free_areas.values()), 3),
        "structure_score": None if np.isnan(found.structure_score) else round(found.structure_score, 4),
        "scale": "" if path.suffix.lower() in YAML_SUFFIXES else said_scale(config.resolution),
        "ms": round(1000 * found.seconds, 2),
        "timings": {stage: round(1000 * seconds, 3) for stage, seconds in found.timings.items()},
        "warnings": list(found.warnings),
        "labels": str(labels),
        "overview": str(overview),
        "geojson": str(geojson),
    }
