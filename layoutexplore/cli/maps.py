"""`layoutexplore maps`: list, show, import and generate floor plans."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from layoutexplore.cli.map_import import import_plan

if TYPE_CHECKING:
    from layoutexplore.maps.floorplan import FloorPlan

group = typer.Typer(name="maps", help="Floor plans: list, show, import, generate.", no_args_is_help=True)


def register(app: typer.Typer) -> None:
    """Add `maps` to the command line."""
    app.add_typer(group)


group.command(
    "import",
    epilog="Examples: layoutexplore maps import floor.yaml --out floor.geojson; "
    "layoutexplore maps import plan.png --blueprint --scale-by '3.2 m = 118 px' --out plan.geojson",
)(import_plan)


@group.command("list", epilog="Example: layoutexplore maps list --split train")
def list_plans(
    split: Annotated[
        str | None, typer.Option(help="Only this split: quick, train, validation or test.")
    ] = None,
) -> None:
    """List the floor plans that ship, with their split and size."""
    from rich.table import Table

    from layoutexplore.cli.progress import plain_console
    from layoutexplore.maps import load_plan, plan_names, splits
    from layoutexplore.maps.generator import FAMILIES

    table = Table(box=None)
    for heading in ("name", "split", "rooms", "doors", "area m2", "size m"):
        table.add_column(
            heading, justify="left" if heading in ("name", "split") else "right", no_wrap=heading == "name"
        )
    for name in plan_names(split):
        plan = load_plan(name)
        x0, y0, x1, y1 = plan.bounds
        member = ", ".join(group_name for group_name, names in splits().items() if name in names)
        table.add_row(
            name,
            member,
            str(len(plan.rooms)),
            str(len(plan.doors)),
            f"{plan.area:.0f}",
            f"{x1 - x0:.0f} x {y1 - y0:.0f}",
        )
    console = plain_console()
    console.print(table)
    console.print(f"Any number more from the generator: FAMILY:SEED with FAMILY one of {', '.join(FAMILIES)}")


@group.command("show", epilog="Example: layoutexplore maps show office-01 --out office.png")
def show_plan(
    plan: Annotated[str, typer.Argument(help="Name of a shipped plan, FAMILY:SEED, or a file.")],
    out: Annotated[Path | None, typer.Option(help="Also draw the plan into this PNG.")] = None,
    resolution: Annotated[float, typer.Option(help="Metres a cell.")] = 0.1,
    radius: Annotated[
        float, typer.Option(help="Radius of the robot in metres, for what is reachable.")
    ] = 0.2,
) -> None:
    """Show what a floor plan holds: rooms, doors, area, and what a robot can reach."""
    from layoutexplore.files import check_file, is_special
    from layoutexplore.maps import load_plan
    from layoutexplore.maps.library import source_files

    if out is not None:
        check_file(out, suffixes=(".png",), kept=source_files(plan))
    loaded = load_plan(plan)
    is_pipe = out is not None and is_special(out)
    for line in _describe(loaded, resolution, radius):
        typer.echo(line, err=is_pipe)
    if out is not None:
        _draw(loaded, resolution, out)
        typer.echo(f"drawn into {out}", err=is_pipe)


@group.command("generate", epilog="Example: layoutexplore maps generate school --seed 3 --out school.geojson")
def generate_plan(
    family: Annotated[str, typer.Argument(help="Family of buildings, such as office or school.")],
    out: Annotated[Path, typer.Option(help="GeoJSON file to write.")],
    seed: Annotated[int, typer.Option(help="The same seed always gives the same plan.")] = 0,
    area: Annotated[float | None, typer.Option(help="Square metres; drawn from the seed without.")] = None,
) -> None:
    """Generate a floor plan."""
    from layoutexplore.errors import counted
    from layoutexplore.files import check_file, is_special
    from layoutexplore.maps.generator import generate
    from layoutexplore.maps.geojson import SUFFIXES, save_plan

    check_file(out, suffixes=SUFFIXES)
    plan = generate(family, seed) if area is None else generate(family, seed, area=area)
    save_plan(plan, out)
    rooms, doors = counted(len(plan.rooms), "room"), counted(len(plan.doors), "door")
    typer.echo(f"{out}: {plan.name}, {rooms}, {doors}, {plan.area:.0f} m2", err=is_special(out))


def _describe(plan: FloorPlan, resolution: float, radius: float) -> list[str]:
    import numpy as np

    raster = plan.rasterize(resolution)
    cell = resolution**2
    x0, y0, x1, y1 = plan.bounds
    rooms = sorted(plan.rooms, key=lambda room: -room.polygon.area)
    labels = sorted({room.label for room in rooms if room.label})
    open_doors = sum(door.is_open for door in plan.doors)
    return [
        f"{plan.name} (building {plan.building})",
        f"size        {x1 - x0:.1f} x {y1 - y0:.1f} m, floor {plan.area:.0f} m2",
        f"rooms       {len(rooms)}" + (f", the largest {rooms[0].polygon.area:.0f} m2" if rooms else ""),
        f"labels      {', '.join(labels) or 'none'}",
        f"doors       {open_doors} open, {len(plan.doors) - open_doors} closed",
        f"free        {np.count_nonzero(raster.free) * cell:.0f} m2 at {resolution:g} m a cell",
        f"to explore  {np.count_nonzero(raster.coverage_target(radius)) * cell:.0f} m2 for a robot of "
        f"radius {radius:g} m",
        *(f"{key:11s} {value}" for key, value in plan.metadata.items()),
    ]


def _draw(plan: FloorPlan, resolution: float, out: Path) -> None:
    from layoutexplore.drawing.floor_plans import draw_sheet
    from layoutexplore.files import write_atomically
    from layoutexplore.grids.ros_map import encode_png

    write_atomically(out, encode_png(draw_sheet(plan, resolution).image))
