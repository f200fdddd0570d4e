"""The page of robustness: strategies and predictors against the level of noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from layoutexplore.benchmark.analysis import FailedRuns
from layoutexplore.errors import checks_arguments
from layoutexplore.evaluation.robustness import AgentUnderNoise, PredictorUnderNoise
from layoutexplore.files import write_atomically, write_csv
from layoutexplore.metrics.statistics import NO_INTERVAL, Interval
from layoutexplore.report.charts import line_chart
from layoutexplore.report.templates import render
from layoutexplore.simulation.config import NOISE

AGENT_COLUMNS = (
    *("agent", "level", "runs", "reached99", "d95", "d95_low", "d95_high", "d99", "d99_low", "d99_high"),
    *("d95_to_nearest", "d95_to_nearest_low", "d95_to_nearest_high"),
)
"""Those of agents.csv."""

PREDICTOR_COLUMNS = ("predictor", "level", "mcc", "hidden_iou", "hidden_iou_low", "hidden_iou_high")
"""Those of predictors.csv."""


@checks_arguments
def write_robustness_report(
    out: Path,
    agents: Sequence[AgentUnderNoise],
    predictors: Sequence[PredictorUnderNoise],
    *,
    facts: dict[str, Any],
    failed: Mapping[str, Sequence[FailedRuns]] | None = None,
) -> list[Path]:
    """Write robustness.html, agents.csv and predictors.csv into a folder.

    Args:
        out: The folder; made when missing.
        agents: One a strategy and level.
        predictors: One a predictor and level.
        facts: "command", "plans", "sensors", "starts", "levels".
        failed: By level, the agents of which runs failed.

    Returns:
        The files written, the page first.
    """
    written = [out / "robustness.html", out / "agents.csv", out / "predictors.csv"]
    write_csv(written[1], [_agent_row(line) for line in agents], columns=AGENT_COLUMNS)
    write_csv(written[2], [_predictor_row(line) for line in predictors], columns=PREDICTOR_COLUMNS)
    levels = facts["levels"]
    metres = {(line.agent, line.level): line.d95 for line in agents}
    hidden = {(line.predictor, line.level): line.hidden_iou for line in predictors}
    mcc = {(line.predictor, line.level): Interval(line.mcc, line.mcc, line.mcc) for line in predictors}
    view = {
        "agents": agents,
        "predictors": predictors,
        "failed": {level: lines for level, lines in (failed or {}).items() if lines},
        "noise": NOISE,
        "metres_chart": line_chart(_lines(metres, levels), levels, low=0.75, high=1.5),
        "mcc_chart": line_chart(_lines(mcc, levels), levels),
        "hidden_chart": line_chart(_lines(hidden, levels), levels),
    }
    write_atomically(written[0], render("studies/robustness.html", **view, **facts))
    return written


def _lines(values: Mapping[tuple[str, str], Interval], levels: Sequence[str]) -> dict[str, list[Interval]]:
    names = dict.fromkeys(name for name, _ in values)
    return {name: [values.get((name, level), NO_INTERVAL) for level in levels] for name in names}


def _agent_row(line: AgentUnderNoise) -> dict[str, Any]:
    row: dict[str, Any] = {
        "agent": line.agent,
        "level": line.level,
        "runs": line.runs,
        "reached99": line.reached,
    }
    row |= line.d95.as_columns("d95") | line.d99.as_columns("d99")
    return row | (line.to_baseline or NO_INTERVAL).as_columns("d95_to_nearest")


def _predictor_row(line: PredictorUnderNoise) -> dict[str, Any]:
    row = {"predictor": line.predictor, "level": line.level, "mcc": line.mcc}
    return row | line.hidden_iou.as_columns("hidden_iou")
