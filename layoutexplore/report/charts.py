"""Small charts as plain shapes in percent of their frame: lines, calibration, scatter on a root scale."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from layoutexplore.drawing import palette
from layoutexplore.drawing.labels import label_gap, label_places
from layoutexplore.grids.arrays import Floats, Mask
from layoutexplore.metrics.statistics import Interval
from layoutexplore.report.plots import agent_look, line_path

MOST_DOTS = 1500
"""Dots of a scatter; of more, every n-th is drawn."""

_STEP = 0.25
"""Between the labels of an axis that is not long."""

_BINS = 10
"""Bins of a calibration between one half and 1."""

_QUIET = {"none": palette.GREY, "oracle": palette.BLACK}
"""Predictors that are bounds, not competitors."""


@dataclass(frozen=True)
class Point:
    """A place with the ends of its whisker, in percent of the frame; y runs downwards."""

    x: float
    y: float
    low: float
    high: float
    title: str


@dataclass(frozen=True)
class Series:
    """Values of one predictor over strata; where its line ends, and where its label stands, in percent."""

    name: str
    colour: str
    dash: str
    path: str
    points: tuple[Point, ...]
    end: float
    label_at: float


@dataclass(frozen=True)
class Ticks:
    """Labels along both axes: (percent, text)."""

    x: tuple[tuple[float, str], ...]
    y: tuple[tuple[float, str], ...]


@dataclass(frozen=True)
class Chart:
    """Lines with labels."""

    series: tuple[Series, ...]
    ticks: Ticks


@dataclass(frozen=True)
class Dot:
    """A dot: place in percent, radius in pixels, a title."""

    x: float
    y: float
    size: float
    title: str


@dataclass(frozen=True)
class Scatter:
    """Dots with labels; equal values lie on the diagonal."""

    dots: tuple[Dot, ...]
    ticks: Ticks


def line_chart(
    values: Mapping[str, Sequence[Interval]],
    strata: Sequence[str],
    *,
    main: str = "",
    low: float = 0.0,
    high: float = 1.0,
) -> Chart:
    """Values over strata, a line each; whiskers stand side by side where strata have several.

    Args:
        values: By name, one interval a stratum; NaN where there is none.
        strata: Labels along the x axis.
        main: The name that wears the first colour.
        low: Where the y axis begins, unless a value or the end of a whisker is less.
        high: Where it ends, unless one is greater.
    """
    low, high = _reach([value for line in values.values() for value in line], low, high)
    slot = 100 / max(len(strata), 1)

    def height(value: float) -> float:
        return round(100 * (1 - min(max((value - low) / (high - low), 0.0), 1.0)), 2)

    looks = predictor_looks(list(values), main)
    drawn: list[tuple[str, str, tuple[Point, ...]]] = []
    for k, (name, line) in enumerate(values.items()):
        shift = (k - (len(values) - 1) / 2) * min(0.09, 0.7 / max(len(values), 1)) * slot
        points = []
        for n, value in enumerate(line):
            if math.isfinite(value.estimate):
                title = f"{name}, {strata[n]}: {value.estimate:.2f}"
                x, y = round((n + 0.5) * slot + shift, 2), height(value.estimate)
                low_end, high_end = map(height, value.ends)
                points.append(Point(x, y, low_end, high_end, title))
        drawn.append((name, line_path((p.x, p.y) for p in points), tuple(points)))
    ends = [points[-1].y if points else 100.0 for _, _, points in drawn]
    series = [
        Series(name, *looks[name], path, points, end, round(label_at, 2))
        for (name, path, points), end, label_at in zip(
            drawn, ends, label_places(ends, label_gap(len(ends), 8.0)), strict=True
        )
    ]
    x_ticks = tuple((round((n + 0.5) * slot, 2), text) for n, text in enumerate(strata))
    count = round((high - low) / _STEP)
    every = max(1, round(count / 8))
    levels = [low + n * _STEP for n in range(0, count + 1, every)]
    y_ticks = tuple((height(level), f"{level:g}".replace("-", "\N{MINUS SIGN}")) for level in levels)
    return Chart(tuple(series), Ticks(x_ticks, y_ticks))


def _reach(values: Sequence[Interval], low: float, high: float) -> tuple[float, float]:
    """Where an axis begins and ends; whiskers make it three times as long at most, and are cut off there."""
    found = [value for value in values if math.isfinite(value.estimate)]
    estimates, ends = [value.estimate for value in found], [end for value in found for end in value.ends]
    low, high = min([low, *estimates]), max([high, *estimates])
    longest = high - low
    low, high = max(min([low, *ends]), low - longest), min(max([high, *ends]), high + longest)
    return _STEP * math.floor(low / _STEP), _STEP * math.ceil(high / _STEP)


def predictor_looks(names: Sequence[str], main: str = "") -> dict[str, tuple[str, str]]:
    """Colour and dashes by name; the bounds are grey and black, the main one has the first colour."""
    looks, k = {}, 0
    for name in sorted(names, key=lambda name: name != main):
        plain = name.partition(":")[0]
        if plain in _QUIET:
            looks[name] = (palette.to_hex(_QUIET[plain]), "5 4")
        else:
            colour, dash = agent_look(k)
            looks[name], k = (palette.to_hex(colour), dash), k + 1
    return looks


def calibration_chart(confidence: Floats, right: Mask) -> Scatter:
    """Stated against observed probability of being right, a dot a bin from one half to 1.

    Its area is its share of all; what was said with less than one half stands at the left end.

    Args:
        confidence: float64 (n,), stated, 0..1.
        right: bool (n,), whether it was.
    """
    which = np.clip(((confidence - 0.5) * 2 * _BINS).astype(int), 0, _BINS - 1)
    dots = []
    for k in range(_BINS):
        inside = which == k
        if inside.any():
            stated, observed = float(confidence[inside].mean()), float(right[inside].mean())
            count = int(inside.sum())
            title = f"said {stated:.2f}, was {observed:.2f}, {count} times"
            size = 4 + 22 * math.sqrt(count / len(right))
            x, y = (200 * max(share - 0.5, 0.0) for share in (stated, observed))
            dots.append(Dot(round(x, 2), round(100 - y, 2), round(size, 1), title))
    ticks = tuple((200 * (v - 0.5), f"{100 * v:.0f} %") for v in (0.5, 0.6, 0.7, 0.8, 0.9, 1.0))
    return Scatter(tuple(dots), Ticks(ticks, tuple((100 - at, text) for at, text in ticks)))


def root_scatter(x: Floats, y: Floats, titles: Sequence[str]) -> Scatter:
    """Pairs of areas as dots on axes that run with the square root, so that small ones are told apart."""
    top = max(float(max(x.max(initial=0), y.max(initial=0))), 1.0)
    stride = max(1, math.ceil(len(x) / MOST_DOTS))

    def at(value: float) -> float:
        return round(100 * math.sqrt(max(value, 0.0) / top), 2)

    dots = tuple(
        Dot(at(a), round(100 - at(b), 2), 5.0, text)
        for a, b, text in list(zip(x, y, titles, strict=True))[::stride]
    )
    labels = [value for value in (0, 1, 5, 10, 20, 50, 100, 200, 400, 800, 1600) if value <= top]
    kept: list[int] = []
    for value in labels:
        if not kept or at(value) - at(kept[-1]) >= 8:
            kept.append(value)
    ticks = tuple((at(value), f"{value}") for value in kept)
    return Scatter(dots, Ticks(ticks, tuple((round(100 - place, 2), text) for place, text in ticks)))
