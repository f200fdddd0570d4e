"""Looking all around on the way: where it pays, what a way is cut into, and when it is given up."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from layoutexplore.agents import make_agent
from layoutexplore.frontiers.decision import STOP, Choice, Decision, Walk, path_of, remembers
from layoutexplore.simulation.looking_around import LookingAround
from tests.agents.cases import CORRIDOR, decide, looking, run

AHEAD = "####################\n#........R.........#\n####################"
"""The corridor of `CORRIDOR` with the robot two cells further on."""

SHUT = "####################\n#........R....#....#\n####################"
"""The same with a wall across it."""

NEAR_END = "####################\n#..............R...#\n####################"
"""The same with the robot near the right end."""

WAY = np.array([[1, col] for col in range(7, 17)], np.int32)
"""From the robot in `CORRIDOR` to the right."""


def columns(choice: Choice | None) -> list[int]:
    assert isinstance(choice, (np.ndarray, Walk))
    assert (path_of(choice)[:, 0] == 1).all()
    return path_of(choice)[:, 1].tolist()


def test_where_that_shows_more_and_costs_nothing() -> None:
    decision, looks = decide(CORRIDOR, (1, 17, 2.0, 9.0)), LookingAround(2.0)
    assert columns(looks.begin(looking(decision), 0)) == [7, 8, 9]
    all_around = looking(decision, fov=2 * math.pi)
    assert looks.begin(all_around, 0) == 0
    assert columns(LookingAround(2.0, with_any_lidar=True).begin(all_around, 0)) == [7, 8, 9]
    assert looks.begin(looking(decision, turn_cost=0.1), 0) == 0
    assert LookingAround(0.0).begin(looking(decision), 0) == 0
    assert looks.begin(looking(decision), STOP) == STOP
    assert looks.go_on(looking(decision)) is None, "a choice that is gone through leaves nothing"


def test_hardly_more_than_a_step_is_gone_at_once() -> None:
    near, looks = looking(decide(CORRIDOR, (1, 9, 2.0, 9.0))), LookingAround(2.0)
    assert looks.begin(near, 0) == 0
    assert np.array_equal(np.asarray(looks.begin(near, WAY[:3])), WAY[:3])
    assert looks.go_on(near) is None


def test_a_frontier_is_kept_to_until_it_is_gone() -> None:
    looks, both = LookingAround(2.0), decide(CORRIDOR, (1, 2, 2.0, 9.0), (1, 17, 2.0, 9.0))
    looks.begin(looking(both), 1)
    assert columns(looks.go_on(looking(decide(AHEAD, (1, 2, 2.0, 9.0), (1, 17, 2.0, 9.0))))) == [9, 10, 11]
    assert looks.go_on(looking(decide(AHEAD, (1, 2, 2.0, 9.0)))) is None
    looks.begin(looking(both), 1)
    looks.forget()
    assert looks.go_on(looking(both)) is None


def long_frontier(drawing: str, view: int, *cols: int) -> Decision:
    """A frontier of some cells of the corridor, seen from its cell in one column."""
    decision = looking(decide(drawing, (1, view, 2.0, 9.0)))
    cells = np.array([[1, col] for col in cols], np.int32)
    return dataclasses.replace(decision, frontiers=[dataclasses.replace(decision.frontiers[0], cells=cells)])


def test_on_to_the_same_end_of_a_frontier_whose_middle_jumps() -> None:
    """The middle of one that runs around a hall lies on one side of the robot, and then on the other."""
    looks, right = LookingAround(2.0), [15, 16, 17]
    to_the_left = long_frontier(AHEAD, 1, 1, 2, *right)

    def turn_round() -> None:
        """To the left for what is on the left now, and to the right again, which must not come to nothing."""
        looks.forget()
        assert columns(looks.begin(long_frontier(CORRIDOR, 1, 1, *right), 0)) == [7, 6, 5]
        assert columns(looks.begin(long_frontier(CORRIDOR, 17, 1, *right), 0)) == [7, 8, 9], "once"

    turn_round()
    assert columns(looks.begin(to_the_left, 0)) == [9, 10, 11], "and not again"
    assert columns(looks.begin(to_the_left, 0)) == [9, 10, 11]
    turn_round()
    assert columns(looks.begin(long_frontier(AHEAD, 1, 1, 2, 18), 0)) == [9, 10, 11], "it receded a little"
    turn_round()
    assert columns(looks.begin(long_frontier(AHEAD, 1, 1, 2), 0)) == [9, 8, 7], "nothing is left there"
    turn_round()
    end = long_frontier(NEAR_END, 1, 1, *right)
    assert columns(looks.begin(end, 0)) == [15, 16, 17], "hardly more than a step"


@pytest.mark.parametrize("sights", [None, np.array([[0, 0], [0, 1]], np.int32)])
def test_a_path_is_gone_to_its_end_unless_it_is_shut(sights: np.ndarray | None) -> None:
    looks, start = LookingAround(2.0), looking(decide(CORRIDOR, (1, 17, 2.0, 9.0)))
    start.grid.cells[0, :2] = -1
    whole = WAY if sights is None else Walk(WAY, sights)
    first = looks.begin(start, whole)
    assert columns(first) == [7, 8, 9] and isinstance(first, Walk) == (sights is not None)
    ahead, shut = (looking(decide(draw, (1, 17, 2.0, 9.0))) for draw in (AHEAD, SHUT))
    for decision in (ahead, shut):
        decision.grid.cells[0, :2] = -1
    assert columns(looks.go_on(ahead)) == [9, 10, 11]
    looks.begin(start, whole)
    assert looks.go_on(shut) is None
    looks.begin(start, Walk(WAY[:5], sights) if sights is not None else WAY[:5])
    assert columns(looks.go_on(ahead)) == [9, 10, 11], "the rest of it is hardly more than a step"
    assert looks.go_on(ahead) is None


def test_a_walk_ends_where_what_it_is_for_has_been_seen() -> None:
    looks, start = LookingAround(2.0), looking(decide(CORRIDOR, (1, 17, 2.0, 9.0)))
    start.grid.cells[0, :2] = -1
    looks.begin(start, Walk(WAY, np.array([[0, 0], [0, 1]], np.int32)))
    assert looks.go_on(looking(decide(AHEAD, (1, 17, 2.0, 9.0)))) is None


def test_tours_look_around_with_a_lidar_that_looks_ahead() -> None:
    tours = [f"layout-tour:look_every={every}" for every in (0, 0.5)]
    plain, looks = (run(tour, "stage", 3, predictor="layout") for tour in tours)
    assert plain.stop_reason == looks.stop_reason == "coverage"
    assert looks.decisions > 2 * plain.decisions
    turning = [run(tour, "indoor", 3, predictor="layout").distance for tour in tours]
    assert turning[0] == turning[1], "it sees all around anyway"
    assert make_agent(tours[0]).name == "layout-tour"
    assert [remembers(make_agent(tour), otherwise=True) for tour in tours] == [False, True]
