"""`layoutexplore warm-up`: compile everything that the commands use."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import TYPE_CHECKING

import typer

from layoutexplore.errors import LayoutExploreError

if TYPE_CHECKING:
    from rich.console import Console

    from layoutexplore.grids.grid import OccupancyGrid
    from layoutexplore.maps.floorplan import FloorPlan
    from layoutexplore.simulation.config import SimulationConfig

OTHER_AGENTS = ("mapex-gain", "aamas-2021", "policy", "layout-gain", "gain-exp", "distance-advantage")
"""Agents with kernels that those of the quick benchmark do not use."""

PREDICTORS = ("rectangle", "hull", "parallel-wall", "face-subset", "oracle:flip=0.1", "layout:network=off")


MOST_JOBS = 4
"""Processes that do the steps: what the list of kernels lacks, they wait for together."""


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("warm-up", epilog="Example: layoutexplore warm-up")(warm_up_kernels)


def warm_up_kernels() -> None:
    """Compile all kernels now instead of at their first use; they are kept for the next time."""
    import time

    from layoutexplore.benchmark.pool import run_all
    from layoutexplore.cli.progress import ProgressLine, plain_console
    from layoutexplore.processes import usable_cores

    began, console, jobs = time.monotonic(), plain_console(), usable_cores()
    compile_missing(_steps(), console)
    with ProgressLine(console, "steps") as line:
        results = run_all(_do_step, list(_steps()), jobs=min(jobs, MOST_JOBS), lost=_tell_of_lost)
        for done, name in enumerate(results, 1):
            line.advance(done, len(_steps()), done / len(_steps()), name)
    console.print(f"done in {time.monotonic() - began:.0f} s; what was compiled is kept for the next time")


def compile_missing(uses: Iterable[str], console: Console | None = None) -> None:
    """Compile what some uses need and no cache has: on all cores, and not one after another as it comes.

    Args:
        uses: Some of those of `warm_up_steps`, and maybe others.
        console: Where it is shown how far it is; the error stream when None.
    """
    from layoutexplore.cli.progress import ProgressLine, plain_console
    from layoutexplore.processes import usable_cores
    from layoutexplore.processes.compilation import LISTENER
    from layoutexplore.processes.kernel_list import compile_kernels, missing_kernels

    if missing := missing_kernels(uses):
        LISTENER.is_silent = True  # the bar says it
        with ProgressLine(console or plain_console(stderr=True), "kernels compiled, once") as line:
            compile_kernels(missing, usable_cores(), lambda k, total: line.advance(k, total, k / total))


@functools.cache
def _steps() -> dict[str, Callable[[], object]]:
    return dict(warm_up_steps())


def _do_step(name: str) -> str:
    _steps()[name]()
    return name


def _tell_of_lost(name: str) -> str:
    raise LayoutExploreError(f"{name}: the process that compiled what it needs was killed (out of memory?)")


def warm_up_steps() -> Iterator[tuple[str, Callable[[], object]]]:
    """Names of what the commands use, each with a call that compiles its kernels."""
    from layoutexplore.benchmark.config import QUICK_AGENTS
    from layoutexplore.benchmark.plans import warm_up_plan
    from layoutexplore.closed_doors.prediction import predict_closed_rooms
    from layoutexplore.importing.cleaning import without_noise
    from layoutexplore.layout.pipeline import METHOD_MODULES, reconstruct
    from layoutexplore.processes.kernel_list import LARGE_MAP
    from layoutexplore.sensing.lidar import SENSORS
    from layoutexplore.simulation.config import SimulationConfig
    from layoutexplore.simulation.robot import OdometryNoise

    yield "a floor plan", _map
    for agent in (*QUICK_AGENTS, *OTHER_AGENTS):
        yield f"agent {agent}", partial(_explore, warm_up_plan, SimulationConfig(), agent)
    noise = OdometryNoise(translation=0.02, rotation=0.01)
    for sensor in SENSORS:
        config = SimulationConfig(sensor=sensor, odometry_noise=noise)
        yield f"sensor {sensor}", partial(_explore, warm_up_plan, config, "nearest")
    yield "a whole exploration", partial(_explore, _apartment, SimulationConfig(), "layout-tour")
    agent, config = "plan-tour:predictor=prior:rough", SimulationConfig(sensor="indoor")
    yield "a prior plan", partial(_explore, _apartment, config, agent)
    for environment in ("Frontier", "Motion"):
        yield f"environment {environment}", partial(_step, environment)
    for method in METHOD_MODULES:
        yield f"layout method {method}", partial(_on_map, reconstruct, method)
    yield "ragged walls", partial(_on_map, reconstruct, of=ragged_map)
    for name in (*PREDICTORS, *(f"reconstruct:{method}" for method in METHOD_MODULES)):
        yield f"predictor {name}", partial(_predict, name)
    yield "closed doors", partial(_on_map, predict_closed_rooms)
    config = SimulationConfig(sensor="indoor", resolution=0.01)  # path lengths come from the map's corners
    yield LARGE_MAP, partial(_explore, _apartment, config, "nearest")
    yield "a recorded map", partial(_on_map, without_noise)


def _apartment() -> FloorPlan:
    """A floor plan as others have."""
    from layoutexplore.maps.library import load_plan

    return load_plan("apartment-01")


def _map() -> OccupancyGrid:
    return _apartment().rasterize(0.05).grid


def _on_map(
    function: Callable[..., object], *arguments: object, of: Callable[[], OccupancyGrid] = _map
) -> object:
    return function(of(), *arguments)


def ragged_map() -> OccupancyGrid:
    """A map with walls in pieces, as recorded ones are."""
    import numpy as np

    from layoutexplore.grids.grid import FREE, OccupancyGrid

    grid = _map()
    missing = grid.occupied & (np.random.default_rng(0).random(grid.shape) < 0.4)
    return OccupancyGrid(np.where(missing, FREE, grid.cells).astype(np.int8), grid.resolution)


def _explore(plan: Callable[[], FloorPlan], simulation: SimulationConfig, agent: str) -> None:
    from layoutexplore.benchmark.counterfactual import CounterfactualRollouts
    from layoutexplore.benchmark.rows import prepare
    from layoutexplore.simulation.episode import play

    play(*prepare(plan(), simulation, agent), probe=CounterfactualRollouts)


def _predict(name: str) -> None:
    from layoutexplore.benchmark.plans import warm_up_plan
    from layoutexplore.predictors import make_room_predictor
    from layoutexplore.simulation.config import SimulationConfig
    from layoutexplore.simulation.simulation import Simulation

    predictor = make_room_predictor(name)
    decision = Simulation(warm_up_plan(), SimulationConfig(), predictor).reset(seed=0)
    if decision.frontiers:
        predictor.rooms(decision)


def _step(environment: str) -> None:
    import gymnasium

    from layoutexplore.benchmark.plans import warm_up_plan

    env = gymnasium.make(f"LayoutExplore/{environment}-v0", plan=warm_up_plan())
    env.reset(seed=0)
    for _ in range(3):
        _, _, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:  # a tiny plan may be seen at once
            env.reset()


def record() -> None:
    """Make the list of kernels anew, of this program: an import of this module and a call of it."""
    from pathlib import Path

    from layoutexplore.processes import kernel_list
    from layoutexplore.processes.kernel_recording import record_kernels

    text = record_kernels(list(_steps()), _do_step)
    Path(kernel_list.__file__).with_name(kernel_list.FILE).write_text(text, encoding="utf-8")
