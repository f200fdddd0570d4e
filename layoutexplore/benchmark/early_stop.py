"""What stopping early saves and loses: distance saved and coverage lost, against the baseline run to 99 %.

A strategy is measured where its run ended, in the same cells as the baseline: distance saved is 1 - its
metres / the baseline's metres to 99 %, coverage lost is 99 % less what it had seen, at least 0. Part of what
it saves is its better route, part is that it does not see the rest; how much the baseline itself would save
by being stopped at the same coverage is given beside. Rules of stopping can be tried on stored runs: a run
that stops is the beginning of the run that does not.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from layoutexplore.agents import make_agent
from layoutexplore.benchmark.analysis import Curves, agents_of, groups
from layoutexplore.benchmark.counterfactual import Counterfactual
from layoutexplore.benchmark.rows import CellKey, Row
from layoutexplore.errors import LayoutExploreError
from layoutexplore.frontiers.tour_features import BEGUN, SURE
from layoutexplore.grids.arrays import Floats, Mask
from layoutexplore.metrics.exploration import FULLY_SEEN, distance_to_coverage
from layoutexplore.metrics.statistics import Interval, cluster_bootstrap, interquartile_mean, weighted_mean

POINTS_LOST = 0.02
"""A run that loses more coverage than this has stopped too early."""

THRESHOLDS = (1.0, 2.0, 4.0, 8.0)
"""Square metres at which stopping is tried on runs that went on."""

Rule = Callable[[Counterfactual], Mask]
"""Whether to stop, bool (n,), at each decision of a run."""


@dataclass(frozen=True)
class RunStop:
    """The end of one run.

    Attributes:
        building: What is resampled.
        saved: 1 - metres / the baseline's metres to 99 %.
        lost: 0.99 less the coverage at the stop, at least 0.
        baseline_saved: What the baseline would have saved by stopping at the same coverage.
        early: Whether it stopped before 99 % at all.
    """

    building: str
    saved: float
    lost: float
    baseline_saved: float
    early: bool


@dataclass(frozen=True, kw_only=True)
class EarlyStop:
    """The stops of one strategy in one group, with intervals over buildings.

    Attributes:
        sensor: The sensor, or all of them.
        agent: The strategy.
        saved: Share of the metres saved, interquartile mean over runs.
        lost: Coverage lost, 0..1, mean over runs (an interquartile mean would hide disasters).
        baseline_saved: What the baseline would have saved at the same coverage, interquartile mean.
        worst: Most coverage lost in a run.
        too_early: Share of the runs that lost more than 2 points.
        stopped: Share of the runs that stopped before 99 %.
        runs: The stops.
        tried: Whether the rule was tried on runs that went on.
    """

    sensor: str
    agent: str
    saved: Interval
    lost: Interval
    baseline_saved: float
    worst: float
    too_early: float
    stopped: float
    runs: tuple[RunStop, ...]
    tried: bool = False


def early_stops(rows: Iterable[Row], baseline: str, curves: Curves) -> list[EarlyStop]:
    """Every agent that stops by itself, in every group, against the baseline's runs to 99 %.

    Those that have a rule of stopping, and those of which some run ended by itself: the agent stopped, or no
    frontier was left; not because the coverage or the budget was reached.
    """
    found = []
    for sensor, part in groups(rows).items():
        base = _to_99(part, baseline)
        for agent in agents_of(part):
            pairs = [(row, base[row.cell]) for row in part if row.agent == agent and row.cell in base]
            by_itself = any(row.stop_reason in ("agent", "no_frontier") for row, _ in pairs)
            if by_itself or (pairs and has_stop_rule(agent)):
                stops = [
                    stop_at(row.cluster, row.distance, row.coverage, other.d99, curves(other))
                    for row, other in pairs
                ]
                found.append(summarise_stops(sensor, agent, stops))
    return found


def tried_stops(
    rows: Iterable[Row],
    baseline: str,
    agent: str,
    curves: Curves,
    notes: Callable[[Row], Counterfactual | None],
    thresholds: Sequence[float] = THRESHOLDS,
) -> list[EarlyStop]:
    """What an agent without a rule would have saved and lost by stopping where little was left, by group.

    Args:
        rows: The runs.
        baseline: The agent to compare with.
        agent: Of whose runs.
        curves: Give the baseline's curves.
        notes: Gives what was noted in a run; runs in which nobody asked do not count.
        thresholds: Square metres that every frontier must have less of behind it.
    """
    found = []
    for sensor, part in groups(rows).items():
        base = _to_99(part, baseline)
        mine = [row for row in part if row.agent == agent and row.cell in base]
        runs = [(row, c, base[row.cell]) for row in mine if (c := notes(row)) is not None]
        for area in thresholds if runs else ():
            name = f"{agent}, below {area:g} m²"
            found.append(try_rule(stops_below(area), runs, curves, sensor=sensor, name=name))
    return found


def _to_99(rows: Iterable[Row], baseline: str) -> dict[CellKey, Row]:
    """The baseline's runs to 99 % by their cells; of one that saw as much where it stood nothing is saved."""
    return {row.cell: row for row in rows if row.agent == baseline and row.reached99 and row.d99 > 0}


def stops_below(area: float) -> Rule:
    """The rule of the option `stop_area`: stop when little is left.

    Every frontier is surely closed and has less than `area` square metres left, and the robot has more than
    begun.
    """

    def rule(notes: Counterfactual) -> Mask:
        surely_closed = (notes.column("open_judged") == 0) & (notes.column("least_sure") >= SURE)
        return np.asarray(
            surely_closed & (notes.column("largest_left") < area) & (notes.column("known") >= BEGUN)
        )

    return rule


def has_stop_rule(agent: str) -> bool:
    """Whether an agent is told to stop when little is left.

    Example:
        >>> has_stop_rule("layout-tour:stop_area=1"), has_stop_rule("layout-tour")
        (True, False)
        >>> has_stop_rule("one of another version")
        False
    """
    try:
        options = getattr(make_agent(agent), "options", None)
    except LayoutExploreError:
        return False
    return bool(getattr(options, "stop_area", 0.0) > 0)


def stop_at(
    building: str, metres: float, coverage: float, baseline_metres: float, baseline_curve: Floats
) -> RunStop:
    """The pair of a run that ended after some metres at some coverage.

    Args:
        building: What is resampled: `Row.cluster`.
        metres: Walked at the stop.
        coverage: Seen at the stop, 0..1.
        baseline_metres: Of the baseline to 99 % in the same cell, above 0.
        baseline_curve: float64 (n, 2), its metres and coverage.
    """
    there, _ = distance_to_coverage(
        baseline_curve[:, 0], baseline_curve[:, 1], min(coverage, FULLY_SEEN), budget=baseline_metres
    )
    lost = max(0.0, FULLY_SEEN - coverage)
    return RunStop(
        building, 1 - metres / baseline_metres, lost, 1 - there / baseline_metres, coverage < FULLY_SEEN
    )


def try_rule(
    rule: Rule,
    runs: Sequence[tuple[Row, Counterfactual, Row]],
    curves: Curves,
    *,
    sensor: str = "",
    name: str = "",
) -> EarlyStop:
    """What a rule of stopping would have saved and lost in runs that went on.

    Args:
        rule: Says at which decisions to stop; the first counts.
        runs: Of one agent, each with what was noted in it, and the baseline's run in the same cell.
        curves: Give the baseline's curves.
        sensor: For the result.
        name: For the result.
    """
    stops = []
    for row, notes, other in runs:
        at = np.flatnonzero(rule(notes))
        metres, coverage = row.distance, row.coverage
        if len(at):
            metres, coverage = (float(notes.column(what)[at[0]]) for what in ("distance", "coverage"))
        stops.append(stop_at(row.cluster, metres, coverage, other.d99, curves(other)))
    return replace(summarise_stops(sensor, name, stops), tried=True)


def summarise_stops(sensor: str, agent: str, stops: Sequence[RunStop]) -> EarlyStop:
    """Means and intervals of some stops."""
    buildings = [stop.building for stop in stops]
    saved = cluster_bootstrap([stop.saved for stop in stops], buildings)
    lost = cluster_bootstrap([stop.lost for stop in stops], buildings, weighted_mean)
    return EarlyStop(
        sensor=sensor,
        agent=agent,
        saved=saved,
        lost=lost,
        baseline_saved=interquartile_mean([stop.baseline_saved for stop in stops]),
        worst=max((stop.lost for stop in stops), default=math.nan),
        too_early=float(np.mean([stop.lost > POINTS_LOST for stop in stops])),
        stopped=float(np.mean([stop.early for stop in stops])),
        runs=tuple(stops),
    )
