"""Playing an episode: stuck agents, time for predicting, what is kept of a track."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from layoutexplore.benchmark.counterfactual import CounterfactualRollouts
from layoutexplore.benchmark.rows import prepare
from layoutexplore.errors import ConfigError, LayoutExploreError, OwnCodeError
from layoutexplore.frontiers.decision import STOP, Decision
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.episode import TimedPredictor, corners, play
from layoutexplore.simulation.simulation import Simulation
from tests.plans import HOUSE


def house() -> FloorPlan:
    return floorplan_from_ascii(HOUSE, resolution=1.0, name="house")


def test_results_say_in_a_line_what_they_are() -> None:
    simulation, agent = prepare(house(), SimulationConfig(), "layout-tour")
    episode = play(simulation, agent)
    decision = simulation.reset(seed=0)
    rows, cols = simulation.raster.shape
    told = {
        decision.grid: f"OccupancyGrid(cells=int8 ({rows}, {cols}), resolution=0.1, origin=Pose(x=",
        simulation.raster: f"PlanRaster(occupied=bool ({rows}, {cols}), ",
        simulation.plan: "FloorPlan(name='house', building='house', rooms=[5 Rooms], doors=[",
        decision: "Decision(step=0, grid=OccupancyGrid(cells=int8",
        decision.frontiers[0]: "Frontier(cells=int32 (",
        simulation.truth: "Truth(plan=FloorPlan(name='house', ",
    }
    for thing, begin in [*told.items(), (episode, f"Episode(curve=float64 ({len(episode.curve)}, 2), ")]:
        assert repr(thing).startswith(begin), repr(thing)
        assert len(repr(thing)) < 1000 and "\n" not in repr(thing)
    assert repr(decision.frontiers) == f"FrontierList({[*decision.frontiers]})"


def test_who_gives_a_name_for_an_agent_is_told_what_makes_one() -> None:
    for given_for_one in ("nearest", object):
        with pytest.raises(ConfigError, match=r"must have the method reset, got .*make_agent"):
            play(Simulation(house()), given_for_one)  # type: ignore[arg-type]


def test_a_stuck_agent_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    class Dawdler:
        name = "dawdler"

        def reset(self, seed: int) -> None: ...

        def act(self, decision: Decision) -> np.ndarray[Any, Any]:
            return np.array([decision.grid.world_to_cell(decision.pose.x, decision.pose.y)], np.int32)

    monkeypatch.setattr("layoutexplore.simulation.episode.MAX_DECISIONS", 20)
    simulation, _ = prepare(house(), SimulationConfig(), "nearest")
    with pytest.raises(
        LayoutExploreError, match=r"'dawdler' is stuck: 20 decisions.*by its number is given up"
    ):
        play(simulation, Dawdler())


def test_an_array_of_one_number_is_a_choice_as_policies_give_it() -> None:
    class Policy:
        name = "policy-of-my-own"

        def __init__(self, choice: Any) -> None:
            self._choice = choice

        def reset(self, seed: int) -> None: ...

        def act(self, decision: Decision) -> Any:
            return self._choice

    simulation, _ = prepare(house(), SimulationConfig(), "layout-tour")
    choices = (0, np.array(0), np.array([0]))  # the last one as for a batch of one decision
    runs = [play(simulation, Policy(choice), probe=CounterfactualRollouts) for choice in choices]
    np.testing.assert_array_equal(runs[1].track, runs[0].track)
    np.testing.assert_array_equal(runs[2].track, runs[0].track)
    simulation.reset()
    with pytest.raises(ConfigError, match=r"there is no frontier 0\.5"):
        simulation.step(np.array([0.5]))
    with pytest.raises(ConfigError, match=r"a path is an integer array \(k, 2\) of cells, got int64 \(2,\)"):
        simulation.step(np.array([0, 1]))
    simulation.step(np.array(STOP))
    assert simulation.stop_reason == "agent"


class Meddler:
    """Goes to the nearest frontier; at its third decision, in a run of three or more, it does something."""

    name = "meddler"

    def __init__(self, meddle: Callable[[Decision], object]) -> None:
        self._meddle = meddle

    def reset(self, seed: int) -> None: ...

    def act(self, decision: Decision) -> Any:
        if decision.step == 2:
            self._meddle(decision)
        return 0

    def predict(self, decision: Decision) -> Any:
        return self._meddle(decision) if decision.step == 2 else decision


def fill(array: NDArray[Any]) -> None:
    array[:] = 0


def leave(decision: Decision) -> None:
    sys.exit(0)


@pytest.mark.parametrize(
    ("meddle", "error", "told"),
    [
        (
            lambda decision: fill(decision.grid.cells),
            ConfigError,
            "agent 'meddler' has changed the robot's map",
        ),
        (lambda decision: fill(decision.track), ValueError, "read-only"),
        (lambda decision: fill(decision.frontiers[0].cells), ValueError, "read-only"),
        (leave, SystemExit, "0"),
    ],
)
def test_an_agent_that_breaks_off_is_named_with_its_decision(
    meddle: Callable[[Decision], object], error: type[BaseException], told: str
) -> None:
    simulation, _ = prepare(house(), SimulationConfig(), "nearest")
    with pytest.raises(error, match=told) as failed:
        play(simulation, Meddler(meddle))
    assert failed.value.__notes__ == ["(agent 'meddler', decision 2 on 'house')"]


class OwnPanic(BaseException):
    """As compiled code raises it."""


@pytest.mark.parametrize("error", [GeneratorExit, asyncio.CancelledError, OwnPanic])
def test_what_is_no_exception_ends_a_run_as_one(error: type[BaseException]) -> None:
    def end(decision: Decision) -> None:
        raise error

    simulation, _ = prepare(house(), SimulationConfig(), "nearest")
    named = rf"^agent 'meddler', decision 2 on 'house':(.*\n)+.*{error.__name__}$"
    with pytest.raises(OwnCodeError, match=named):
        play(simulation, Meddler(end))


def test_ctrl_c_stays_what_it_is() -> None:
    def end(decision: Decision) -> None:
        raise KeyboardInterrupt

    simulation, agent = prepare(house(), SimulationConfig(), "nearest")
    with pytest.raises(KeyboardInterrupt):
        play(simulation, Meddler(end))

    def end_in_a_kernel(decision: Decision) -> None:
        """Numba looks for its classes as it hands out results; where Ctrl-C comes then, that fails."""
        try:
            end(decision)
        except KeyboardInterrupt as ctrl_c:
            raise SystemError("CPUDispatcher(...) returned a result with an exception set") from ctrl_c

    with pytest.raises(KeyboardInterrupt):
        play(Simulation(house(), predictor=Meddler(end_in_a_kernel)), agent)


@pytest.mark.parametrize(
    ("meddle", "told"),
    [
        (lambda decision: fill(decision.grid.cells), "'meddler' has changed the robot's map"),
        (lambda decision: None, "what predictor 'meddler' makes of a decision must be a Decision, got None"),
    ],
)
def test_a_predictor_answers_and_leaves_the_map(meddle: Callable[[Decision], object], told: str) -> None:
    simulation = Simulation(house(), predictor=Meddler(meddle))
    _, agent = prepare(house(), SimulationConfig(), "nearest")
    with pytest.raises(ConfigError, match=told):
        play(simulation, agent)


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


def test_what_earlier_runs_took_to_predict_is_not_counted_again() -> None:
    simulation, agent = prepare(house(), SimulationConfig(), "layout-nearest:predictor=oracle")
    timed = simulation.predictor
    assert isinstance(timed, TimedPredictor)
    for _ in range(3):
        before = timed.ms
        episode = play(simulation, agent)
        assert 0 < sum(episode.prediction_ms) < 1.001 * (timed.ms - before)
        timed.ms += 1e6
