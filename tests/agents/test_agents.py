"""Agents: by name, each by its rule, and a bound that knows the floor plan."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

from layoutexplore.agents import agent_names, describe_agents, make_agent
from layoutexplore.agents.base import register
from layoutexplore.agents.greedy import Nearest, NearestOptions, best_index
from layoutexplore.agents.omniscient.route import cheapest_gaps
from layoutexplore.agents.omniscient.route_planner import RouteConfig, WatchmanPlanner
from layoutexplore.agents.omniscient.visibility import Sight, added_sizes, size
from layoutexplore.errors import ConfigError, UnknownNameError
from layoutexplore.frontiers.decision import STOP, Agent, Decision, Frontier, Privileged
from layoutexplore.grids.grid import Cell, OccupancyGrid, Pose
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.planning.shortest_paths import geodesic_distances
from layoutexplore.sensing.lidar import LidarConfig, around
from layoutexplore.sensing.mapper import Mapper
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.simulation import Simulation

REQUIRED = [
    "random",
    "nearest",
    "nearest-0.4",
    "nearest-straight",
    "cost-utility-0.5",
    "cost-utility-0.9",
    "gain-over-distance",
    "gain-exp",
    "wait-3",
    "wait-8",
    "tour",
    "tour-0.4",
    "distance-advantage",
    "clairvoyant",
]

OFFICES = """
################################
#aaaaaaa#bbbbbbbbb#ccccc#dddddd#
#aaaaaaa#bbbbbbbbb#ccccc#dddddd#
#aaaaaaa#bbbbbbbbb#ccccc#dddddd#
####.#######..######.######.####
#eeeeeeeeeeeeeeeeeeeeeeeeeeeeee#
#eeeeeeeeeeeeeeeeeeeeeeeeeeeeee#
###.########.########.##########
#fffffff#ggggggggg#hhhhhhhhhhhh#
#fffffff#ggggggggg#hhhhhhhhhhhh#
#fffffff#ggggggggg#hhhhhhhhhhhh#
################################
"""


def offices() -> FloorPlan:
    return floorplan_from_ascii(OFFICES, resolution=0.6)


def run(spec: str, sensor: str = "indoor", seed: int = 0) -> Simulation:
    simulation = Simulation(offices(), SimulationConfig(sensor=sensor))
    decision = simulation.reset(seed=seed)
    agent = make_agent(spec)
    agent.reset(seed)
    if isinstance(agent, Privileged):
        agent.reveal(simulation.truth)
    while not simulation.done:
        decision = simulation.step(agent.act(decision))
    return simulation


def decide(drawing: str, *frontiers: tuple[int, int, float, float]) -> Decision:
    """A decision on an ASCII grid (# wall, . free, R robot; 1 m cells) with frontiers (row, col, size, visible area)."""
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
        0, grid, pose, tuple(found), distances, 0.0, LidarConfig(range_max=8.0, fov=6.28, beams=8), 0.2
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


# ---- the registry


def test_every_arm_of_the_benchmark_is_there() -> None:
    assert set(REQUIRED) <= set(agent_names())
    described = {row.name: row for row in describe_agents()}
    assert set(described) == set(agent_names()) and all(row.summary for row in described.values())
    assert described["nearest-0.4"].parameters[0][:2] == ("min_size", "0.4")


@pytest.mark.parametrize("name", agent_names())
def test_agents_keep_the_protocol(name: str) -> None:
    agent = make_agent(name)
    assert isinstance(agent, Agent) and agent.name == name and name in repr(agent)
    if not isinstance(agent, Privileged):
        assert agent.act(dataclasses.replace(decide(CORRIDOR), frontiers=())) == STOP


@pytest.mark.parametrize(
    ("spec", "name"),
    [
        ("nearest:min_size=0.40", "nearest:min_size=0.4"),
        (" nearest : min_size = 1".replace(" :", ":"), "nearest"),
        ("nearest:distance=straight,min_size=0.5", "nearest:min_size=0.5,distance=straight"),
        ("cost-utility-0.9:alpha=0.9", "cost-utility-0.9"),
        ("clairvoyant:rounds=3", "clairvoyant:rounds=3"),
    ],
)
def test_specs_have_a_canonical_name(spec: str, name: str) -> None:
    assert make_agent(spec).name == name
    assert make_agent(make_agent(spec).name).name == name


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ("nearst", "did you mean 'nearest'"),
        ("nearest:minsize=1", "did you mean 'min_size'"),
        ("nearest:", "nothing follows the colon"),
        ("nearest:min_size", "not of the form key=value"),
        ("nearest:min_size=", "not of the form key=value"),
        ("nearest:min_size=1,min_size=2", "given twice"),
        ("nearest:min_size=big", "must be a number, got 'big'"),
        ("nearest:min_size=nan", "must be a finite number, 0 or more"),
        ("nearest:min_size=-1", "must be a finite number, 0 or more"),
        ("nearest:distance=euclid", "unknown distance 'euclid'"),
        ("cost-utility:alpha=1.5", "from 0 to 1"),
        ("clairvoyant:rounds=2.5", "a whole number"),
        ("random:p=1", "has no parameters"),
        ("", "unknown agent"),
    ],
)
def test_bad_specs_say_what_is_wrong(spec: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        make_agent(spec)


def test_unknown_names_are_unknown_name_errors() -> None:
    with pytest.raises(UnknownNameError):
        make_agent("toor")


def test_a_name_is_given_once() -> None:
    register("nearest", "the same again", Nearest, NearestOptions())
    with pytest.raises(ConfigError, match="already"):
        register("nearest", "another", Nearest, NearestOptions(min_size=3.0))


# ---- one decision


def test_nearest_by_path_and_by_straight_line_differ_behind_a_wall() -> None:
    decision = decide(AROUND_A_WALL, (3, 4, 2.0, 1.0), (1, 1, 2.0, 1.0))
    assert chosen("nearest", decision) == (1, 1)
    assert chosen("nearest-straight", decision) == (3, 4)


def test_small_frontiers_wait_until_no_other_is_left() -> None:
    near, far = (1, 6, 0.5, 1.0), (1, 15, 1.0, 1.0)
    assert chosen("nearest", decide(CORRIDOR, near, far)) == (1, 15)
    assert chosen("nearest-0.4", decide(CORRIDOR, near, far)) == (1, 6)
    assert chosen("nearest", decide(CORRIDOR, near)) == (1, 6)


def test_frontiers_with_little_in_sight_wait() -> None:
    decision = decide(CORRIDOR, (1, 8, 2.0, 2.0), (1, 10, 2.0, 5.0), (1, 17, 2.0, 9.0))
    assert [chosen(spec, decision)[1] for spec in ("wait:area=0", "wait-3", "wait-8", "wait:area=50")] == [
        8,
        10,
        17,
        8,
    ]


def test_gain_and_cost_are_weighed() -> None:
    decision = decide(CORRIDOR, (1, 8, 2.0, 1.0), (1, 17, 2.0, 20.0))
    assert chosen("cost-utility:alpha=1", decision) == (1, 8)
    assert chosen("cost-utility:alpha=0", decision) == (1, 17)
    assert chosen("gain-over-distance", decision) == (1, 17)  # 20 / 10 against 1 / 1
    assert chosen("gain-exp:rate=0.2", decision) == (1, 17)
    assert chosen("gain-exp:rate=0.5", decision) == (1, 8)
    assert chosen("gain-exp:rate=500", decision) == (1, 8)


def test_a_tour_takes_the_short_end_first() -> None:
    """To the left is one frontier, to the right are two: nearest goes right, the tour left."""
    decision = decide(CORRIDOR, (1, 4, 2.0, 1.0), (1, 9, 2.0, 1.0), (1, 17, 2.0, 1.0))
    assert chosen("nearest", decision) == (1, 9)
    assert chosen("tour", decision) == (1, 4)


def test_distance_advantage_clears_the_lonely_frontier_first() -> None:
    decision = decide(CORRIDOR, (1, 4, 2.0, 1.0), (1, 9, 2.0, 1.0), (1, 10, 2.0, 1.0), (1, 11, 2.0, 1.0))
    assert chosen("distance-advantage:weight=0", decision) == (1, 9)
    assert chosen("distance-advantage:weight=1", decision) == (1, 4)
    assert chosen("distance-advantage", decide(CORRIDOR, (1, 4, 2.0, 1.0))) == (1, 4)


def test_ties_go_to_the_nearest_then_to_the_first() -> None:
    assert best_index(np.array([0.3, 0.1 + 0.2, 0.3]), np.array([2.0, 1.0, 1.0])) == 1
    assert best_index(np.zeros(3), np.array([2.0, 2.0, 3.0])) == 0
    nothing_in_sight = decide(CORRIDOR, (1, 4, 2.0, 0.0), (1, 9, 2.0, 0.0))
    for name in ("cost-utility-0.5", "gain-over-distance", "gain-exp", "wait-3"):
        assert chosen(name, nothing_in_sight) == (1, 9)


def test_random_follows_its_seed() -> None:
    decision = decide(CORRIDOR, *((1, col, 2.0, 1.0) for col in range(1, 18)))
    agent = make_agent("random")

    def draws(seed: int) -> list[object]:
        agent.reset(seed)
        return [agent.act(decision) for _ in range(20)]

    assert draws(1) == draws(1) != draws(2)


# ---- whole runs


@pytest.mark.parametrize("name", REQUIRED)
def test_agents_explore_and_repeat_themselves(name: str) -> None:
    spec = "clairvoyant:rounds=2" if name == "clairvoyant" else name
    one, same = run(spec), run(spec)
    assert one.stop_reason == "coverage"
    assert np.array_equal(one.track, same.track)


# ---- the floor plan known


@pytest.mark.parametrize("sensor", ["stage", "indoor", "short"])
def test_clairvoyant_is_shorter_than_nearest(sensor: str) -> None:
    known, nearest = run("clairvoyant:rounds=5", sensor), run("nearest", sensor)
    assert known.coverage >= 0.99 and known.distance < 0.9 * nearest.distance


def test_clairvoyant_has_to_be_shown_the_floor_plan() -> None:
    agent = make_agent("clairvoyant")
    agent.reset(0)
    with pytest.raises(ConfigError, match="reveal"):
        agent.act(decide(CORRIDOR, (1, 4, 2.0, 1.0)))


def test_a_smaller_quota_makes_a_shorter_route() -> None:
    simulation = Simulation(offices(), SimulationConfig(sensor="short"))
    simulation.reset(seed=0)
    start = simulation.truth.raster.world_to_cell(*simulation.pose[:2])
    lengths = []
    for coverage in (0.5, 0.8, 0.99):
        stops = WatchmanPlanner(simulation.truth, RouteConfig(coverage=coverage, rounds=3)).plan(start)
        assert simulation.truth.reachable[stops[:, 0], stops[:, 1]].all()
        cells = [start, *(Cell(int(r), int(c)) for r, c in stops)]
        fields = [geodesic_distances(simulation.truth.reachable, cell, 0.1) for cell in cells]
        lengths.append(sum(float(field[cell]) for field, cell in zip(fields, cells[1:], strict=False)))
    assert lengths[0] < lengths[1] < lengths[2]


@pytest.mark.parametrize("sensor", ["indoor", "stage"])
def test_sight_agrees_with_the_lidar(sensor: str) -> None:
    """A full turn shows what a scan marks, up to what falls between its fewer beams."""
    simulation = Simulation(offices(), SimulationConfig(sensor=sensor))
    simulation.reset(seed=0)
    truth, raster = simulation.truth, simulation.raster
    sight = Sight(truth, 0.5)
    cells = np.argwhere(truth.reachable)[:: len(np.argwhere(truth.reachable)) // 12].astype(np.int32)
    everything = np.bitwise_or.reduce(
        sight.turning(np.argwhere(truth.reachable)[::40].astype(np.int32)), axis=0
    )
    assert size(everything) > 0.98 * sight.count
    for cell, seen in zip(cells, sight.turning(cells), strict=True):
        mapper = Mapper(raster.shape, raster.resolution, raster.origin)
        mapper.observe(simulation.lidar, Pose(*raster.cell_to_world(*cell)), full_turn=True)
        share = np.count_nonzero(truth.target & mapper.grid.free) / np.count_nonzero(truth.target)
        assert -0.03 < size(seen) / sight.count - share < 0.01


def test_sight_ahead_and_around() -> None:
    simulation = Simulation(offices(), SimulationConfig(sensor="stage"))
    simulation.reset(seed=0)
    sight = Sight(simulation.truth, 0.5)
    row, cols = 36, np.arange(30, 60)
    path = np.stack([np.full(len(cols), row), cols], axis=1).astype(np.int32)
    ahead, back = sight.walking(path), sight.walking(path[::-1])
    both = ahead | back
    assert 0 < size(ahead) < size(both) and 0 < size(back) < size(both)
    assert size(sight.walking(path[:4])) == 0, "no scan falls due on a short way"
    assert around(simulation.config.lidar).full_turn


def test_sets_are_counted() -> None:
    rng = np.random.default_rng(0)
    sets: NDArray[np.uint64] = rng.integers(0, 2**64, (5, 7), dtype=np.uint64)
    other: NDArray[np.uint64] = rng.integers(0, 2**64, 7, dtype=np.uint64)
    expected = [
        sum(bin(int(a) & ~int(b) & (2**64 - 1)).count("1") for a, b in zip(row, other, strict=True))
        for row in sets
    ]
    assert added_sizes(sets, np.arange(5), other).tolist() == expected
    assert size(other) == sum(bin(int(b)).count("1") for b in other)


def test_cheapest_gaps_against_trying_all() -> None:
    rng = np.random.default_rng(1)
    near = rng.uniform(1, 9, (4, 50)).astype(np.float32)
    lengths, to, on = rng.uniform(1, 5, 3), rng.uniform(1, 2, 4), rng.uniform(1, 2, 4)
    added, gaps = cheapest_gaps(near, lengths, to, on)
    for k in range(50):
        tried = [
            to[i] * near[i, k] + (on[i] * (near[i + 1, k] - lengths[i]) if i < 3 else 0.0) for i in range(4)
        ]
        assert added[k] == pytest.approx(min(tried)) and gaps[k] == int(np.argmin(tried))
