"""Performance profiles: how often each agent is within a factor of the best one in a cell.

References:
    Dolan and More 2002, "Benchmarking optimization software with performance profiles".
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from layoutexplore.benchmark.analysis import SHORTEST, agents_of
from layoutexplore.benchmark.rows import CellKey, Row
from layoutexplore.drawing.labels import label_gap, label_places
from layoutexplore.grids.arrays import Floats
from layoutexplore.report.plots import Look, Tick

FARTHEST = 3.0
"""Factor at the right of the chart; its axis is logarithmic."""

_TICKS = (1.0, 1.25, 1.5, 2.0, 2.5, 3.0)


@dataclass(frozen=True, eq=False)
class ProfileLine:
    """One agent: its steps as an SVG path in a frame of 100 x 100, its end, and where its label stands.

    Its `factors` float64 (cells,) are what the steps are made of.
    """

    name: str
    colour: str
    dash: str
    path: str
    end: float
    label_at: float
    factors: Floats


@dataclass(frozen=True, eq=False)
class ProfilePlot:
    """The profiles of all agents over the cells that every one of them ran."""

    lines: list[ProfileLine]
    ticks: list[Tick]
    cells: int


def factors_of_best(rows: Sequence[Row], agents: Sequence[str]) -> Floats:
    """Metres to 95 % over those of the best agent, in the cells that all agents ran and one reached 95 %.

    Args:
        rows: The runs.
        agents: Those that are compared.

    Returns:
        float64 (agents, cells), at least 1; inf where 95 % was not reached.
    """
    metres: dict[CellKey, dict[str, float]] = {}
    for row in rows:
        if not row.error and not math.isnan(row.d95) and row.agent in agents:
            needed = max(row.d95, SHORTEST) if row.reached95 else math.inf
            metres.setdefault(row.cell, {})[row.agent] = needed
    shared = [m for m in metres.values() if len(m) == len(agents) and math.isfinite(min(m.values()))]
    table = np.array([[m[agent] for m in shared] for agent in agents], np.float64)
    best = np.array([min(m.values()) for m in shared], np.float64)
    return np.asarray(table.reshape(len(agents), len(shared)) / best)


def profile_plot(
    rows: Sequence[Row], looks: Mapping[str, Look], knowing: Collection[str]
) -> ProfilePlot | None:
    """The profiles of the agents that do not know the plan, the most often near the best first.

    Args:
        rows: All runs.
        looks: Of the agents.
        knowing: Agents that are shown the floor plan.

    Returns:
        None where there are fewer than two agents, or no cell that all ran.
    """
    agents = [a for a in agents_of(row for row in rows if not row.error) if a not in knowing]
    factors = factors_of_best(rows, agents)
    if len(agents) < 2 or not factors.shape[1]:
        return None
    nearness = [float(np.mean(np.log(np.minimum(mine, FARTHEST)))) for mine in factors]
    order = sorted(range(len(agents)), key=nearness.__getitem__)
    ends = [100 * (1 - float(np.mean(factors[k] <= FARTHEST))) for k in order]
    lines = [
        ProfileLine(agents[k], *looks[agents[k]], _steps(factors[k]), round(end, 2), round(at, 2), factors[k])
        for k, end, at in zip(order, ends, label_places(ends, label_gap(len(ends))), strict=True)
    ]
    return ProfilePlot(lines, [Tick(_across(value), f"{value:g}") for value in _TICKS], factors.shape[1])


def share_within(factors: Floats) -> tuple[Floats, Floats]:
    """The steps of a profile: factors at which it rises, from 1 on, and its share from there.

    Example:
        >>> [values.tolist() for values in share_within(np.array([1.0, 2.0, 2.0, np.inf]))]
        [[1.0, 2.0], [0.25, 0.75]]
    """
    values = np.unique(np.append(factors[np.isfinite(factors)], 1.0))
    return values, np.searchsorted(np.sort(factors), values, side="right") / len(factors)


def _steps(factors: Floats) -> str:
    """A profile as an SVG path from 1 to `FARTHEST`."""
    values, shares = share_within(factors)
    kept = values <= FARTHEST
    path = f"M0.00,{100 * (1 - shares[0]):.2f}"
    for value, share in zip(values[kept][1:].tolist(), shares[kept][1:].tolist(), strict=True):
        path += f" H{_across(value):.2f} V{100 * (1 - share):.2f}"
    return f"{path} H100.00"


def _across(factor: float) -> float:
    return 100 * math.log(factor) / math.log(FARTHEST)
