"""Reward functions: what they pay for, and that they are found by name."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.envs.rewards import (
    REWARDS,
    PathToMarks,
    RoomArea,
    Transition,
    area,
    area_per_metre,
    coverage,
    path_length,
    reads_rooms,
    reward,
)
from layoutexplore.envs.room_progress import RoomLedger
from layoutexplore.errors import ConfigError, UnknownNameError
from layoutexplore.grids.grid import Pose
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.metrics.exploration import distance_to_coverage
from layoutexplore.simulation.coverage import TargetCoverage
from layoutexplore.simulation.simulation import Simulation, SimulationConfig
from tests.envs.cases import rooms
from tests.plans import ROW_OF_ROOMS, TWO_ROOMS

STEP = Transition(metres=4.0, new_area=6.0, coverage=0.5, coverage_gain=0.1, distance=40.0, budget=200.0)


def total(
    distance: float, stop_reason: str, coverage: float, budget: float = 200.0, steps: int = 10
) -> float:
    """The return of `path_length` for an episode of equal steps."""
    metres = distance / steps
    walked = [
        Transition(
            metres, 1.0, coverage, 0.01, metres * (k + 1), budget, stop_reason if k == steps - 1 else ""
        )
        for k in range(steps)
    ]
    return sum(path_length(step) for step in walked)


def test_names_and_callables_are_found() -> None:
    assert reward("area") is area
    assert set(REWARDS) == {
        *("path_length", "path_to_marks", "area", "area_per_metre", "room_area", "coverage", "foreseen_area")
    }

    def mine(transition: Transition) -> float:
        return transition.metres

    assert reward(mine) is mine


def test_an_unknown_name_suggests_the_closest() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'path_length'"):
        reward("path_lenght")
    with pytest.raises(ConfigError, match="callable"):
        reward(1)  # type: ignore[arg-type]


def test_the_simple_ones() -> None:
    assert area(STEP) == 6.0
    assert area_per_metre(STEP) == 1.5
    assert area_per_metre(STEP._replace(metres=0.0)) == 6.0
    assert coverage(STEP) == pytest.approx(10.0)


@given(st.floats(1, 200), st.floats(1, 200))
def test_the_shorter_complete_exploration_earns_more(first: float, second: float) -> None:
    if first < second - 1e-6:
        assert total(first, "coverage", 0.99) > total(second, "coverage", 0.99)
    assert total(first, "coverage", 0.99) == pytest.approx(total(first, "coverage", 0.99, steps=3))


@given(st.floats(0, 100), st.floats(0, 99), st.floats(0, 0.98))
def test_finishing_within_half_of_the_budget_beats_stopping(stopped: float, rest: float, seen: float) -> None:
    assert total(stopped + rest, "coverage", 0.99) > total(stopped, "agent", seen)


def test_giving_up_at_once_earns_less_than_seeing_more() -> None:
    assert total(0.0, "agent", 0.1) < total(20.0, "agent", 0.5)


def test_metres_are_charged_up_to_the_marks() -> None:
    step = STEP._replace(reference=100.0)
    charge = PathToMarks(weight_95=2.0, weight_99=1.0)
    assert charge(step._replace(metres_before_95=4.0, metres_before_99=4.0)) == pytest.approx(-0.12)
    assert charge(step._replace(coverage=0.96, metres_before_95=1.0, metres_before_99=4.0)) == pytest.approx(
        -0.06
    )
    assert charge(step._replace(coverage=0.97, metres_before_99=4.0)) == pytest.approx(-0.04)
    assert charge(
        step._replace(coverage=0.995, metres_before_99=3.0, stop_reason="coverage")
    ) == pytest.approx(-0.03)


@pytest.mark.parametrize(
    ("reason", "early", "late"), [("agent", 164.0, 164.0), ("budget", 4.0, 4.0), ("no_frontier", 4.0, 4.0)]
)
def test_giving_up_costs_the_rest_of_the_budget(reason: str, early: float, late: float) -> None:
    step = STEP._replace(reference=100.0, metres_before_95=4.0, metres_before_99=4.0, stop_reason=reason)
    assert PathToMarks()(step) == pytest.approx(-(early + late) / 100.0)
    seen = step._replace(coverage=0.97, metres_before_95=0.0)
    assert PathToMarks()(seen) == pytest.approx(-late / 100.0)
    assert PathToMarks()(seen._replace(coverage=0.99)) == pytest.approx(-0.04)  # there is nothing to give up


def test_finished_rooms_earn_a_bonus() -> None:
    assert RoomArea(bonus=2.0)(STEP._replace(rooms_finished=3)) == pytest.approx(7.5)
    assert [name for name, function in REWARDS.items() if reads_rooms(function)] == ["room_area"]
    assert reads_rooms(lambda transition: 0.0) and not reads_rooms(PathToMarks(weight_95=0.0))


@pytest.mark.parametrize(
    ("seed", "options"), [(0, {}), (1, {}), (1, {"turn_cost": 0.5, "max_distance": 20.0})], ids=str
)
def test_the_return_of_path_to_marks_is_what_the_benchmark_reports(
    seed: int, options: dict[str, float]
) -> None:
    config = SimulationConfig(sensor="short", **options)
    env = gymnasium.make(
        "LayoutExplore/Frontier-v0", plan=rooms(), simulation=config, reward="path_to_marks"
    ).unwrapped
    env.reset(seed=seed)
    total, over = 0.0, False
    while not over:
        _, value, terminated, truncated, _ = env.step(0)
        total, over = total + value, terminated or truncated
    curve, simulation = env.simulation.curve, env.simulation
    assert (simulation.distance > simulation.max_distance) == bool(options), "turns beyond the budget"
    marks = [
        distance_to_coverage(curve[:, 0], curve[:, 1], mark, budget=simulation.max_distance)[0]
        for mark in (0.95, 0.99)
    ]
    assert total == pytest.approx(-sum(marks) / (0.2 * (100.0 + simulation.target_area)))


def test_rooms_are_counted_when_they_are_finished_on_the_first_visit() -> None:
    plan = floorplan_from_ascii(ROW_OF_ROOMS, resolution=1.0)
    simulation = Simulation(plan, SimulationConfig(sensor="short"))
    simulation.reset(0, Pose(2.5, 1.5, 0.0))
    a, b, c = (
        int(simulation.raster.room_ids[simulation.raster.world_to_cell(x, 2.5)]) for x in (2.5, 7.5, 11.0)
    )
    ids, target = simulation.raster.room_ids, simulation.truth.target
    ledger, unseen = RoomLedger(simulation.truth), np.bincount(ids[target])
    assert ledger.left[[a, b, c]] == pytest.approx(
        [np.count_nonzero(target & (ids == room)) * 0.01 for room in (a, b, c)]
    )
    track = np.array([[2.5, 1.5, 0.0]])
    assert ledger.update(unseen, track) == 0 and ledger.visits[a] == 1
    unseen[a] = 0
    assert ledger.update(unseen, track) == 1, "the robot is in it for the first time"
    unseen[c] = 0
    assert ledger.update(unseen, track) == 1, "it needs no visit at all"
    track = np.concatenate([track, [[x, 3.5, 0.0] for x in (5.5, 6.5, 4.5, 6.5)]])
    unseen[b] = 0
    assert ledger.update(unseen, track) == 0 and ledger.visits[b] == 2, "the robot came back to it"
    assert not ledger.open.any()


@settings(deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 15), st.integers(1, 15))
def test_cells_that_are_seen_leave_their_rooms(seed: int, rows: int, cols: int) -> None:
    rng = np.random.default_rng(seed)
    target, rooms = rng.random((rows, cols)) < rng.random(), rng.integers(0, 5, (rows, cols)).astype(np.int32)
    coverage, cells = TargetCoverage(target, rooms), np.full((rows, cols), -1, np.int8)
    for _ in range(3):
        row, col = int(rng.integers(rows)), int(rng.integers(cols))
        box = (row, int(rng.integers(row, rows)) + 1, col, int(rng.integers(col, cols)) + 1)
        part = cells[box[0] : box[1], box[2] : box[3]]
        part[:] = np.maximum(part, rng.choice([-1, 0, 100], part.shape))
        coverage.update(cells, box)
        unseen = target & (cells == -1)
        np.testing.assert_array_equal(coverage.unseen, unseen)
        np.testing.assert_array_equal(
            coverage.unseen_in, np.bincount(rooms[unseen], minlength=int(rooms.max()) + 1)
        )
        assert coverage.unseen_count == unseen.sum()


@pytest.mark.parametrize("name", ["LayoutExplore/Frontier-v0", "LayoutExplore/Motion-v0"])
def test_an_environment_hands_over_what_happened(name: str) -> None:
    plan = floorplan_from_ascii(TWO_ROOMS, resolution=1.0)
    seen: list[Transition] = []

    def spy(transition: Transition) -> float:
        seen.append(transition)
        return float(len(seen))

    env = gymnasium.make(name, plan=plan, sensor="short", reward=spy, max_episode_steps=300)
    _, first = env.reset(seed=1)
    info, over, terminated = first, False, False
    rewards = []
    while not over:
        rng = np.random.default_rng(len(seen))
        action = 0 if "action_mask" in info else int(rng.choice([0, 0, 1]))
        _, value, terminated, truncated, info = env.step(action)
        rewards.append(value)
        over = terminated or truncated
    assert rewards == [float(k + 1) for k in range(len(seen))]
    assert sum(step.metres for step in seen) == pytest.approx(info["distance"])
    assert sum(step.new_area for step in seen) == pytest.approx(info["known_area"] - first["known_area"])
    assert sum(step.coverage_gain for step in seen) == pytest.approx(info["coverage"] - first["coverage"])
    assert all(step.stop_reason == "" for step in seen[:-1])
    assert seen[-1].stop_reason == ("coverage" if terminated else "")


def test_a_class_derived_from_ours_reads_all_of_a_transition() -> None:
    """Rooms and foresight are counted for it as for any callable of a user's own."""

    class Mine(PathToMarks):
        def __call__(self, transition: Transition) -> float:
            return 5.0 * transition.rooms_finished + transition.foreseen_area

    def plain(transition: Transition) -> float:
        return 5.0 * transition.rooms_finished + transition.foreseen_area

    returns = []
    for function in (Mine(), plain):
        env = gymnasium.make(
            "LayoutExplore/Frontier-v0", plan=rooms(), predictor="oracle:horizon=1", reward=function
        )
        env.reset(seed=1)
        steps = [env.step(0)]
        while not (steps[-1][2] or steps[-1][3]):
            steps.append(env.step(0))
        returns.append([step[1] for step in steps])
    assert returns[0] == returns[1] and sum(returns[1]) > 5.0


def test_an_error_of_one_s_own_in_a_worker_tells_its_line() -> None:
    def broken(transition: Transition) -> float:
        raise ValueError("no such thing")

    envs = gymnasium.make_vec(
        "LayoutExplore/Frontier-v0", num_envs=2, backend="processes", workers=1, plan=rooms(), reward=broken
    )
    envs.reset(seed=0)
    with pytest.raises(ValueError, match="no such thing") as raised:
        envs.step([0, 0])
    envs.close()
    (note,) = raised.value.__notes__
    assert "test_rewards.py" in note and "in broken" in note
