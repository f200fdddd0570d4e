"""`layoutexplore explore`: one exploration, watched."""

from __future__ import annotations

import math
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.table import Table

    from layoutexplore.benchmark.rows import Row
    from layoutexplore.drawing.film import Film
    from layoutexplore.grids.grid import Pose
    from layoutexplore.simulation.simulation import Simulation

HELP = """Explore one floor plan with one agent; print what came of it, and film it.

[bold]Examples[/bold]

  layoutexplore explore office-01 --agent tour --video tour.mp4

  layoutexplore explore school-01 --agent layout-tour --out run

  layoutexplore explore floor.png --sensor indoor --start 3.2,1.5,0 --out run
"""


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("explore", help=HELP)(explore)


RunFolder = Annotated[
    Path | None,
    typer.Option(
        help="Folder for pictures and the rooms believed (a quarter each), the final map (ROS YAML and "
        "PGM), the path walked and the coverage curve."
    ),
]


def explore(
    plan: Annotated[str, typer.Argument(help="Floor plan: a name, FAMILY:SEED, or a file.")],
    agent: Annotated[str, typer.Option(help="Strategy, such as tour or nearest:min_size=0.4.")] = "nearest",
    sensor: Annotated[str, typer.Option(help="Lidar: stage, indoor, short or mapex.")] = "stage",
    seed: Annotated[
        int, typer.Option(min=0, help="Decides the start, the noise and the agent's own randomness.")
    ] = 0,
    start: Annotated[
        str | None, typer.Option(metavar="X,Y[,THETA]", help="Start in metres, and heading in radians.")
    ] = None,
    video: Annotated[Path | None, typer.Option(help="Write an .mp4 or .gif of the run.")] = None,
    fps: Annotated[float, typer.Option(min=0.5, max=60, help="Frames of the video per second.")] = 24.0,
    out: RunFolder = None,
) -> None:
    """Explore one floor plan."""
    from rich.console import Console

    from layoutexplore.benchmark.rows import Row, prepare, score_run
    from layoutexplore.cli.progress import ProgressLine
    from layoutexplore.drawing.pictures import draw_state
    from layoutexplore.files import check_places
    from layoutexplore.grids.ros_map import encode_png
    from layoutexplore.layout.export import layout_to_geojson
    from layoutexplore.simulation.config import SimulationConfig
    from layoutexplore.simulation.episode import play

    check_places(out)
    console = Console(highlight=False)
    simulation, chosen = prepare(plan, SimulationConfig(sensor=sensor), agent)
    pictures: dict[int, bytes] = {}
    layouts: dict[int, dict[str, Any]] = {}
    with ProgressLine(console, "% seen") as line, _film(video, fps) as film:

        def show(state: Simulation) -> None:
            share = min(1.0, state.coverage / state.config.coverage_goal)
            line.advance(
                int(100 * state.coverage), 100, share, f"{state.distance:.0f} m, {state.decisions} decisions"
            )
            quarter = 25 * int(4 * state.coverage)
            if out and (quarter not in pictures or state.done):
                percent = 100 if state.done else quarter
                pictures[percent] = encode_png(draw_state(state, agent=agent))
                if state.decision.rooms is not None:
                    layouts[percent] = layout_to_geojson(state.decision.rooms.layout)

        if film:
            simulation.on_scan = lambda state: film.add(draw_state(state, agent=agent))
        episode = play(simulation, chosen, seed=seed, start=parse_start(start), on_step=show)
    row = score_run(
        Row(plan=simulation.plan.name, start=0, sensor=sensor, agent=agent, seed=seed), simulation, episode
    )
    console.print(_summary(row, filmed=video is not None))
    if video:
        console.print(f"wrote {video}", soft_wrap=True)
    if out:
        for path in save_run(out, simulation, pictures, layouts):
            console.print(f"wrote {path}", soft_wrap=True)


def parse_start(text: str | None) -> Pose | None:
    """A pose from "X,Y" or "X,Y,THETA".

    Raises:
        ConfigError: It is not two or three finite numbers.

    Example:
        >>> parse_start("1.5,2,0.1")
        Pose(x=1.5, y=2.0, theta=0.1)
    """
    from layoutexplore.errors import ConfigError
    from layoutexplore.grids.grid import Pose

    if text is None:
        return None
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (2, 3) or not all(map(math.isfinite, numbers)):
        raise ConfigError(f"--start needs X,Y or X,Y,THETA in metres and radians, got {text!r}")
    return Pose(*numbers)


def save_run(
    folder: Path, simulation: Simulation, pictures: dict[int, bytes], layouts: dict[int, dict[str, Any]]
) -> list[Path]:
    """Write map, track, curve, pictures and layouts (by percent seen) of a run; the files written."""
    import io
    import json

    import numpy as np

    from layoutexplore.files import write_atomically
    from layoutexplore.grids.ros_map import save_grid

    save_grid(simulation.mapper.grid, folder / "map.yaml")
    tables = {
        "track": (simulation.track, "%.4f", "x,y,theta"),
        "curve": (simulation.curve, "%.6f", "distance,coverage,scan"),
    }
    for name, (table, digits, header) in tables.items():
        text = io.StringIO()
        np.savetxt(text, table, digits, ",", header=header, comments="")
        write_atomically(folder / f"{name}.csv", text.getvalue().encode())
    for percent, picture in pictures.items():
        write_atomically(folder / f"seen_{percent:03}.png", picture)
    for percent, layout in layouts.items():
        write_atomically(folder / f"rooms_{percent:03}.geojson", json.dumps(layout) + "\n")
    names = ["map.yaml", "track.csv", "curve.csv", *(f"seen_{percent:03}.png" for percent in pictures)]
    names += [f"rooms_{percent:03}.geojson" for percent in layouts]
    return [folder / name for name in names]


def _film(path: Path | None, fps: float) -> AbstractContextManager[Film | None]:
    if path is None:
        return nullcontext()
    from layoutexplore.drawing.film import Film

    return Film(path, fps=fps)


def _summary(row: Row, *, filmed: bool) -> Table:
    from rich.table import Table

    table = Table(box=None, show_header=False, pad_edge=False)
    reached = {"d90": row.reached90, "d95": row.reached95, "d99": row.reached99}
    lines = [
        ("floor plan", f"{row.plan}, {row.target_area:.0f} m² to see"),
        ("agent, sensor", f"{row.agent}, {row.sensor}"),
        ("ended by", row.stop_reason),
        ("seen", f"{100 * row.coverage:.1f} %, {row.rooms_finished} of {row.rooms} rooms finished"),
        ("travelled", f"{row.distance:.1f} m, {100 * row.revisits:.0f} % of it where it had been before"),
        *(
            (f"{name[1:]} % seen after", f"{getattr(row, name):.1f} m" if ok else "not reached")
            for name, ok in reached.items()
        ),
        ("decisions", f"{row.decisions}, {row.ms_decision_median:.2f} ms each (median)"),
        ("scans", f"{row.scans}"),
        ("took", f"{row.wall_seconds:.1f} s{', filming included' if filmed else ''}"),
    ]
    for line in lines:
        table.add_row(*line)
    return table
