"""The page of robustness: strategies and predictors against the level of noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from layoutexplore.benchmark.analysis import FailedRuns
from layoutexplore.errors import checks_arguments
from layoutexplore.evaluation.robustness import AgentUnderNoise, PredictorUnderNoise
from layoutexplore.files import write_atomically, write_csv
from layoutexplore.metrics.statistics import Interval
from layoutexplore.report.charts import line_chart
from layoutexplore.report.templates import render
from layoutexplore.simulation.config import NOISE

NOTHING = Interval(float("nan"), float("nan"), float("nan"))

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
    write_atomically(written[0], render("robustness.html", **view, **facts))
    return written


def _lines(values: Mapping[tuple[str, str], Interval], levels: Sequence[str]) -> dict[str, list[Interval]]:
    names = dict.fromkeys(name for name, _ in values)
    return {name: [values.get((name, level), NOTHING) for level in levels] for name in names}


def _agent_row(line: AgentUnderNoise) -> dict[str, Any]:
    row: dict[str, Any] = {
        "agent": line.agent,
        "level": line.level,
        "runs": line.runs,
        "reached99": line.reached,
    }
    for key, value in (("d95", line.d95), ("d99", line.d99), ("d95_to_nearest", line.to_baseline or NOTHING)):
        row |= {key: value.estimate, f"{key}_low": value.low, f"{key}_high": value.high}
    return row


def _predictor_row(line: PredictorUnderNoise) -> dict[str, Any]:
    hidden = line.hidden_iou
    return {
        "predictor": line.predictor,
        "level": line.level,
        "mcc": line.mcc,
        "hidden_iou": hidden.estimate,
        "hidden_iou_low": hidden.low,
        "hidden_iou_high": hidden.high,
    }
