"""What a predicted layout changed in a run, and how right it was.

At every decision the same agent, with the same memory, is asked again beside the run: with the layout hidden,
and with the true rooms. The run itself goes on as if nobody had asked. *Changed* is a decision in which the
agent chooses otherwise with the layout than without it; *misled* is one in which it would choose otherwise
with the true rooms. Why it was misled is asked too: do the true classes alone set it right, the true areas
alone, only both, or only the true rooms themselves?

Copies of the agent answer, with the random numbers that it had itself. Where one cannot, nothing is noted;
what one keeps elsewhere, in its class or module, is not copied.
"""

from __future__ import annotations

import copy
import dataclasses
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from layoutexplore.errors import checks_making
from layoutexplore.frontiers.classes import LITTLE_LEFT
from layoutexplore.frontiers.decision import PATHS, STOP, Agent, Choice, Decision, path_of
from layoutexplore.frontiers.table import Frontier
from layoutexplore.frontiers.viewpoints import remaining_share
from layoutexplore.frontiers.walks import plain_choice
from layoutexplore.grids.arrays import Cells, Floats, Ints, Ints32, shows_shapes
from layoutexplore.grids.boxes import known_box
from layoutexplore.grids.grid import Cell, OccupancyGrid
from layoutexplore.planning.shortest_paths import distance_matrix
from layoutexplore.predictors import OraclePredictor
from layoutexplore.processes import asked_to_stop
from layoutexplore.processes.random_numbers import random_numbers_now
from layoutexplore.simulation.episode import untimed
from layoutexplore.simulation.simulation import Simulation

LOG = (
    "distance", "coverage", "prediction_ms", "frontiers",
    "changed", "misled", "class_alone", "area_alone", "both",
    "closed", "closed_as_open", "open", "open_as_closed", "leftover", "leftover_missed", "leftover_wrong",
    "largest_left", "total_left", "least_sure", "open_judged", "open_left", "true_left", "known",
)  # fmt: skip
"""Columns of the log, a row a decision. Counts of frontiers: truly `closed` and `closed_as_open` judged
open; truly `open` and `open_as_closed`; truly `leftover` (closed, less than 1 m2 left), `leftover_missed`,
and `leftover_wrong` (judged so and not). `largest_left` and `total_left` are the predicted square metres
behind frontiers judged closed, `least_sure` the least confidence among them, 1 without any; `open_judged`
counts frontiers judged open, `open_left` are the predicted square metres behind them; `true_left` is the
unseen target area, `known` that of the known floor."""

MOST_DECISIVE = 4
"""Decisive decisions that are kept of a run: those in which most metres were at stake."""

_NEAR = 2.0
"""Metres: two decisions between places no further apart count as one, that with more at stake."""

_MARGIN = 1.2
"""Metres around what is known that are kept of a decision's grid."""


@shows_shapes
@dataclass(frozen=True, eq=False, kw_only=True)
class DecisiveDecision:
    """A decision in which the layout changed the choice.

    Attributes:
        distance: Metres walked before.
        coverage: Share seen before.
        stake: Metres of the detour over the frontier that was given up, on the way to the chosen one.
        cells: int8 (rows, cols), the known part of the grid.
        corner: Row and column of its first cell in the grid.
        here: Cell of the robot.
        chosen: Cell that was gone to.
        given_up: Cell that would have been gone to without the layout.
        without: Index of the frontier that was given up.
        judged: float64 (k, 4), a row a frontier: judged closed, expected area, truly closed, true area.
        members: int32 (n, 2), the frontiers' cells.
        offsets: int64 (k + 1,), where each frontier's cells begin.
        seen_after: Metres walked until the frontier that was given up was gone; NaN when it never was.
        came_back: Whether the robot went to it later: to a frontier with some of its cells, or by a path of
            the agent's own that ends within 2 m of it.
    """

    distance: float
    coverage: float
    stake: float
    cells: Cells
    corner: tuple[int, int]
    here: tuple[int, int]
    chosen: tuple[int, int]
    given_up: tuple[int, int]
    without: int
    judged: Floats
    members: Ints32
    offsets: Ints
    seen_after: float = float("nan")
    came_back: bool = False

    @property
    def right(self) -> bool:
        """Whether the truth says the same of the frontier that was given up: put off, or not."""
        closed, area, true_closed, true_area = self.judged[self.without].tolist()
        return bool((closed and area < LITTLE_LEFT) == (true_closed and true_area < LITTLE_LEFT))

    def is_about(self, other: DecisiveDecision, resolution: float) -> bool:
        """Whether both are about the same two places, to within 2 m.

        Args:
            other: A decision on the same floor plan.
            resolution: Metres per cell.
        """
        pairs = ((self.chosen, other.chosen), (self.given_up, other.given_up))
        return all(math.dist(here, there) * resolution <= _NEAR for here, there in pairs)


@shows_shapes
@dataclass(frozen=True, eq=False)
class Counterfactual:
    """What was noted in a run.

    Attributes:
        log: float64 (n, len(LOG)), a row a decision.
        decisive: The most decisive ones, in their order.
    """

    log: Floats
    decisive: tuple[DecisiveDecision, ...]

    def column(self, name: str) -> Floats:
        """float64 (n,): a column of the log."""
        return self.log[:, LOG.index(name)]


@dataclass(eq=False)
class _Pursued:
    """A decisive decision whose outcome is still open, its step, and the frontier that was given up."""

    decided: DecisiveDecision
    step: int
    cells: Ints32

    @property
    def rank(self) -> tuple[float, int]:
        """The greatest where most is at stake, of equals that of the earliest."""
        return self.decided.stake, -self.step


class _UnansweredError(Exception):
    """A copy of the agent does not answer."""


@checks_making
class CounterfactualRollouts:
    """Asks the agent again beside a run.

    Args:
        simulation: What is explored; it has been reset.

    Attributes:
        seconds: Time that asking took.
    """

    def __init__(self, simulation: Simulation) -> None:
        self.seconds = 0.0
        self._simulation = simulation
        inner = untimed(simulation.predictor)
        # Less foresight than the agent has had would change its choice, however right its predictor is.
        oracle = inner if isinstance(inner, OraclePredictor) else OraclePredictor()
        self._oracle = OraclePredictor(horizon=oracle.horizon, within=oracle.within)
        self._oracle.reveal(simulation.truth)
        self._rows: list[list[float]] = []
        self._kept: list[_Pursued] = []
        self._answers = True

    def before(self, agent: Agent) -> None:
        """Remember the agent as it is before it chooses, and the random numbers that are to come."""
        if not self._answers:
            return
        began = time.perf_counter()
        self._restore = random_numbers_now()
        try:
            self._agent = copy.deepcopy(agent)
        except Exception:  # a generator, a lock, an open file
            self._answers = False
            if asked_to_stop():
                raise
        self._restore()
        self.seconds += time.perf_counter() - began

    def note(self, decision: Decision, choice: Choice, prediction_ms: float) -> None:
        """Note a decision and the choice that was made, before the simulation acts on it.

        Args:
            decision: The decision with its prediction.
            choice: What the agent chose.
            prediction_ms: What the prediction took.
        """
        if not self._answers or not _is_choice(decision, choice):  # the simulation says what is wrong with it
            return
        began, go_on = time.perf_counter(), random_numbers_now()
        try:
            self._note(decision, choice, prediction_ms)
        except _UnansweredError:
            self._answers = False
        finally:
            go_on()
        self.seconds += time.perf_counter() - began

    def _note(self, decision: Decision, choice: Choice, prediction_ms: float) -> None:
        self._pursue(decision, choice)
        hidden = without_layout(decision)
        without = self._ask(hidden)
        truth = self._oracle.predict(hidden)
        with_truth = choice if _same_judgement(decision, truth) else self._ask(truth)
        changed, misled = not same_choice(choice, without), not same_choice(choice, with_truth)
        reasons = self._reasons(decision, truth, with_truth) if misled else (False, False, False)
        counts = _counts(decision.frontiers, truth.frontiers)
        unseen = (1 - self._simulation.coverage) * self._simulation.target_area
        self._rows.append(
            [decision.distance, self._simulation.coverage, prediction_ms, len(decision.frontiers)]
            + [float(flag) for flag in (changed, misled, *reasons)]
            + [*counts, unseen, decision.grid.free_area]
        )
        if changed:
            self._keep(decision, truth, choice, without)

    def end(self) -> Counterfactual | None:
        """Everything noted, once the run is over; None where a copy of the agent gave no answer."""
        if not self._answers:
            return None
        self._settle()
        log = np.array(self._rows, np.float64).reshape(-1, len(LOG))
        decisive = sorted((kept.decided for kept in self._kept), key=lambda decided: decided.distance)
        return Counterfactual(log, tuple(decisive))

    def _ask(self, decision: Decision) -> Choice:
        """What a copy of the agent chooses; `_UnansweredError` where it fails, or its choice is none."""
        try:
            twin = copy.deepcopy(self._agent)
            self._restore()
            choice = plain_choice(twin.act(decision))
        except (Exception, SystemExit) as error:
            if asked_to_stop():
                raise
            raise _UnansweredError from error
        if not _is_choice(decision, choice):
            raise _UnansweredError
        return choice

    def _reasons(self, decision: Decision, truth: Decision, with_truth: Choice) -> tuple[bool, bool, bool]:
        """Whether true classes alone, true areas alone, or only both lead to the choice of the truth."""

        def mended(*, classes: bool, areas: bool) -> bool:
            return same_choice(self._ask(_mixed(decision, truth, classes=classes, areas=areas)), with_truth)

        by_classes, by_areas = mended(classes=True, areas=False), mended(classes=False, areas=True)
        by_both = not (by_classes or by_areas) and mended(classes=True, areas=True)
        return by_classes, by_areas, by_both

    def _keep(self, decision: Decision, truth: Decision, choice: Choice, without: Choice) -> None:
        """Keep a changed decision if more is at stake than in those that were kept."""
        decided = self._decisive(decision, truth, choice, without)
        if decided is None:
            return
        same = [kept for kept in self._kept if kept.decided.is_about(decided, decision.grid.resolution)]
        rivals = same or (self._kept[:1] if len(self._kept) == MOST_DECISIVE else [])
        if any(decided.stake <= rival.decided.stake for rival in rivals):
            return
        others = [kept for kept in self._kept if kept not in same]
        pursued = _Pursued(decided, decision.step, decision.frontiers[decided.without].cells.copy())
        self._kept = sorted([*others, pursued], key=lambda kept: kept.rank)[-MOST_DECISIVE:]

    def _decisive(
        self, decision: Decision, truth: Decision, choice: Choice, without: Choice
    ) -> DecisiveDecision | None:
        """A changed decision with what is at stake; None where nowhere is gone, or nobody can say."""
        if isinstance(without, PATHS) or without == STOP or same_choice(choice, STOP):
            return None
        here = decision.grid.nearest_cell(decision.pose.x, decision.pose.y)
        if isinstance(choice, PATHS):
            chosen = Cell(*path_of(choice)[-1].tolist())
        else:
            chosen = decision.frontiers[choice].viewpoint
        given_up = decision.frontiers[without].viewpoint
        places = np.array([here, given_up, chosen], np.int32)
        between = distance_matrix(decision.traversable, places, decision.grid.resolution)
        stake = float(between[0, 1] + between[1, 2] - between[0, 2])
        if not np.isfinite(stake):
            return None
        cells, corner = _known_part(decision.grid)
        return DecisiveDecision(
            distance=decision.distance,
            coverage=self._simulation.coverage,
            stake=stake,
            cells=cells,
            corner=corner,
            here=(here.row, here.col),
            chosen=(int(chosen[0]), int(chosen[1])),
            given_up=(given_up.row, given_up.col),
            without=int(without),
            judged=_judged(decision.frontiers, truth.frontiers),
            members=decision.clusters.cells,
            offsets=decision.clusters.offsets,
        )

    def _pursue(self, decision: Decision, choice: Choice) -> None:
        """See what becomes of the frontiers that were given up."""
        self._settle()
        if isinstance(choice, PATHS):
            end, near = path_of(choice)[-1], _NEAR / decision.grid.resolution
            comes = [bool((np.hypot(*(kept.cells - end).T) <= near).any()) for kept in self._kept]
        elif choice == STOP:
            return
        else:
            goal = set(map(tuple, decision.frontiers[choice].cells.tolist()))
            comes = [not goal.isdisjoint(map(tuple, kept.cells.tolist())) for kept in self._kept]
        for kept, is_goal in zip(self._kept, comes, strict=True):
            if is_goal and np.isnan(kept.decided.seen_after):
                kept.decided = dataclasses.replace(kept.decided, came_back=True)

    def _settle(self) -> None:
        cells, gone = self._simulation.mapper.grid.cells, self._simulation.config.gone_share
        for kept in self._kept:
            if np.isnan(kept.decided.seen_after) and remaining_share(cells, kept.cells) < gone:
                walked = self._simulation.distance - kept.decided.distance
                kept.decided = dataclasses.replace(kept.decided, seen_after=walked)


def without_layout(decision: Decision) -> Decision:
    """The decision as it is without a predictor."""
    plain = tuple(
        dataclasses.replace(f, is_closed=None, expected_area=None, confidence=None, room=None)
        for f in decision.frontiers
    )
    return dataclasses.replace(decision, frontiers=plain, rooms=None, foresee=None)


def _is_choice(decision: Decision, choice: object) -> bool:
    """Whether it is a path, `STOP` or the index of a frontier."""
    if isinstance(choice, (int, np.integer)):
        return choice == STOP or 0 <= int(choice) < len(decision.frontiers)
    return isinstance(choice, PATHS)


def same_choice(a: Choice, b: Choice) -> bool:
    """Whether two choices are one: the same frontier, both `STOP`, or the same path."""
    if isinstance(a, PATHS) or isinstance(b, PATHS):
        return isinstance(a, PATHS) and isinstance(b, PATHS) and np.array_equal(path_of(a), path_of(b))
    return int(a) == int(b)


def _same_judgement(a: Decision, b: Decision) -> bool:
    """Whether two predictions say the same, as far as an agent can see."""
    pairs = zip(a.frontiers, b.frontiers, strict=True)
    return a.rooms is b.rooms and all(
        (f.is_closed, f.expected_area) == (g.is_closed, g.expected_area) for f, g in pairs
    )


def _mixed(decision: Decision, truth: Decision, *, classes: bool, areas: bool) -> Decision:
    """The decision with the true classes, the true areas, or both."""
    mixed = []
    for f, true in zip(decision.frontiers, truth.frontiers, strict=True):
        changed = (
            dataclasses.replace(f, is_closed=true.is_closed, confidence=true.confidence) if classes else f
        )
        mixed.append(dataclasses.replace(changed, expected_area=true.expected_area) if areas else changed)
    return dataclasses.replace(decision, frontiers=tuple(mixed))


def _judged(found: Sequence[Frontier], true: Sequence[Frontier]) -> Floats:
    """float64 (k, 4): judged closed, expected area, truly closed, true area."""
    rows = [
        (f.is_closed, f.expected_area, t.is_closed, t.expected_area) for f, t in zip(found, true, strict=True)
    ]
    return np.array(rows, np.float64)


def _counts(found: Sequence[Frontier], true: Sequence[Frontier]) -> list[float]:
    """The columns from `closed` to `open_left`."""
    judged = _judged(found, true)
    closed, true_closed = judged[:, 0] > 0, judged[:, 2] > 0
    leftover = closed & (judged[:, 1] < LITTLE_LEFT)
    true_leftover = true_closed & (judged[:, 3] < LITTLE_LEFT)
    sums = [
        true_closed, true_closed & ~closed, ~true_closed, ~true_closed & closed,
        true_leftover, true_leftover & ~leftover, leftover & ~true_leftover,
    ]  # fmt: skip
    areas = np.where(closed, judged[:, 1], 0.0)
    sure = np.array([1.0 if f.confidence is None else f.confidence for f in found])[closed]
    left = [float(areas.max(initial=0)), float(areas.sum()), float(sure.min(initial=1))]
    return [*(float(s.sum()) for s in sums), *left, float((~closed).sum()), float(judged[~closed, 1].sum())]


def _known_part(grid: OccupancyGrid) -> tuple[Cells, tuple[int, int]]:
    """A copy of the known part of a grid int8 (rows, cols) with a margin, and its first row and column."""
    row0, row1, col0, col1 = known_box(grid.cells, round(_MARGIN / grid.resolution))
    return grid.cells[row0:row1, col0:col1].copy(), (row0, col0)
