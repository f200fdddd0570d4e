"""Paths followed in one go against the same paths scan by scan and step by step."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.planning.traversability import Traversability
from layoutexplore.sensing.lidar import LidarConfig
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.simulation import Simulation

SENSORS = ("stage", "indoor", LidarConfig(name="narrow", range_max=2.5, fov=1.2, beams=40, angle_offset=0.4))


def rooms(seed: int) -> FloorPlan:
    """Rooms of 3 m with doors here and there, and pillars that stand in the way."""
    rng = np.random.default_rng(seed)
    drawn = np.full((26, 38), ".")
    drawn[::6], drawn[:, ::6] = "#", "#"
    drawn = np.where((rng.random(drawn.shape) < 0.25) & (drawn == "#"), ".", drawn)
    drawn = np.where(rng.random(drawn.shape) < 0.03, "#", drawn)
    drawn[[0, -1]], drawn[:, [0, -1]] = "#", "#"
    return floorplan_from_ascii("\n".join("".join(row) for row in drawn), resolution=0.5)


def same(a: Simulation, b: Simulation) -> None:
    """Whether two runs have come to the same point, to the bit."""
    for left, right in (
        (a.track, b.track),
        (a.curve, b.curve),
        (a.mapper.grid.cells, b.mapper.grid.cells),
        (a.seen, b.seen),
    ):
        np.testing.assert_array_equal(left, right)
    for name in ("pose", "distance", "coverage", "scans", "decisions", "stop_reason"):
        assert getattr(a, name) == getattr(b, name), name
    for name in ("walked", "turned", "collisions", "believed"):
        assert getattr(a.robot, name) == getattr(b.robot, name), name
    assert (a.mapper.known_free, a.mapper.occupied_count) == (b.mapper.known_free, b.mapper.occupied_count)


def in_python(simulation: Simulation, *, steps: bool) -> None:
    """Let Python make the scans of a run, and maybe every step too, as it does where they are noisy."""
    follower = simulation.state.follower
    follower.scans_itself, follower.steps_itself = False, not steps


@settings(max_examples=20, deadline=None)
@given(st.data())
def test_a_path_in_one_go_is_the_path_scan_by_scan(data: st.DataObject) -> None:
    config = SimulationConfig(
        sensor=data.draw(st.sampled_from(SENSORS)),
        scan_spacing=data.draw(st.sampled_from([0.05, 0.5, 3.0])),
        turn_cost=data.draw(st.sampled_from([0.0, 0.3])),
        max_distance=data.draw(st.sampled_from([None, 7.0, 40.0])),
        coverage_goal=data.draw(st.sampled_from([0.7, 1.0])),
        robot_radius=data.draw(st.sampled_from([0.1, 0.35])),
    )
    seed = data.draw(st.integers(0, 2**32))
    plan, rng = rooms(seed), np.random.default_rng(seed)
    fast, slow = Simulation(plan, config), Simulation(plan, config)
    for simulation in (fast, slow):
        simulation.reset(seed=seed % 1000)
    in_python(slow, steps=data.draw(st.booleans()))
    scans: list[int] = []
    if data.draw(st.booleans()):
        fast.on_scan = lambda simulation: scans.append(simulation.scans)
    for _ in range(25):
        same(fast, slow)
        if fast.done:
            break
        choice = min(int(rng.geometric(0.4)) - 1, len(fast.decision.frontiers) - 1)
        if rng.random() < 0.2:  # A path that leads to no frontier, through what may be a wall.
            here = np.array([fast._here()])
            path = here + np.arange(12)[:, None] * rng.choice([(0, 1), (1, 0), (1, 1), (-1, 1)])
            path = path[((path >= 0) & (path < fast.raster.shape)).all(axis=1)].astype(np.int32)
            fast.step(path), slow.step(path)
        else:
            fast.step(choice), slow.step(choice)
    assert scans in ([], list(range(2, fast.scans + 1)))


@pytest.mark.parametrize("steps", [False, True])
def test_nothing_is_scanned_once_the_budget_is_spent(steps: bool) -> None:
    """Turning for a scan on the way may spend it: the robot does not go a step on and scan again."""
    config = SimulationConfig(sensor="stage", turn_cost=0.3, max_distance=10.0, coverage_goal=1.0)
    spent = 0
    for seed in range(30):
        simulation = Simulation(rooms(seed), config)
        simulation.reset(seed=seed)
        if steps:
            in_python(simulation, steps=True)
        while not simulation.done:
            simulation.step(len(simulation.decision.frontiers) - 1)
        metres = simulation.curve[:, 0]
        spent += metres[-1] >= config.max_distance
        assert (metres[:-1] < config.max_distance).all()
    assert spent >= 20


def test_a_wall_that_was_not_seen_is_walked_around(monkeypatch: pytest.MonkeyPatch) -> None:
    """Scans put what blocks a path on the map; some paths are planned anew, in one go as scan by scan."""
    config = SimulationConfig(sensor=SENSORS[2], coverage_goal=1.0, robot_radius=0.35)
    fast, slow = Simulation(rooms(1), config), Simulation(rooms(1), config)
    replanned, search = [], Traversability.path

    def counted(where: Traversability, *arguments: Any) -> NDArray[np.int32]:
        replanned.append(where)
        return search(where, *arguments)

    monkeypatch.setattr(Traversability, "path", counted)
    for simulation in (fast, slow):
        simulation.reset(seed=1)
        if simulation is slow:
            in_python(slow, steps=True)
        while not simulation.done:
            simulation.step(len(simulation.decision.frontiers) - 1)
    same(fast, slow)
    assert replanned.count(fast.state.traversability) == replanned.count(slow.state.traversability) >= 2
