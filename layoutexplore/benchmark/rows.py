"""One exploration from start to end, and the row of results that it becomes."""

from __future__ import annotations

import csv
import dataclasses
import inspect
import operator
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from layoutexplore.agents import AGENTS, make_agent
from layoutexplore.errors import LayoutExploreError, checks_arguments, shortened
from layoutexplore.frontiers.decision import Agent, Privileged, predictor_of
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.metrics.exploration import revisit_share, rooms_finished, score_curve
from layoutexplore.plugins.code_digest import digest_of
from layoutexplore.predictors import PREDICTORS, make_predictor
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.episode import Episode, TimedPredictor
from layoutexplore.simulation.simulation import Simulation

NAN = float("nan")

_LARGEST = 1e15

RunKey = tuple[str, int, str, str]
"""What names a run: floor plan, start, sensor and agent."""

CellKey = tuple[str, int, str]
"""What runs are paired by: floor plan, start and sensor."""


@dataclass(frozen=True, kw_only=True, slots=True)
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
        building: Building of the floor plan; empty in results of earlier versions.
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
    building: str = ""

    @property
    def cluster(self) -> str:
        """What is resampled for intervals: the building, or the floor plan where none was noted."""
        return self.building or self.plan

    @property
    def key(self) -> RunKey:
        """What tells the runs of one benchmark apart."""
        return *self.cell, self.agent

    @property
    def cell(self) -> CellKey:
        """Where the runs of all agents are compared."""
        return self.plan, self.start, self.sensor

    def __reduce__(self) -> tuple[Callable[[tuple[Any, ...]], Row], tuple[tuple[Any, ...]]]:
        """Rows come back from workers by the hundred thousand: without the names of their columns."""
        return _received, (tuple(getattr(self, name) for name in Row.__slots__),)


def _received(values: tuple[Any, ...]) -> Row:
    """A row from another process; the names in it are kept once, whatever the number of rows."""
    row, write = object.__new__(Row), object.__setattr__
    for name, value in zip(Row.__slots__, values, strict=True):
        write(row, name, sys.intern(value) if type(value) is str else value)
    return row


TIMING_COLUMNS = (
    "ms_decision_median",
    "ms_decision_p95",
    "wall_seconds",
    "ms_prediction_median",
    "prediction_seconds",
)
"""Columns that differ from one execution to the next; every other one is decided by the configuration."""


def prepare(plan: FloorPlan | str, config: SimulationConfig, agent: str) -> tuple[Simulation, Agent]:
    """A simulation and an agent by its name, with the predictor that the agent asks for.

    Raises:
        UnknownNameError: No agent or plan of that name.
    """
    chosen = make_agent(agent)
    predictor = make_predictor(predictor_of(chosen))
    return Simulation(plan, config, TimedPredictor(predictor) if predictor else None), chosen


def fingerprints(agents: Iterable[str]) -> dict[str, str]:
    """What tells apart weights and users' own code of agents and their predictors, by agent.

    Agents without either are left out.

    Raises:
        UnknownNameError: No agent of that name, or no predictor of the one that it asks for.
    """
    found = {}
    for name in agents:
        agent = make_agent(name)
        if text := fingerprint_of_agent(name, agent, make_predictor(predictor_of(agent))):
            found[name] = text
    return found


def fingerprint_of_agent(name: str, agent: Agent, predictor: object) -> str:
    """As of `fingerprints`, of an agent by its name and the predictor made for it; empty for none."""
    wanted = predictor_of(agent)
    code = PREDICTORS.digest(wanted) if isinstance(wanted, str) else digest_of(wanted)
    learnt = (getattr(part, "fingerprint", "") for part in (agent, predictor))
    return " ".join(filter(None, (AGENTS.digest(name), code, *learnt)))


def has_own_code(agent: str) -> bool:
    """Whether an agent, or the predictor that it asks for, is a user's own code.

    Raises:
        UnknownNameError: As `fingerprints`.
    """
    wanted = predictor_of(make_agent(agent))
    if AGENTS.digest(agent) or not isinstance(wanted, str):
        return bool(AGENTS.digest(agent) or wanted)
    return bool(PREDICTORS.digest(wanted)) or ".py:" in wanted


def knows_the_plan(agent: str) -> bool:
    """Whether an agent, or its predictor, is shown the floor plan; not one that this version cannot make.

    A predictor that is told of a run but learns nothing true of its plan says so (`shows_truth`).
    """
    try:
        chosen = make_agent(agent)
        if isinstance(chosen, Privileged):
            return True
        predictor: object = make_predictor(predictor_of(chosen))
        return isinstance(predictor, Privileged) and bool(getattr(predictor, "shows_truth", True))
    except LayoutExploreError:
        return False


@checks_arguments
def score_run(row: Row, simulation: Simulation, episode: Episode) -> Row:
    """The row completed with the scores of a run that has ended."""
    budget, area = simulation.max_distance, simulation.target_area
    curve = score_curve(episode.curve, budget=budget, target_area=area, goal=simulation.config.coverage_goal)
    finished, rooms = rooms_finished(simulation.raster.room_ids, simulation.truth.target, simulation.seen)
    x, y, theta = episode.track[0]
    median, p95 = np.percentile(episode.decision_ms, [50, 95]) if episode.decision_ms else (0.0, 0.0)
    notes = episode.notes if episode.notes and len(episode.notes.log) else None
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
        stop_reason=str(simulation.stop_reason),
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
        layout_changed=float(notes.column("changed").mean()) if notes else unasked,
        layout_misled=float(notes.column("misled").mean()) if notes else unasked,
    )
    return _rounded(scored)


def _rounded(row: Row) -> Row:
    """Numbers to six decimals, as they stand in the file."""
    values: dict[str, Any] = {
        n: round(v, 6) for n, v in dataclasses.asdict(row).items() if isinstance(v, float)
    }
    return dataclasses.replace(row, **values)


COLUMNS = tuple(f.name for f in dataclasses.fields(Row))
"""Those of results.csv."""


def column_meanings() -> list[tuple[str, str]]:
    """Name and meaning of the columns of results.csv, from the documentation of `Row`."""
    text = inspect.cleandoc(Row.__doc__ or "").split("Attributes:")[1]
    entries = re.sub(r"\n {8,}", " ", text).strip().splitlines()  # an entry that goes on is indented further
    pairs = (line.strip().split(": ", 1) for line in entries)
    return [(name, meaning) for name, meaning in pairs]


_OF_TYPE: dict[str, Callable[[str], Any]] = {
    "int": lambda text: _bounded(int(text), 0),
    "float": lambda text: _bounded(float(text), 0) if text else NAN,
    "bool": {"True": True, "False": False}.__getitem__,
    "str": str,
}
_CONVERTERS = {f.name: _OF_TYPE[str(f.type)] for f in dataclasses.fields(Row)} | dict.fromkeys(
    ("start_x", "start_y", "start_theta"), lambda text: _bounded(float(text), -_LARGEST) if text else NAN
)
"""By column, what makes a value of a text."""


def _bounded(value: float, least: float) -> float:
    """A number that is finite and no larger than any metre, second or count can be."""
    if not least <= value <= _LARGEST:
        raise ValueError(f"{shortened(value)} is too large or too small")
    return value


class _Line:
    """What a CSV writer writes a line to: it hands the line back to whoever asked for it."""

    def write(self, text: str, /) -> str:
        return text


_values = operator.attrgetter(*COLUMNS)
_writer: Any = csv.writer(_Line(), lineterminator="\n")


def format_row(row: Row) -> str:
    """A line of results.csv; NaN is an empty field."""
    line: str = _writer.writerow(["" if value != value else value for value in _values(row)])
    return line


def parse_row(line: list[str], header: Sequence[str] = COLUMNS) -> Row:
    """The inverse of `format_row`; columns that the header does not name are empty.

    Raises:
        ValueError: A value is missing, or is none of its column.
    """
    if len(line) != len(header):
        raise ValueError(f"a row has {len(line)} values, not {len(header)}")
    values: dict[str, Any] = {}
    for name, text in zip(header, line, strict=True):
        try:
            values[name] = _CONVERTERS[name](text)
        except (ValueError, KeyError) as error:
            raise ValueError(f"{name} cannot be {shortened(text)}") from error
    return Row(**values)
