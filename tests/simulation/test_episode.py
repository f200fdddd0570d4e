"""Playing an episode: stuck agents, time for predicting, what is kept of a track."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from layoutexplore.benchmark.rows import prepare
from layoutexplore.errors import LayoutExploreError
from layoutexplore.frontiers.decision import Decision
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.episode import TimedPredictor, corners, play
from tests.plans import HOUSE


def house() -> FloorPlan:
    return floorplan_from_ascii(HOUSE, resolution=1.0, name="house")


def test_a_stuck_agent_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    class Dawdler:
        name = "dawdler"

        def reset(self, seed: int) -> None: ...

        def act(self, decision: Decision) -> np.ndarray[Any, Any]:
            return np.array([decision.grid.world_to_cell(decision.pose.x, decision.pose.y)], np.int32)

    monkeypatch.setattr("layoutexplore.simulation.episode.MAX_DECISIONS", 20)
    simulation, _ = prepare(house(), SimulationConfig(), "nearest")
    with pytest.raises(LayoutExploreError, match="'dawdler' is stuck: 20 decisions"):
        play(simulation, Dawdler())


STEPS = st.lists(st.tuples(st.integers(-1, 1), st.integers(-1, 1)), min_size=1, max_size=40)


@given(STEPS)
def test_corners_are_the_same_track(steps: list[tuple[int, int]]) -> None:
    track = np.column_stack([np.cumsum(np.array(steps, float), axis=0), np.zeros(len(steps))])
    short = corners(track)

    def length(track: NDArray[np.float64]) -> float:
        return float(np.hypot(*np.diff(track[:, :2], axis=0).T).sum())

    assert length(short) == pytest.approx(length(track))
    assert len(short) <= len(track) and {tuple(p) for p in short} <= {tuple(p) for p in track}


def test_predicting_is_part_of_deciding() -> None:
    simulation, agent = prepare(house(), SimulationConfig(), "layout-nearest:predictor=oracle")
    episode = play(simulation, agent)
    timed = simulation.predictor
    assert simulation.stop_reason == "coverage" and isinstance(timed, TimedPredictor)
    assert timed.ms > 0 and timed.name == "oracle" and len(episode.decision_ms) == simulation.decisions
