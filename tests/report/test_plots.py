"""Pictures and plots of a report: places on axes, ways, floors, colours."""

from __future__ import annotations

import base64
import dataclasses
import itertools
import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from layoutexplore.benchmark.analysis import Comparison, PooledCurve
from layoutexplore.metrics.statistics import Interval
from layoutexplore.report.plots import agent_looks, curve_lines, floor_picture, forest, heat, track_picture
from layoutexplore.report.templates import png_uri


def comparison(agent: str, ratio: float, width: float = 0.1, metric: str = "d95") -> Comparison:
    value = Interval(ratio, ratio * (1 - width), ratio * (1 + width))
    return Comparison(
        sensor="stage",
        agent=agent,
        metric=metric,
        cells=3,
        plans=3,
        buildings=3,
        ratio=value,
        plan_ratio=value,
        improvement=Interval(0.5, 0.4, 0.6),
        reached=1.0,
    )


@given(st.lists(st.floats(0.05, 20), min_size=1, max_size=8), st.floats(0, 0.9))
def test_forest_places_lie_on_the_axis(ratios: list[float], width: float) -> None:
    drawn = forest([comparison(f"agent {k}", ratio, width) for k, ratio in enumerate(ratios)])
    estimates = [row.comparison.ratio.estimate for row in drawn.rows]
    assert estimates == sorted(ratios)
    for row in drawn.rows:
        assert 0 <= row.low <= row.place <= row.high <= 100
        if not row.outside:
            assert (row.place < drawn.one) == (
                row.comparison.ratio.estimate < 1
            ) or row.place == pytest.approx(drawn.one)
    places = sorted(tick.at for tick in drawn.ticks)
    assert "1" in {tick.label for tick in drawn.ticks} and all(0 <= place <= 100 for place in places)
    assert all(b - a >= 9.99 for a, b in itertools.pairwise(places))


def test_forest_without_intervals_and_with_a_guard() -> None:
    nan = math.nan
    lone = dataclasses.replace(comparison("tour", 0.9), ratio=Interval(0.9, nan, nan))
    drawn = forest([lone, comparison("tour", 1.1, metric="d99")])
    (row,) = drawn.rows
    assert row.low == row.place == row.high
    assert row.guard_place is not None
    assert row.guard_place > drawn.one > row.place


def test_the_axis_of_a_forest_reaches_as_far_as_its_guards() -> None:
    ratios = {"bound": (0.65, 0.5), "tour": (0.9, 1.5), "random": (3.0, 5.0)}
    both = [
        comparison(name, pair[k], metric=metric)
        for k, metric in enumerate(("d95", "d99"))
        for name, pair in ratios.items()
    ]
    *rows, lost = forest(both).rows
    assert [row.guard_place is not None and 0 < row.guard_place < 100 for row in rows] == [True, True]
    assert lost.outside and lost.guard_place == 100


def test_coverage_rises_from_the_lower_left_of_its_frame() -> None:
    x, mean = np.array([0.0, 0.5, 1.0]), np.array([0.0, 0.6, 0.9])
    curve = PooledCurve(agent="tour", x=x, mean=mean, low=0.5 * mean, high=mean, cells=2)
    (line,) = curve_lines([curve], ["nearest", "tour"], agent_looks(["tour"], "nearest"))
    assert line.path == "M0.00,100.00 L50.00,40.00 L100.00,10.00" and line.end == 10.0
    assert line.band.startswith(line.path) and "L100.00,55.00" in line.band


def test_a_way_starts_and_ends_where_it_should() -> None:
    track = np.array([[1.0, 1.0, 0.0], [3.0, 1.0, 0.0], [3.0, 2.0, 0.0]])
    drawn = track_picture(track, np.array([0.5, 0.0, 0.0, 0.0]), rows=10)
    assert drawn.start == (2.0, 8.0) and drawn.end == (
        6.0,
        6.0,
    )  # y is up in the world and down in the picture
    assert drawn.pieces[0][1].startswith("M2.00,8.00") and drawn.pieces[-1][1].endswith("6.00,6.00")
    assert any("6.00,8.00" in path for _, path in drawn.pieces)
    assert track_picture(track[:1], np.array([0.5, 0.0, 0.0, 0.0]), rows=10).pieces == []
    long = track_picture(np.repeat(track, 40_000, axis=0), np.array([0.5, 0.0, 0.0, 0.0]), rows=10)
    assert (long.start, long.end) == (drawn.start, drawn.end)
    assert sum(path.count(",") for _, path in long.pieces) < 50_000


def test_floor_picture_is_upright() -> None:
    occupied = np.ones((40, 30), np.bool_)
    occupied[30:38, 5:25] = False  # free at high y: at the top of the picture
    data = np.frombuffer(base64.b64decode(floor_picture(occupied).split(",")[1]), np.uint8)
    image = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE)
    assert image.shape == (40, 30) and image[5, 10] == 255 and image[35, 10] < 255 and image[10, 10] == 88
    assert png_uri(np.zeros((2, 2, 3), np.uint8)).startswith("data:image/png;base64,")


def test_heat_is_white_at_one() -> None:
    assert heat(1.0).endswith(",0.00)") and heat(math.nan) == "transparent"
    assert heat(0.5).startswith("rgba(0,114,178") and heat(2.0).startswith("rgba(213,94,0")


def test_a_long_name_leaves_room_for_the_forest_plot() -> None:
    assert forest([comparison("tour", 0.9)]).name_width == len("tour") + 1
    assert forest([comparison("mine.py:Mine:weights=" + "x" * 150, 0.9)]).name_width <= 50
