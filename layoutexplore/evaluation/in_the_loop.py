"""What layout methods are worth to a robot: how right they are about frontiers, and the metres they save."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from layoutexplore.agents import make_agent
from layoutexplore.benchmark.analysis import Comparison, compare, over_all_sensors
from layoutexplore.benchmark.rows import Row
from layoutexplore.errors import checks_arguments
from layoutexplore.evaluation.partial_rooms_summary import PredictorSummary
from layoutexplore.metrics.statistics import Interval

BASELINE = "nearest"
"""What every strategy is compared with."""

DRIVER = "layout-tour"
"""The strategy that every predictor drives."""


@dataclass(frozen=True, kw_only=True)
class LoopScore:
    """One predictor, judged on snapshots and in the loop.

    Attributes:
        predictor: Its name.
        mcc: Matthews' correlation of closed and open frontiers; NaN where none was judged.
        hidden_iou: IoU of the predicted and the true hidden parts of rooms, interval over buildings; NaN
            where no room was half seen.
        leftover: Share of frontiers of which "closed, with less than 1 m2 left" is told rightly, 0..1.
        ms: Milliseconds of a prediction, median.
        d95: Metres to 95 % over those of the baseline, interval over buildings; None where nothing ran.
        d99: The same to 99 %.
        reached: Share of the runs that reached 99 %, 0..1; None where nothing ran.
    """

    predictor: str
    mcc: float
    hidden_iou: Interval
    leftover: float
    ms: float
    d95: Interval | None = None
    d99: Interval | None = None
    reached: float | None = None


@checks_arguments
def driver_of(predictor: str, driver: str = DRIVER) -> str:
    """The agent that explores with a predictor, by the name that it has in results.

    Args:
        predictor: Its name; commas between its options would end it inside the agent's.
        driver: The strategy.

    Example:
        >>> driver_of("reconstruct:rose2"), driver_of("layout")
        ('layout-tour:predictor=reconstruct:rose2', 'layout-tour')
    """
    return make_agent(f"{driver}:predictor={predictor.replace(',', ';')}").name


@checks_arguments
def score_in_the_loop(summary: Mapping[str, PredictorSummary], rows: Sequence[Row]) -> list[LoopScore]:
    """One line a predictor, the shortest way to 95 % first.

    Args:
        summary: What `layoutexplore.evaluation.partial_rooms_summary.summarise_partial_rooms` made.
        rows: Runs of the baseline and of the driver with each predictor.
    """
    pooled = over_all_sensors(compare(rows, BASELINE))
    lines = [_line(name, part, pooled) for name, part in summary.items()]
    return sorted(lines, key=lambda line: (line.d95 is None, line.d95.estimate if line.d95 else 0.0))


def _line(name: str, part: PredictorSummary, pooled: Mapping[tuple[str, str], Comparison]) -> LoopScore:
    d95, d99 = (pooled.get((driver_of(name), metric)) for metric in ("d95", "d99"))
    return LoopScore(
        predictor=name,
        mcc=part.mcc,
        hidden_iou=part.hidden,
        leftover=part.frontiers[0].leftover_accuracy if part.frontiers else math.nan,
        ms=part.ms,
        d95=d95.ratio if d95 else None,
        d99=d99.ratio if d99 else None,
        reached=d99.reached if d99 else None,
    )
