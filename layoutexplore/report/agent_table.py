"""The table of agents: their comparisons and figures, a line each, the best first."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from layoutexplore.benchmark.analysis import METRICS, AgentSummary, Comparison, agents_of
from layoutexplore.benchmark.rows import Row
from layoutexplore.report.templates import number


@dataclass(frozen=True)
class AgentLine:
    """One row of the tables: an agent's comparisons by level, figures, how often it reached each level.

    Attributes:
        agent: The strategy.
        privileged: Whether it knows the plan.
        ratios: By level, those that were measured and compared.
        main: The one of them that agents are ranked by.
        summary: Plain figures.
        reached: By level, the share of its runs that reached it, NaN for levels that were not measured.
        metres: By level, their mean, NaN likewise.
        distance: Metres in all, their mean.
    """

    agent: str
    privileged: bool
    ratios: dict[str, Comparison]
    main: Comparison | None
    summary: AgentSummary
    reached: dict[str, float]
    metres: dict[str, float]
    distance: float

    @property
    def reached_text(self) -> str:
        """Percents of all levels, a dash for one that was not measured."""
        return " / ".join(number(100 * self.reached[m], 0) for m in METRICS)


def agent_table(
    part: Sequence[Row],
    comparisons: Sequence[Comparison],
    summaries: Sequence[AgentSummary],
    levels: Sequence[str],
    level: str,
    knowing: Collection[str] = (),
) -> list[AgentLine]:
    """One line an agent, the best at a level first; figures of levels that were not measured are NaN."""
    summary_of = {s.agent: s for s in summaries}
    lines = []
    for agent in agents_of(part):
        mine = [row for row in part if row.agent == agent]
        found = {c.metric: c for c in comparisons if c.agent == agent}
        metres, reached = (
            {m: _mean(mine, m.replace("d", prefix)) if m in levels else math.nan for m in METRICS}
            for prefix in ("d", "reached")
        )
        knows, main = agent in knowing, found.get(level)
        walked = _mean(mine, "distance")
        lines.append(AgentLine(agent, knows, found, main, summary_of[agent], reached, metres, walked))
    return sorted(lines, key=lambda line: (rank(line.main), line.metres[level] if level else 0, line.agent))


def _mean(rows: Sequence[Row], name: str) -> float:
    return float(sum(getattr(row, name) for row in rows) / len(rows))


def rank(main: Comparison | None) -> float:
    """What agents are sorted by: the ratio; those that were compared with nobody come last."""
    return math.inf if main is None else main.ratio.estimate
