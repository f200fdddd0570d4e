"""The parts of the exploration report that are about layouts.

What they changed, how right they were, stopping early; what runs believed of plans known beforehand.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from layoutexplore.benchmark.analysis import Comparison, Curves, headline_level, measured_levels
from layoutexplore.benchmark.counterfactual import Counterfactual, DecisiveDecision
from layoutexplore.benchmark.early_stop import POINTS_LOST, EarlyStop, early_stops, has_stop_rule, tried_stops
from layoutexplore.benchmark.layout_effects import LayoutEffect, layout_effects
from layoutexplore.benchmark.rows import CellKey, Row
from layoutexplore.benchmark.store import ResultsFolder
from layoutexplore.drawing.beliefs import SUFFIX, BelievedPlan, believed_plan
from layoutexplore.drawing.labels import LABEL_GAP, label_gap, label_places
from layoutexplore.drawing.prior_plans import draw_comparison
from layoutexplore.errors import ResultsError
from layoutexplore.grids.arrays import Floats
from layoutexplore.grids.boxes import window
from layoutexplore.priors.completion import Compared
from layoutexplore.report.decisive_decisions import DecisionPicture, decision_picture
from layoutexplore.report.plots import Look, agent_looks, line_path
from layoutexplore.report.templates import NBSP, number, percent, png_uri

DRAWN, WRONG_DRAWN = 6, 2
"""Decisive decisions that are drawn, and how many of them at most in which the prediction was wrong."""


STEPS = np.linspace(0.0, 1.0, 41)
"""Shares of a run's metres at which its confidence is drawn."""

MARGIN = 1.0
"""Metres around what a picture shows."""


@dataclass(frozen=True)
class EffectLine:
    """A row of the tables: an agent's effects beside its ratios to the baseline by level."""

    effect: LayoutEffect
    privileged: bool
    ratios: dict[str, Comparison]


@dataclass(frozen=True)
class Mark:
    """A pair of coverage lost and distance saved, in percent of the frame, with its whiskers."""

    stop: EarlyStop
    colour: str
    place: tuple[float, float]
    across: tuple[float, float]
    along: tuple[float, float]
    dots: tuple[tuple[float, float], ...]
    label_at: float


@dataclass(frozen=True)
class StopPlot:
    """Distance saved over coverage lost."""

    marks: list[Mark]
    x_ticks: list[tuple[float, str]]
    y_ticks: list[tuple[float, str]]
    limit: float


@dataclass(frozen=True, kw_only=True)
class LayoutSection:
    """What is shown about layouts; each is empty where there is nothing.

    Attributes:
        effects: By group of runs, a line an agent with a predictor.
        effect_levels: The levels of coverage at which effects are shown.
        decisive: Decisions in which the layout changed the choice and most was at stake.
        stops: By sensor, strategies that stop by themselves.
    """

    effects: dict[str, list[EffectLine]]
    effect_levels: tuple[str, ...]
    decisive: list[DecisionPicture]
    stops: dict[str, tuple[StopPlot, list[EarlyStop]]]


def layout_section(
    folder: ResultsFolder,
    rows: Sequence[Row],
    comparisons: Sequence[Comparison],
    baseline: str,
    curves: Curves,
    looks: Mapping[str, Look],
    knowing: Collection[str],
) -> LayoutSection:
    """What the templates show about layouts."""
    effects = layout_effects(rows, folder.log)
    by_group: dict[str, list[EffectLine]] = {}
    for effect in effects:
        mine = {c.metric: c for c in comparisons if (c.sensor, c.agent) == (effect.sensor, effect.agent)}
        line = EffectLine(effect, effect.agent in knowing, mine)
        by_group.setdefault(effect.sensor, []).append(line)
    for lines in by_group.values():
        lines.sort(key=lambda line: (line.effect.agent.partition(":")[0], line.privileged, line.effect.agent))
    best = _best(next(iter(by_group.values()), []), rows)
    stops: dict[str, list[EarlyStop]] = {}
    noted = functools.cache(lambda row: None if (log := folder.log(row)) is None else Counterfactual(log, ()))
    tried = tried_stops(rows, baseline, best, curves, noted) if best else []
    for stop in (*early_stops(rows, baseline, curves), *tried):
        stops.setdefault(stop.sensor, []).append(stop)
    return LayoutSection(
        effects=by_group,
        effect_levels=measured_levels(rows)[-2:],
        decisive=_decisive(folder, rows, best),
        stops={name: (stop_plot(found, looks), found) for name, found in stops.items()},
    )


def _best(lines: Sequence[EffectLine], rows: Sequence[Row]) -> str:
    """The agent that predicts, does not stop by itself and needs the fewest metres to the level that ranks.

    In all, where no level was measured or there is nothing to compare with; empty where there is none.
    """
    level = headline_level(rows)

    def needed(line: EffectLine) -> tuple[float, float]:
        mine = [row.distance for row in rows if row.agent == line.effect.agent and not row.error]
        return line.ratios[level].ratio.estimate if level in line.ratios else math.inf, float(np.mean(mine))

    honest = [line for line in lines if not line.privileged and not has_stop_rule(line.effect.agent)]
    best = min(honest, key=needed, default=None)
    return best.effect.agent if best else ""


def _decisive(folder: ResultsFolder, rows: Sequence[Row], agent: str) -> list[DecisionPicture]:
    """Decisive decisions of an agent: most at stake first, from different runs before from the same."""
    found: list[tuple[Row, DecisiveDecision]] = []
    for row in rows:
        notes = None if row.error or row.agent != agent else folder.counterfactual(row)
        found += [(row, _without_map(decision)) for decision in (notes.decisive if notes else ())]
    found.sort(key=lambda pair: (-pair[1].stake, pair[0].key))
    resolutions = {plan: float(folder.raster(plan)[1][0]) for plan in {row.plan for row, _ in found}}
    found = _distinct(found, resolutions)
    wrong = _spread((pair for pair in found if not pair[1].right), WRONG_DRAWN)
    shown = _spread((pair for pair in found if pair[1].right), DRAWN - len(wrong)) + wrong
    pictures = []
    for row, decision in shown:
        occupied, frame = folder.raster(row.plan)
        notes = folder.counterfactual(row)
        whole = next(d for d in notes.decisive if d.distance == decision.distance) if notes else decision
        ends = np.add(whole.corner, whole.cells.shape)
        if (ends > occupied.shape).any() or (whole.members >= occupied.shape).any():
            raise ResultsError(
                f"{folder.raster_path(row.plan)} and {folder.curve_path(row)} do not fit together: one is "
                "damaged; remove both, and the same benchmark command makes them anew"
            )
        pictures.append(decision_picture(row, whole, occupied, float(frame[0])))
    return pictures


def _without_map(decision: DecisiveDecision) -> DecisiveDecision:
    """A decision without its grid and frontiers: those of all runs would not fit into memory."""
    return dataclasses.replace(decision, cells=decision.cells[:0].copy(), members=decision.members[:0].copy())


def _distinct(
    pairs: Sequence[tuple[Row, DecisiveDecision]], resolutions: Mapping[str, float]
) -> list[tuple[Row, DecisiveDecision]]:
    """Without those about the same two places as an earlier one, in another run on the same floor plan."""
    kept: list[tuple[Row, DecisiveDecision]] = []
    met: dict[str, list[DecisiveDecision]] = {}
    for row, decision in pairs:
        others = met.setdefault(row.plan, [])
        if not any(other.is_about(decision, resolutions[row.plan]) for other in others):
            others.append(decision)
            kept.append((row, decision))
    return kept


def _spread(pairs: Iterable[tuple[Row, DecisiveDecision]], count: int) -> list[tuple[Row, DecisiveDecision]]:
    """The first pairs of each run, then the second ones, and so on."""
    turns: Counter[tuple[Any, ...]] = Counter()
    ranked = []
    for row, decision in pairs:
        turns[row.key] += 1
        ranked.append((turns[row.key], (row, decision)))
    ranked.sort(key=lambda entry: entry[0])
    return [pair for _, pair in ranked[:count]]


def stop_plot(stops: Sequence[EarlyStop], looks: Mapping[str, Look]) -> StopPlot:
    """Every strategy that stops by itself as a mark with whiskers, and its runs as dots.

    Args:
        stops: What stopping saved and lost.
        looks: Of the agents; rules that were tried get those that come next.
    """
    every = {**agent_looks([*looks, *(stop.agent for stop in stops)], ""), **looks}
    runs = [run for stop in stops for run in stop.runs]
    most_lost = max((run.lost for run in runs), default=0.0)
    right = max(math.ceil(100 * most_lost + 0.5), round(200 * POINTS_LOST)) / 100
    low = min(0.0, math.floor(10 * min((run.saved for run in runs), default=0.0)) / 10)
    high = max(0.3, math.ceil(10 * max((run.saved for run in runs), default=0.0) + 0.2) / 10)

    def x(value: float) -> float:
        return round(100 * min(max(value / right, 0.0), 1.0), 2)

    def y(value: float) -> float:
        return round(100 * (1 - min(max((value - low) / (high - low), 0.0), 1.0)), 2)

    labels = label_places([y(stop.saved.estimate) for stop in stops], label_gap(len(stops), 2 * LABEL_GAP))
    marks = []
    for k, stop in enumerate(stops):
        lost, saved = stop.lost.ends, stop.saved.ends
        marks.append(
            Mark(
                stop=stop,
                colour=every[stop.agent][0],
                place=(x(stop.lost.estimate), y(stop.saved.estimate)),
                across=(x(lost[0]), x(lost[1])),
                along=(y(saved[0]), y(saved[1])),
                dots=tuple((x(run.lost), y(run.saved)) for run in stop.runs),
                label_at=round(labels[k], 2),
            )
        )
    points = round(100 * right)
    step = max(1, round(points / 6))
    x_ticks = [(x(value / 100), f"{value}") for value in range(0, points + 1, step)]
    step = 10 * max(1, round((high - low) * 10 / 12))
    first = -step * (round(-100 * low) // step)
    y_ticks = [(y(value / 100), f"{value} %") for value in range(first, round(100 * high) + 1, step)]
    return StopPlot(marks, x_ticks, y_ticks, x(POINTS_LOST))


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
    base = {row.cell: row for row in rows if row.agent == baseline and not row.error}
    level = (measured_levels(rows) or ("",))[-1]
    by_agent: dict[str, list[tuple[Row, BelievedPlan]]] = {}
    for row in rows:
        found = None if row.error else believed_plan(folder.curve_path(row).with_suffix(SUFFIX))
        if found is not None and len(found.way):
            by_agent.setdefault(row.agent, []).append((row, found))
    lines = []
    for agent, runs in by_agent.items():
        curves = np.array([_confidence(found) for _, found in runs])
        lines.append(
            BeliefLine(
                agent=agent,
                colour=looks[agent][0] if agent in looks else "#444",
                median=_line(np.median(curves, axis=0)),
                runs=tuple(_line(curve) for curve in curves),
                sure=float(curves[:, len(STEPS) // 2].mean()),
                shown=_runs_shown(runs, base, level),
            )
        )
    return lines


def _confidence(found: BelievedPlan) -> Floats:
    """A run's confidence at `STEPS` of its metres: that of the last decision before each."""
    metres = found.way[:, 0].astype(np.float64)
    at = np.searchsorted(metres, STEPS * max(float(metres[-1]), 1e-9), side="right") - 1
    return np.asarray(found.way[np.maximum(at, 0), 2], np.float64)


def _line(curve: Floats) -> str:
    return line_path(zip((100 * STEPS).tolist(), (100 - 100 * curve).tolist(), strict=True))


def _runs_shown(
    runs: Sequence[tuple[Row, BelievedPlan]], base: Mapping[CellKey, Row], level: str
) -> tuple[BeliefRun, ...]:
    """The run that gained most and the one that gained least against the baseline, at a level or in all.

    The first one where none can be compared.
    """
    ratios, scale = [], f"to {level[1:]}{NBSP}%" if level else "in all"
    for k, (row, _) in enumerate(runs):
        other = base.get(row.cell)
        mine, theirs = (getattr(each, level or "distance") if each else 0.0 for each in (row, other))
        if theirs > 0:
            ratios.append((mine / theirs, k))
    chosen: dict[int, str] = {}
    for word, end in (("gained most", min), ("gained least", max)) if ratios else ():
        ratio, k = end(ratios)
        chosen.setdefault(k, f"{word}, {number(ratio)} of the metres {scale}")
    found = []
    for k, why in (chosen or {0: "there is nothing to compare it with"}).items():
        row, plan = runs[k]
        pictures = tuple(_belief_picture(plan, n) for n in range(len(plan.at)))
        found.append(BeliefRun(row, why, pictures))
    return tuple(found)


def _belief_picture(plan: BelievedPlan, n: int) -> BeliefPicture:
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
    image = draw_comparison(codes[window(codes > 0, round(MARGIN / plan.resolution))], confidence)
    return BeliefPicture(png_uri(image), caption)
