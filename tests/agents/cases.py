"""Decisions in drawn grids, and runs of an agent."""

from __future__ import annotations

import dataclasses

import numpy as np

from layoutexplore.agents import make_agent
from layoutexplore.frontiers.decision import STOP, Decision, KnownDistances, Privileged
from layoutexplore.frontiers.table import Frontier
from layoutexplore.grids.grid import Cell, OccupancyGrid, Pose
from layoutexplore.planning.shortest_paths import geodesic_distances
from layoutexplore.predictors import make_predictor
from layoutexplore.sensing.lidar import LidarConfig
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.simulation import Simulation
from tests.plans import offices


def run(
    spec: str, sensor: str = "indoor", seed: int = 0, *, predictor: str = "none", noise: str = ""
) -> Simulation:
    config = SimulationConfig(sensor=sensor, noise=noise)
    simulation = Simulation(offices(), config, make_predictor(predictor))
    decision = simulation.reset(seed=seed)
    agent = make_agent(spec)
    agent.reset(seed)
    if isinstance(agent, Privileged):
        agent.reveal(simulation.truth)
    while not simulation.done:
        decision = simulation.step(agent.act(decision))
        assert simulation.decisions < 1000
    return simulation


def decide(drawing: str, *frontiers: tuple[int, int, float, float]) -> Decision:
    """A decision on an ASCII grid (# wall, . free, R robot; 1 m) and frontiers (row, col, size, area)."""
    lines = drawing.split()[::-1]
    cells = np.array([[100 if c == "#" else 0 for c in line] for line in lines], np.int8)
    robot = next(Cell(r, line.index("R")) for r, line in enumerate(lines) if "R" in line)
    grid = OccupancyGrid(cells, 1.0)
    distances = geodesic_distances(grid.free, robot, 1.0)
    pose = Pose(*grid.cell_to_world(*robot))
    found = []
    for row, col, length, area in frontiers:
        x, y = grid.cell_to_world(row, col)
        found.append(
            Frontier(
                cells=np.array([[row, col]], np.int32),
                size=length,
                centroid=(x, y),
                viewpoint=Cell(row, col),
                path_length=float(distances[row, col]),
                straight_distance=float(np.hypot(x - pose.x, y - pose.y)),
                visible_area=area,
            )
        )
    found.sort(key=lambda frontier: frontier.path_length)
    return Decision(
        0,
        grid,
        pose,
        tuple(found),
        KnownDistances(distances),
        0.0,
        LidarConfig(range_max=8.0, fov=6.28, beams=8),
        0.2,
    )


def chosen(spec: str, decision: Decision) -> tuple[int, int]:
    """The viewpoint that an agent goes to."""
    agent = make_agent(spec)
    agent.reset(0)
    index = agent.act(decision)
    assert isinstance(index, int) and index != STOP
    viewpoint = decision.frontiers[index].viewpoint
    return viewpoint.row, viewpoint.col


CORRIDOR = "#################### #......R...........# ####################"


AROUND_A_WALL = "########### #.R#......# #..#......# #.........# ###########"


def looking(decision: Decision, *, fov: float = 3.0, turn_cost: float = 0.0) -> Decision:
    """The decision of a robot with such a lidar, for which turning costs so much."""
    sensor = dataclasses.replace(decision.sensor, fov=fov)
    return dataclasses.replace(decision, sensor=sensor, turn_cost=turn_cost)
