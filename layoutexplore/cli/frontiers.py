"""`layoutexplore frontiers`: what is open and what is closed on the map of a robot of your own."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from layoutexplore.cli.map_import import ImageAnywhere, Resolution, UnknownGreyOption

if TYPE_CHECKING:
    from layoutexplore.frontiers.decision import Agent, Choice, Decision
    from layoutexplore.grids.arrays import Floats
    from layoutexplore.grids.grid import OccupancyGrid, Pose


def register(app: typer.Typer) -> None:
    """Add `frontiers` to the command line."""
    examples = (
        "layoutexplore frontiers map.yaml --at 3.2,1.5",
        "layoutexplore frontiers map.yaml --agent watchful-tour --sensor indoor --out found",
    )
    app.command("frontiers", epilog="Examples: " + "; ".join(examples))(show_frontiers)


Place = Annotated[
    str | None,
    typer.Option(
        metavar="X,Y[,THETA]",
        help="Where the robot is, in metres and radians. Default: where most floor is clear around it.",
    ),
]
Strategy = Annotated[str, typer.Option(help="Who chooses; its predictor completes the rooms.")]
Lidar = Annotated[str, typer.Option(help="Lidar of the robot: stage, indoor, short or mapex.")]
Radius = Annotated[float, typer.Option(help="Of the robot, in metres.")]
Folder = Annotated[
    Path | None,
    typer.Option(help="Folder for NAME_frontiers.png and NAME_rooms.geojson, the rooms completed."),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object instead of a table.")]


def show_frontiers(
    source: Annotated[
        Path, typer.Argument(metavar="MAP", help="ROS map YAML file or image of a map that is not finished.")
    ],
    at: Place = None,
    agent: Strategy = "layout-tour",
    sensor: Lidar = "stage",
    robot_radius: Radius = 0.2,
    resolution: Resolution = None,
    unknown_grey: UnknownGreyOption = "auto",
    image_anywhere: ImageAnywhere = False,
    out: Folder = None,
    as_json: AsJson = False,
) -> None:
    """The frontiers of a robot's map, which of them are closed, and where an agent goes next.

    The map is one that a robot has recorded so far. Rooms that it has half seen are completed; a frontier is
    closed where it leads to no more than the rest of such a room, and open where it leads on.
    """
    from layoutexplore.agents import make_agent
    from layoutexplore.cli.explore import parse_start
    from layoutexplore.errors import ConfigError, LayoutExploreError
    from layoutexplore.files import check_places, naming
    from layoutexplore.frontiers.decision import Privileged, predictor_of
    from layoutexplore.importing.pictures import picture_config, read_picture
    from layoutexplore.predictors.robot_map import RobotMap

    check_places(out)
    pose = parse_start(at, "--at")
    config = picture_config(
        resolution=resolution,
        unknown_grey=unknown_grey,
        image_anywhere=image_anywhere,
        keep_outside=True,  # floor at the edge of a map that is not finished is no garden
    )
    chosen = make_agent(agent)
    if isinstance(chosen, Privileged):
        raise ConfigError(f"{agent} goes by the true floor plan, which no map of a robot tells")
    robot_map = RobotMap(predictor_of(chosen), sensor=sensor, robot_radius=robot_radius)
    grid = read_picture(source, config)
    with naming(source, LayoutExploreError):
        decision = robot_map.decide(grid, pose or _clearest(grid))
    choice = _answer(chosen, decision)
    way = robot_map.way(decision, choice)
    written = [] if out is None else _write(out / source.stem, decision, choice, way)
    found = {
        "map": str(source),
        "pose": list(decision.pose),
        "agent": agent,
        "choice": choice if isinstance(choice, int) and choice >= 0 else None,
        "way": way.round(3).tolist(),
        "frontiers": _rows(decision),
        "written": [str(path) for path in written],
    }
    typer.echo(json.dumps(found)) if as_json else _print(found)


def _clearest(grid: OccupancyGrid) -> Pose:
    """Where a robot has the most room around it."""
    import cv2
    import numpy as np

    from layoutexplore.grids.grid import Pose

    free = np.pad(grid.free.astype(np.uint8), 1)
    row, col = np.unravel_index(cv2.distanceTransform(free, cv2.DIST_L2, 5)[1:-1, 1:-1].argmax(), grid.shape)
    return Pose(*grid.cell_to_world(int(row), int(col)))


def _answer(agent: Agent, decision: Decision) -> Choice:
    """What the agent chooses; to stop where nothing is left."""
    from layoutexplore.frontiers.decision import STOP
    from layoutexplore.frontiers.walks import plain_choice

    agent.reset(0)
    return plain_choice(agent.act(decision)) if decision.frontiers else STOP


def _rows(decision: Decision) -> list[dict[str, Any]]:
    """The frontiers, nearest first: lengths in metres, areas in square metres."""
    return [
        {
            "x": round(frontier.centroid[0], 3),
            "y": round(frontier.centroid[1], 3),
            "path_length": round(frontier.path_length, 3),
            "size": round(frontier.size, 3),
            "visible_area": round(frontier.visible_area, 3),
            "closed": frontier.is_closed,
            "confidence": None if frontier.confidence is None else round(frontier.confidence, 3),
            "expected_area": None if frontier.expected_area is None else round(frontier.expected_area, 3),
        }
        for frontier in decision.frontiers
    ]


def _write(base: Path, decision: Decision, choice: Choice, way: Floats) -> list[Path]:
    """The picture, and the rooms where some are predicted."""
    from layoutexplore.drawing.pictures import draw_decision
    from layoutexplore.files import write_atomically
    from layoutexplore.grids.ros_map import encode_png
    from layoutexplore.layout.export import layout_to_geojson

    picture, rooms = (base.with_name(f"{base.name}{end}") for end in ("_frontiers.png", "_rooms.geojson"))
    target = choice if isinstance(choice, int) and choice >= 0 else None
    write_atomically(picture, encode_png(draw_decision(decision, target=target, way=way)))
    if decision.rooms is None:
        return [picture]
    write_atomically(rooms, (json.dumps(layout_to_geojson(decision.rooms.layout)) + "\n").encode())
    return [picture, rooms]


def _print(found: dict[str, Any]) -> None:
    """A table of the frontiers, and what comes next."""
    from rich.table import Table

    from layoutexplore.cli.progress import plain_console
    from layoutexplore.errors import counted

    console = plain_console()
    names = "", "class", "sure", "m2 behind", "m2 in view", "m to go", "m long", "x", "y"
    rows: list[tuple[str, ...]] = [names]
    for k, row in enumerate(found["frontiers"]):
        judged = row["closed"] is not None
        rows.append(
            (
                f"{'>' if k == found['choice'] else ' '}{k:3}",
                ("closed" if row["closed"] else "open") if judged else "",
                f"{100 * row['confidence']:.0f} %" if judged else "",
                f"{row['expected_area']:.1f}" if judged else "",
                *(f"{row[name]:.1f}" for name in ("visible_area", "path_length", "size", "x", "y")),
            )
        )
    table, columns = Table(box=None, pad_edge=False), list(zip(*rows, strict=True))
    widths = [max(map(len, column)) for column in columns]
    if sum(widths) + 2 * len(widths) > console.width:  # headings are broken, what stands below them never is
        widths = [max(map(len, (*name.split(), *values))) for name, *values in columns]
    for (name, *_), width in zip(columns, widths, strict=True):
        table.add_column(name, justify="left" if name == "class" else "right", width=width)
    for line in rows[1:]:
        table.add_row(*line)
    x, y, theta = found["pose"]
    left = counted(len(found["frontiers"]), "frontier")
    told = f"{found['map']}: {left} to look at from ({x:.2f}, {y:.2f}), heading {theta:.2f}"
    console.print(told, soft_wrap=True)
    if found["frontiers"]:
        plain_console(width=max(console.width, sum(widths) + 2 * len(widths))).print(table)
    goal = "goes to ({:.2f}, {:.2f})".format(*found["way"][-1]) if found["way"] else "stops"
    then = ", where it looks around and decides anew" if found["way"] and found["choice"] is None else ""
    console.print(f"{found['agent']} {goal}{then}")
    for path in found["written"]:
        console.print(f"wrote {path}", soft_wrap=True)
