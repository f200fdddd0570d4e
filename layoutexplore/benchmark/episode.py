"""One exploration from start to end, and the row of results that it becomes."""

from __future__ import annotations

import dataclasses
import math
import time
import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from layoutexplore.agents import make_agent
from layoutexplore.benchmark.counterfactual import Asides, Counterfactual
from layoutexplore.errors import LayoutExploreError
from layoutexplore.frontiers.decision import Agent, Decision, Predictor, Privileged
from layoutexplore.grids.grid import Pose
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.metrics.exploration import revisit_share, rooms_finished, score_curve
from layoutexplore.predictors import make_predictor
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.simulation import Simulation

MAX_DECISIONS = 20_000
"""A run that is not over after this many decisions is stuck: the longest real ones take a few hundred."""

NAN = float("nan")


@dataclass(frozen=True, kw_only=True)
class Row:
    """One row of results.csv: one run of one agent.

    Attributes:
        plan: Name of the floor plan.
        start: Number of the start on the plan.
        sensor: Name of the sensor.
        agent: Name of the strategy.
        seed: Seed of the benchmark.
        d90: Metres until 90 % of the target area was seen; the budget where that never happened.
        d95: The same for 95 %.
        d99: The same for 99 %.
        reached90: Whether 90 % was seen.
        reached95: Whether 95 % was seen.
        reached99: Whether 99 % was seen.
        auc: Mean coverage over the first 20 m + 0.2 m per square metre of target area, 0..1.
        coverage: Share of the target area seen at the end, 0..1.
        distance: Metres travelled at the end.
        decisions: Decisions taken.
        scans: Scans taken.
        ms_decision_median: Milliseconds in which the agent chose (with its layout prediction), median over
            its decisions.
        ms_decision_p95: The same, 95th percentile.
        stop_reason: coverage, no_frontier, budget, agent; or error.
        version: Version of layoutexplore.
        config_hash: Tells configurations apart.
        target_area: Square metres that could be seen from this start.
        budget: Metres after which the run would have been ended.
        rooms_finished: Rooms of which at least 95 % was seen.
        rooms: Rooms that have target area.
        revisits: Share of the metres walked that led through places walked before, 0..1.
        collisions: Times that a wall not yet seen stopped the robot.
        start_x: Start in metres.
        start_y: Start in metres.
        start_theta: Heading at the start in radians.
        wall_seconds: Seconds that the run took.
        ms_prediction_median: Milliseconds of the layout prediction, median over the decisions; 0 without a
            predictor.
        prediction_seconds: Seconds that all predictions of the run took.
        layout_changed: Share of the decisions in which the agent chose otherwise than without the layout (not
            with --no-explain).
        layout_misled: Share of the decisions in which it would have chosen otherwise with the true rooms.
        error: What went wrong; empty where nothing did.
    """

    plan: str
    start: int
    sensor: str
    agent: str
    seed: int
    d90: float = NAN
    d95: float = NAN
    d99: float = NAN
    reached90: bool = False
    reached95: bool = False
    reached99: bool = False
    auc: float = NAN
    coverage: float = NAN
    distance: float = NAN
    decisions: int = 0
    scans: int = 0
    ms_decision_median: float = NAN
    ms_decision_p95: float = NAN
    stop_reason: str = "error"
    version: str = ""
    config_hash: str = ""
    target_area: float = NAN
    budget: float = NAN
    rooms_finished: int = 0
    rooms: int = 0
    revisits: float = NAN
    collisions: int = 0
    start_x: float = NAN
    start_y: float = NAN
    start_theta: float = NAN
    wall_seconds: float = NAN
    ms_prediction_median: float = NAN
    prediction_seconds: float = NAN
    layout_changed: float = NAN
    layout_misled: float = NAN
    error: str = ""

    @property
    def key(self) -> tuple[str, int, str, str]:
        """What tells the runs of one benchmark apart."""
        return self.plan, self.start, self.sensor, self.agent


TIMING_COLUMNS = (
    "ms_decision_median",
    "ms_decision_p95",
    "wall_seconds",
    "ms_prediction_median",
    "prediction_seconds",
)
"""Columns that differ from one execution to the next; every other one is decided by the configuration."""


@dataclass(frozen=True)
class Episode:
    """What one exploration left behind.

    Attributes:
        curve: float64 (n, 2), metres travelled and coverage 0..1, a row a scan.
        track: float64 (n, 3), poses at the corners of the way walked.
        decision_ms: Milliseconds of every choice.
        seconds: Duration of the whole run, without the questions asked beside it.
        prediction_ms: Milliseconds of the prediction at every decision; empty without a predictor.
        counterfactual: What the layout changed; None where nobody asked.
    """

    curve: NDArray[np.float64]
    track: NDArray[np.float64]
    decision_ms: list[float] = field(repr=False)
    seconds: float = 0.0
    prediction_ms: list[float] = field(default_factory=list, repr=False)
    counterfactual: Counterfactual | None = None


def prepare(plan: FloorPlan | str, config: SimulationConfig, agent: str) -> tuple[Simulation, Agent]:
    """A simulation and an agent by its name, with the predictor that the agent asks for.

    Raises:
        UnknownNameError: No agent or plan of that name.
    """
    chosen = make_agent(agent)
    predictor = make_predictor(getattr(chosen, "predictor", "none"))
    return Simulation(plan, config, _Timed(predictor) if predictor else None), chosen


def fingerprints(agents: Iterable[str]) -> dict[str, str]:
    """What tells apart the weights that agents and their predictors have learnt, by agent; agents without weights are left out.

    Raises:
        UnknownNameError: No agent of that name, or no predictor of the one that it asks for.
    """
    found = {}
    for name in agents:
        agent = make_agent(name)
        parts = agent, make_predictor(getattr(agent, "predictor", "none"))
        if text := " ".join(filter(None, (getattr(part, "fingerprint", "") for part in parts))):
            found[name] = text
    return found


def knows_the_plan(agent: str) -> bool:
    """Whether an agent, or its predictor, is shown the floor plan; not one that this version cannot make."""
    try:
        chosen = make_agent(agent)
        return isinstance(chosen, Privileged) or isinstance(
            make_predictor(getattr(chosen, "predictor", "none")), Privileged
        )
    except LayoutExploreError:
        return False


class _Timed:
    """A predictor whose time is measured: predicting is part of deciding."""

    def __init__(self, inner: Predictor) -> None:
        self.inner = inner
        self.name = inner.name
        self.ms = 0.0
        if isinstance(inner, Privileged):
            self.reveal = inner.reveal

    def predict(self, decision: Decision) -> Decision:
        """What the predictor makes of the decision."""
        asked = time.perf_counter()
        completed = self.inner.predict(decision)
        self.ms += 1000 * (time.perf_counter() - asked)
        return completed


def play(
    simulation: Simulation,
    agent: Agent,
    *,
    seed: int = 0,
    start: Pose | None = None,
    on_step: Callable[[Simulation], None] | None = None,
    explain: bool = False,
) -> Episode:
    """Explore until the simulation or the agent ends the run.

    Args:
        simulation: What to explore; it is reset.
        agent: Who explores; it is reset.
        seed: For both.
        start: Where to begin; drawn from the seed when None.
        on_step: Called after the reset and after every decision.
        explain: Ask beside the run what the layout changes; only where there is a predictor.

    Raises:
        LayoutExploreError: The agent is stuck: it decides and decides and the run does not end.
    """
    began = time.perf_counter()
    decision = simulation.reset(seed=seed, start=start)
    agent.reset(seed)
    if isinstance(agent, Privileged):
        agent.reveal(simulation.truth)
    took: list[float] = []
    timed = simulation.predictor if isinstance(simulation.predictor, _Timed) else None
    asides = Asides(simulation) if explain and timed else None
    predictions: list[float] = []
    predicted = 0.0
    if on_step:
        on_step(simulation)
    while not simulation.done:
        if asides:
            asides.before(agent)
        asked = time.perf_counter()
        choice = agent.act(decision)
        took.append(1000 * (time.perf_counter() - asked))
        if timed:
            predictions.append(timed.ms - predicted)
            took[-1] += predictions[-1]
            predicted = timed.ms
        if asides:
            asides.note(decision, choice, predictions[-1])
        decision = simulation.step(choice)
        if on_step:
            on_step(simulation)
        if simulation.decisions > MAX_DECISIONS:
            raise LayoutExploreError(
                f"agent {agent.name!r} is stuck: {MAX_DECISIONS} decisions, {simulation.distance:.0f} m, "
                f"{100 * simulation.coverage:.1f} % seen"
            )
    seconds = time.perf_counter() - began - (asides.seconds if asides else 0.0)
    counterfactual = asides.end() if asides else None
    return Episode(
        simulation.curve[:, :2], corners(simulation.track), took, seconds, predictions, counterfactual
    )


def score(row: Row, simulation: Simulation, episode: Episode) -> Row:
    """The row completed with the scores of a run that has ended."""
    budget, area = simulation.max_distance, simulation.target_area
    curve = score_curve(episode.curve, budget=budget, target_area=area, goal=simulation.config.coverage_goal)
    finished, rooms = rooms_finished(simulation.raster.room_ids, simulation.truth.target, simulation.seen)
    x, y, theta = episode.track[0]
    median, p95 = np.percentile(episode.decision_ms, [50, 95]) if episode.decision_ms else (0.0, 0.0)
    told = episode.counterfactual if episode.counterfactual and len(episode.counterfactual.log) else None
    unasked = NAN if episode.prediction_ms else 0.0
    scored = dataclasses.replace(
        row,
        **dataclasses.asdict(curve),
        coverage=simulation.coverage,
        distance=simulation.distance,
        decisions=simulation.decisions,
        scans=simulation.scans,
        ms_decision_median=float(median),
        ms_decision_p95=float(p95),
        stop_reason=simulation.stop_reason,
        target_area=area,
        budget=budget,
        rooms_finished=finished,
        rooms=rooms,
        revisits=revisit_share(simulation.track),
        collisions=simulation.robot.collisions,
        start_x=float(x),
        start_y=float(y),
        start_theta=float(theta),
        wall_seconds=episode.seconds,
        ms_prediction_median=float(np.median(episode.prediction_ms)) if episode.prediction_ms else 0.0,
        prediction_seconds=sum(episode.prediction_ms) / 1000,
        layout_changed=float(told.column("changed").mean()) if told else unasked,
        layout_misled=float(told.column("misled").mean()) if told else unasked,
    )
    return _rounded(scored)


def corners(track: NDArray[np.float64]) -> NDArray[np.float64]:
    """The rows of a track (n, 3) at which the way bends, and its ends: the same line with fewer points.

    Example:
        >>> corners(np.array([(0, 0, 0), (1, 0, 0), (2, 0, 0), (2, 1, 0)], float))[:, :2].tolist()
        [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0]]
    """
    moved = np.concatenate([[True], np.any(np.diff(track[:, :2], axis=0) != 0, axis=1)])
    places = track[moved]
    if len(places) < 3:
        return np.asarray(places)
    steps = np.diff(places[:, :2], axis=0)
    heading = np.arctan2(steps[:, 1], steps[:, 0])
    bends = np.abs(np.remainder(np.diff(heading) + math.pi, 2 * math.pi) - math.pi) > 1e-6
    return np.asarray(places[np.concatenate([[True], bends, [True]])])


def run_seed(seed: int, plan: str, start: int) -> int:
    """The seed of a cell: the same for all agents and sensors, different for every plan and start."""
    return int(np.random.SeedSequence([seed, zlib.crc32(plan.encode()), start]).generate_state(1)[0])


def _rounded(row: Row) -> Row:
    """Numbers to six decimals, as they stand in the file."""
    values: dict[str, Any] = {
        n: round(v, 6) for n, v in dataclasses.asdict(row).items() if isinstance(v, float)
    }
    return dataclasses.replace(row, **values)
