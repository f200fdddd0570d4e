"""The report's section on plans known beforehand: how sure runs were on the way, and what they believed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from layoutexplore.benchmark.believed import BelievedPlan, believed_plan
from layoutexplore.benchmark.rows import Row
from layoutexplore.benchmark.store import ResultsFolder
from layoutexplore.drawing.prior_plans import draw_comparison
from layoutexplore.grids.arrays import Bytes, Floats
from layoutexplore.priors.completion import Compared
from layoutexplore.report.plots import Look
from layoutexplore.report.templates import number, percent, png_uri

NBSP = "\N{NO-BREAK SPACE}"

STEPS = np.linspace(0.0, 1.0, 41)
"""Shares of a run's metres at which its confidence is drawn."""

MARGIN = 10
"""Cells around what a picture shows."""


@dataclass(frozen=True)
class BeliefPicture:
    """The map with the plan as it was believed to lie at one moment of a run."""

    image: str
    caption: str


@dataclass(frozen=True)
class BeliefRun:
    """A run that is shown: why, and its pictures."""

    row: Row
    why: str
    pictures: tuple[BeliefPicture, ...]

    @property
    def title(self) -> str:
        """The cell, and how the run compares."""
        return f"{self.row.plan}, start {self.row.start}, {self.row.sensor}: {self.why}"


@dataclass(frozen=True)
class BeliefLine:
    """One agent: its runs' confidence over their metres as paths in a square of 100, and the runs shown."""

    agent: str
    colour: str
    median: str
    runs: tuple[str, ...]
    sure: float
    shown: tuple[BeliefRun, ...]


def prior_section(
    folder: ResultsFolder, rows: Sequence[Row], baseline: str, looks: Mapping[str, Look]
) -> list[BeliefLine]:
    """A line for each agent with a plan known beforehand; empty where there is none."""
    base = {row.key[:3]: row for row in rows if row.agent == baseline and not row.error}
    by_agent: dict[str, list[tuple[Row, BelievedPlan]]] = {}
    for row in rows:
        found = None if row.error or "prior:" not in row.agent else believed_plan(folder, row)
        if found is not None and len(found.way):
            by_agent.setdefault(row.agent, []).append((row, found))
    lines = []
    for agent, runs in by_agent.items():
        curves = np.array([_confidence(found) for _, found in runs])
        lines.append(
            BeliefLine(
                agent=agent,
                colour=looks[agent][0] if agent in looks else "#444",
                median=_path(np.median(curves, axis=0)),
                runs=tuple(_path(curve) for curve in curves),
                sure=float(curves[:, len(STEPS) // 2].mean()),
                shown=_shown(runs, base),
            )
        )
    return lines


def _confidence(found: BelievedPlan) -> Floats:
    """A run's confidence at `STEPS` of its metres: that of the last decision before each."""
    metres = found.way[:, 0].astype(np.float64)
    at = np.searchsorted(metres, STEPS * max(float(metres[-1]), 1e-9), side="right") - 1
    return np.asarray(found.way[np.maximum(at, 0), 2], np.float64)


def _path(curve: Floats) -> str:
    points = (f"{100 * x:.1f},{100 - 100 * y:.1f}" for x, y in zip(STEPS, curve, strict=True))
    return "M" + " L".join(points)


def _shown(
    runs: Sequence[tuple[Row, BelievedPlan]], base: Mapping[tuple[str, int, str], Row]
) -> tuple[BeliefRun, ...]:
    """The run that gained most and the one that gained least against the baseline."""
    compared = ((row, base.get(row.key[:3])) for row, _ in runs)
    ratios = [(row.d99 / other.d99 if other else 1.0, k) for k, (row, other) in enumerate(compared)]
    found: list[BeliefRun] = []
    for word, (ratio, k) in (("gained most", min(ratios)), ("gained least", max(ratios))):
        row, plan = runs[k]
        if found and found[0].row is row:
            continue
        why = f"{word}, {number(ratio)} of the metres to 99{NBSP}%"
        pictures = tuple(_picture(plan, n) for n in range(len(plan.at)))
        found.append(BeliefRun(row, why, pictures))
    return tuple(found)


def _picture(plan: BelievedPlan, n: int) -> BeliefPicture:
    codes = plan.maps[n]
    metres, coverage, confidence = plan.way[plan.at[n]].tolist()
    counts = np.bincount(codes.ravel(), minlength=len(Compared))
    floor, walls = counts[Compared.FLOOR] + counts[Compared.OTHER_FLOOR], counts[Compared.OTHER_WALL]
    wrong_floor = counts[Compared.OTHER_FLOOR] / max(floor, 1)
    wrong_walls = walls / max(walls + counts[Compared.WALL], 1)
    caption = (
        f"{percent(coverage)} seen, {number(metres, 0)}{NBSP}m: confidence {number(confidence)}; of what is "
        f"seen the plan shows otherwise {percent(float(wrong_floor))} of the floor and "
        f"{percent(float(wrong_walls))} of the walls"
    )
    image = draw_comparison(_cropped(codes), confidence)
    return BeliefPicture(png_uri(image), caption)


def _cropped(codes: Bytes) -> Bytes:
    """The part that shows anything, with a margin."""
    rows, cols = np.nonzero(codes)
    if not len(rows):
        return codes
    low = np.maximum([rows.min() - MARGIN, cols.min() - MARGIN], 0)
    return codes[low[0] : rows.max() + MARGIN + 1, low[1] : cols.max() + MARGIN + 1]
