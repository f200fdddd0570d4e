"""Agents: by name, each by its rule, and a bound that knows the floor plan."""

from __future__ import annotations

import numpy as np
import pytest

from layoutexplore.agents import make_agent
from layoutexplore.agents.greedy import best_index
from tests.agents.cases import AROUND_A_WALL, CORRIDOR, chosen, decide


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


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_scores_without_an_end_tie_with_none() -> None:
    nearer = np.array([3.0, 1.0, 2.0])
    assert best_index(np.array([5.0, -np.inf, 4.0]), nearer) == 0
    assert best_index(np.full(3, -np.inf), nearer) == 1
    for score in (np.inf, np.nan):
        with pytest.raises(ValueError, match="scores that are numbers"):
            best_index(np.array([5.0, score, 4.0]), nearer)


def test_random_follows_its_seed() -> None:
    decision = decide(CORRIDOR, *((1, col, 2.0, 1.0) for col in range(1, 18)))
    agent = make_agent("random")

    def draws(seed: int) -> list[object]:
        agent.reset(seed)
        return [agent.act(decision) for _ in range(20)]

    assert draws(1) == draws(1) != draws(2)
