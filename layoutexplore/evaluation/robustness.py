"""What noise costs: metres of strategies, and how right predictors are, level by level."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from layoutexplore.benchmark.analysis import Comparison, agents_of, compare, over_all_sensors
from layoutexplore.benchmark.rows import Row
from layoutexplore.errors import ConfigError, checks_arguments, unknown_name
from layoutexplore.evaluation.partial_rooms_summary import PredictorSummary
from layoutexplore.metrics.statistics import NO_INTERVAL, Interval
from layoutexplore.simulation.config import NOISE

NOISELESS = "none"
"""The level that the others are compared with."""

LEVELS = (NOISELESS, *NOISE)
"""All levels, from exact sensors to bad ones."""

BASELINE = "nearest"
"""The strategy that the others are compared with at each level."""


@checks_arguments
def chosen_levels(names: Sequence[str] | None) -> tuple[str, ...]:
    """The levels that were named, in the order in which they rise, after the noiseless one; all without.

    Raises:
        UnknownNameError: There is no such level.
    """
    for name in names or ():
        if name not in LEVELS:
            raise unknown_name("level of noise", name, LEVELS)
    return tuple(level for level in LEVELS if level == NOISELESS or level in (names or LEVELS))


@dataclass(frozen=True, kw_only=True)
class AgentUnderNoise:
    """One strategy at one level of noise; intervals over buildings.

    Attributes:
        agent: The strategy.
        level: One of `LEVELS`.
        runs: How many.
        reached: Share of them that saw 99 %, 0..1.
        d95: Metres to 95 % over those of the same strategy without noise in the same cells; NaN where none
            of these ended well.
        d99: The same to 99 %.
        to_baseline: Metres to 95 % over those of `BASELINE` at the same level; None where it did not run.
    """

    agent: str
    level: str
    runs: int
    reached: float
    d95: Interval
    d99: Interval
    to_baseline: Interval | None


@dataclass(frozen=True, kw_only=True)
class PredictorUnderNoise:
    """One predictor at one level of noise, on snapshots of explorations.

    Attributes:
        predictor: Its name.
        level: One of `LEVELS`.
        mcc: Matthews' correlation of closed and open frontiers.
        hidden_iou: IoU of the predicted and the true hidden parts of rooms, interval over buildings.
    """

    predictor: str
    level: str
    mcc: float
    hidden_iou: Interval


@checks_arguments
def agents_under_noise(rows: Mapping[str, Sequence[Row]]) -> list[AgentUnderNoise]:
    """One line an agent and level at which a run of it ended well, in the order of the levels given.

    Args:
        rows: By level, the runs of the same cells.

    Raises:
        ConfigError: The noiseless runs are missing.
    """
    if NOISELESS not in rows:
        raise ConfigError(f"runs at any level are compared with those at level {NOISELESS!r}: give them, too")
    to_baseline = {level: over_all_sensors(compare(part, BASELINE)) for level, part in rows.items()}
    found = []
    for agent in agents_of(rows[NOISELESS]):
        exact = [row for row in rows[NOISELESS] if row.agent == agent]
        for level, part in rows.items():
            mine = [row for row in part if row.agent == agent and not row.error]
            if mine:
                found.append(_line(agent, level, mine, exact, to_baseline[level].get((agent, "d95"))))
    return found


def _line(
    agent: str, level: str, mine: Sequence[Row], exact: Sequence[Row], to_baseline: Comparison | None
) -> AgentUnderNoise:
    # `compare` pairs by agents: the runs of one strategy at two levels are handed to it under two names.
    pairs = [dataclasses.replace(row, agent=NOISELESS) for row in exact]
    pairs += [dataclasses.replace(row, agent="noisy") for row in mine]
    own = over_all_sensors(compare(pairs, NOISELESS))
    d95, d99 = (own["noisy", m].ratio if ("noisy", m) in own else NO_INTERVAL for m in ("d95", "d99"))
    return AgentUnderNoise(
        agent=agent,
        level=level,
        runs=len(mine),
        reached=sum(row.reached99 for row in mine) / len(mine),
        d95=d95,
        d99=d99,
        to_baseline=to_baseline.ratio if to_baseline else None,
    )


@checks_arguments
def predictors_under_noise(
    summaries: Mapping[str, Mapping[str, PredictorSummary]],
) -> list[PredictorUnderNoise]:
    """One line a predictor and level.

    Args:
        summaries: By level, what `layoutexplore.evaluation.partial_rooms_summary.summarise_partial_rooms`
            made.
    """
    found = []
    for level, summary in summaries.items():
        for name, part in summary.items():
            line = PredictorUnderNoise(predictor=name, level=level, mcc=part.mcc, hidden_iou=part.hidden)
            found.append(line)
    return sorted(found, key=lambda line: line.predictor)
