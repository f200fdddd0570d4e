"""`layoutexplore explore`: one exploration, watched."""

from __future__ import annotations

import functools
import math
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from layoutexplore.benchmark.rows import Row
    from layoutexplore.cli.exploration import RunWatcher
    from layoutexplore.frontiers.decision import Agent
    from layoutexplore.grids.grid import Pose
    from layoutexplore.maps.floorplan import FloorPlan
    from layoutexplore.simulation.config import SimulationConfig
    from layoutexplore.simulation.saved_run import SavedRun
    from layoutexplore.simulation.simulation import Simulation

HELP = """Explore one floor plan with one agent; print what came of it, and film it.

[bold]Examples[/bold]

  layoutexplore explore office-01 --agent tour --video tour.mp4

  layoutexplore explore school-01 --agent layout-tour --out run

  layoutexplore explore floor.png --sensor indoor --start 3.2,1.5,0 --out run

  layoutexplore explore office-01 --region "0,0 12,0 12,9 0,9" --return --out run

  layoutexplore explore office-01 --agent plan-tour --prior evacuation-plan.png

  layoutexplore explore office-01 --pause-after 80 --save-state run.npz

  layoutexplore explore office-01 --continue run.npz
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


ConfigFile = Annotated[
    Path | None,
    typer.Option(
        help="\\[simulation] and \\[lidars.NAME] of a benchmark: its TOML file or its results' run.toml."
    ),
]


RegionText = Annotated[
    str | None,
    typer.Option(
        metavar='"X,Y X,Y X,Y ..."|FILE',
        help="Explore inside this polygon alone: corners in metres, or a GeoJSON file.",
    ),
]

StateFile = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Keep the run in this file as it goes, for --continue.")
]

SavedFile = Annotated[
    Path | None,
    typer.Option(
        "--continue",
        metavar="FILE",
        help="Go on with a run of --save-state: its agent, sensor, seed, start and region count.",
    ),
]


NoiseLevel = Annotated[
    str, typer.Option(help="Odometry and lidar: low, middle or high noise. Default: none.")
]
PlanName = Annotated[str, typer.Argument(help="Floor plan: a name, FAMILY:SEED, or a file.")]
AgentName = Annotated[str, typer.Option(help="Strategy, such as tour or nearest:min_size=0.4.")]
SensorName = Annotated[str, typer.Option(help="Lidar: stage, indoor, short or mapex.")]
Seed = Annotated[
    int, typer.Option(min=0, help="Decides the start, the noise and the agent's own randomness.")
]
Start = Annotated[
    str | None, typer.Option(metavar="X,Y[,THETA]", help="Start in metres, and heading in radians.")
]
Returns = Annotated[bool, typer.Option("--return", help="Send the robot back to its start in the end.")]
PauseAfter = Annotated[
    float | None, typer.Option(min=0, metavar="METRES", help="Pause at the first decision from here on.")
]
Video = Annotated[Path | None, typer.Option(help="Write an .mp4 or .gif of the run.")]
FramesPerSecond = Annotated[float, typer.Option(min=0.5, max=60, help="Frames of the video per second.")]


PriorFile = Annotated[
    str | None,
    typer.Option(
        metavar="FILE",
        help="A plan known beforehand: a floor plan, a blueprint or the picture of an evacuation plan, "
        "at any scale and rotation. For agents with a predictor, such as plan-tour.",
    ),
]
PriorScale = Annotated[
    float | None, typer.Option(help="Metres a pixel of that picture (a metre of that floor plan).")
]


def explore(
    context: typer.Context,
    plan: PlanName,
    agent: AgentName = "nearest",
    sensor: SensorName = "stage",
    seed: Seed = 0,
    start: Start = None,
    region: RegionText = None,
    noise: NoiseLevel = "",
    returns: Returns = False,
    pause_after: PauseAfter = None,
    save_state: StateFile = None,
    saved_state: SavedFile = None,
    video: Video = None,
    fps: FramesPerSecond = 24.0,
    out: RunFolder = None,
    config: ConfigFile = None,
    prior: PriorFile = None,
    prior_scale: PriorScale = None,
) -> None:
    """Explore one floor plan."""
    from layoutexplore.benchmark.rows import Row, score_run
    from layoutexplore.cli.exploration import RunWatcher, check_run_files, film_of, notes_of, save_run
    from layoutexplore.cli.progress import ProgressLine, plain_console
    from layoutexplore.files import check_places
    from layoutexplore.files.locking import held
    from layoutexplore.maps.library import load_plan
    from layoutexplore.options import KEPT_SEED
    from layoutexplore.simulation.episode import play
    from layoutexplore.simulation.saved_run import read_saved_run

    check_places(out, save_state, file="--save-state")
    if save_state:
        KEPT_SEED.convert("--seed", seed)
    check_run_files([plan] if prior is None else [plan, prior], out, save_state)
    saved = read_saved_run(saved_state) if saved_state else None
    settings = saved.config if saved else _settings(config, sensor, region, noise)
    if saved:
        agent, seed, sensor = _as_saved(saved, context)
    agent = with_prior(agent, prior, prior_scale)
    begin, until = parse_start(start), functools.partial(_has_come, pause_after)
    simulation, chosen = _prepared(load_plan(plan), settings, agent)
    notes = notes_of(agent, chosen, simulation, saved.notes if saved else None)
    with held(out, "run") if out else nullcontext():
        with ProgressLine(plain_console(), "% seen") as line, film_of(video, fps) as film:
            watcher = RunWatcher(line, notes, pictures=bool(out), state_file=save_state, goes_on=bool(saved))
            if film:
                simulation.on_scan = lambda state: film.add(watcher.draw(state))
            episode = play(
                simulation, chosen, seed=seed, start=begin, on_step=watcher.note, until=until, saved=saved
            )
            watcher.save(simulation)
            simulation.on_scan = None
        row = Row(plan=simulation.plan.name, start=0, sensor=sensor, agent=agent, seed=seed)
        row = score_run(row, simulation, episode)
        _tell(row, simulation, watcher, returns=returns, filmed=video is not None)
        for path in filter(None, (video, save_state, *(save_run(out, simulation, watcher) if out else ()))):
            plain_console().print(f"wrote {path}", soft_wrap=True)


def _as_saved(saved: SavedRun, context: typer.Context) -> tuple[str, int, str]:
    """The agent, the seed and the sensor of a run that goes on; says which options are not heeded."""
    asked, sensor = context.params, saved.config.lidar.name
    kept = {"agent": saved.notes.get("agent", asked["agent"]), "seed": saved.seed, "sensor": sensor}
    fixed = (*kept, "start", "region", "noise", "config")
    given = [
        name for name in fixed if getattr(context.get_parameter_source(name), "name", "") == "COMMANDLINE"
    ]
    if other := [f"--{name}" for name in given if name not in kept or asked[name] != kept[name]]:
        told = f"the run goes on as it was saved, with {kept['agent']}, seed {saved.seed} and {sensor}"
        typer.echo(f"{', '.join(other)} not heeded: {told}", err=True)
    return kept["agent"], saved.seed, sensor


def _tell(row: Row, simulation: Simulation, watcher: RunWatcher, *, returns: bool, filmed: bool) -> None:
    """Print what came of a run, after the way back if there is to be one."""
    from layoutexplore.cli.exploration import summary, way_home
    from layoutexplore.cli.progress import plain_console

    back = way_home(simulation) if returns and simulation.done else ""
    plain_console().print(summary(row, filmed=filmed, back=back, prior=watcher.belief(simulation)))


def _prepared(floor: FloorPlan, settings: SimulationConfig, agent: str) -> tuple[Simulation, Agent]:
    """The simulation and the agent of a run; what they need is compiled."""
    from layoutexplore.benchmark.rows import prepare
    from layoutexplore.cli.warm_up import compile_missing

    compile_missing(_uses(agent, settings, floor))
    simulation, chosen = prepare(floor, settings, agent)
    note_unused(simulation)
    return simulation, chosen


def _uses(agent: str, settings: SimulationConfig, floor: FloorPlan) -> set[str]:
    """What a run needs of what the list of kernels knows."""
    from layoutexplore.agents import make_agent
    from layoutexplore.frontiers.decision import predictor_of
    from layoutexplore.processes.kernel_list import LARGE_MAP, uses_of_runs
    from layoutexplore.simulation.config import SimulationConfig
    from layoutexplore.simulation.state import is_large, is_noisy

    sensor, predictor = settings.lidar.name, predictor_of(make_agent(agent))
    plain = sensor == SimulationConfig().lidar.name and not is_noisy(settings)
    uses = uses_of_runs([agent], [] if plain else [sensor], predicts=predictor != "none")
    if str(predictor).startswith("prior:"):
        uses.add("a prior plan")
    return uses | {LARGE_MAP} if is_large(floor, settings) else uses


def _has_come(metres: float | None, simulation: Simulation) -> bool:
    """Whether the robot has travelled so far; never where no distance is given."""
    return metres is not None and simulation.distance >= metres


def _settings(config: Path | None, sensor: str, region: str | None, noise: str) -> SimulationConfig:
    """How the run is simulated, by the options that say so."""
    import dataclasses

    from layoutexplore.benchmark.config import simulation_of_file
    from layoutexplore.simulation.config import SimulationConfig
    from layoutexplore.simulation.region import read_region

    settings = simulation_of_file(config, sensor) if config else SimulationConfig(sensor=sensor)
    if noise:
        settings = dataclasses.replace(settings, noise=noise)
    return dataclasses.replace(settings, region=read_region(region)) if region is not None else settings


def with_prior(agent: str, prior: str | None, scale: float | None) -> str:
    """The agent whose predictor is a plan known beforehand.

    Raises:
        ConfigError: A scale without a plan or that is none, or an agent that names a predictor already or
            takes none.

    Example:
        >>> with_prior("layout-tour", "plan.png", 0.02)
        'layout-tour:predictor=prior:plan.png;scale=0.02'
    """
    from layoutexplore.agents import make_agent
    from layoutexplore.errors import ConfigError, shortened
    from layoutexplore.options import Rule

    if prior is None:
        if scale is not None:
            raise ConfigError("--prior-scale says how large the plan of --prior is: give that, too")
        return agent
    if "predictor=" in agent or not hasattr(make_agent(agent), "predictor"):
        raise ConfigError(
            f"--prior needs an agent that takes a predictor and names none, got {shortened(agent)}"
        )
    if set(prior) & set(",;="):
        raise ConfigError(f"--prior: the name {shortened(prior)} must have none of , ; =")
    Rule(above=0.0, high=1e4, optional=True).convert("--prior-scale", scale)
    hint = "" if scale is None else f";scale={scale:g}"
    return f"{agent}{',' if ':' in agent else ':'}predictor=prior:{prior}{hint}"


def note_unused(simulation: Simulation) -> None:
    """Say so where a plan known beforehand tells nothing."""
    from layoutexplore.simulation.episode import untimed

    if reason := getattr(untimed(simulation.predictor), "unused", ""):
        typer.echo(f"the prior plan is not used, because {reason}", err=True)


def parse_start(text: str | None, option: str = "--start") -> Pose | None:
    """A pose from "X,Y" or "X,Y,THETA", as an option tells it.

    Raises:
        ConfigError: It is not two or three finite numbers.

    Example:
        >>> parse_start("1.5,2,0.1")
        Pose(x=1.5, y=2.0, theta=0.1)
    """
    from layoutexplore.errors import ConfigError, shortened
    from layoutexplore.grids.grid import Pose

    if text is None:
        return None
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (2, 3) or not all(map(math.isfinite, numbers)):
        raise ConfigError(f"{option} needs X,Y or X,Y,THETA in metres and radians, got {shortened(text)}")
    return Pose(*numbers)
