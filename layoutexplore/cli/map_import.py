"""`layoutexplore maps import`: a user's own building becomes a floor plan, with what to correct in it."""

from __future__ import annotations

import cmath
import warnings
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from layoutexplore.grids.grid import Pose
    from layoutexplore.importing.building import Building
    from layoutexplore.importing.findings import Finding
    from layoutexplore.importing.pictures import PictureConfig
    from layoutexplore.maps.floorplan import FloorPlan

Source = Annotated[
    Path, typer.Argument(help="A ROS map's YAML, an image, or a floor plan of any format that is read.")
]
Out = Annotated[Path, typer.Option(help="GeoJSON file to write; a picture lands beside it.")]
Resolution = Annotated[float | None, typer.Option(help="Metres a pixel of a plain image (0.05 without).")]
ScaleBy = Annotated[
    str | None,
    typer.Option(metavar="'3.2 m = 118 px'", help="Instead: a length known in the image or drawing."),
]
Blueprint = Annotated[
    bool,
    typer.Option("--blueprint", help="A drawn plan: erase words (by tesseract), symbols and door swings."),
]
UnknownGreyOption = Annotated[
    str,
    typer.Option("--unknown-grey", help="Grey level that is unknown: auto, none or a number such as 205."),
]
ImageAnywhere = Annotated[
    bool, typer.Option("--image-anywhere", help="A ROS map's image may lie outside of the YAML's folder.")
]
KeepOutside = Annotated[
    bool, typer.Option("--keep-outside", help="Free space around the building is floor, too.")
]

Rooms = Annotated[str, typer.Option(help="Layout method that finds the rooms of maps and images, or none.")]
Columns = Annotated[
    list[str] | None,
    typer.Option(metavar="room=NAME", help="GeoJSON property with a room's name (or kind, width)."),
]
Doors = Annotated[
    float | None,
    typer.Option(help="Metres: widen narrower doors to it, as thick walls of recorded maps narrow them."),
]
RobotFolder = Annotated[
    Path | None,
    typer.Option(help="Folder for a robot: cleaned map (YAML, PGM), rooms and doors, graph of rooms."),
]
RobotRadius = Annotated[
    float | None,
    typer.Option(help="Metres, for what is out of reach (0.2 without) and the graph's goals (0.25)."),
]

MOST_FINDINGS = 30
"""Findings that are printed; all are drawn."""


def import_plan(
    source: Source,
    out: Out,
    resolution: Resolution = None,
    scale_by: ScaleBy = None,
    blueprint: Blueprint = False,
    unknown_grey: UnknownGreyOption = "auto",
    image_anywhere: ImageAnywhere = False,
    keep_outside: KeepOutside = False,
    rooms: Rooms = "default",
    column: Columns = None,
    doors: Doors = None,
    robot: RobotFolder = None,
    robot_radius: RobotRadius = None,
) -> None:
    """Read a building of your own, find its rooms and doors, and say what to correct.

    A ROS map or a picture is cleaned and divided into rooms by a layout method, unless an image of its rooms
    lies beside it. OUT.geojson is the floor plan, for every command that takes one; OUT.png shows it with the
    places of the findings (OUT_imported.png where another OUT.png lies there); a device or a pipe as OUT gets
    the floor plan alone.
    """
    from layoutexplore.drawing.findings import draw_findings
    from layoutexplore.errors import ConfigError
    from layoutexplore.files import check_places, write_atomically
    from layoutexplore.grids.ros_map import encode_png
    from layoutexplore.importing.doors import widen_doors
    from layoutexplore.importing.findings import ROBOT_RADIUS, find_faults
    from layoutexplore.importing.pictures import picture_config
    from layoutexplore.importing.robot_files import GOAL_RADIUS, write_robot_files
    from layoutexplore.maps.geojson import save_plan
    from layoutexplore.options import Rule

    check_places(None, out, file="--out", robot=robot)
    picture = _picture_place(source, out, robot)
    if doors is not None and robot is not None:
        raise ConfigError("--doors widens doors of the floor plan alone: a robot needs them as they are")
    if robot_radius is not None:
        Rule(low=0.0, high=100.0).convert("--robot-radius", robot_radius)
    config = picture_config(
        resolution=resolution,
        scale_by=scale_by,
        blueprint=blueprint,
        unknown_grey=unknown_grey,
        image_anywhere=image_anywhere,
        keep_outside=keep_outside,
    )
    building = _building(source, config, rooms, _columns(column or []))
    if doors is not None:
        building = replace(building, plan=widen_doors(building.plan, doors))
    findings = find_faults(building.plan, radius=ROBOT_RADIUS if robot_radius is None else robot_radius)
    save_plan(building.plan, out)
    if picture is not None:
        write_atomically(picture, encode_png(draw_findings(building.plan, findings)))
    for line in _summary(out, picture, building, findings):
        typer.echo(line, err=picture is None)  # OUT may be the standard output
    radius = GOAL_RADIUS if robot_radius is None else robot_radius
    for path in [] if robot is None else write_robot_files(building, robot, radius=radius):
        typer.echo(f"wrote {path}", err=picture is None)


def _picture_place(source: Path, out: Path, robot: Path | None) -> Path | None:
    """Where the picture of the floor plan goes; None beside a device or a pipe, which is no place for one.

    Raises:
        ConfigError: Something would be written over what is read, or the floor plan is no GeoJSON by name.
    """
    from layoutexplore.files import check_file, check_kept, is_special
    from layoutexplore.importing.robot_files import ROBOT_FILES
    from layoutexplore.maps.geojson import SUFFIXES, is_saved_plan
    from layoutexplore.maps.library import source_files

    # A plan of ours may be corrected in place.
    kept = [] if is_saved_plan(source) else list(source_files(source))
    check_file(out, suffixes=SUFFIXES, kept=kept)
    if robot is not None:
        check_kept([robot / name for name in ROBOT_FILES], [source, out, *kept], option="--robot")
    if is_special(out):
        return None
    picture, other = out.with_suffix(".png"), out.with_name(f"{out.stem}_imported.png")
    # A picture that lies there before the floor plan does is no drawing of it: it may be somebody's own.
    foreign = picture.exists() and (other.exists() or not out.exists())
    picture = other if foreign or picture in source_files(source) else picture
    check_kept([picture], source_files(source))
    return picture


def _columns(words: list[str]) -> dict[str, str]:
    """What `--column` says: meaning -> name of the property."""
    from layoutexplore.errors import ConfigError, shortened
    from layoutexplore.maps.formats.foreign_geojson import COLUMNS
    from layoutexplore.options import check_keys, split_pairs

    pairs = [word.partition("=") for word in words]
    if wrong := [word for word, (key, _, name) in zip(words, pairs, strict=True) if not (key and name)]:
        raise ConfigError(f"--column needs room=NAME, kind=NAME or width=NAME, got {shortened(wrong[0])}")
    columns = split_pairs("--column", words)
    check_keys(columns, COLUMNS, "--column")
    return columns


def _building(source: Path, config: PictureConfig, rooms: str, columns: dict[str, str]) -> Building:
    """The building of a map or image with rooms found in it, or of a floor plan as it is."""
    from layoutexplore.errors import ConfigError
    from layoutexplore.importing.building import building_of_plan, import_building
    from layoutexplore.importing.doors import through_walls
    from layoutexplore.maps import load_plan
    from layoutexplore.maps.geojson import is_saved_plan
    from layoutexplore.maps.library import shows_rooms

    if shows_rooms(source):
        plan = load_plan(source, resolution=config.resolution, columns=columns)  # else it has no rooms
        config.check_unused(source)
        if rooms != "default":
            raise ConfigError(
                f"{source} has rooms of its own: --rooms, which finds them, means nothing for it"
            )
        plan = through_walls(plan) if is_saved_plan(source) else plan
        return building_of_plan(plan, origin=_turned(source, plan))
    if columns:
        raise ConfigError(f"{source} is a picture: --column is for GeoJSON")
    return import_building(source, config, method=rooms)


def _turned(source: Path, plan: FloorPlan) -> Pose | None:
    """The origin of a ROS map with a yaw, about which the floor plan that was read from it is turned."""
    from layoutexplore.grids.ros_map import YAML_SUFFIXES, load_grid

    if "frame" not in plan.metadata or source.suffix.lower() not in YAML_SUFFIXES:
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what is odd in it has been said
        return load_grid(source).origin


def _place(finding: Finding, frame: Pose) -> str:
    """Where a finding is: in the floor plan, and in a map with a yaw, about whose origin that is turned."""
    told = f"x {finding.x:.1f}, y {finding.y:.1f}"
    if not frame.theta:
        return told
    turn = cmath.rect(1.0, frame.theta)
    point = complex(frame.x, frame.y) + turn * complex(finding.x - frame.x, finding.y - frame.y)
    return f"x {point.real:.1f}, y {point.imag:.1f} of the map ({told} of the floor plan)"


def _summary(out: Path, picture: Path | None, building: Building, findings: list[Finding]) -> list[str]:
    """What was imported, and what to correct in it, with places in metres."""
    from layoutexplore.errors import counted

    plan, frame = building.plan, building.grid.origin
    note = f", {plan.metadata['scale']}" if "scale" in plan.metadata else ""
    rooms, doors = counted(len(plan.rooms), "room"), counted(len(plan.doors), "door")
    drawn = f"{out} is no file: no picture is drawn beside it" if picture is None else f"drawn into {picture}"
    lines = [f"{out}: {plan.name}, {rooms}, {doors}, {plan.area:.0f} m2{note}", drawn]
    if findings:
        kinds = ", ".join(f"{count} {kind}" for kind, count in Counter(f.kind for f in findings).items())
        lines.append(f"to look at ({kinds}){'' if picture is None else ', by number in the picture'}:")
    for number, finding in enumerate(findings[:MOST_FINDINGS], start=1):
        lines.append(f"  {number}. at {_place(finding, frame)}: {finding.text}")
    if len(findings) > MOST_FINDINGS:
        rest = "" if picture is None else ", all in the picture"
        lines.append(f"  ... and {len(findings) - MOST_FINDINGS} more{rest}")
    return lines
