"""What layouts did in the runs of a benchmark: what they changed, how right they were, what they cost.

Where the difference to perfect rooms comes from is read off two ways: predictions are compared with the truth
at every decision, and the agent is asked what it would have chosen with true classes, true areas or the true
rooms.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from layoutexplore.benchmark.analysis import agents_of, groups, share_of
from layoutexplore.benchmark.counterfactual import LOG
from layoutexplore.benchmark.rows import Row, RunKey
from layoutexplore.grids.arrays import Floats, Mask
from layoutexplore.metrics.statistics import Interval, cluster_bootstrap, weighted_mean

LogOf = Callable[[Row], Floats | None]
"""Gives the log of a run, a row a decision; None where nobody asked."""


@dataclass(frozen=True, kw_only=True)
class LayoutEffect:
    """What the layout did in the runs of one agent in one group.

    Shares are of all decisions or frontiers of its runs.

    Attributes:
        sensor: The sensor, or all of them.
        agent: The strategy.
        runs: Number of runs in which was asked.
        decisions: Number of their decisions.
        prediction_ms: Median milliseconds of a prediction.
        prediction_ms_p95: 95th percentile.
        episode_seconds: Median seconds that the predictions of a run took.
        changed: Mean share of the decisions of a run in which the layout changed the choice, interval over
            buildings.
        misled: Mean share in which the true rooms would have.
        by_class: Share of the misled decisions that true classes alone set right.
        by_area: Share that true areas alone set right.
        by_both: Share that takes both.
        by_rooms: Share that only the true rooms set right.
        closed_as_open: Share of the truly closed frontiers that were judged open.
        open_as_closed: Share of the truly open frontiers that were judged closed.
        leftover_missed: Share of the truly closed frontiers with less than 1 m2 left that were not judged so.
        leftover_wrong: Share of the frontiers judged closed with less than 1 m2 left that are not.
    """

    sensor: str
    agent: str
    runs: int
    decisions: int
    prediction_ms: float
    prediction_ms_p95: float
    episode_seconds: float
    changed: Interval
    misled: Interval
    by_class: float
    by_area: float
    by_both: float
    by_rooms: float
    closed_as_open: float
    open_as_closed: float
    leftover_missed: float
    leftover_wrong: float


@dataclass(frozen=True, eq=False)
class _Digest:
    """What is kept of the log of one run: a log is read once, and many do not fit into memory.

    Attributes:
        row: The run.
        totals: float64 (len(LOG),), sums over its decisions.
        times: float64 (n,), milliseconds of its predictions.
        changed: Share of the decisions that the layout changed.
        misled: Share that the true rooms would have.
        either: Decisions that true classes, true areas or both set right.
    """

    row: Row
    totals: Floats
    times: Floats
    changed: float
    misled: float
    either: int

    @staticmethod
    def of(row: Row, log: Floats) -> _Digest:
        """The digest of a log that is not empty."""
        changed, misled = (float(log[:, LOG.index(name)].mean()) for name in ("changed", "misled"))
        either = _logical(log, "class_alone") | _logical(log, "area_alone") | _logical(log, "both")
        times = log[:, LOG.index("prediction_ms")].copy()
        return _Digest(row, log.sum(axis=0), times, changed, misled, int(either.sum()))


def layout_effects(rows: Iterable[Row], log_of: LogOf) -> list[LayoutEffect]:
    """The effects of the layout for every agent with a predictor, in every group.

    Runs in which nobody asked do not count.
    """
    found = []
    digests: dict[RunKey, _Digest | None] = {}

    def digest(row: Row) -> _Digest | None:
        if row.key not in digests:
            log = log_of(row)
            digests[row.key] = None if log is None or not len(log) else _Digest.of(row, log)
        return digests[row.key]

    for sensor, part in groups(rows).items():
        for agent in agents_of(part):
            mine = [run for row in part if row.agent == agent and (run := digest(row))]
            if mine:
                found.append(_effect(sensor, agent, mine))
    return found


def _effect(sensor: str, agent: str, runs: Sequence[_Digest]) -> LayoutEffect:
    buildings = [run.row.cluster for run in runs]
    total = dict(zip(LOG, np.sum([run.totals for run in runs], axis=0).tolist(), strict=True))
    times = np.concatenate([run.times for run in runs])
    changed, misled = (
        cluster_bootstrap([getattr(run, name) for run in runs], buildings, weighted_mean)
        for name in ("changed", "misled")
    )
    either = sum(run.either for run in runs)
    return LayoutEffect(
        sensor=sensor,
        agent=agent,
        runs=len(runs),
        decisions=len(times),
        prediction_ms=float(np.median(times)),
        prediction_ms_p95=float(np.percentile(times, 95)),
        episode_seconds=float(np.median([run.row.prediction_seconds for run in runs])),
        changed=changed,
        misled=misled,
        by_class=share_of(total["class_alone"], total["misled"]),
        by_area=share_of(total["area_alone"], total["misled"]),
        by_both=share_of(total["both"], total["misled"]),
        by_rooms=share_of(total["misled"] - either, total["misled"]),
        closed_as_open=share_of(total["closed_as_open"], total["closed"]),
        open_as_closed=share_of(total["open_as_closed"], total["open"]),
        leftover_missed=share_of(total["leftover_missed"], total["leftover"]),
        leftover_wrong=share_of(
            total["leftover_wrong"], total["leftover"] - total["leftover_missed"] + total["leftover_wrong"]
        ),
    )


def _logical(log: Floats, name: str) -> Mask:
    return np.asarray(log[:, LOG.index(name)] > 0)
