"""What the results of a benchmark say: paired comparisons with the baseline, pooled curves, tables.

Every comparison is paired: an agent's run against the baseline's run of the same cell (floor plan, start,
sensor). A ratio of 0.9 means nine tenths of the baseline's metres. Ratios are averaged as logarithms, by
interquartile mean.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from layoutexplore.benchmark.rows import CellKey, Row, RunKey
from layoutexplore.errors import ConfigError, checks_arguments
from layoutexplore.grids.arrays import Floats, shows_shapes
from layoutexplore.metrics.exploration import coverage_at, mean_coverage
from layoutexplore.metrics.statistics import (
    Interval,
    cluster_bootstrap,
    cluster_means,
    improvements,
    interquartile_mean,
    log_ratios,
    weighted_mean,
)

METRICS = ("d90", "d95", "d99")
"""The distances that are compared; d95 is the headline, d99 its guard."""

HEADLINE = "d95"
"""The distance that agents are ranked by, where runs were not ended below it."""

POOLED = "all sensors"
"""Name of the group that holds the cells of every sensor."""

SHORTEST = 1.0
"""Metres; shorter distances count as this much in ratios (a level may be reached by the first scan)."""

CURVE_END = 1.5
"""Pooled curves reach this multiple of the baseline's distance to 99 %."""

CURVE_POINTS = 121

Curves = Callable[[Row], Floats]
"""Gives the coverage curve (n, 2) of a run."""


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """One agent against the baseline at one coverage level.

    Attributes:
        sensor: The sensor, or `POOLED`.
        agent: The strategy.
        metric: d90, d95 or d99.
        cells: Number of pairs.
        plans: Number of floor plans among them.
        buildings: Number of buildings among them: what is resampled.
        ratio: exp of the interquartile mean over cells of ln(metres / baseline's metres), interval over
            buildings.
        plan_ratio: The same over the buildings' mean log-ratios, so that every building counts once.
        improvement: Probability of needing fewer metres than the baseline on a cell drawn at random; as many
            count half.
        reached: Share of this agent's runs that reached the level, 0..1.
    """

    sensor: str
    agent: str
    metric: str
    cells: int
    plans: int
    buildings: int
    ratio: Interval
    plan_ratio: Interval
    improvement: Interval
    reached: float


@dataclass(frozen=True, kw_only=True)
class AgentSummary:
    """Plain figures of one agent in one group.

    Coverage and revisits are means over its runs, finished rooms their share of all rooms of its runs, the
    others medians.
    """

    sensor: str
    agent: str
    runs: int
    auc_difference: Interval | None
    decisions: float
    ms_decision: float
    ms_decision_p95: float
    revisits: float
    rooms_finished: float
    coverage: float
    seconds: float


@shows_shapes
@dataclass(frozen=True, kw_only=True)
class PooledCurve:
    """Coverage of an agent against distance in units of the baseline's distance to 99 % in the same cell.

    Attributes:
        agent: The strategy.
        x: float64 (k,), multiples of the baseline's distance; of its budget where it did not get there.
        mean: float64 (k,), mean coverage over cells.
        low: float64 (k,), lower quartile over cells.
        high: float64 (k,), upper quartile over cells.
        cells: Number of cells.
    """

    agent: str
    x: Floats
    mean: Floats
    low: Floats
    high: Floats
    cells: int


@dataclass(frozen=True, kw_only=True)
class FailedRuns:
    """The runs of one agent that ended in an error.

    Attributes:
        agent: The strategy.
        failed: How many of its runs failed.
        runs: How many runs it has.
        error: What the first of them says.
    """

    agent: str
    failed: int
    runs: int
    error: str

    def __str__(self) -> str:
        if self.runs == 1:
            return f"{self.agent}: its only run failed with {self.error}"
        which = f"all {self.runs}" if self.failed == self.runs else f"{self.failed} of {self.runs}"
        return f"{self.agent}: {which} runs failed, first with {self.error}"


def groups(rows: Iterable[Row]) -> dict[str, list[Row]]:
    """The runs that ended well by sensor; where there are several, all of them under `POOLED` first."""
    good = [row for row in rows if not row.error]
    sensors = sorted({row.sensor for row in good})
    parts = {sensor: [row for row in good if row.sensor == sensor] for sensor in sensors}
    return {POOLED: good, **parts} if len(sensors) > 1 else parts


def measured_levels(rows: Iterable[Row]) -> tuple[str, ...]:
    """Those of `METRICS` that every run that ended well has: runs are ended below the others.

    A level that only some runs have is one that their last scans happened to see.
    """
    good = [row for row in rows if not row.error]
    return tuple(m for m in METRICS if good and not any(math.isnan(getattr(row, m)) for row in good))


def headline_level(rows: Iterable[Row]) -> str:
    """What agents are ranked by: `HEADLINE`, or the highest level below that was measured; "" without one."""
    below = METRICS[: METRICS.index(HEADLINE) + 1]
    return next((m for m in reversed(measured_levels(rows)) if m in below), "")


def cells_of_agents(rows: Iterable[Row]) -> dict[str, set[CellKey]]:
    """The cells in which each agent ended well; none for one that always failed."""
    found: dict[str, set[CellKey]] = {}
    for row in rows:
        cells = found.setdefault(row.agent, set())
        if not row.error:
            cells.add(row.cell)
    return found


def failed_runs(rows: Iterable[Row]) -> list[FailedRuns]:
    """A line an agent of which a run failed, sorted by name."""
    every: dict[str, list[Row]] = {}
    for row in rows:
        every.setdefault(row.agent, []).append(row)
    found = []
    for agent, mine in sorted(every.items()):
        errors = [row.error for row in mine if row.error]
        if errors:
            found.append(FailedRuns(agent=agent, failed=len(errors), runs=len(mine), error=errors[0]))
    return found


@checks_arguments
def compare(rows: Iterable[Row], baseline: str) -> list[Comparison]:
    """Every agent against the baseline, for every group and level; nothing where the baseline did not run.

    Levels that were not measured (the runs were ended below them) are left out.

    Args:
        rows: The runs of one results folder.
        baseline: The agent to compare with.

    Raises:
        ConfigError: An agent has two runs in one cell, as where rows of several folders are put together.
    """
    rows = list(rows)
    _check_cells(rows)
    levels = measured_levels(rows)
    found = []
    for sensor, part in groups(rows).items():
        base = {row.cell: row for row in part if row.agent == baseline}
        for agent in agents_of(part):
            pairs = [(row, base[row.cell]) for row in part if row.agent == agent and row.cell in base]
            if pairs:
                found += [_comparison(sensor, agent, metric, pairs) for metric in levels]
    return found


def over_all_sensors(comparisons: Iterable[Comparison]) -> dict[tuple[str, str], Comparison]:
    """Those of the runs with every sensor, by agent and level."""
    found = list(comparisons)
    alone = len({c.sensor for c in found}) == 1
    return {(c.agent, c.metric): c for c in found if alone or c.sensor == POOLED}


def _check_cells(rows: Iterable[Row]) -> None:
    """Every agent that ended well in a cell did so once: of two runs nobody can tell which to pair."""
    met: dict[RunKey, Row] = {}
    for row in rows:
        if row.error:
            continue
        if (other := met.setdefault(row.key, row)) is not row:
            apart = f" (configurations {other.config_hash} and {row.config_hash})"
            raise ConfigError(
                f"compare: {row.agent} has two runs on {row.plan}, start {row.start}, {row.sensor}"
                + (apart if row.config_hash != other.config_hash else "")
                + ": compare the rows of each results folder by themselves, or give the agents of each other "
                "names, as by dataclasses.replace(row, agent=...)"
            )


def _comparison(sensor: str, agent: str, metric: str, pairs: list[tuple[Row, Row]]) -> Comparison:
    buildings = [row.cluster for row, _ in pairs]
    metres, reference = (np.maximum([getattr(pair[k], metric) for pair in pairs], SHORTEST) for k in (0, 1))
    logs = log_ratios(metres, reference)
    means, names = cluster_means(logs, buildings)
    return Comparison(
        sensor=sensor,
        agent=agent,
        metric=metric,
        cells=len(pairs),
        plans=len({row.plan for row, _ in pairs}),
        buildings=len(names),
        ratio=cluster_bootstrap(logs, buildings).map(math.exp),
        plan_ratio=cluster_bootstrap(means, names).map(math.exp),
        improvement=cluster_bootstrap(improvements(logs), buildings, weighted_mean),
        reached=float(np.mean([getattr(row, metric.replace("d", "reached")) for row, _ in pairs])),
    )


def summarise_agents(rows: Iterable[Row], baseline: str, curves: Curves) -> list[AgentSummary]:
    """Plain figures of every agent in every group."""
    found = []

    @functools.cache
    def covered(row: Row, scale: float) -> float:
        """Mean coverage of a run; it counts for two groups, and the baseline's for every agent."""
        metres, seen = curves(row).T
        return mean_coverage(metres, seen, scale)

    def gained(row: Row, other: Row) -> float:
        """Coverage gained by a run over another one in its cell."""
        scale = curve_scale(other)
        return covered(row, scale) - covered(other, scale)

    for sensor, part in groups(rows).items():
        base = {row.cell: row for row in part if row.agent == baseline}
        for agent in agents_of(part):
            mine = [row for row in part if row.agent == agent]
            found.append(
                AgentSummary(
                    sensor=sensor,
                    agent=agent,
                    runs=len(mine),
                    auc_difference=_auc_difference(mine, base, gained),
                    decisions=float(np.median([row.decisions for row in mine])),
                    ms_decision=float(np.median([row.ms_decision_median for row in mine])),
                    ms_decision_p95=float(np.median([row.ms_decision_p95 for row in mine])),
                    revisits=float(np.mean([row.revisits for row in mine])),
                    rooms_finished=share_of(
                        sum(row.rooms_finished for row in mine), sum(row.rooms for row in mine)
                    ),
                    coverage=float(np.mean([row.coverage for row in mine])),
                    seconds=float(np.median([row.wall_seconds for row in mine])),
                )
            )
    return found


def share_of(part: float, whole: float) -> float:
    """A share of a whole, NaN of nothing."""
    return part / whole if whole else math.nan


def _auc_difference(
    mine: list[Row], base: dict[CellKey, Row], gained: Callable[[Row, Row], float]
) -> Interval | None:
    """Mean coverage over the baseline's metres to 99 %, minus the baseline's, IQM over cells."""
    pairs = [(row, base[row.cell]) for row in mine if row.cell in base]
    if not pairs:
        return None
    return cluster_bootstrap([gained(*pair) for pair in pairs], [row.cluster for row, _ in pairs])


def curve_scale(row: Row) -> float:
    """Metres that a run of the baseline needed for the highest level that was measured, at least 1 m."""
    measured = [value for value in (row.d99, row.d95, row.d90, row.distance) if not math.isnan(value)]
    return max(measured[0], SHORTEST)


def pooled_curves(rows: Iterable[Row], baseline: str, curves: Curves) -> list[PooledCurve]:
    """Coverage over distance of every agent, over the cells that the baseline ran too."""
    part = [row for row in rows if not row.error]
    scale = {row.cell: curve_scale(row) for row in part if row.agent == baseline}
    x = np.linspace(0, CURVE_END, CURVE_POINTS)
    found = []
    for agent in agents_of(part):
        mine = [row for row in part if row.agent == agent and row.cell in scale]
        if mine:
            own = ((row, *curves(row).T) for row in mine)
            sampled = np.array([coverage_at(metres, seen, x * scale[row.cell]) for row, metres, seen in own])
            low, high = np.quantile(sampled, [0.25, 0.75], axis=0)
            found.append(
                PooledCurve(agent=agent, x=x, mean=sampled.mean(axis=0), low=low, high=high, cells=len(mine))
            )
    return found


def by_plan(rows: Iterable[Row], metric: str) -> dict[tuple[str, str], dict[str, float]]:
    """For every (floor plan, sensor) the interquartile mean over starts of a distance, by agent."""
    values: dict[tuple[str, str], dict[str, list[float]]] = {}
    for row in rows:
        if not row.error and not math.isnan(getattr(row, metric)):
            values.setdefault((row.plan, row.sensor), {}).setdefault(row.agent, []).append(
                getattr(row, metric)
            )
    return {
        key: {agent: interquartile_mean(v) for agent, v in agents.items()}
        for key, agents in sorted(values.items())
    }


def ratios_by_plan(
    rows: Iterable[Row], metric: str, baseline: str
) -> dict[tuple[str, str], dict[str, float]]:
    """As `by_plan`, each agent's metres over the baseline's, of the starts that ended well with both.

    Agents without such a start, or whose baseline needed no metre there, are left out.
    """
    rows, found = list(rows), dict[tuple[str, str], dict[str, float]]()
    cells = cells_of_agents(rows)
    for agent, mine in cells.items():
        both, pair = mine & cells.get(baseline, set()), (agent, baseline)
        shared = by_plan((row for row in rows if row.agent in pair and row.cell in both), metric)
        for key, metres in shared.items():
            if metres[baseline] > 0:
                found.setdefault(key, {})[agent] = metres[agent] / metres[baseline]
    return found


def agents_of(rows: Iterable[Row]) -> list[str]:
    """Names of the agents, sorted."""
    return sorted({row.agent for row in rows})
