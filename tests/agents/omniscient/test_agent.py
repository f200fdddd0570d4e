"""The agent that knows the floor plan."""

from __future__ import annotations

import pytest

from layoutexplore.agents import make_agent
from layoutexplore.errors import ConfigError
from tests.agents.cases import CORRIDOR, decide, run


@pytest.mark.parametrize("sensor", ["stage", "indoor", "short"])
def test_clairvoyant_is_shorter_than_nearest(sensor: str) -> None:
    known, nearest = run("clairvoyant:rounds=5", sensor), run("nearest", sensor)
    assert known.coverage >= 0.99 and known.distance < 0.9 * nearest.distance


def test_clairvoyant_has_to_be_shown_the_floor_plan() -> None:
    agent = make_agent("clairvoyant")
    agent.reset(0)
    with pytest.raises(ConfigError, match="reveal"):
        agent.act(decide(CORRIDOR, (1, 4, 2.0, 1.0)))
