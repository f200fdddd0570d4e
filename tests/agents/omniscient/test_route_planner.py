"""Routes that see a share of a known floor plan."""

from __future__ import annotations

from layoutexplore.agents.omniscient.route_planner import RouteConfig, RoutePlanner
from layoutexplore.grids.grid import Cell
from layoutexplore.planning.shortest_paths import geodesic_distances
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.simulation import Simulation
from tests.plans import offices


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
