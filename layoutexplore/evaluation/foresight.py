"""What foresight is worth to a robot: metres of one planner with predictors that foresee more or less."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from layoutexplore.benchmark.analysis import METRICS, compare
from layoutexplore.benchmark.rows import Row
from layoutexplore.errors import checks_arguments
from layoutexplore.evaluation.in_the_loop import driver_of
from layoutexplore.metrics.statistics import Interval

REFERENCE = "layout-tour"
"""The strategy that the metres are compared with, in the same cells."""

PLANNER = "plan-tour"
"""The strategy that is given foresight."""

HORIZONS = tuple(f"oracle:horizon={doors}" for doors in (0, 1, 2, 3, "inf"))
"""Who foresees when no predictor is named: the truth, so many doors ahead."""


@dataclass(frozen=True, kw_only=True)
class ForesightScore:
    """The planner with one predictor, on the cells of one sensor or of all.

    Attributes:
        sensor: Name of the sensor, or "all sensors".
        predictor: Who foresees.
        cells: Runs that are compared.
        buildings: Their buildings.
        d95: Metres to 95 % over those of the reference, interval over buildings.
        d99: The same to 99 %.
        reached: Share of the runs that saw 99 %, 0..1.
        ms: Milliseconds of a decision, median over runs of their medians, what foresees included.
    """

    sensor: str
    predictor: str
    cells: int
    buildings: int
    d95: Interval
    d99: Interval
    reached: float
    ms: float


@checks_arguments
def explorer_with(predictor: str) -> str:
    """The agent that explores with a predictor's foresight, by the name that it has in results.

    Example:
        >>> explorer_with("oracle:horizon=2")
        'plan-tour:predictor=oracle:horizon=2'
    """
    return driver_of(predictor, PLANNER)


@checks_arguments
def score_foresight(rows: Iterable[Row], predictors: Sequence[str]) -> list[ForesightScore]:
    """A line a sensor and predictor, all sensors together first where there are several.

    Args:
        rows: Runs of the reference and of the planner with each predictor.
        predictors: Their names, in the order of the lines.
    """
    good = [row for row in rows if not row.error]
    found = {(c.sensor, c.agent, c.metric): c for c in compare(good, REFERENCE)}
    lines = []
    for sensor in dict.fromkeys(sensor for sensor, _, _ in found):
        for predictor in predictors:
            agent = explorer_with(predictor)
            parts = [found.get((sensor, agent, metric)) for metric in METRICS[1:]]
            if parts[0] is None or parts[1] is None:
                continue
            sensors = {row.sensor for row in good} & {sensor} or {row.sensor for row in good}
            took = [row.ms_decision_median for row in good if row.agent == agent and row.sensor in sensors]
            lines.append(
                ForesightScore(
                    sensor=sensor,
                    predictor=predictor,
                    cells=parts[0].cells,
                    buildings=parts[0].buildings,
                    d95=parts[0].ratio,
                    d99=parts[1].ratio,
                    reached=parts[1].reached,
                    ms=float(np.median(took)),
                )
            )
    return lines


@checks_arguments
def foresight_table(scores: Sequence[ForesightScore]) -> str:
    """The lines as a table in Markdown."""
    lines = [
        f"| sensor | foresight | runs | buildings | d95 / {REFERENCE} | d99 / {REFERENCE} | saw 99 % | ms |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for s in scores:
        d95, d99 = (f"{w:.2f}" for w in (s.d95, s.d99))
        lines.append(
            f"| {s.sensor} | `{s.predictor}` | {s.cells} | {s.buildings} | {d95} | {d99} | {s.reached:.0%} "
            f"| {s.ms:.0f} |"
        )
    return "\n".join(lines) + "\n"
