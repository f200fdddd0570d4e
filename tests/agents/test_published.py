"""The published strategy: by hand, and that its rooms come from IAS-15."""

from __future__ import annotations

import dataclasses

import pytest

from layoutexplore.agents import make_agent
from layoutexplore.agents.room_aware import RoomAwareHeuristic
from layoutexplore.frontiers.decision import STOP
from tests.agents.cases import decide

ROW = "R........\n#########"


@pytest.mark.parametrize(
    ("closed", "areas", "chosen"),
    [
        ((True, True), (1.0, 10.0), 1),  # (4/8 + 0.1) / 2 = 0.3 against (0 + 1) / 2 = 0.5
        ((True, True), (6.0, 10.0), 0),  # (4/8 + 0.6) / 2 = 0.55
        ((True, False), (6.0, 10.0), 0),  # the open one has what is seen from it, 2 m2: (0 + 2/6) / 2
        ((False, True), (100.0, 1.0), 0),  # 2 m2 in sight, and nearer
    ],
)
def test_utility_by_hand(closed: tuple[bool, bool], areas: tuple[float, float], chosen: int) -> None:
    decision = decide(ROW, (1, 4, 1.0, 2.0), (1, 8, 1.0, 2.0))
    frontiers = tuple(
        dataclasses.replace(f, is_closed=c, expected_area=a, confidence=1.0, room=1)
        for f, c, a in zip(decision.frontiers, closed, areas, strict=True)
    )
    assert make_agent("aamas-2021").act(dataclasses.replace(decision, frontiers=frontiers)) == chosen


def test_its_pipeline_is_the_published_one() -> None:
    agent = make_agent("aamas-2021")
    assert isinstance(agent, RoomAwareHeuristic) and agent.predictor == "reconstruct:ias15;growth=0"
    other = make_agent("aamas-2021:predictor=reconstruct:rose2")
    assert isinstance(other, RoomAwareHeuristic) and other.predictor == "reconstruct:rose2"


def test_it_stops_when_little_is_left() -> None:
    decision = decide(ROW, (1, 4, 1.0, 2.0))
    frontier = dataclasses.replace(
        decision.frontiers[0], is_closed=True, expected_area=0.4, confidence=1.0, room=1
    )
    agent = make_agent("aamas-2021:stop_area=1,stop_known=0")
    assert agent.act(dataclasses.replace(decision, frontiers=(frontier,))) == STOP
