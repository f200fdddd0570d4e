"""Routes that see a share of a known floor plan."""

from __future__ import annotations

import itertools

import numpy as np

from layoutexplore.agents.omniscient.route_planner import PlannedRoute, Quota, RouteConfig, RoutePlanner
from layoutexplore.agents.omniscient.visibility import size
from layoutexplore.grids.grid import Cell
from layoutexplore.planning.shortest_paths import geodesic_distances
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.simulation import Simulation
from tests.plans import offices

NOTHING = PlannedRoute(np.empty((0, 2), np.int32), 0)


def test_a_smaller_quota_makes_a_shorter_route() -> None:
    simulation = Simulation(offices(), SimulationConfig(sensor="short"))
    simulation.reset(seed=0)
    start = simulation.truth.raster.world_to_cell(*simulation.pose[:2])
    lengths = []
    for coverage in (0.5, 0.8, 0.99):
        stops = RoutePlanner.of(simulation.truth, RouteConfig(coverage=coverage, rounds=3)).plan(start)
        assert simulation.truth.reachable[stops[:, 0], stops[:, 1]].all()
        cells = [start, *(Cell(int(r), int(c)) for r, c in stops)]
        fields = [geodesic_distances(simulation.truth.reachable, cell, 0.1) for cell in cells]
        lengths.append(sum(float(field[cell]) for field, cell in zip(fields, cells[1:], strict=False)))
    assert lengths[0] < lengths[1] < lengths[2]


def test_a_plan_that_shows_enough_is_kept_and_one_that_does_not_is_filled_up() -> None:
    simulation = Simulation(offices(), SimulationConfig(sensor="short"))
    simulation.reset(seed=0)
    start = simulation.truth.raster.world_to_cell(*simulation.pose[:2])
    planner = RoutePlanner.of(simulation.truth, RouteConfig(rounds=0))
    places = planner.places
    nothing, count = np.zeros(places.visibility.words, np.uint64), places.visibility.count

    def replanned(plan: PlannedRoute, wanted: float, least: float) -> PlannedRoute:
        quotas = [Quota(int(wanted * count), int(least * count))] * 2
        return planner.replan(start, nothing, plan, quotas, seed=0)

    def shown(plan: PlannedRoute) -> float:
        stops = [places.at(start), *(places.at(Cell(int(r), int(c))) for r, c in plan.stops)]
        legs = [places.way(a.cell, b.cell) for a, b in itertools.pairwise(stops)]
        return size(np.bitwise_or.reduce([*(stop.seen for stop in stops), *legs])) / count

    plan = replanned(NOTHING, 0.8, 0.8)
    assert 0.8 <= shown(plan) < 0.95
    kept = replanned(plan, 0.97, 0.75)
    assert shown(plan) - 1e-9 <= shown(kept) < 0.95
    assert shown(replanned(plan, 0.97, 0.96)) >= 0.97


def test_a_place_that_shows_everything_leaves_nothing_to_plan() -> None:
    simulation = Simulation(offices(), SimulationConfig(sensor="short"))
    simulation.reset(seed=0)
    start = simulation.truth.raster.world_to_cell(*simulation.pose[:2])
    planner = RoutePlanner.of(simulation.truth)
    everything = np.full(planner.places.visibility.words, ~np.uint64(0))
    quotas = [Quota(64 * planner.places.visibility.words + 1, 0)] * 2
    assert len(planner.replan(start, everything, NOTHING, quotas, seed=0).stops) == 0
