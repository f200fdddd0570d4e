"""An exploration from start to end: an agent asked at every decision, with the curve and the times."""

from __future__ import annotations

import math
import time
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Protocol

import numpy as np

from layoutexplore.errors import ConfigError, LayoutExploreError, checks_making, shortened
from layoutexplore.frontiers.answers import leaving_the_map, saying_where
from layoutexplore.frontiers.decision import PATHS, Agent, Choice, Decision, Predictor, Privileged, remembers
from layoutexplore.frontiers.walks import plain_choice
from layoutexplore.grids.arrays import Floats, shows_shapes
from layoutexplore.grids.grid import Pose
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.options import NATURAL, SEED, check_kind
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.region import region_mask
from layoutexplore.simulation.robot import draw_start
from layoutexplore.simulation.saved_run import SavedRun
from layoutexplore.simulation.simulation import Simulation

MAX_DECISIONS = 20_000
"""A run that is not over after this many decisions is stuck: the longest real ones take a few hundred."""


@shows_shapes
@dataclass(frozen=True)
class Episode:
    """What one exploration left behind.

    Attributes:
        curve: float64 (n, 2), metres travelled and coverage 0..1, a row a scan.
        track: float64 (n, 3), poses at the corners of the way walked.
        decision_ms: Milliseconds of every choice.
        seconds: Duration of the whole run, without the questions asked beside it.
        prediction_ms: Milliseconds of the prediction at every decision; empty without a predictor.
        notes: What the probe noted; None without one.
    """

    curve: Floats
    track: Floats
    decision_ms: list[float] = field(repr=False)
    seconds: float = 0.0
    prediction_ms: list[float] = field(default_factory=list, repr=False)
    notes: Any = None


class Probe(Protocol):
    """Asks questions beside a run, without touching it."""

    seconds: float
    """Time that asking took."""

    def before(self, agent: Agent) -> None:
        """The agent is about to choose."""

    def note(self, decision: Decision, choice: Choice, prediction_ms: float) -> None:
        """It has chosen."""

    def end(self) -> Any:
        """What was noted."""


@checks_making
class TimedPredictor:
    """A predictor whose time is measured: predicting is part of deciding."""

    def __init__(self, inner: Predictor) -> None:
        self.inner = inner
        self.name = inner.name
        self.ms = 0.0
        self.remembers = remembers(inner, otherwise=False)
        if isinstance(inner, Privileged):
            self.reveal = inner.reveal

    def predict(self, decision: Decision) -> Decision:
        """What the predictor makes of the decision."""
        asked = time.perf_counter()
        completed = self.inner.predict(decision)
        self.ms += 1000 * (time.perf_counter() - asked)
        return completed


def untimed(predictor: Predictor | None) -> Predictor | None:
    """The predictor itself, where its time is measured."""
    return predictor.inner if isinstance(predictor, TimedPredictor) else predictor


def play(
    simulation: Simulation,
    agent: Agent,
    *,
    seed: int = 0,
    start: Pose | None = None,
    on_step: Callable[[Simulation], None] | None = None,
    until: Callable[[Simulation], bool] | None = None,
    probe: Callable[[Simulation], Probe] | None = None,
    saved: SavedRun | None = None,
) -> Episode:
    """Explore until the simulation or the agent ends the run.

    Args:
        simulation: What to explore; it is reset.
        agent: Who explores; it is reset.
        seed: For both.
        start: Where to begin; drawn from the seed when None.
        on_step: Called after the reset and after every decision.
        until: Ends the run early where it is true, asked after `on_step`.
        probe: Makes what asks beside the run, of the simulation after its reset; only where a predictor is
            timed.
        saved: Go on from here instead of beginning; it decides seed and start, too.

    Raises:
        ConfigError: The saved run is one of another floor plan or configuration.
        LayoutExploreError: The agent is stuck: it decides and decides and the run does not end.
    """
    _check_callers(simulation, agent, saved, on_step=on_step, until=until, probe=probe)
    began = time.perf_counter()
    timed = simulation.predictor if isinstance(simulation.predictor, TimedPredictor) else None
    predicted = timed.ms if timed else 0.0  # Earlier runs of this simulation have added to it.
    decision = saved.restore(simulation, agent) if saved else _begin(simulation, agent, seed, start)
    took: list[float] = []
    asked_beside = probe(simulation) if probe and timed else None
    predictions: list[float] = []
    if timed and saved:
        predicted = timed.ms
    if on_step:
        on_step(simulation)
    with saying_where(partial(_asked, agent, simulation)):
        while not simulation.done and not (until and until(simulation)):
            if asked_beside:
                asked_beside.before(agent)
            choice, ms = _ask(agent, decision)
            took.append(ms)
            if timed:
                predictions.append(timed.ms - predicted)
                took[-1] += predictions[-1]
                predicted = timed.ms
            if asked_beside:
                asked_beside.note(decision, choice, predictions[-1])
            decision = simulation.step(choice)
            if on_step:
                on_step(simulation)
            if simulation.decisions > MAX_DECISIONS:
                raise LayoutExploreError(_stuck(agent, simulation, choice))
    seconds = time.perf_counter() - began - (asked_beside.seconds if asked_beside else 0.0)
    notes = asked_beside.end() if asked_beside else None
    return Episode(simulation.curve[:, :2], corners(simulation.track), took, seconds, predictions, notes)


def _check_callers(
    simulation: Simulation, agent: Agent, saved: SavedRun | None, **functions: Callable[..., Any] | None
) -> None:
    """Raise `ConfigError` where an argument of `play` is not what it is to be."""
    check_kind("simulation", simulation, Simulation)
    check_kind("saved", saved, SavedRun, optional=True)
    for method in ("reset", "act"):
        if isinstance(agent, type) or not callable(getattr(agent, method, None)):
            raise ConfigError(
                f"agent must have the method {method}, got {shortened(agent)}: it is an object, such as "
                "layoutexplore.make_agent makes of a name"
            )
    for name, function in functions.items():
        if function is not None and not callable(function):
            raise ConfigError(f"{name} must be a function or None, got {shortened(function)}")


def _named(agent: Agent) -> str:
    """What an agent is called in messages."""
    return f"agent {getattr(agent, 'name', type(agent).__name__)!r}"


def _stuck(agent: Agent, simulation: Simulation, choice: Choice) -> str:
    """What is said of an agent whose run does not end."""
    seen = f"{simulation.distance:.0f} m, {100 * simulation.coverage:.1f} % seen"
    told = f"{_named(agent)} is stuck: {MAX_DECISIONS} decisions, {seen}"
    if isinstance(choice, PATHS):
        told += "; it answers with paths, but only a frontier that is answered by its number is given up"
    return told


def _ask(agent: Agent, decision: Decision) -> tuple[Choice, float]:
    """An agent's choice at a decision, and the milliseconds that it took; it must leave the map alone."""
    with leaving_the_map(decision.grid.cells, _named(agent)):
        asked = time.perf_counter()
        choice = plain_choice(agent.act(decision))
        ms = 1000 * (time.perf_counter() - asked)
    return choice, ms


def _asked(agent: Agent, simulation: Simulation) -> str:
    """Who was asked last, and where."""
    return f"{_named(agent)}, decision {simulation.decisions} on {simulation.plan.name!r}"


def _begin(simulation: Simulation, agent: Agent, seed: int, start: Pose | None) -> Decision:
    """Reset both; the first decision."""
    decision = simulation.reset(seed=seed, start=start)
    agent.reset(seed)
    if isinstance(agent, Privileged):
        agent.reveal(simulation.truth)
    return decision


def corners(track: Floats) -> Floats:
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
    check_kind("plan", plan, str)
    seed, start = SEED.convert("seed", seed), NATURAL.convert("start", start)
    of_plan = zlib.crc32(plan.encode(errors="surrogatepass"))
    return int(np.random.SeedSequence([seed, of_plan, start]).generate_state(1)[0])


def start_pose(plan: FloorPlan, simulation: SimulationConfig, seed: int, start: int) -> Pose:
    """Start number `start` on a plan: the same for every sensor and agent."""
    check_kind("plan", plan, FloorPlan)
    check_kind("simulation", simulation, SimulationConfig)
    rng = np.random.default_rng(run_seed(seed, plan.name, start))
    raster, region = plan.rasterize(simulation.resolution), simulation.region
    inside = None if region is None else region_mask(raster, region)
    return draw_start(raster, simulation.robot_radius, rng, inside)
